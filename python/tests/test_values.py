"""Tests of values that need no daemon: messages, EXR files, rotations, addresses, and transmitted metadata."""

from __future__ import annotations

import shutil
import struct
import subprocess
import zlib
from collections.abc import Iterator
from concurrent import futures
from pathlib import Path
from typing import Any

import grpc
import numpy as np
import numpy.typing as npt
import pytest

import steradian
from steradian import exr


def test_plain_values_become_messages() -> None:
    body = steradian.message(
        "Body",
        name="rock",
        position_m=np.array([1, 2, 3], dtype=np.float32),
        geometric_albedo=[0.1, 0.2, 0.3],
        spin={"period_s": np.float64(5.0), "phase_rad": None},
        emission={},
    )
    assert (body.position_m.z, body.geometric_albedo.blue, body.spin.period_s, body.spin.phase_rad) == (3, 0.3, 5, 0)
    assert body.HasField("emission") and not body.HasField("radii_m")
    field = steradian.message("AsteroidField", radius_m=(1.0, 2.0), instances=np.int64(7), box={"size_m": [1, 1, 1]})
    assert (field.radius_m.least, field.radius_m.most, field.instances) == (1, 2, 7)
    views = steradian.message(
        "NextFramesRequest", views=[{"view": "a", "encoding": "EXR"}, {"view": "b", "encoding": 2}]
    )
    assert [view.encoding for view in views.views] == [5, 2]
    assert steradian.message("UpdateSceneRequest", update_mask=["time", "stars"]).update_mask.paths == ["time", "stars"]


