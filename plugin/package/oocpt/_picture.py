# SPDX-License-Identifier: Apache-2.0
"""What a render gives: arrays by name, which a notebook shows as a picture."""

from __future__ import annotations

import struct
import zlib

import numpy as np


class Picture(dict[str, np.ndarray]):
    """The images of a render by name (see `oocpt.render`). A notebook shows `color`.

    Attributes:
        messages: what the renderer and the host said: warnings about the scene, one line each.
        statistics: the renderer's statistics at the end of the render (samples, seconds, memory and others).
    """

    def __init__(self, images: dict[str, np.ndarray], messages: list[str], statistics: dict[str, object]) -> None:
        super().__init__(images)
        self.messages = messages
        self.statistics = statistics

    def __repr__(self) -> str:
        images = ", ".join(f"{name} {array.dtype}{list(array.shape)}" for name, array in self.items())
        return f"<oocpt.Picture {images}>"

    def png(self) -> bytes:
        """`color` as a PNG file: sRGB, 8 bits, with alpha.

        Raises:
            KeyError: the picture has no `color`.
        """
        return png_of(self["color"])

    def _repr_png_(self) -> bytes | None:
        return self.png() if "color" in self else None


def png_of(color: np.ndarray) -> bytes:
    """Linear colour, premultiplied, (height, width, 4), as a PNG file, which holds colour that is not multiplied."""
    clean = np.nan_to_num(color.astype(np.float32), nan=0.0, posinf=1.0, neginf=0.0)
    alpha = np.clip(clean[..., 3:], 0.0, 1.0)
    straight = np.clip(np.divide(clean[..., :3], alpha, out=np.zeros_like(clean[..., :3]), where=alpha > 0), 0.0, 1.0)
    encoded = np.where(straight <= 0.0031308, 12.92 * straight, 1.055 * straight ** (1 / 2.4) - 0.055)
    pixels = np.rint(np.concatenate([encoded, alpha], axis=-1) * 255.0).astype(np.uint8)
    height, width = pixels.shape[:2]
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)  # no filter
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"sRGB", b"\0"), (b"IDAT", zlib.compress(rows.tobytes(), 6)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, content) for kind, content in chunks)


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
