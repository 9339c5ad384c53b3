# SPDX-License-Identifier: Apache-2.0
"""Writes small pictures: PNG, Radiance HDR, OpenEXR. Arrays are (height, width[, channels]), row 0 at the top. Same
array, same bytes.

Needs numpy, and OpenEXR for `exr`. PNG data are stored without compression unless `packed`, so that the bytes do not
depend on zlib's version.
"""

from __future__ import annotations

import pathlib
import struct
import zlib

import numpy as np

COLOR_TYPES = {1: 0, 2: 4, 3: 2, 4: 6}
"""PNG's number for grey, grey and alpha, RGB, RGBA."""


def _cube(array: np.ndarray) -> np.ndarray:
    array = np.asarray(array)
    return array[:, :, None] if array.ndim == 2 else array


def to_8_bit(values: np.ndarray) -> np.ndarray:
    """0 .. 1 to 0 .. 255, rounded."""
    return np.clip(np.rint(np.asarray(values) * 255.0), 0, 255).astype(np.uint8)


def to_srgb(linear: np.ndarray) -> np.ndarray:
    """The curve of IEC 61966-2-1, linear 0 .. 1 to encoded 0 .. 1."""
    linear = np.clip(linear, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def from_srgb(encoded: np.ndarray) -> np.ndarray:
    """The inverse of `to_srgb`."""
    encoded = np.asarray(encoded, dtype=np.float64)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def png(path: pathlib.Path, array: np.ndarray, packed: bool = False) -> None:
    """8 bits (uint8) or 16 (uint16), one to four channels. No gamma or sRGB chunk: readers are told nothing."""
    array = _cube(array)
    height, width, channels = array.shape
    if array.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"PNG of {array.dtype}")
    bits = 8 * array.dtype.itemsize
    rows = array.astype(">u2" if bits == 16 else "u1")
    raw = b"".join(b"\0" + row.tobytes() for row in rows)
    chunk = lambda name, data: struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    header = struct.pack(">IIBBBBB", width, height, bits, COLOR_TYPES[channels], 0, 0, 0)
    body = zlib.compress(raw, 6 if packed else 0)
    pathlib.Path(path).write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", body) + chunk(b"IEND", b"")
    )


def hdr(path: pathlib.Path, array: np.ndarray) -> None:
    """Radiance RGBE, flat scanlines."""
    array = np.asarray(array, dtype=np.float64)
    height, width, _ = array.shape
    largest = array.max(axis=2)
    mantissa, exponent = np.frexp(largest)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(largest > 1e-32, mantissa * 256.0 / largest, 0.0)
    bytes_ = np.concatenate([array * scale[..., None], np.where(largest > 1e-32, exponent + 128, 0)[..., None]], axis=2)
    head = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    pathlib.Path(path).write_bytes(head + np.clip(bytes_, 0, 255).astype(np.uint8).tobytes())


def exr(path: pathlib.Path, array: np.ndarray, half: bool = False, packed: bool = False) -> None:
    """OpenEXR of one channel (Y), three (RGB) or four (RGBA), float or half."""
    import OpenEXR

    array = _cube(array)
    names = {1: ["Y"], 3: ["R", "G", "B"], 4: ["R", "G", "B", "A"]}[array.shape[2]]
    kind = np.float16 if half else np.float32
    channels = {name: np.ascontiguousarray(array[..., index], dtype=kind) for index, name in enumerate(names)}
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION if packed else OpenEXR.NO_COMPRESSION,
        "type": OpenEXR.scanlineimage,
    }
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))
