#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Puts pictures on one sheet with their names below: `contact_sheet.py OUT.jpg [--columns 3] [--width 426]
PICTURE[=LABEL] ...`.

Pictures are .exr (linear; shown through the sRGB curve, `--exposure` in stops) or anything Pillow reads (shown as it
is). Needs the usd-core environment (numpy, OpenEXR, Pillow).
"""

from __future__ import annotations

import argparse
import math
import pathlib

import numpy as np
from PIL import Image, ImageDraw, ImageFont

PAPER, INK, GAP, LINE = (24, 24, 26), (225, 225, 220), 6, 22


def linear(path: pathlib.Path) -> np.ndarray:
    """(height, width, 3), row 0 at the top, not a number where the file says so."""
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        return np.stack([channels[name].pixels.astype(np.float64) for name in "RGB"], axis=-1)


def shown(values: np.ndarray) -> np.ndarray:
    """Linear to 8-bit sRGB; what is not a number is magenta, so that it is seen."""
    bad = ~np.isfinite(values).all(axis=-1)
    values = np.clip(np.where(np.isfinite(values), values, 0.0), 0.0, 1.0)
    encoded = np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)
    picture = np.rint(255 * encoded).astype(np.uint8)
    picture[bad] = (255, 0, 255)
    return picture


def load(path: pathlib.Path, exposure: float) -> Image.Image:
    if path.suffix.lower() == ".exr":
        return Image.fromarray(shown(linear(path) * 2.0**exposure))
    return Image.open(path).convert("RGB")


def sheet(entries: list[tuple[str, Image.Image | None]], columns: int, width: int) -> Image.Image:
    """A page of labelled pictures; one that is missing (None) leaves a crossed-out place."""
    shapes = [picture.size for _, picture in entries if picture is not None]
    height = round(width * (shapes[0][1] / shapes[0][0] if shapes else 9 / 16))
    rows = math.ceil(len(entries) / columns)
    page = Image.new("RGB", (GAP + columns * (width + GAP), GAP + rows * (height + LINE + GAP)), PAPER)
    draw, font = ImageDraw.Draw(page), ImageFont.load_default(13)
    for number, (label, picture) in enumerate(entries):
        x, y = GAP + number % columns * (width + GAP), GAP + number // columns * (height + LINE + GAP)
        if picture is None:
            draw.rectangle((x, y, x + width, y + height), outline=INK)
            draw.line((x, y, x + width, y + height), fill=INK)
            draw.line((x, y + height, x + width, y), fill=INK)
        else:
            page.paste(picture.resize((width, height), Image.Resampling.LANCZOS), (x, y))
        draw.text((x + 2, y + height + 3), label, fill=INK, font=font)
    return page


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("pictures", nargs="+")
    parser.add_argument("--columns", type=int, default=3)
    parser.add_argument("--width", type=int, default=426, help="of a picture on the sheet, in pixels")
    parser.add_argument("--exposure", type=float, default=0.0)
    arguments = parser.parse_args()
    entries = []
    for text in arguments.pictures:
        path, _, label = text.partition("=")
        path = pathlib.Path(path)
        entries.append(
            (label or path.stem.replace("_", " "), load(path, arguments.exposure) if path.exists() else None)
        )
    options = (
        {"quality": 82, "optimize": True} if arguments.out.suffix.lower() in (".jpg", ".jpeg") else {"optimize": True}
    )
    sheet(entries, arguments.columns, arguments.width).save(arguments.out, **options)


if __name__ == "__main__":
    main()
