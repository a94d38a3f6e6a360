"""Pull loops: a thread asks for the next frame when it has the last one, and keeps the newest.

A stream of frames fills the buffers of connection and client, so that a slow reader sees old pictures. Here nothing
waits: `NextFrame` answers with the newest frame beyond the last one, the loop keeps one frame of each view, and whoever
takes a frame gets the newest that there is. What was replaced before anybody took it is counted in `skipped`.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Mapping
from typing import Any, Generic, TypeVar

import grpc

from . import _protocol, errors
from ._channel import Transport
from ._protocol import Message
from .frames import Frame

T = TypeVar("T")
Loop = TypeVar("Loop", bound="PullLoop[Any]")

# Between two attempts of a loop that reconnects: doubled from the first to the second.
_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 2.0


class Closed(Exception):
    """The loop was closed while a frame was waited for."""


class PullLoop(Generic[T]):
    """What loops of one and of several views have in common. A loop is an iterator and a context manager; `close` ends
    it, as the client's `close` does.

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
            raise ValueError(f"max_rate_hz = {max_rate_hz}: a rate above 0 is allowed, or None")
        self._transport = transport
        self._encodings = {view: _protocol.enum_value("Encoding", encoding) for view, encoding in wanted.items()}
        self._max_size = max_size
        self._period_s = 0.0 if max_rate_hz is None else 1.0 / max_rate_hz
        self._reconnect = reconnect
        self._timeout_s = timeout_s
        self._changed = threading.Condition()
        # All below is guarded by it.
        self._waiting: dict[str, Frame] = {}
        self._newest: dict[str, Frame] = {}
        self._error: Exception | None = None
        self._call: Any = None
        self._closed = False
        self._received = self._skipped = self._reconnects = 0
        self._problem = ""
        self._thread = threading.Thread(target=self._run, name=f"frames of {', '.join(wanted)}", daemon=True)
        self._thread.start()

    # For those who take frames.

    @property
    def received(self) -> int:
        """Frames that have come."""
        with self._changed:
            return self._received

    @property
    def skipped(self) -> int:
        """Frames that have come, and were replaced by newer ones before they were taken."""
        with self._changed:
            return self._skipped

    @property
    def reconnects(self) -> int:
        """Losses of the connection after which frames came again."""
        with self._changed:
            return self._reconnects

    @property
    def problem(self) -> str:
        """Why there are no frames at present, of a loop that reconnects; empty while they come."""
        with self._changed:
            return self._problem

    @property
    def closed(self) -> bool:
        """Whether the loop has ended: it was closed, or has failed."""
        with self._changed:
            return self._closed or self._error is not None

    def next(self, timeout_s: float | None = None) -> T:
        """Waits for what has not been taken yet, and takes it: the newest that there is.

        Raises:
            TimeoutError: nothing came within `timeout_s`.
            Closed: the loop was closed.
            SteradianError: the call failed; without `reconnect` also because the daemon has gone.
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
            return self._given(taken)

    def latest(self) -> T | None:
        """The newest that has come, taken before or not; None before the first. Does not wait.

        Raises:
            SteradianError: as `next`.
        """
        with self._changed:
            if self._error is not None:
                raise self._error
            self._waiting = {}
            return self._given(dict(self._newest)) if self._newest else None

    def close(self) -> None:
        """Ends the loop and its thread. What waits for a frame gets `Closed`."""
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

    # For the thread.

    def _given(self, frames: dict[str, Frame]) -> T:
        """What frames look like to who takes them."""
        raise NotImplementedError

    def _request(self, after: Mapping[str, int]) -> tuple[_protocol.Method, Message]:
        """The call, and its message."""
        raise NotImplementedError

    def _frames(self, answer: Message) -> list[Frame]:
        """What the answer of the call holds."""
        raise NotImplementedError

    def _views(self, after: Mapping[str, int]) -> list[dict[str, object]]:
        """Fields of a `NextFrameRequest` for each view."""
        return [
            {"view": view, "encoding": encoding, "after_frame_number": after[view], "max_size": self._max_size}
            for view, encoding in self._encodings.items()
        ]

    def _run(self) -> None:
        try:
            self._pull()
        # Whatever it is, it is raised where frames are taken, or nobody would hear of it.
        except Exception as error:
            with self._changed:
                self._error = error
                self._changed.notify_all()

    def _pull(self) -> None:
        after = dict.fromkeys(self._encodings, 0)
        pause_s, lost = _FIRST_PAUSE_S, False
        while True:
            begun = time.monotonic()
            try:
                frames = self._fetch(after)
            except (errors.Unavailable, errors.DeadlineExceeded) as error:
                if not self._reconnect:
                    raise
                # A daemon that comes back counts its frames anew.
                after, lost = dict.fromkeys(self._encodings, 0), True
                if self._pause(pause_s, str(error)):
                    return
                pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)
                continue
            if frames is None:
                return
            for frame in frames:
                after[frame.view] = frame.frame_number
            self._put(frames, lost)
            pause_s, lost = _FIRST_PAUSE_S, False
            # It waits before it asks, so that what comes is new.
            if self._pause(begun + self._period_s - time.monotonic(), ""):
                return

    def _fetch(self, after: Mapping[str, int]) -> list[Frame] | None:
        """The next frames; None when the loop is closed."""
        method, request = self._request(after)
        with self._changed:
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
        """Waits; tells whether the loop was closed meanwhile."""
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

    def _request(self, after: Mapping[str, int]) -> tuple[_protocol.Method, Message]:
        method = _protocol.method("ViewService", "NextFrame")
        return method, _protocol.build(method.request, self._views(after)[0])

    def _frames(self, answer: Message) -> list[Frame]:
        return [Frame.of(answer)]


class FramesLoop(PullLoop[dict[str, Frame]]):
    """The newest frames of several views, by one call at a time: see `Client.frames_of`. What it gives is the frames
    that have not been taken yet, by view: one at least."""

    def _given(self, frames: dict[str, Frame]) -> dict[str, Frame]:
        return frames

    def _request(self, after: Mapping[str, int]) -> tuple[_protocol.Method, Message]:
        method = _protocol.method("ViewService", "NextFrames")
        return method, _protocol.build(method.request, {"views": self._views(after)})

    def _frames(self, answer: Message) -> list[Frame]:
        return [Frame.of(message) for message in answer.frames]
