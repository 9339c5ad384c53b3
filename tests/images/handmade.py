# SPDX-License-Identifier: Apache-2.0
"""Kinds of image files that no package of the test environment writes, made from their specifications byte by byte."""

from __future__ import annotations

import struct
import zlib

import numpy as np

ADAM7 = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
COLOR_TYPES = {1: 0, 2: 4, 3: 2, 4: 6}


def chunk(name: bytes, data: bytes) -> bytes:
    """A chunk of a PNG."""
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def png(texels: np.ndarray, interlaced: bool = False) -> bytes:
    """8 or 16 bits, 1 to 4 channels; interlaced as ISO 15948, 8.2 has it (x, y, step in x, step in y of each pass)."""
    height, width, channels = texels.shape
    big = texels.astype(">u2") if texels.dtype == np.uint16 else texels
    passes = [big[y::dy, x::dx] for x, y, dx, dy in ADAM7] if interlaced else [big]
    rows = b"".join(b"\0" + row.tobytes() for part in passes if part.size for row in part)
    head = struct.pack(">IIBBBBB", width, height, 8 * texels.dtype.itemsize, COLOR_TYPES[channels], 0, 0, interlaced)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def bmp(indices: np.ndarray, palette: np.ndarray, bits: int, top_down: bool = False) -> bytes:
    """1, 4 or 8 bits into a palette of RGB."""
    height, width = indices.shape
    digits = 8 // bits
    padded = np.pad(indices, ((0, 0), (0, -width % (4 * digits))))
    packed = sum(padded[:, i::digits] << (bits * (digits - 1 - i)) for i in range(digits)).astype(np.uint8)
    rows = (packed if top_down else packed[::-1]).tobytes()
    colors = b"".join(bytes([*color[::-1], 0]) for color in palette)
    head = struct.pack(
        "<IiiHHIIiiII", 40, width, -height if top_down else height, 1, bits, 0, len(rows), 2835, 2835, len(palette), 0
    )
    return b"BM" + struct.pack("<IHHI", 54 + len(colors) + len(rows), 0, 0, 54 + len(colors)) + head + colors + rows


def bmp_true(texels: np.ndarray, top_down: bool = False) -> bytes:
    """24 or 32 bits."""
    height, width, channels = texels.shape
    order = texels[:, :, [2, 1, 0, 3][:channels]]
    rows = b"".join(row.tobytes() + bytes(-width * channels % 4) for row in (order if top_down else order[::-1]))
    head = struct.pack(
        "<IiiHHIIiiII", 40, width, -height if top_down else height, 1, 8 * channels, 0, len(rows), 2835, 2835, 0, 0
    )
    return b"BM" + struct.pack("<IHHI", 54 + len(rows), 0, 0, 54) + head + rows


def tga(
    width: int,
    height: int,
    kind: int,
    bits: int,
    body: bytes,
    palette: bytes = b"",
    palette_bits: int = 0,
    top_left: bool = False,
) -> bytes:
    """`kind`: 1 palette, 2 colours, 3 grey, 9 to 11 the same in runs."""
    entries = len(palette) * 8 // palette_bits if palette_bits else 0
    alpha_bits = {32: 8, 16: 1}.get(bits, 0)
    head = struct.pack(
        "<BBBHHBHHHHBB", 0, bool(palette), kind, 0, entries, palette_bits, 0, 0, width, height, bits,
        alpha_bits | 0x20 * top_left,
    )
    return head + palette + body


def hdr(rgbe: np.ndarray, order: str = "-Y {h} +X {w}", old_runs: bool = False) -> bytes:
    """Radiance, without runs or with the old kind of them (1, 1, 1, count)."""
    height, width, _ = rgbe.shape
    body = bytearray()
    for row in rgbe:
        if not old_runs:
            body += row.tobytes()
            continue
        x = 0
        while x < width:
            same = 1
            while x + same < width and same < 256 and (row[x + same] == row[x]).all():
                same += 1
            body += row[x].tobytes()
            if same > 1:
                body += bytes([1, 1, 1, same - 1])
            x += same
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + order.format(h=height, w=width).encode() + b"\n" + bytes(body)
