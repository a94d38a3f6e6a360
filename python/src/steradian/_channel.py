"""The connection to a daemon: its address, credentials, and calls with deadlines and typed errors."""

from __future__ import annotations

import ipaddress
import os
import threading
import time
import urllib.parse
from collections.abc import Iterator
from typing import Any

import grpc

from . import _protocol, errors
from ._protocol import Message

_OPTIONS: list[tuple[str, int | str]] = [
    ("grpc.max_receive_message_length", -1),
    ("grpc.max_send_message_length", -1),
    # Maximum delay between reconnections: by default gRPC waits up to two minutes.
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 2000),
    # A daemon that hangs is noticed within 15 s, even while no call is waiting.
    ("grpc.keepalive_time_ms", 10_000),
    ("grpc.keepalive_timeout_ms", 5_000),
    # Newer versions of gRPC use this key instead of the previous one.
    ("grpc.http2.ping_timeout_ms", 5_000),
    ("grpc.keepalive_permit_without_calls", 1),
    ("grpc.http2.max_pings_without_data", 0),
    # Each client has its own connection, and with it its own share of the daemon's limits. By default, all clients of a
    # process share one connection of gRPC.
    ("grpc.use_local_subchannel_pool", 1),
]
_HEALTH = "/grpc.health.v1.Health/Check"
# Encoded answer of the health service of a daemon that serves. The message has one field.
_SERVING = b"\x08\x01"
# Status codes of a daemon that does not serve yet. NOT_FOUND comes from the server that reports the health during the
# start of the daemon, shortly before that server ends.
_NOT_YET = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.NOT_FOUND)
# gRPC names the host of a Unix socket by its percent-encoded path. The HTTP library of the daemon refuses such a host.
_UNIX_HOST = ("grpc.default_authority", "localhost")

PathLike = str | os.PathLike[str]


def _is_local(host: str) -> bool:
    """Returns whether a host name always refers to this machine, so that data does not leave it."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class _Address:
    """Address of a daemon: `HOST:PORT`, `http://HOST:PORT`, `https://HOST:PORT` or `unix:PATH`."""

    def __init__(self, text: str) -> None:
        self.secure = text.startswith("https://")
        self.unix = text.startswith("unix:")
        if self.unix:
            self.target = text
            self.local = True
            return
        parts = urllib.parse.urlsplit(text if "://" in text else f"http://{text}")
        try:
            port = parts.port
        except ValueError:
            port = None
        if parts.scheme not in ("http", "https") or not parts.hostname or port is None or parts.path not in ("", "/"):
            raise ValueError(f"`{text}` is not an address: must be HOST:PORT, http[s]://HOST:PORT or unix:PATH")
        host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
        self.target = f"{host}:{port}"
        self.local = _is_local(parts.hostname)


def _read(path: PathLike | None) -> bytes | None:
    if path is None:
        return None
    with open(path, "rb") as file:
        return file.read()


class Transport:
    """A channel with the credentials of a client. All methods may be called from any thread."""

    def __init__(
        self,
        address: str,
        token: str | None,
        ca_file: PathLike | None,
        cert_file: PathLike | None,
        key_file: PathLike | None,
        timeout_s: float,
    ) -> None:
        where = _Address(address)
        if (cert_file is None) != (key_file is None):
            raise ValueError("a client's certificate needs both cert_file and key_file")
        if not where.secure and (ca_file is not None or cert_file is not None):
            raise ValueError(f"certificates need TLS: use https://, not `{address}`")
        if token is not None and not where.secure and not where.local:
            raise ValueError(f"the token would be sent unencrypted: use https://, not `{address}`")
        self.timeout_s = timeout_s
        self._guard = threading.Lock()
        self._seeking: Any = None
        self._metadata = [("authorization", f"Bearer {token}")] if token is not None else []
        options = list(_OPTIONS)
        if where.local:
            # Connections to this machine must not use a proxy that environment variables define.
            options.append(("grpc.enable_http_proxy", 0))
        if where.unix:
            options.append(_UNIX_HOST)
        if where.secure:
            credentials = grpc.ssl_channel_credentials(_read(ca_file), _read(key_file), _read(cert_file))
            self._channel = grpc.secure_channel(where.target, credentials, options=options)
        else:
            self._channel = grpc.insecure_channel(where.target, options=options)

    def close(self) -> None:
        """Ends the connection, and all calls on it."""
        self._channel.close()

    def wait_until_ready(self, timeout_s: float) -> None:
        """Waits until the daemon reports that it serves."""
        end = time.monotonic() + timeout_s
        check = self._channel.unary_unary(_HEALTH)
        found = "no connection"
        while (left := end - time.monotonic()) > 0:
            try:
                answer = check(b"", timeout=left, wait_for_ready=True, metadata=self._metadata)
            except grpc.RpcError as error:
                if error.code() not in _NOT_YET:
                    raise errors.from_rpc(error, _HEALTH) from error
            else:
                if answer == _SERVING:
                    return
                found = "the daemon was still starting"
            time.sleep(min(0.1, max(end - time.monotonic(), 0.0)))
        raise errors.DeadlineExceeded("DEADLINE_EXCEEDED", f"{found} after {timeout_s} s", "connect")

    def unary(self, service: str, name: str, request: Message, timeout_s: float | None = None) -> Message:
        """Makes a unary call."""
        method = _protocol.method(service, name)
        try:
            return self.start(method, request, timeout_s).result()
        except grpc.RpcError as error:
            raise self.error(error, method) from error

    def error(self, error: grpc.RpcError, method: _protocol.Method) -> errors.SteradianError:
        """Converts an error of a call. After a loss, the channel starts to reconnect."""
        found = errors.from_rpc(error, method.path)
        if isinstance(found, errors.Unavailable):
            self._seek()
        return found

    def _seek(self) -> None:
        """Makes the channel connect, and waits for the connection. A channel connects by itself, but older versions of
        gRPC serve its socket only during a call, and calls fail at once without a connection."""
        with self._guard:
            if self._seeking is not None:
                return
            call = self._channel.unary_unary(_HEALTH)
            seeking = self._seeking = call.future(b"", wait_for_ready=True, metadata=self._metadata)
        seeking.add_done_callback(self._found)

    def _found(self, _: object) -> None:
        with self._guard:
            self._seeking = None

    def start(self, method: _protocol.Method, request: Message, timeout_s: float | None = None) -> Any:
        """Returns the future of a unary call, which can be cancelled from another thread."""
        if method.client_streams or method.server_streams:
            raise ValueError(f"{method.path} is a stream")
        call = self._channel.unary_unary(method.path, method.request.SerializeToString, method.response.FromString)
        timeout = self.timeout_s if timeout_s is None else timeout_s
        return call.future(request, timeout=timeout, metadata=self._metadata)

    def stream(self, method: _protocol.Method, request: Message) -> Any:
        """Returns the messages of a server stream: an iterator of gRPC, which can be cancelled. Streams have no
        deadline."""
        if method.client_streams or not method.server_streams:
            raise ValueError(f"{method.path} is not a server stream")
        call = self._channel.unary_stream(method.path, method.request.SerializeToString, method.response.FromString)
        return call(request, metadata=self._metadata)

    def send(self, method: _protocol.Method, requests: Iterator[Message]) -> Any:
        """Returns the future of the answer to a client stream."""
        if not method.client_streams or method.server_streams:
            raise ValueError(f"{method.path} is not a client stream")
        call = self._channel.stream_unary(method.path, method.request.SerializeToString, method.response.FromString)
        return call.future(requests, metadata=self._metadata)