@pytest.mark.parametrize(
    "name, fields, error, text",
    [
        ("Bdy", {}, ValueError, "no message `Bdy`"),
        ("Body", {"radius_m": 1.0}, TypeError, "no field `radius_m`: it has name"),
        ("Body", {"position_m": [1, 2]}, ValueError, "3 numbers"),
        ("Body", {"position_m": "far"}, ValueError, "far"),
        ("Body", {"emission": 3.0}, TypeError, "converted to Emission"),
        ("NextFramesRequest", {"views": "dome"}, TypeError, "sequence"),
        ("NextFrameRequest", {"encoding": "GIF"}, ValueError, "has no `GIF`"),
        ("NextFrameRequest", {"view": 3}, TypeError, "type"),
    ],
)
def test_values_that_do_not_fit_are_refused(
    name: str, fields: dict[str, object], error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        steradian.message(name, **fields)


def run_lengths(plain: bytes) -> bytes:
    """Writes runs of at least three bytes as counts, and everything else unchanged."""
    out, at, literal = b"", 0, b""
    while at < len(plain):
        run = 1
        while run < 128 and at + run < len(plain) and plain[at + run] == plain[at]:
            run += 1
        if run < 3 and len(literal) < 127:
            literal += plain[at : at + 1]
            at += 1
            continue
        if literal:
            out += bytes([256 - len(literal)]) + literal
            literal = b""
        if run >= 3:
            out += bytes([run - 1]) + plain[at : at + 1]
            at += run
    return out + (bytes([256 - len(literal)]) + literal if literal else b"")


def exr_file(pixels: dict[str, npt.NDArray[Any]], compression: int) -> bytes:
    """Writes a file in the layout of the OpenEXR documentation, row by row."""
    height, width = next(iter(pixels.values())).shape
    kinds = {np.dtype("float16"): 1, np.dtype("float32"): 2}
    names = sorted(pixels)
    listed = b"".join(name.encode() + struct.pack("<xiiii", kinds[pixels[name].dtype], 0, 1, 1) for name in names)
    window = struct.pack("<iiii", 0, 0, width - 1, height - 1)
    attributes = [("channels", "chlist", listed + b"\0"), ("compression", "compression", bytes([compression]))]
    header = struct.pack("<II", 20_000_630, 2)
    for name, kind, value in [*attributes, ("dataWindow", "box2i", window)]:
        header += f"{name}\0{kind}\0".encode() + struct.pack("<i", len(value)) + value
    header += b"\0"
    rows = {0: 1, 1: 1, 2: 1, 3: 16}[compression]
    blocks = []
    for first in range(0, height, rows):
        plain = b"".join(pixels[name][y].tobytes() for y in range(first, min(first + rows, height)) for name in names)
        if compression:
            mixed = plain[0::2] + plain[1::2]
            differences = bytes([mixed[0]]) + bytes((b - a + 128) % 256 for a, b in zip(mixed, mixed[1:]))
            short = run_lengths(differences) if compression == 1 else zlib.compress(differences)
            plain = short if len(short) < len(plain) else plain
        blocks.append(struct.pack("<ii", first, len(plain)) + plain)
    at, offsets = len(header) + 8 * len(blocks), []
    for block in blocks:
        offsets.append(at)
        at += len(block)
    return header + struct.pack(f"<{len(blocks)}Q", *offsets) + b"".join(blocks)


@pytest.mark.parametrize("compression", [0, 1, 2, 3])
def test_exr_files_are_read(compression: int) -> None:
    random = np.random.default_rng(1)
    pixels: dict[str, npt.NDArray[Any]] = {
        "B": np.zeros((37, 21), dtype=np.float32),
        "G": random.random((37, 21)).astype(np.float16),
        "omega": random.random((37, 21)).astype(np.float32),
    }
    data = exr_file(pixels, compression)
    read = exr.channels(data)
    assert list(read) == ["B", "G", "omega"]
    for name, values in pixels.items():
        np.testing.assert_array_equal(read[name], values.astype(np.float32))
    # A truncated file is an error.
    for length in [0, 3, 20, 100, len(data) // 2, len(data) - 1]:
        with pytest.raises(ValueError):
            exr.channels(data[:length])


def test_exr_files_of_other_kinds_are_refused() -> None:
    data = bytearray(exr_file({"G": np.ones((4, 4), dtype=np.float32)}, 3))
    tiled = bytearray(data)
    tiled[5] |= 2
    with pytest.raises(ValueError, match="tiles"):
        exr.channels(bytes(tiled))
    data[data.index(b"compression\0compression\0") + 28] = 4
    with pytest.raises(ValueError, match="compression 4"):
        exr.channels(bytes(data))


def test_images_that_do_not_fit_their_size_are_refused() -> None:
    with pytest.raises(ValueError):
        steradian.Image("", 4, 4, "RGBA8", bytes(63)).array()
    with pytest.raises(ValueError, match="not decoded"):
        steradian.Image("", 4, 4, "H264", b"").array()
    with pytest.raises(ValueError, match="EXR"):
        steradian.Image("", 4, 4, "RGBA8", bytes(64)).illuminance_lx()


def test_rotations() -> None:
    half = steradian.quaternion([0, 0, 2], np.pi)
    np.testing.assert_allclose(half, [0, 0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(steradian.rotate(half, [[1, 2, 3]]), [[-1, -2, 3]], atol=1e-15)
    random = np.random.default_rng(2)
    for _ in range(20):
        direction, up, v = random.normal(size=(3, 3))
        q = steradian.looking_at(direction, up)
        # The view looks along -z; up is in the plane of y and z.
        np.testing.assert_allclose(steradian.rotate(q, [0, 0, -1]), direction / np.linalg.norm(direction), atol=1e-12)
        seen = steradian.rotate(steradian.conjugate(q), up)
        assert abs(seen[0]) < 1e-12 and seen[1] > 0
        p = steradian.quaternion(up, 0.3)
        np.testing.assert_allclose(
            steradian.rotate(steradian.multiply(p, q), v), steradian.rotate(p, steradian.rotate(q, v)), atol=1e-12
        )
    with pytest.raises(ValueError, match="direction"):
        steradian.looking_at([0, 0, 1], [0, 0, 2])


@pytest.mark.parametrize(
    "address", ["127.0.0.1", "localhost:port", "ftp://127.0.0.1:1", "http://127.0.0.1:1/path", "", "http://:7143"]
)
def test_wrong_addresses_are_refused(address: str) -> None:
    with pytest.raises(ValueError, match="must be HOST:PORT"):
        steradian.Client(address)


def test_credentials_unsuitable_for_the_address_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="unencrypted"):
        steradian.Client("http://control.example:7143", token="secret")
    with pytest.raises(ValueError, match="https"):
        steradian.Client("127.0.0.1:7143", ca_file=tmp_path / "ca.pem")
    with pytest.raises(ValueError, match="key_file"):
        steradian.Client("https://127.0.0.1:7143", cert_file=tmp_path / "cert.pem")
    with pytest.raises(FileNotFoundError):
        steradian.Client("https://127.0.0.1:7143", ca_file=tmp_path / "ca.pem")


def _get_camera(request: bytes, context: Any) -> bytes:
    """Returns a camera whose revision is the length of the received token."""
    sent = dict(context.invocation_metadata()).get("authorization", "")
    answer: bytes = steradian.message("Camera", revision=len(sent.removeprefix("Bearer "))).SerializeToString()
    return answer


@pytest.fixture
def server() -> Iterator[Any]:
    """A gRPC server that does not listen on a port yet."""
    methods = {"GetCamera": grpc.unary_unary_rpc_method_handler(_get_camera)}
    handler = grpc.method_handlers_generic_handler("steradian.v1.CameraService", methods)
    made = grpc.server(futures.ThreadPoolExecutor(2), handlers=[handler])
    yield made
    made.stop(None)


def test_a_token_is_sent_with_every_call_over_tcp_and_sockets(server: Any, tmp_path: Path) -> None:
    port = server.add_insecure_port("127.0.0.1:0")
    server.add_insecure_port(f"unix:{tmp_path}/socket")
    server.start()
    for address in [f"127.0.0.1:{port}", f"http://localhost:{port}/", f"unix:{tmp_path}/socket"]:
        for token, length in [("secret", 6), (None, 0)]:
            with steradian.Client(address, token=token) as client:
                assert client.camera().revision == length


def test_certificates_are_checked(server: Any, tmp_path: Path) -> None:
    if shutil.which("openssl") is None:
        pytest.skip("openssl, which makes the certificates of this test, is not installed")
    command = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 1 -subj /CN=localhost"
    for name in ["daemon", "other"]:
        files = ["-keyout", f"{name}.key", "-out", f"{name}.pem", "-addext", "subjectAltName=DNS:localhost"]
        subprocess.run(command.split() + files, cwd=tmp_path, check=True, capture_output=True)
    key, certificate = (tmp_path / "daemon.key").read_bytes(), (tmp_path / "daemon.pem").read_bytes()
    # The server requires a client certificate.
    credentials = grpc.ssl_server_credentials([(key, certificate)], certificate, True)
    port = server.add_secure_port("127.0.0.1:0", credentials)
    server.start()
    address = f"https://localhost:{port}"

    def revision(ca: str, own: str | None) -> int:
        files = {} if own is None else {"cert_file": tmp_path / f"{own}.pem", "key_file": tmp_path / f"{own}.key"}
        with steradian.Client(
            address, token="secret", ca_file=tmp_path / f"{ca}.pem", **files, timeout_s=20.0
        ) as client:
            return client.camera().revision

    assert revision("daemon", "daemon") == 6
    for ca, own in [("other", "daemon"), ("daemon", "other"), ("daemon", None)]:
        with pytest.raises(steradian.Unavailable):
            revision(ca, own)
