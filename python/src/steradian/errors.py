"""Errors of calls: one class per status of the daemon, with its text.

`SteradianError.text` is the daemon's message, which states the problem and the valid values. Mistakes that this package
detects itself, such as an encoding that the protocol does not have, are Python's own `TypeError` and `ValueError`.
"""

from __future__ import annotations

import grpc


class SteradianError(Exception):
    """A call has failed.

    Attributes:
        code: name of its gRPC status, such as `NOT_FOUND`.
        text: message of the daemon.
        call: the call, such as `ViewService/GetView`.
    """

    def __init__(self, code: str, text: str, call: str) -> None:
        super().__init__(f"{call}: {text or code}")
        self.code = code
        self.text = text
        self.call = call


class InvalidArgument(SteradianError):
    """A value is invalid; nothing has changed."""


class NotFound(SteradianError):
    """No view, snapshot or stream has this name; the text lists the existing ones."""


class AlreadyExists(SteradianError):
    """The name exists already."""


class Conflict(SteradianError):
    """Scene, views or camera no longer have the expected revision: read them again."""


class FailedPrecondition(SteradianError):
    """The state of the daemon does not allow the call."""


class LeaseHeld(FailedPrecondition):
    """Another client holds the lease of the camera, or has taken it over; the text names it."""


class ResourceExhausted(SteradianError):
    """The call exceeds a limit of the daemon: streams, calls, bytes."""


class Unavailable(SteradianError):
    """The daemon cannot be reached, is shutting down, or has no headset at present."""


class DeadlineExceeded(SteradianError):
    """No answer within `timeout_s`."""


class Unauthenticated(SteradianError):
    """The daemon requires a token or a certificate, or does not know the given one."""


class PermissionDenied(SteradianError):
    """The role of the client does not allow the call."""


class Internal(SteradianError):
    """The daemon has failed; the text states the reason. Later calls may succeed."""


class Unimplemented(SteradianError):
    """The daemon is older than this package and lacks the call."""


class Cancelled(SteradianError):
    """The client ended the call."""


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
    """Converts an error of gRPC; `path` is that of the call."""
    code = error.code().name
    call = path.removeprefix("/steradian.v1.")
    # Message of the daemon for an expired deadline, if it arrives before the client's own timeout.
    if code == "CANCELLED" and error.details() == "Timeout expired":
        code = "DEADLINE_EXCEEDED"
    cls = _CLASSES.get(code, SteradianError)
    # The only precondition of the camera is the lease.
    if cls is FailedPrecondition and call.startswith("CameraService/"):
        cls = LeaseHeld
    return cls(code, error.details() or "", call)
