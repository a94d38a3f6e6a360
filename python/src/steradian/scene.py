"""The scene, its snapshots, and information about the daemon."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass, field

from . import _protocol
from ._protocol import Message
from .camera import Vector


@dataclass(frozen=True)
class Scene:
    """The scene.

    Attributes:
        revision: number of its changes, including those of views, without those of the camera.
        time: scene time, UTC, to microseconds; None if none is set.
        time_rate: seconds of scene time per second of real time; 0: the time does not run.
        star_method: rendering method of stars.
        magnitude_limit: limiting magnitude, mag.
        bodies: messages `Body` by name.
        asteroid_fields: messages `AsteroidField` by name.
        message: the whole message `Scene`.
    """

    revision: int
    time: datetime.datetime | None
    time_rate: float
    star_method: str
    magnitude_limit: float
    bodies: Mapping[str, Message]
    asteroid_fields: Mapping[str, Message]
    message: Message = field(repr=False, compare=False)

    @classmethod
    def of(cls, message: Message) -> Scene:
        """Reads a scene from a message."""
        return cls(
            revision=message.revision,
            time=_protocol.datetime_of(message.time) if message.HasField("time") else None,
            time_rate=message.time_rate,
            star_method=message.stars.method,
            magnitude_limit=message.stars.magnitude_limit,
            bodies={body.name: body for body in message.bodies},
            asteroid_fields={asteroids.name: asteroids for asteroids in message.asteroid_fields},
            message=message,
        )


def update_of(changes: Mapping[str, object]) -> tuple[Message, list[str]]:
    """Converts values by path to a message `Scene` and the paths of its field mask: see `Client.update_scene`.

    Raises:
        TypeError: the field does not exist, or a value does not fit it.
    """
    scene = _protocol.message("Scene")
    for path, value in changes.items():
        if value is not None:
            _protocol.put(scene, path, value)
    return scene, list(changes)


@dataclass(frozen=True, eq=False)
class SeenObject:
    """An object as the camera sees it.

    Attributes:
        kind: `STAR`, `BODY` or `CONSTELLATION`.
        name: its name, for stars the common one; empty if it has none.
        designation: Bayer or Flamsteed designation of a star; empty if unknown.
        direction: (3,), float64: unit vector to its apparent place, ICRS axes.
        separation_deg: angle from the requested direction; 0 if a body covers that direction.
        v_mag: apparent V magnitude of a star; None for others.
        temperature_k: effective temperature of a star; None for others.
        distance_m: distance from the camera; None if unknown.
        message: the whole message `IdentifiedObject`.
    """

    kind: str
    name: str
    designation: str
    direction: Vector
    separation_deg: float
    v_mag: float | None
    temperature_k: float | None
    distance_m: float | None
    message: Message = field(repr=False)

    @classmethod
    def of(cls, message: Message) -> SeenObject:
        """Reads an object from a message."""

        def optional(name: str) -> float | None:
            return float(getattr(message, name)) if message.HasField(name) else None

        return cls(
            kind=_protocol.enum_name("ObjectKind", message.kind).removeprefix("OBJECT_KIND_"),
            name=message.name,
            designation=message.designation,
            direction=_protocol.numbers_of(message.direction),
            separation_deg=message.separation_deg,
            v_mag=optional("v_mag"),
            temperature_k=optional("temperature_k"),
            distance_m=optional("distance_m"),
            message=message,
        )


@dataclass(frozen=True)
class Snapshot:
    """A saved state of scene, settings of views, and camera.

    Attributes:
        name: its name.
        time: time at which it was saved, UTC.
    """

    name: str
    time: datetime.datetime

    @classmethod
    def of(cls, message: Message) -> Snapshot:
        """Reads a snapshot from a message."""
        return cls(message.name, _protocol.datetime_of(message.time))


@dataclass(frozen=True)
class Info:
    """Adapter and scene of the daemon.

    Attributes:
        version: version of the daemon.
        adapter: name of the adapter.
        driver: name and version of its driver.
        stars: number of stars in the scene.
        frames_rendered: frames since the start.
        fallbacks: a sentence for every fallback in use.
        message: the whole message `Info`.
    """

    version: str
    adapter: str
    driver: str
    stars: int
    frames_rendered: int
    fallbacks: tuple[str, ...]
    message: Message = field(repr=False, compare=False)

    @classmethod
    def of(cls, message: Message) -> Info:
        """Reads information from a message."""
        return cls(
            version=message.version,
            adapter=message.adapter,
            driver=message.driver,
            stars=message.stars,
            frames_rendered=message.frames_rendered,
            fallbacks=tuple(message.fallbacks),
            message=message,
        )


@dataclass(frozen=True)
class Stats:
    """Statistics of the daemon.

    Attributes:
        time: time at which they were read, by its clock, UTC.
        frames_rendered: frames since the start, without those of a headset.
        frames_failed: failed frames since the start.
        frames_dropped: frames dropped since the start because readers were slow.
        streams: current streams of frames, of all views.
        problem: reason of the last frame's failure; empty if it succeeded.
        message: the whole message `Stats`.
    """

    time: datetime.datetime
    frames_rendered: int
    frames_failed: int
    frames_dropped: int
    streams: int
    problem: str
    message: Message = field(repr=False, compare=False)

    @classmethod
    def of(cls, message: Message) -> Stats:
        """Reads statistics from a message."""
        return cls(
            time=_protocol.datetime_of(message.time),
            frames_rendered=message.frames_rendered,
            frames_failed=message.frames_failed,
            frames_dropped=message.frames_dropped,
            streams=message.streams,
            problem=message.problem,
            message=message,
        )


@dataclass(frozen=True)
class Check:
    """Result of a check of the daemon's adapter.

    Attributes:
        name: name of the check.
        group: its group.
        outcome: `PASS`, `FAIL` or `NOT_APPLICABLE`.
        seconds: duration, s.
        message: the whole message `VerifyResult`, with `figures`.
    """

    name: str
    group: str
    outcome: str
    seconds: float
    message: Message = field(repr=False, compare=False)

    @classmethod
    def of(cls, message: Message) -> Check:
        """Reads a result from a message."""
        outcome = _protocol.enum_name("VerifyResult.Outcome", message.outcome)
        return cls(message.name, message.group, outcome, message.seconds, message)
