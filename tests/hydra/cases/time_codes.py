# SPDX-License-Identifier: Apache-2.0
"""Stages whose time codes are no 24ths of a second: shutters are in time codes, velocities per second.

Every mover is a card that is 0.2 wide and at x = 1 when the frame's own time is; what is compared is how much of the
time each cell of 0.2 units is covered. Where the card is at a time is in closed form; the mean over the shutter is a
midpoint rule over 4096 times, exact to 1e-4.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from cases.case import Case

CELL = 0.2
AT_TEN = "view.params.frame = Usd.TimeCode(10)\n"
PARTS = (np.arange(4096) + 0.5) / 4096


def _covered(left: np.ndarray, right: np.ndarray, column: int) -> float:
    """Mean share of a column of cells that lies between `left` and `right`."""
    low, high = column * CELL, (column + 1) * CELL
    return float(np.mean(np.clip(np.minimum(right, high) - np.maximum(left, low), 0, None)) / CELL)


def _disk(centers: np.ndarray, column: int, radius: float = 0.1) -> float:
    """The same for a disk that is as high as the cells are: its area to the left of x is a segment's."""

    def left_of(x: np.ndarray) -> np.ndarray:
        u = np.clip((x - centers) / radius, -1, 1)
        return radius**2 * (u * np.sqrt(1 - u * u) + np.arcsin(u) + np.pi / 2)

    return float(np.mean(left_of((column + 1) * CELL) - left_of(column * CELL)) / CELL**2)


def _row(y: int, share: Callable[[int], float]) -> dict[tuple[int, int], float]:
    return {(x, y): share(x) for x in range(20)}


def _card(y: int, shift: np.ndarray) -> dict[tuple[int, int], float]:
    return _row(y, lambda x: _covered(1 + shift, 1.2 + shift, x))


def _one(name: str, shift: np.ndarray, why: str) -> Case:
    """A file of one mover, 4 units by 1."""
    share = (lambda x: _disk(1.1 + shift, x)) if "points" in name else lambda x: _covered(1 + shift, 1.2 + shift, x)
    return Case(
        f"26_velocity_{name}", (20, 5), _row(2, share), why,
        absolute=0.03, pixels=4, samples=256, edit=AT_TEN, covers=True,
    )  # fmt: skip


# 24 units a second, for half a time code of a 48th or a 24th of a second, or a whole one of a 12th.
QUARTER = "24 units a second for 0.5 / 48 s: a quarter of a unit"
SINGLE = [
    _one("mesh_48", 0.25 * PARTS, QUARTER),
    _one("points_48", 0.25 * PARTS, QUARTER),
    _one("inst_48", 0.25 * PARTS, QUARTER),
    _one("xform_48", 0.5 * PARTS, "samples are in time codes: half of one, at a unit a time code, in any case"),
    _one("mesh_12", 1.0 * PARTS, "12 units a second for 1 / 12 s: a unit"),
    _one("mesh_24", 0.5 * PARTS, "24 units a second for 0.5 / 24 s: half a unit"),
    _one("mesh_back", 0.5 * (PARTS - 1), "the same, backwards from the frame's time"),
    _one("mesh_centred", 0.5 * (PARTS - 0.5), "the same, about the frame's time"),
    _one("mesh_accel", 0.5 * PARTS**2, "576 / 2 units for the square of 1 / 24 s: half a unit"),
]


def _siblings(rate: float, seconds: float, **more) -> Case:
    """All that moves by rates, the shutter open for `seconds`: in each row of one unit its middle cells."""
    t = seconds * PARTS
    cells: dict[tuple[int, int], float] = {}
    for row in (0, 2, 4):  # a mesh, curves, an instancer: a unit a second
        cells |= _card(5 * row + 2, t)
    for row in (1, 5):  # a mesh, an instancer: from rest, 4 units a second more each second
        cells |= _card(5 * row + 2, 2 * t * t)
    cells |= _row(5 * 3 + 2, lambda x: _disk(1.1 + t, x))
    # About y by half a circle a second: 0.6 wide, seen by the cosine.
    cells |= _row(5 * 6 + 2, lambda x: _covered(np.full_like(t, 1.0), 1 + 0.6 * np.cos(np.pi * t), x))
    edit = (
        f"stage.GetRootLayer().timeCodesPerSecond = {rate}\n"
        f"stage.GetPrimAtPath('/Cam').GetAttribute('shutter:close').Set({seconds * (rate if rate > 0 else 24)})\n"
    )
    return Case(
        "26_rates", (20, 35), cells, f"rates are per second, the shutter is open for {seconds} s",
        absolute=0.03, pixels=4, samples=256, edit=edit, variant=str(rate), covers=True, **more,
    )  # fmt: skip


CASES = [
    *SINGLE,
    *(_siblings(rate, 0.5, silent=True) for rate in (1, 25, 60, 1000)),
    _siblings(0, 0.5, says=("the stage's timeCodesPerSecond is 0; 24 is assumed",)),
]
