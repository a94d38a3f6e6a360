"""Iterators over streams of the daemon."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeVar

import grpc

from . import _protocol
from ._channel import Transport
from ._protocol import Message

T = TypeVar("T")


class Watch(Generic[T]):
    """An iterator over a stream of the daemon, and a context manager. It ends when the daemon shuts down or `close` is
    called. A stream that fails raises a `SteradianError`.
    """

    def __init__(
        self, transport: Transport, method: _protocol.Method, request: Message, convert: Callable[[Message], T]
    ) -> None:
        self._transport, self._method = transport, method
        self._convert = convert
        self._closed = False
        self._call: Any = transport.stream(method, request)

        # Queue of the messages that a thread reads for `next`; None marks the end. It holds only one message, so that a
        # slow reader gets the newest.
        self._read: queue.Queue[T | Exception | None] | None = None

    def __iter__(self) -> Iterator[T]:
        return self

    def __next__(self) -> T:
        return self._next() if self._read is None else self._taken(None)

    def next(self, timeout_s: float | None = None) -> T:
        """Waits for the next message.

        Raises:
            TimeoutError: no message arrived within `timeout_s`. The stream continues.
            StopIteration: the stream has ended.
            SteradianError: the stream has failed.
        """
        if self._read is None:
            if timeout_s is None:
                return self._next()
            self._read = queue.Queue(maxsize=1)
            threading.Thread(target=self._follow, args=(self._read,), daemon=True).start()
        return self._taken(timeout_s)

    def _taken(self, timeout_s: float | None) -> T:
        assert self._read is not None
        try:
            taken = self._read.get(timeout=timeout_s)
        except queue.Empty:
            raise TimeoutError(f"no message within {timeout_s} s") from None
        if taken is not None and not isinstance(taken, Exception):
            return taken
        # Later calls end in the same way.
        self._read.put(taken)
        if taken is None:
            raise StopIteration
        raise taken

    def _follow(self, read: queue.Queue[T | Exception | None]) -> None:
        """Reads messages until the end; runs in a thread."""
        while True:
            try:
                read.put(self._next())
            except StopIteration:
                read.put(None)
                return
            except Exception as error:  # Raised where messages are taken.
                read.put(error)
                return

    def _next(self) -> T:
        try:
            message = next(self._call)
        except grpc.RpcError as error:
            if self._closed:
                raise StopIteration from None
            raise self._transport.error(error, self._method) from error
        return self._convert(message)

    def close(self) -> None:
        """Ends the stream, from any thread."""
        self._closed = True
        self._call.cancel()

    def __enter__(self) -> Watch[T]:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
