#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes the references of the feature scenes anew: NAME.json beside NAME.usda, means over blocks of the picture with
their standard errors.

    make_references.py [NAME ...] [--samples 4096] [--batches 16] [--date YYYY-MM-DD]

Every batch is a render with a seed of its own; the error is their standard deviation over the root of their number.
Tests never write these.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import json
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "scenes")]

import to_mitsuba  # noqa: E402  (sets Mitsuba's variant)
import drjit  # noqa: E402
import feature_references  # noqa: E402
import features  # noqa: E402
import materials  # noqa: E402
import mitsuba as mi  # noqa: E402
import numpy as np  # noqa: E402


def block_means(picture: np.ndarray) -> np.ndarray:
    """(rows, columns, 3), row 0 at the bottom as in Hydra's buffers; `picture` has its row 0 at the top."""
    columns, rows = feature_references.BLOCKS
    height, width = picture.shape[:2]
    return picture[::-1].reshape(rows, height // rows, columns, width // columns, 3).mean(axis=(1, 3))


def make(name: str, samples: int, batches: int, date: str) -> dict:
    path = features.FOLDER / f"{name}.usda"
    bounces = feature_references.BOUNCES.get(name, 5)
    width, height = feature_references.SIZE
    scene, notes = to_mitsuba.translate(path, width, height, bounces=bounces, blocks=False)
    means = np.stack([block_means(to_mitsuba.render(scene, samples, seed)) for seed in range(batches)])
    error = means.std(axis=0, ddof=1) / np.sqrt(batches)
    print(f"{name}: worst relative error {100 * (error / means.mean(axis=0)).max():.3f} %", file=sys.stderr)
    rounded = lambda values: [[[float(f"{x:.6g}") for x in color] for color in row] for row in values]
    return {
        "scene": path.name,
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "made": {
            "command": f"cargo xtask reference {name} --samples {samples} --batches {batches}", "date": date,
            "mitsuba": mi.__version__, "drjit": drjit.__version__, "variant": mi.variant(),
            "size": [width, height], "bounces": bounces, "samples": samples * batches, "notes": notes,
        },
        "mean": rounded(means.mean(axis=0)),
        "error": rounded(error),
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser()
    names = [scene.__name__ for scene in feature_references.SCENES]
    parser.add_argument("names", nargs="*", help="scenes; all of them by default")
    parser.add_argument("--samples", type=int, default=4096, help="of a pixel in one batch")
    parser.add_argument("--batches", type=int, default=16)
    parser.add_argument("--date", default=datetime.date.today().isoformat())
    arguments = parser.parse_args()
    materials.EXACT_METALS = True
    for name in arguments.names or names:
        if name not in names:
            parser.error(f"{name} is none of {names}")
        reference = make(name, arguments.samples, arguments.batches, arguments.date)
        # One line per key: rows of numbers stay readable in a diff.
        text = (
            "{\n" + ",\n".join(f" {json.dumps(key)}: {json.dumps(value)}" for key, value in reference.items()) + "\n}"
        )
        (features.FOLDER / f"{name}.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
