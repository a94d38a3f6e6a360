"""Client of the Steradian daemon: views of space scenes as numpy arrays.

    import steradian

    with steradian.Client("127.0.0.1:7143") as client:
        frame = client.render("dome", "RGB32F")
        print(frame.array().shape, frame.camera)
        with client.frames("dome") as frames:
            for frame in frames:
                print(frame.frame_number, frame.array().mean())

Units are in the names: metres, radians, cd/m^2, lux, seconds. Positions and directions are in ICRS axes,
quaternions are x, y, z, w.
"""

from ._protocol import message, services
from .camera import Camera, conjugate, looking_at, multiply, quaternion, rotate
from .client import Client
from .errors import (
    AlreadyExists,
    Cancelled,
    Conflict,
    DeadlineExceeded,
    FailedPrecondition,
    Internal,
    InvalidArgument,
    LeaseHeld,
    NotFound,
    PermissionDenied,
    ResourceExhausted,
    SteradianError,
    Unauthenticated,
    Unavailable,
    Unimplemented,
)
from .frames import Frame, Image, luminance
from .pull import Closed, FrameLoop, FramesLoop
from .scene import Check, Info, Scene, SeenObject, Snapshot, Stats
from .steering import Steering
from .views import View, ViewImage
from .watch import Watch

__all__ = [
    "AlreadyExists",
    "Camera",
    "Cancelled",
    "Check",
    "Client",
    "Closed",
    "Conflict",
    "DeadlineExceeded",
    "FailedPrecondition",
    "Frame",
    "FrameLoop",
    "FramesLoop",
    "Image",
    "Info",
    "Internal",
    "InvalidArgument",
    "LeaseHeld",
    "NotFound",
    "PermissionDenied",
    "ResourceExhausted",
    "Scene",
    "SeenObject",
    "Snapshot",
    "Stats",
    "SteradianError",
    "Steering",
    "Unauthenticated",
    "Unavailable",
    "Unimplemented",
    "View",
    "ViewImage",
    "Watch",
    "conjugate",
    "looking_at",
    "luminance",
    "message",
    "multiply",
    "quaternion",
    "rotate",
    "services",
]
