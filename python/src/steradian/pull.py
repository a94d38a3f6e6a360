"""Pull loops: a thread requests the next frame as soon as it has received the last one, and keeps the newest frame.

A stream of frames fills the buffers of connection and client, so that a slow reader sees old pictures. A pull loop has
no such queue: `NextFrame` returns the newest frame after the last one, the loop keeps one frame of each view, and
the reader gets the newest frame. Frames that were replaced before they were taken are counted in `skipped`.

A picture of H.264 depends on the previous one, so it must not be replaced: a loop with such a view requests the next
frames when the last picture has been taken.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Mapping
from typing import Any, Generic, NamedTuple, TypeVar

import grpc

from . import _protocol, errors
from ._channel import Transport
from ._protocol import Message
from .frames import Frame

T = TypeVar("T")
Loop = TypeVar("Loop", bound="PullLoop[Any]")

# First and longest delay between attempts to reconnect. The delay doubles after each attempt.
_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 2.0


class Seen(NamedTuple):
    """The newest frame of a view that the loop has received."""

    # 0: none.
    number: int
    # Number of the H.264 sequence that the pictures belong to, 0: none. The next picture may continue this sequence and
    # need not be a key picture.
    video: int


_NOTHING = Seen(0, 0)


class Closed(Exception):
    """The loop was closed while a reader waited for a frame."""


class PullLoop(Generic[T]):
    """Common part of loops of one and of several views. A loop is an iterator and a context manager; `close` ends
    it, and so does the client's `close`.

    Its methods may be called from any thread.
    """

    def __init__(
        self,
        transport: Transport,
        wanted: Mapping[str, str],
        *,
        max_size: int,
        max_rate_hz: float | None,
        reconnect: bool,
        timeout_s: float | None,
    ) -> None:
        if not wanted:
            raise ValueError("a loop needs a view")
        if max_rate_hz is not None and not max_rate_hz > 0:
            raise ValueError(f"max_rate_hz = {max_rate_hz}: must be above 0, or None")
        self._transport = transport
        self._encodings = {view: _protocol.enum_value("Encoding", encoding) for view, encoding in wanted.items()}
        # Views of which the reader must get every frame.
        self._videos = {view for view, encoding in wanted.items() if encoding == "H264"}
        self._max_size = max_size
        self._period_s = 0.0 if max_rate_hz is None else 1.0 / max_rate_hz
        self._reconnect = reconnect
        self._timeout_s = timeout_s
        self._changed = threading.Condition()
        # The lock guards everything below.
        self._waiting: dict[str, Frame] = {}
        self._newest: dict[str, Frame] = {}
        self._error: Exception | None = None
        self._call: Any = None
        self._closed = False
        self._received = self._skipped = self._reconnects = 0
        self._problem = ""
        self._thread = threading.Thread(target=self._run, name=f"frames of {', '.join(wanted)}", daemon=True)
        self._thread.start()

    # Methods for readers of frames.

    @property
    def received(self) -> int:
        """Number of received frames."""
        with self._changed:
            return self._received

    @property
    def skipped(self) -> int:
        """Number of received frames that were replaced by newer ones before they were taken."""
        with self._changed:
            return self._skipped

    @property
    def reconnects(self) -> int:
        """Number of lost connections that were restored."""
        with self._changed:
            return self._reconnects

    @property
    def problem(self) -> str:
        """Reason of the current interruption of a loop that reconnects; empty while frames arrive."""
        with self._changed:
            return self._problem

    @property
    def closed(self) -> bool:
        """Whether the loop has ended: it was closed, or has failed."""
        with self._changed:
            return self._closed or self._error is not None

    def next(self, timeout_s: float | None = None) -> T:
        """Waits for a frame that has not been taken yet, and takes the newest.

        Raises:
            TimeoutError: no frame arrived within `timeout_s`.
            Closed: the loop was closed.
            SteradianError: the call failed. Without `reconnect`, this includes a daemon that cannot be reached.
        """
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        with self._changed:
            while not self._waiting:
                if self._error is not None:
                    raise self._error
                if self._closed:
                    raise Closed("the loop was closed")
                left = None if deadline is None else deadline - time.monotonic()
                if left is not None and left <= 0:
                    raise TimeoutError(f"no frame within {timeout_s} s{': ' if self._problem else ''}{self._problem}")
                self._changed.wait(left)
            taken, self._waiting = self._waiting, {}
            self._changed.notify_all()
            return self._given(taken)

    def latest(self) -> T | None:
        """Returns the newest received frame, whether or not it has been taken; None before the first frame. Does not
        wait.

        Raises:
            SteradianError: as for `next`.
        """
        with self._changed:
            if self._error is not None:
                raise self._error
            self._waiting = {}
            self._changed.notify_all()
            return self._given(dict(self._newest)) if self._newest else None

    def close(self) -> None:
        """Ends the loop and its thread. Waiting readers get `Closed`."""
        with self._changed:
            self._closed = True
            self._waiting = {}
            call = self._call
            self._changed.notify_all()
        if call is not None:
            call.cancel()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def __enter__(self: Loop) -> Loop:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[T]:
        return self

    def __next__(self) -> T:
        try:
            return self.next()
        except Closed:
            raise StopIteration from None

    # Methods of the thread.

    def _given(self, frames: dict[str, Frame]) -> T:
        """Converts frames for readers."""
        raise NotImplementedError

    def _request(self, after: Mapping[str, Seen]) -> tuple[_protocol.Method, Message]:
        """Returns the call and its message."""
        raise NotImplementedError

    def _frames(self, answer: Message) -> list[Frame]:
        """Reads the frames of an answer."""
        raise NotImplementedError

    def _views(self, after: Mapping[str, Seen]) -> list[dict[str, object]]:
        """Returns the fields of a `NextFrameRequest` for each view."""
        return [
            {
                "view": view,
                "encoding": encoding,
                "after_frame_number": after[view].number,
                "max_size": self._max_size,
                "video": after[view].video,
            }
            for view, encoding in self._encodings.items()
        ]

    def _run(self) -> None:
        try:
            self._pull()
        # Readers raise the error, whatever it is; otherwise it would be lost.
        except Exception as error:
            with self._changed:
                self._error = error
                self._changed.notify_all()

    def _pull(self) -> None:
        after = dict.fromkeys(self._encodings, _NOTHING)
        pause_s, lost = _FIRST_PAUSE_S, False
        while True:
            begun = time.monotonic()
            try:
                frames = self._fetch(after)
            except (errors.Unavailable, errors.DeadlineExceeded) as error:
                if not self._reconnect:
                    raise
                # A restarted daemon restarts its frame numbers.
                after, lost = dict.fromkeys(self._encodings, _NOTHING), True
                if self._pause(pause_s, str(error)):
                    return
                pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)
                continue
            if frames is None:
                return
            for frame in frames:
                after[frame.view] = Seen(frame.frame_number, frame.message.video)
            self._put(frames, lost)
            pause_s, lost = _FIRST_PAUSE_S, False
            # Wait before the request, so that the frame is new.
            if self._pause(begun + self._period_s - time.monotonic(), ""):
                return

    def _fetch(self, after: Mapping[str, Seen]) -> list[Frame] | None:
        """Returns the next frames; None when the loop is closed."""
        method, request = self._request(after)
        with self._changed:
            self._changed.wait_for(lambda: self._closed or self._videos.isdisjoint(self._waiting))
            if self._closed:
                return None
            self._call = call = self._transport.start(method, request, self._timeout_s)
        try:
            return self._frames(call.result())
        except grpc.FutureCancelledError:
            with self._changed:
                if self._closed:
                    return None
            raise errors.Cancelled("CANCELLED", "the connection was closed", method.path) from None
        except grpc.RpcError as error:
            raise self._transport.error(error, method) from error

    def _put(self, frames: list[Frame], lost: bool) -> None:
        with self._changed:
            self._received += len(frames)
            self._reconnects += lost
            self._problem = ""
            for frame in frames:
                self._skipped += frame.view in self._waiting
                self._waiting[frame.view] = self._newest[frame.view] = frame
            self._changed.notify_all()

    def _pause(self, pause_s: float, problem: str) -> bool:
        """Waits; returns whether the loop was closed in the meantime."""
        with self._changed:
            if problem:
                self._problem = problem
            if pause_s > 0:
                self._changed.wait_for(lambda: self._closed, pause_s)
            return self._closed


class FrameLoop(PullLoop[Frame]):
    """The newest frames of one view: see `Client.frames`."""

    def _given(self, frames: dict[str, Frame]) -> Frame:
        return next(iter(frames.values()))

    def _request(self, after: Mapping[str, Seen]) -> tuple[_protocol.Method, Message]:
        method = _protocol.method("ViewService", "NextFrame")
        return method, _protocol.build(method.request, self._views(after)[0])

    def _frames(self, answer: Message) -> list[Frame]:
        return [Frame.of(answer)]


class FramesLoop(PullLoop[dict[str, Frame]]):
    """The newest frames of several views, by one call at a time: see `Client.frames_of`. It yields the frames that have
    not been taken yet, at least one, by view."""

    def _given(self, frames: dict[str, Frame]) -> dict[str, Frame]:
        return frames

    def _request(self, after: Mapping[str, Seen]) -> tuple[_protocol.Method, Message]:
        method = _protocol.method("ViewService", "NextFrames")
        return method, _protocol.build(method.request, {"views": self._views(after)})

    def _frames(self, answer: Message) -> list[Frame]:
        return [Frame.of(message) for message in answer.frames]
