"""Iterators over streams of the daemon."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeVar

import grpc

from . import _protocol
from ._channel import Transport
from ._protocol import Message

T = TypeVar("T")


class Watch(Generic[T]):
    """An iterator over a stream of the daemon, and a context manager. It ends when the daemon shuts down, or by
    `close`; a stream that fails raises a `SteradianError`.
    """

    def __init__(
        self, transport: Transport, method: _protocol.Method, request: Message, convert: Callable[[Message], T]
    ) -> None:
        self._transport, self._method = transport, method
        self._convert = convert
        self._closed = False
        self._call: Any = transport.stream(method, request)

    def __iter__(self) -> Iterator[T]:
        return self

    def __next__(self) -> T:
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
