"""What a call may fail with: one class per status of the daemon, with its text.

The daemon says in words what was wrong and what is allowed; `SteradianError.text` is that. Mistakes that this package
can see by itself, such as an encoding that the protocol does not have, are Python's own `TypeError` and `ValueError`.
"""

from __future__ import annotations

import grpc


class SteradianError(Exception):
    """A call has failed.

    Attributes:
        code: name of its gRPC status, such as `NOT_FOUND`.
        text: what the daemon says of it.
        call: the call, such as `ViewService/GetView`.
    """

    def __init__(self, code: str, text: str, call: str) -> None:
        super().__init__(f"{call}: {text or code}")
        self.code = code
        self.text = text
        self.call = call


class InvalidArgument(SteradianError):
    """A value is not allowed; nothing has changed."""


class NotFound(SteradianError):
    """There is no view, snapshot or stream of this name; the text lists those that there are."""


class AlreadyExists(SteradianError):
    """The name is taken."""


class Conflict(SteradianError):
    """Scene, views or camera do not have the expected revision any more: read them again."""


class FailedPrecondition(SteradianError):
    """The state of the daemon does not allow the call."""


class LeaseHeld(FailedPrecondition):
    """Another client steers the camera, or has taken its lease over; the text names it."""


class ResourceExhausted(SteradianError):
    """The call would take more than the daemon gives: streams, calls, bytes."""


class Unavailable(SteradianError):
    """The daemon cannot be reached, is shutting down, or has no headset at present."""


class DeadlineExceeded(SteradianError):
    """No answer within `timeout_s`."""


class Unauthenticated(SteradianError):
    """The daemon asks for a token or a certificate, or does not know the one that it got."""


class PermissionDenied(SteradianError):
    """The role of the client does not allow the call."""


class Internal(SteradianError):
    """The daemon has failed, and says why; later calls may succeed."""


class Unimplemented(SteradianError):
    """The daemon does not know the call: it is older than this package."""


class Cancelled(SteradianError):
    """The call was ended by this side."""


_CLASSES: dict[str, type[SteradianError]] = {
    "INVALID_ARGUMENT": InvalidArgument,
    "OUT_OF_RANGE": InvalidArgument,
    "NOT_FOUND": NotFound,
    "ALREADY_EXISTS": AlreadyExists,
    "ABORTED": Conflict,
    "FAILED_PRECONDITION": FailedPrecondition,
    "RESOURCE_EXHAUSTED": ResourceExhausted,
    "UNAVAILABLE": Unavailable,
    "DEADLINE_EXCEEDED": DeadlineExceeded,
    "UNAUTHENTICATED": Unauthenticated,
    "PERMISSION_DENIED": PermissionDenied,
    "INTERNAL": Internal,
    "UNIMPLEMENTED": Unimplemented,
    "CANCELLED": Cancelled,
}


def from_rpc(error: grpc.RpcError, path: str) -> SteradianError:
    """The error of this package for one of gRPC; `path` is that of the call."""
    code = error.code().name
    call = path.removeprefix("/steradian.v1.")
    # What the daemon says at the deadline that came with the call, if that is here before the clock of this side has
    # found out.
    if code == "CANCELLED" and error.details() == "Timeout expired":
        code = "DEADLINE_EXCEEDED"
    cls = _CLASSES.get(code, SteradianError)
    # The camera has one precondition: that nobody else steers.
    if cls is FailedPrecondition and call.startswith("CameraService/"):
        cls = LeaseHeld
    return cls(code, error.details() or "", call)
