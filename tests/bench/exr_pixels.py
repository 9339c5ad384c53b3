# SPDX-License-Identifier: Apache-2.0
"""Colours of an EXR file as usdrecord and Blender write them: one part of scan lines, f16 or f32, without compression
or by ZIP. Needs numpy alone, so that it runs where no OpenEXR is."""

from __future__ import annotations

import pathlib
import struct
import zlib

import numpy as np

LINES = {0: 1, 2: 1, 3: 16}
"""Scan lines of a block by compression: none, ZIPS, ZIP."""
TYPES = {1: np.dtype("<f2"), 2: np.dtype("<f4")}
MAX_VALUES = 1 << 28
"""Values of a picture at most: a file says how large it is before it is."""


def colors(path: pathlib.Path) -> np.ndarray:
    """(height, width, 3) f64 of the channels R, G and B; raises ValueError for other files."""
    data = pathlib.Path(path).read_bytes()
    try:
        header, at = _header(data)
        return _pixels(data, header, at)
    except (struct.error, zlib.error, IndexError, KeyError, ValueError) as error:
        raise ValueError(f"{path}: no EXR file of the kinds that are read here: {error!r}") from error


def _header(data: bytes) -> tuple[dict[str, bytes], int]:
    if data[:4] != b"\x76\x2f\x31\x01" or data[5] & 0x1A:
        raise ValueError("no EXR file of one part of scan lines")
    at, header = 8, {}
    while data[at]:
        end = data.index(b"\0", at)
        name, at = data[at:end].decode("latin-1"), data.index(b"\0", end + 1) + 1
        size = struct.unpack_from("<I", data, at)[0]
        header[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    return header, at + 1


def _channels(listed: bytes) -> list[tuple[str, np.dtype]]:
    made, at = [], 0
    while listed[at]:
        end = listed.index(b"\0", at)
        made.append((listed[at:end].decode("latin-1"), TYPES[struct.unpack_from("<I", listed, end + 1)[0]]))
        at = end + 17
    return made


def _pixels(data: bytes, header: dict[str, bytes], at: int) -> np.ndarray:
    left, top, right, bottom = struct.unpack("<4i", header["dataWindow"])
    width, height, kind = right - left + 1, bottom - top + 1, header["compression"][0]
    channels = _channels(header["channels"])
    if width < 1 or height < 1 or width * height * len(channels) > MAX_VALUES:
        raise ValueError(f"{width} x {height} pixels")
    size = width * sum(dtype.itemsize for _, dtype in channels)
    made = np.zeros((height, width, 3))
    for block in range(-(-height // LINES[kind])):
        offset = struct.unpack_from("<Q", data, at + 8 * block)[0]
        line, length = struct.unpack_from("<iI", data, offset)
        count = min(LINES[kind], height - (line - top))
        if not 0 <= line - top < height:
            raise ValueError(f"a block at line {line}")
        raw = data[offset + 8 : offset + 8 + length]
        if length < size * count:
            raw = _unpacked(raw, size * count)
        for row in range(count):
            start = row * size
            for name, dtype in channels:
                values = np.frombuffer(raw, dtype, width, start)
                start += values.nbytes
                if name in ("R", "G", "B"):
                    made[line - top + row, :, "RGB".index(name)] = values
    return made


def _unpacked(raw: bytes, size: int) -> bytes:
    """ZIP of OpenEXR: halves interleaved, differences of bytes."""
    packed = np.frombuffer(zlib.decompressobj().decompress(raw, size), np.uint8)
    if len(packed) != size:
        raise ValueError("a block that is cut off")
    sums = np.cumsum(packed.astype(np.int64) - 128) + 128
    halves = (sums & 255).astype(np.uint8)
    middle = (size + 1) // 2
    made = np.empty(size, np.uint8)
    made[0::2], made[1::2] = halves[:middle], halves[middle:]
    return made.tobytes()


def write(path: pathlib.Path, picture: np.ndarray) -> None:
    """(height, width, 3) as f32 without compression."""
    height, width = picture.shape[:2]
    channels = b"".join(name + struct.pack("<IIII", 2, 0, 1, 1) for name in (b"B\0", b"G\0", b"R\0")) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = [
        (b"channels", b"chlist", channels), (b"compression", b"compression", b"\0"), (b"dataWindow", b"box2i", window),
        (b"displayWindow", b"box2i", window), (b"lineOrder", b"lineOrder", b"\0"),
        (b"pixelAspectRatio", b"float", struct.pack("<f", 1.0)),
        (b"screenWindowCenter", b"v2f", struct.pack("<2f", 0.0, 0.0)),
        (b"screenWindowWidth", b"float", struct.pack("<f", 1.0)),
    ]  # fmt: skip
    header = b"\x76\x2f\x31\x01\x02\0\0\0" + b"".join(
        name + b"\0" + kind + b"\0" + struct.pack("<I", len(value)) + value for name, kind, value in attributes
    )
    first, size = len(header) + 1 + 8 * height, 12 * width
    offsets = np.arange(height, dtype="<u8") * (8 + size) + first
    rows = np.ascontiguousarray(picture[..., ::-1].transpose(0, 2, 1), "<f4")
    lines = b"".join(struct.pack("<iI", number, size) + row.tobytes() for number, row in enumerate(rows))
    pathlib.Path(path).write_bytes(header + b"\0" + offsets.tobytes() + lines)
