"""The camera, and rotations. Quaternions are (x, y, z, w) as in configurations and the protocol, float64, and take the
axes of a camera (+x right, +y up, looking along -z) to ICRS axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from . import _protocol
from ._protocol import Message

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Camera:
    """Pose and velocity of the rig.

    Attributes:
        position_m: (3,), float64: position, metres, ICRS axes, from the Solar-System barycentre.
        orientation: (4,), float64: unit quaternion x, y, z, w, which takes camera axes to ICRS axes.
        velocity_c: (3,), float64: velocity along the ICRS axes, in units of the speed of light.
        revision: number of changes of the camera; 0 is the pose of the configuration.
        frame: reference frame with which the camera turns, such as `icrs` and `horizon`.
        azimuth_deg: azimuth from north through east, for the scene's observer; None without one.
        altitude_deg: altitude; None without an observer.
    """

    position_m: Vector
    orientation: Vector
    velocity_c: Vector
    revision: int
    frame: str = "icrs"
    azimuth_deg: float | None = None
    altitude_deg: float | None = None

    @classmethod
    def of(cls, message: Message) -> Camera:
        """Reads a camera from a message."""
        return cls(
            position_m=_protocol.numbers_of(message.position_m),
            orientation=_protocol.numbers_of(message.orientation),
            velocity_c=_protocol.numbers_of(message.velocity_c),
            revision=message.revision,
            frame=_protocol.enum_name("SkyFrame", message.frame).removeprefix("SKY_FRAME_").lower(),
            azimuth_deg=message.look.longitude_deg if message.HasField("look") else None,
            altitude_deg=message.look.latitude_deg if message.HasField("look") else None,
        )


def frame_value(frame: str | None) -> str:
    """Returns the protocol's value for a reference frame such as `horizon`; None means the current frame."""
    return f"SKY_FRAME_{'UNSPECIFIED' if frame is None else frame.upper()}"


def quaternion(axis: npt.ArrayLike, angle_rad: float) -> Vector:
    """Returns the rotation about an axis of any length, anticlockwise as seen from its tip, (4,).

    Raises:
        ValueError: the axis has no direction.
    """
    unit = _unit(axis)
    return np.append(np.sin(angle_rad / 2) * unit, np.cos(angle_rad / 2))


def multiply(a: npt.ArrayLike, b: npt.ArrayLike) -> Vector:
    """Returns the rotation `b` followed by `a`, (4,), normalised."""
    p, q = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    vector = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
    product: Vector = np.append(vector, p[3] * q[3] - p[:3] @ q[:3])
    normalised: Vector = product / np.linalg.norm(product)
    return normalised


def conjugate(rotation: npt.ArrayLike) -> Vector:
    """Returns the inverse rotation, (4,)."""
    turned: Vector = np.asarray(rotation, dtype=np.float64) * np.array([-1.0, -1.0, -1.0, 1.0])
    return turned


def rotate(rotation: npt.ArrayLike, vectors: npt.ArrayLike) -> Vector:
    """Rotates vectors, (..., 3), by a unit quaternion, (4,)."""
    q, v = np.asarray(rotation, dtype=np.float64), np.asarray(vectors, dtype=np.float64)
    across = 2 * np.cross(q[:3], v)
    turned: Vector = v + q[3] * across + np.cross(q[:3], across)
    return turned


def looking_at(direction: npt.ArrayLike, up: npt.ArrayLike = (0.0, 0.0, 1.0)) -> Vector:
    """Returns the orientation of a camera that looks along an ICRS direction, with `up` upwards in its picture; the
    default is celestial north. (4,).

    Raises:
        ValueError: one of the vectors has no direction, or they are parallel.
    """
    back = -_unit(direction)
    right = _unit(np.cross(_unit(up), back))
    columns = np.stack([right, np.cross(back, right), back], axis=1)
    # Use the eigenvector of the largest eigenvalue, which needs no case distinctions by the trace. Source: I. Y.
    # Bar-Itzhack, "New method for extracting the quaternion from a rotation matrix", 2000.
    m = columns
    symmetric = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
            [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    _, vectors = np.linalg.eigh(symmetric)
    found: Vector = vectors[:, -1]
    return found if found[3] >= 0 else -found


def _unit(vector: npt.ArrayLike) -> Vector:
    v: Vector = np.asarray(vector, dtype=np.float64)
    length = float(np.linalg.norm(v))
    if v.shape != (3,) or not np.isfinite(length) or length < 1e-12:
        raise ValueError(f"{vector!r} is not a direction: must be three numbers that are not all 0")
    unit: Vector = v / length
    return unit
