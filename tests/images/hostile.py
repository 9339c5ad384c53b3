# SPDX-License-Identifier: Apache-2.0
"""Files that lie: headers of 10^9 texels in a hundred bytes, broken ends, wrong lengths, circles, flipped bits. Pure;
the same for the same seed."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator

import handmade
import numpy as np
import OpenEXR
import tifffile
from PIL import Image

SIDES = [
    (1 << 30, 1), (1, 1 << 30), (65535, 65535), (65536, 65536), (0, 4), (0x7FFFFFFF, 0x7FFFFFFF), (0xFFFFFFFF, 1),
    (40000, 30000),
]


def texels(channels: int = 3, kind=np.uint8) -> np.ndarray:
    random = np.random.default_rng(5).random((33, 47, channels))
    return (random * 255).astype(np.uint8) if kind == np.uint8 else random.astype(kind)


def saved(array: np.ndarray, form: str, **options) -> bytes:
    out = io.BytesIO()
    Image.fromarray(array.squeeze()).save(out, form, **options)
    return out.getvalue()


def tiff(**options) -> bytes:
    out = io.BytesIO()
    tifffile.imwrite(out, texels(), photometric="rgb", metadata=None, **options)
    return out.getvalue()


def exr(folder, **header) -> bytes:
    path = folder / "made.exr"
    channels = {name: np.ascontiguousarray(texels(3, np.float16)[:, :, i]) for i, name in enumerate("RGB")}
    OpenEXR.File({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION} | header, channels).write(
        str(path)
    )
    return path.read_bytes()


def good(folder) -> dict[str, bytes]:
    """One sound file of each sort."""
    tiles = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    return {
        "a.png": saved(texels(), "PNG"),
        "i.png": handmade.png(texels(4), interlaced=True),
        "p.png": saved(texels(1), "PNG"),
        "a.jpg": saved(texels(), "JPEG"),
        "p.jpg": saved(texels(), "JPEG", progressive=True),
        "a.bmp": saved(texels(), "BMP"),
        "a.tga": saved(texels(), "TGA"),
        "r.tga": saved(texels(4), "TGA", compression="tga_rle"),
        "a.hdr": handmade.hdr(texels(4)),
        "s.tif": tiff(rowsperstrip=5),
        "z.tif": tiff(rowsperstrip=5, compression="zlib"),
        "t.tif": tiff(tile=(16, 16), compression="zlib"),
        "b.tif": tiff(bigtiff=True, byteorder=">"),
        "l.tif": saved(texels(), "TIFF", compression="tiff_lzw"),
        "j.tif": saved(texels(), "TIFF", compression="jpeg"),
        "a.exr": exr(folder),
        "n.exr": exr(folder, compression=OpenEXR.NO_COMPRESSION),
        "p.exr": exr(folder, compression=OpenEXR.PIZ_COMPRESSION),
        "d.exr": exr(folder, compression=OpenEXR.DWAB_COMPRESSION),
        "b.exr": exr(folder, compression=OpenEXR.B44A_COMPRESSION),
        "t.exr": exr(folder, **tiles),
    }


def png_of(width: int, height: int, kind: int = 2, bits: int = 8, interlaced: int = 0, data: bytes = b"") -> bytes:
    head = struct.pack(">IIBBBBB", width & 0xFFFFFFFF, height & 0xFFFFFFFF, bits, kind, 0, 0, interlaced)
    return (
        b"\x89PNG\r\n\x1a\n"
        + handmade.chunk(b"IHDR", head)
        + handmade.chunk(b"IDAT", zlib.compress(data))
        + handmade.chunk(b"IEND", b"")
    )


def tiff_of(width: int, height: int, extra: dict[int, tuple[int, int]] | None = None, following: int = 0) -> bytes:
    """A little-endian TIFF of one directory; `extra`: tag to (type, value)."""
    tags = {
        256: (4, width), 257: (4, height), 258: (3, 8), 259: (3, 1), 262: (3, 1), 273: (4, 8), 277: (3, 1),
        278: (4, height), 279: (4, 100),
    } | (extra or {})
    entries = b"".join(
        struct.pack("<HHII", tag, kind, 1, value & 0xFFFFFFFF) for tag, (kind, value) in sorted(tags.items())
    )
    return (
        b"II\x2a\0"
        + struct.pack("<I", 8)
        + struct.pack("<H", len(tags))
        + entries
        + struct.pack("<I", following)
        + bytes(100)
    )


def exr_attribute(name: str, kind: str, data: bytes, size: int | None = None) -> bytes:
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<I", len(data) if size is None else size) + data


def exr_of(
    window: tuple[int, int, int, int],
    compression: int = 3,
    tiles: tuple[int, int, int] | None = None,
    version: int = 2,
    extra: bytes = b"",
    channels: int = 3,
    tail: int = 100,
) -> bytes:
    names = b"".join(b"%c\0" % (65 + i % 26) + struct.pack("<IIII", 1, 0, 1, 1) for i in range(channels)) + b"\0"
    box = struct.pack("<iiii", *window)
    header = (
        exr_attribute("channels", "chlist", names)
        + exr_attribute("compression", "compression", bytes([compression]))
        + exr_attribute("dataWindow", "box2i", box)
    )
    header += (
        exr_attribute("displayWindow", "box2i", box)
        + exr_attribute("lineOrder", "lineOrder", b"\0")
        + exr_attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
    )
    header += (
        exr_attribute("screenWindowCenter", "v2f", bytes(8))
        + exr_attribute("screenWindowWidth", "float", struct.pack("<f", 1))
        + extra
    )
    if tiles:
        header += exr_attribute(
            "tiles", "tiledesc", struct.pack("<IIB", tiles[0] & 0xFFFFFFFF, tiles[1] & 0xFFFFFFFF, tiles[2])
        )
        version |= 0x200
    return b"\x76\x2f\x31\x01" + struct.pack("<I", version) + header + b"\0" + bytes(tail)


def jpeg_of(content: bytes, width: int, height: int) -> bytes:
    """The same file, which says that it has another size."""
    at = next(i for i in range(len(content)) if content[i] == 0xFF and content[i + 1] in (0xC0, 0xC2))
    return content[: at + 5] + struct.pack(">HH", height & 0xFFFF, width & 0xFFFF) + content[at + 9 :]


def lies(folder) -> Iterator[tuple[str, bytes]]:
    """Headers that say what cannot be."""
    files = good(folder)
    for i, (width, height) in enumerate(SIDES):
        for interlaced in (0, 1):
            yield f"size{i}{interlaced}.png", png_of(width, height, 6, 16, interlaced, bytes(1000))
        yield f"size{i}.tif", tiff_of(width, height)
        yield f"rows{i}.tif", tiff_of(width, height, {278: (4, 0xFFFFFFFF)})
        yield f"tile{i}.tif", tiff_of(64, 64, {322: (4, width), 323: (4, height), 324: (4, 8), 325: (4, 100)})
        yield f"size{i}.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + f"-Y {height} +X {width}\n".encode() + bytes(
            100
        )
        yield f"size{i}.bmp", b"BM" + struct.pack("<IHHI", 200, 0, 0, 54) + struct.pack(
            "<IIIHHIIiiII", 40, width, height, 1, 24, 0, 0, 0, 0, 0, 0
        ) + bytes(100)
        for bits in (1, 4, 8):
            yield f"size{i}{bits}.bmp", b"BM" + struct.pack("<IHHI", 200, 0, 0, 54) + struct.pack(
                "<IIIHHIIiiII", 40, width, height, 1, bits, 1 if bits == 8 else 0, 0, 0, 0, 0xFFFFFF, 0
            ) + bytes(100)
        for kind in (2, 10):
            yield f"size{i}{kind}.tga", handmade.tga(width & 0xFFFF, height & 0xFFFF, kind, 32, bytes(100))
        for name in ("a.jpg", "p.jpg"):
            yield f"size{i}{name}", jpeg_of(files[name], width, height)
        for compression in (0, 3, 4, 9):
            yield f"size{i}{compression}.exr", exr_of(
                (0, 0, min(width - 1, 0x7FFFFFFF), min(height - 1, 0x7FFFFFFF)), compression
            )
        for levels in (0, 1, 2, 0x11, 0x12):
            yield f"tiles{i}{levels}.exr", exr_of((0, 0, 65535, 65535), 3, (width, height, levels))
            yield f"ones{i}{levels}.exr", exr_of(
                (0, 0, min(width - 1, 65535), min(height - 1, 65535)), 3, (1, 1, levels)
            )
    for window in [
        (-(1 << 31), -(1 << 31), (1 << 31) - 1, (1 << 31) - 1),
        (10, 10, 0, 0),
        (-(1 << 31), 0, 0, 0),
        ((1 << 31) - 1, 0, (1 << 31) - 1, 0),
        (1 << 30, 1 << 30, (1 << 30) + 9, (1 << 30) + 9),
    ]:
        yield f"window{window[0]}{window[2]}.exr", exr_of(window)
    yield "huge_attribute.exr", exr_of((0, 0, 9, 9), extra=exr_attribute("note", "string", b"x", 0x7FFFFFFF))
    yield "negative_attribute.exr", exr_of((0, 0, 9, 9), extra=exr_attribute("note", "string", b"x", 0xFFFFFFFF))
    yield "many_attributes.exr", exr_of(
        (0, 0, 9, 9), extra=b"".join(exr_attribute(f"a{i}", "int", bytes(4)) for i in range(9000))
    )
    yield "many_channels.exr", exr_of((0, 0, 65535, 255), 9, channels=20000)
    yield "no_channels.exr", exr_of((0, 0, 9, 9), channels=0)
    yield "deep.exr", exr_of((0, 0, 9, 9), version=0x802, extra=exr_attribute("type", "string", b"deepscanline"))
    yield "parts.exr", exr_of((0, 0, 9, 9), version=0x1002)
    yield "compression.exr", exr_of((0, 0, 9, 9), compression=200)
    yield "circle.tif", tiff_of(8, 8, following=8)
    yield "count.tif", b"II\x2a\0" + struct.pack("<IH", 8, 0xFFFF) + bytes(200)
    yield "many_samples.tif", tiff_of(8, 8, {277: (3, 65535)})
    yield "bits.tif", tiff_of(8, 8, {258: (3, 65535)})
    for number in (1, 5, 7, 8, 32773, 32946, 34712, 34925, 50000):
        yield f"compression{number}.tif", tiff_of(4000, 4000, {259: (3, number)})
    for name in ("a.png", "p.jpg", "z.tif", "a.exr"):
        yield f"doubled_{name}", files[name] * 2
    content = files["a.png"]
    for length in (0, 0x7FFFFFFF, 0xFFFFFFFF):
        yield f"chunk{length}.png", content[:33] + struct.pack(">I", length) + content[37:]
    bomb = zlib.compress(bytes(1 << 22), 9)
    yield "text.png", content[:33] + handmade.chunk(b"zTXt", b"Comment\0\0" + bomb) * 20 + content[33:]
    yield "profile.png", content[:33] + handmade.chunk(b"iCCP", b"p\0\0" + bomb) + content[33:]
    progressive = files["p.jpg"]
    scan = progressive[progressive.rindex(b"\xff\xda") : -2]
    yield "scans.jpg", progressive[:-2] + scan * 3000 + progressive[-2:]
    for value in (np.nan, np.inf, -np.inf, 1e38):
        out = io.BytesIO()
        tifffile.imwrite(out, np.full((9, 9, 3), value, np.float32), photometric="rgb", metadata=None)
        yield f"value{value}.tif", out.getvalue()


def cuts(folder, each: int) -> Iterator[tuple[str, bytes]]:
    """Every sort of file ended early, at `each` places all over it, the first bytes all of them."""
    for name, content in good(folder).items():
        for length in sorted(
            {*range(0, min(64, len(content)), 4), *np.linspace(0, len(content) - 1, each).astype(int)}
        ):
            yield f"cut{length}_{name}", content[:length]


def flips(folder, each: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """Every sort of file with some bits turned, or bytes set to extremes; more often near its beginning."""
    random = np.random.default_rng(seed)
    for name, content in good(folder).items():
        for number in range(each):
            turned = bytearray(content)
            for _ in range(int(random.integers(1, 5))):
                place = (
                    int(len(content) * random.random() ** 3)
                    if random.random() < 0.7
                    else int(random.integers(len(content)))
                )
                place = max(4, place) % len(content)
                turned[place] = (
                    turned[place] ^ 1 << int(random.integers(8))
                    if random.random() < 0.5
                    else (0, 1, 127, 128, 255)[int(random.integers(5))]
                )
            yield f"flip{number}_{name}", bytes(turned)
