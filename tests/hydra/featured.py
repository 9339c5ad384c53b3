# SPDX-License-Identifier: Apache-2.0
"""What the tests of feature scenes share: pictures of a scene with several seeds, and the comparison of their block
means with an answer.

The scenes are opened by path: their pictures lie beside them.
"""

from __future__ import annotations

import numpy as np

import features

SIGMAS = 4.5
"""Blocks and channels are about fifty: chance passes this once in 3000 comparisons."""


def path(name: str) -> str:
    return str(features.FOLDER / f"{name}.usda")


def settings(samples: int, bounces: int, seed: int = 0) -> dict:
    return {"oocpt:samplesPerPixel": samples, "oocpt:maxBounces": bounces, "oocpt:seed": seed}


def pictures(
    host, name: str, size=(32, 32), samples=64, bounces=0, seeds=4, edit=None, camera="/World/Camera"
) -> list[np.ndarray]:
    """(height, width, 3) in f64, one per seed; `edit` runs in the host before the first."""
    made = []
    with host.open(path(name), size, settings=settings(samples, bounces), camera=camera) as view:
        if edit:
            view.edit(edit)
        for seed in range(seeds):
            view.edit(f"engine.SetRendererSetting('oocpt:seed', {seed})")
            made.append(view.render()["color"][..., :3].astype(np.float64))
    return made


def picture(host, name: str, size=(32, 32), samples=16, bounces=0, edit=None, camera="/World/Camera") -> np.ndarray:
    """One picture, for answers without noise."""
    return pictures(host, name, size, samples, bounces, 1, edit, camera)[0]


def blocks(values: np.ndarray, mask: np.ndarray, columns: int, rows: int) -> np.ndarray:
    """Means over a grid of blocks, (rows, columns, channels), of the pixels in `mask`; NaN where a block has none."""
    height, width = mask.shape
    made = np.full((rows, columns, values.shape[-1]), np.nan)
    for j in range(rows):
        for i in range(columns):
            cut = (
                slice(j * height // rows, (j + 1) * height // rows),
                slice(i * width // columns, (i + 1) * width // columns),
            )
            if mask[cut].any():
                made[j, i] = values[cut][mask[cut]].mean(axis=0)
    return made


def agree(
    made: list[np.ndarray],
    expected: np.ndarray,
    what: str,
    mask=None,
    grid=(4, 4),
    relative=5e-4,
    noise=5e-3,
    error=0.0,
) -> None:
    """Block means of pictures with different seeds against the answer: a z-test with the renders' own noise and the
    answer's `error`.

    `relative` is what rounding may do, `noise` the largest standard error (of the brightest block) at which the
    comparison says anything.
    """
    mask = np.ones(expected.shape[:2], dtype=bool) if mask is None else mask
    assert all(np.isfinite(picture).all() for picture in made), f"{what}: not finite"
    stack = np.stack([blocks(picture, mask, *grid) for picture in made])
    want = blocks(expected, mask, *grid)
    full = np.isfinite(want).all(axis=-1)
    assert full.any(), f"{what}: the mask leaves nothing"
    stack, want = stack[:, full], want[full]
    error = np.asarray(error)[full] if np.ndim(error) == 3 else error
    # The deviation of one block from a few seeds is too loose to judge by: relative deviations are pooled over all of
    # them.
    floor = 1e-3 * np.abs(want).max() + 1e-12
    share = (
        np.sqrt((stack.std(axis=0, ddof=1) ** 2 / (np.abs(want) + floor) ** 2).mean() / len(made))
        if len(made) > 1
        else 0.0
    )
    assert share <= noise, f"{what}: noise of {100 * share:.2f} % tells nothing (allowed {100 * noise:.2f} %)"
    allowed = SIGMAS * np.hypot(share * (np.abs(want) + floor), error) + relative * np.abs(want) + 1e-6
    off = np.abs(stack.mean(axis=0) - want)
    worst = np.unravel_index(np.argmax(off / allowed), off.shape)
    assert (off <= allowed).all(), (
        f"{what}: block {worst} is {stack.mean(axis=0)[worst]:.6g}, expected {want[worst]:.6g}; off by"
        f" {off[worst]:.3g}, allowed {allowed[worst]:.3g} (noise {100 * share:.3f} %)"
    )


CELL = 16
"""Pixels of a square's cell."""


def cells(made: np.ndarray, count: int, rows: int = 1) -> list[np.ndarray]:
    """The middles of `rows` rows of squares, from the bottom, each left to right; the rows are in the middle of a
    square picture."""
    first = (count - rows) * CELL // 2
    middle = lambda k: slice(k * CELL + 4, k * CELL + 12)
    return [made[first:][middle(j), middle(i)] for j in range(rows) for i in range(count)]


def row_of(host, name, count, samples=16, bounces=1, rows=1, **options):
    return cells(picture(host, name, (count * CELL, count * CELL), samples, bounces, **options), count, rows)
