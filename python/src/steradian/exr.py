"""Reads the daemon's OpenEXR files: one part with scan lines, either uncompressed or compressed by run lengths or ZIP,
and channels of 16- or 32-bit floats.

Follows the file layout in the OpenEXR documentation ("OpenEXR File Layout"): header, table of offsets, blocks of rows.
A block that compression does not shrink is stored uncompressed. Otherwise its bytes are split into those of even and of
odd index, and each is the difference from the previous one, plus 128.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np
import numpy.typing as npt

# Number of rows per block, for each number of a compression: none, run lengths, ZIP of single rows, ZIP of 16 rows.
_ROWS_OF_BLOCK = {0: 1, 1: 1, 2: 1, 3: 16}
_RUN_LENGTHS = 1
_PIXEL_TYPES = {1: "<f2", 2: "<f4"}
# Flags in the version field: tiles, deep data, several parts.
_NOT_FLAT = 0x200 | 0x800 | 0x1000


def channels(data: bytes) -> dict[str, npt.NDArray[np.float32]]:
    """Returns the channels of a file by name, each (height, width), float32.

    Raises:
        ValueError: it is not an OpenEXR file, is damaged, or is of a kind that the daemon does not write.
    """
    try:
        return _channels(data)
    except (struct.error, zlib.error, IndexError) as error:
        raise ValueError(f"the OpenEXR file is damaged: {error}") from error


def _text(data: bytes, at: int) -> tuple[str, int]:
    """Returns a zero-terminated string, and the offset of the next value."""
    end = data.find(b"\0", at)
    if end < 0:
        raise ValueError("the OpenEXR file is damaged: its header does not end")
    return data[at:end].decode("ascii", "replace"), end + 1


def _header(data: bytes) -> tuple[dict[str, bytes], int]:
    """Returns the attributes by name, and the offset of the table of offsets."""
    magic, version = struct.unpack_from("<II", data)
    if magic != 20_000_630:
        raise ValueError("this is not an OpenEXR file")
    if version & _NOT_FLAT:
        raise ValueError("OpenEXR files with tiles, deep data or several parts are not supported")
    attributes, at = {}, 8
    while data[at] != 0:
        name, at = _text(data, at)
        _, at = _text(data, at)
        (size,) = struct.unpack_from("<i", data, at)
        attributes[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def _channel_list(value: bytes) -> list[tuple[str, str]]:
    """Returns names and types of the channels, in their order within rows."""
    found: list[tuple[str, str]] = []
    at = 0
    while value[at] != 0:
        name, at = _text(value, at)
        kind, _, x_step, y_step = struct.unpack_from("<iiii", value, at)
        at += 16
        if kind not in _PIXEL_TYPES or (x_step, y_step) != (1, 1):
            raise ValueError(f"channel {name} of the OpenEXR file must contain floats and be as large as the image")
        found.append((name, _PIXEL_TYPES[kind]))
    return found


def _expanded(block: bytes) -> bytes:
    """Expands run lengths. A count -n precedes n bytes to copy, a count n >= 0 one byte to repeat n + 1 times."""
    parts, at = [], 0
    while at < len(block):
        count = block[at] - 256 if block[at] > 127 else block[at]
        if count < 0:
            parts.append(block[at + 1 : at + 1 - count])
            at += 1 - count
        else:
            parts.append(block[at + 1 : at + 2] * (count + 1))
            at += 2
    return b"".join(parts)


def _decompressed(block: bytes, compression: int, size: int) -> bytes:
    """Decompresses a block."""
    expanded = _expanded(block) if compression == _RUN_LENGTHS else zlib.decompress(block)
    differences = np.frombuffer(expanded, dtype=np.uint8).copy()
    if differences.size != size:
        raise ValueError("the OpenEXR file is damaged: the size of a block differs from that of its rows")
    differences[1:] -= 128
    halves = np.cumsum(differences, dtype=np.uint8)
    joined = np.empty_like(halves)
    joined[0::2] = halves[: (size + 1) // 2]
    joined[1::2] = halves[(size + 1) // 2 :]
    return joined.tobytes()


def _channels(data: bytes) -> dict[str, npt.NDArray[np.float32]]:
    attributes, at = _header(data)
    for name in ("channels", "compression", "dataWindow"):
        if name not in attributes:
            raise ValueError(f"the OpenEXR file is damaged: its header has no {name}")
    left, top, right, bottom = struct.unpack("<iiii", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    compression = attributes["compression"][0]
    if compression not in _ROWS_OF_BLOCK:
        raise ValueError(f"OpenEXR files of compression {compression} are not supported: must be none, RLE, ZIPS or ZIP")
    rows_of_block = _ROWS_OF_BLOCK[compression]
    listed = _channel_list(attributes["channels"])
    if width < 1 or height < 1 or not listed:
        raise ValueError("the OpenEXR file is damaged: it has no pixels")
    images = {name: np.empty((height, width), dtype=np.float32) for name, _ in listed}
    # A row contains the values of the first channel, then those of the next one.
    row = np.dtype([(name, kind, (width,)) for name, kind in listed])
    blocks = -(-height // rows_of_block)
    for offset in struct.unpack_from(f"<{blocks}Q", data, at):
        y, size = struct.unpack_from("<ii", data, offset)
        first = y - top
        count = min(rows_of_block, height - first)
        block = data[offset + 8 : offset + 8 + size]
        if first < 0 or count < 1 or len(block) != size:
            raise ValueError("the OpenEXR file is damaged: a block lies outside of the image or of the file")
        whole = count * row.itemsize
        if compression != 0 and size != whole:
            block = _decompressed(block, compression, whole)
        if len(block) != whole:
            raise ValueError("the OpenEXR file is damaged: the size of a block differs from that of its rows")
        rows = np.frombuffer(block, dtype=row)
        for name, image in images.items():
            image[first : first + count] = rows[name]
    return images
