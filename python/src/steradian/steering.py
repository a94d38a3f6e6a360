"""Steering: a stream of poses with the lease of the camera. While it lasts, no other client can move the camera."""

from __future__ import annotations

import datetime
import threading
from collections import deque
from collections.abc import Iterator
from types import TracebackType
from typing import Any

import grpc
import numpy.typing as npt

from . import _protocol, errors
from ._channel import Transport
from ._protocol import Message
from .camera import Camera


def pose_fields(
    pose: Camera | None,
    position_m: npt.ArrayLike | None,
    orientation: npt.ArrayLike | None,
    velocity_c: npt.ArrayLike | None,
    turn: npt.ArrayLike | None = None,
) -> dict[str, object]:
    """Returns the fields of a `SetCameraRequest`: those of the pose, replaced by single values."""
    given = {"position_m": position_m, "orientation": orientation, "velocity_c": velocity_c}
    whole = {} if pose is None else {name: getattr(pose, name) for name in given}
    if turn is not None:
        # A turn replaces the orientation of the pose.
        whole.pop("orientation", None)
    changed = whole | {name: value for name, value in given.items() if value is not None}
    return changed if turn is None else changed | {"turn": turn}


# Maximum number of queued poses that have a time. A call that adds another one waits.
MOST_WAITING = 1000


class Steering:
    """A stream of poses, a context manager: see `Client.steer`. It may be called from any thread.

    The newest pose wins: an unsent pose is replaced by the next one. Poses with a time are all sent, in their order; a
    pose without one removes those that are waiting. The daemon answers at the end of the stream, so a refusal is raised
    by the first call after its arrival, or at the end.

    Attributes:
        camera: after the end: the camera after the last pose.
        poses: after the end: number of poses that the daemon has accepted.
    """

    def __init__(self, transport: Transport, lease: str, holder: str) -> None:
        self._transport = transport
        self.camera: Camera | None = None
        self.poses: int | None = None
        self._method = _protocol.method("CameraService", "StreamCamera")
        first = _protocol.build(self._method.request, {"lease": lease, "holder": holder})
        self._changed = threading.Condition()
        # The lock guards everything below.
        self._waiting: deque[Message] = deque([first])
        self._ended = self._answered = False
        self._call: Any = transport.send(self._method, self._messages())
        self._call.add_done_callback(self._done)

    def __call__(
        self,
        pose: Camera | None = None,
        *,
        position_m: npt.ArrayLike | None = None,
        orientation: npt.ArrayLike | None = None,
        velocity_c: npt.ArrayLike | None = None,
        time: datetime.datetime | None = None,
    ) -> None:
        """Moves the camera without waiting. Missing values stay unchanged.

        Args:
            pose: the whole pose, instead of the following arguments.
            position_m: (3,), metres, ICRS axes, from the Solar-System barycentre.
            orientation: (4,), unit quaternion x, y, z, w.
            velocity_c: (3,), in units of the speed of light.
            time: time at which the camera is to have this pose, by the daemon's clock, with a time zone; at most 10 s
                ahead and later than that of the previous pose. The camera moves there from the previous pose.

        Raises:
            LeaseHeld: another client holds the lease, or has taken it over.
            InvalidArgument: an earlier pose was refused; the stream has ended.
            SteradianError: the stream has failed.
        """
        fields = pose_fields(pose, position_m, orientation, velocity_c)
        message = _protocol.build(self._method.request, {"camera": fields, "time": time})
        with self._changed:
            if self._ended:
                raise errors.Cancelled("CANCELLED", "the stream of poses has ended", self._method.path)
            if not self._call.done():
                self._put(message)
                return
        self._raise()
        raise errors.Cancelled("CANCELLED", "the daemon has ended the stream of poses", self._method.path)

    def close(self) -> None:
        """Ends the stream after the last pose, and releases the lease.

        Raises:
            SteradianError: as for a pose.
        """
        with self._changed:
            if self._ended:
                return
            self._ended = True
            self._changed.notify_all()
        self._raise()

    def __enter__(self) -> Steering:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if error is None:
            self.close()
            return
        # An exception inside the block takes precedence; waiting poses are not sent.
        with self._changed:
            self._ended = True
            self._waiting.clear()
            self._changed.notify_all()
        self._call.cancel()

    def _put(self, message: Message) -> None:
        """Queues a pose.

        A pose without a time removes the queued poses that have one, and is merged with the last queued pose.
        """
        if not message.HasField("time"):
            while len(self._waiting) > 0 and self._waiting[-1].HasField("time"):
                self._waiting.pop()
        if len(self._waiting) == 0 or message.HasField("time"):
            self._changed.wait_for(lambda: len(self._waiting) < MOST_WAITING or self._answered)
            self._waiting.append(message)
        else:
            last = self._waiting[-1]
            last.camera.SetInParent()
            for field, value in message.camera.ListFields():
                getattr(last.camera, field.name).CopyFrom(value)
        self._changed.notify_all()

    def _messages(self) -> Iterator[Message]:
        """Yields the messages to send; runs in a thread of gRPC."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: len(self._waiting) > 0 or self._ended or self._answered)
                if len(self._waiting) == 0:
                    return
                message = self._waiting.popleft()
                self._changed.notify_all()
            yield message

    def _done(self, _: object) -> None:
        with self._changed:
            # Ends the sending thread.
            self._waiting.clear()
            self._answered = True
            self._changed.notify_all()

    def _raise(self) -> None:
        """Waits for the answer, and raises its error."""
        try:
            answer = self._call.result(timeout=self._transport.timeout_s)
        except grpc.FutureTimeoutError:
            self._call.cancel()
            text = f"no answer within {self._transport.timeout_s} s"
            raise errors.DeadlineExceeded("DEADLINE_EXCEEDED", text, self._method.path) from None
        except grpc.FutureCancelledError:
            raise errors.Cancelled("CANCELLED", "the stream of poses was ended", self._method.path) from None
        except grpc.RpcError as error:
            raise self._transport.error(error, self._method) from error
        self.camera, self.poses = Camera.of(answer.camera), answer.poses
