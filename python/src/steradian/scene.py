"""The scene, its snapshots, and what the daemon tells of itself."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass, field

from . import _protocol
from ._protocol import Message


@dataclass(frozen=True)
class Scene:
    """The scene.

    Attributes:
        revision: counts its changes, and those of views; not those of the camera.
        time: the time shown, UTC, to microseconds; None where none is set.
        star_method: how stars are drawn.
        magnitude_limit: fainter stars are not drawn, mag.
        bodies: messages `Body` by name.
        asteroid_fields: messages `AsteroidField` by name.
        message: the whole message `Scene`.
    """

    revision: int
    time: datetime.datetime | None
    star_method: str
    magnitude_limit: float
    bodies: Mapping[str, Message]
    asteroid_fields: Mapping[str, Message]
    message: Message = field(repr=False, compare=False)

    @classmethod
    def of(cls, message: Message) -> Scene:
        """The scene of a message."""
        return cls(
            revision=message.revision,
            time=_protocol.datetime_of(message.time) if message.HasField("time") else None,
            star_method=message.stars.method,
            magnitude_limit=message.stars.magnitude_limit,
            bodies={body.name: body for body in message.bodies},
            asteroid_fields={asteroids.name: asteroids for asteroids in message.asteroid_fields},
            message=message,
        )


def update_of(changes: Mapping[str, object]) -> tuple[Message, list[str]]:
    """A message `Scene` with new values, and the paths of the field mask, of values by path: see `Client.update_scene`.

    Raises:
        TypeError: there is no such field, or a value does not fit it.
    """
    scene = _protocol.message("Scene")
    for path, value in changes.items():
        if value is not None:
            _protocol.put(scene, path, value)
    return scene, list(changes)


@dataclass(frozen=True)
class Snapshot:
    """A saved state of scene, settings of views, and camera.

    Attributes:
        name: its name.
        time: when it was saved, UTC.
    """

    name: str
    time: datetime.datetime

    @classmethod
    def of(cls, message: Message) -> Snapshot:
        """The snapshot of a message."""
        return cls(message.name, _protocol.datetime_of(message.time))


@dataclass(frozen=True)
class Info:
    """Adapter and scene of the daemon.

    Attributes:
        version: of the daemon.
        adapter: name of the adapter.
        driver: name and version of its driver.
        stars: stars in the scene.
        frames_rendered: frames since the start.
        fallbacks: every fallback in use, as a sentence.
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
        """What a message tells."""
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
        time: when they were read, by its clock, UTC.
        frames_rendered: frames since the start, without those of a headset.
        frames_failed: frames since the start that could not be drawn.
        frames_dropped: frames dropped since the start because readers were slow.
        streams: current streams of frames, of all views.
        problem: why the last frame could not be drawn; empty if it could.
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
        """What a message tells."""
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
        name: of the check.
        group: that it belongs to.
        outcome: `PASS`, `FAIL` or `NOT_APPLICABLE`.
        seconds: how long it took, s.
        message: the whole message `VerifyResult`, with `figures`.
    """

    name: str
    group: str
    outcome: str
    seconds: float
    message: Message = field(repr=False, compare=False)

    @classmethod
    def of(cls, message: Message) -> Check:
        """The result of a message."""
        outcome = _protocol.enum_name("VerifyResult.Outcome", message.outcome)
        return cls(message.name, message.group, outcome, message.seconds, message)
