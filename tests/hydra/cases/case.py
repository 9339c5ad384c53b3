# SPDX-License-Identifier: Apache-2.0
"""One small scene and what its cells must show."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence

import numpy as np

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "scenes" / "cases"

Value = float | Sequence[float]
"""Linear radiance: grey, or (red, green, blue)."""


@dataclasses.dataclass(frozen=True)
class Case:
    """A file of FOLDER under its camera `/Cam`, which sees `size` cells of one unit from (0, 0) on.

    `cells` gives the expected mean over each cell (x to the right, y up), derived from the scene as `why` says, never
    taken from a render. The mean is over the whole cell, or over its middle if `inset` (a share of the cell cut off on
    each side) is not 0.
    """

    file: str
    size: tuple[int, int]
    cells: Mapping[tuple[int, int], Value]
    why: str
    relative: float = 1e-2
    absolute: float = 2e-3
    inset: float = 0.0
    pixels: int = 16
    """Pixels of a cell, each way."""
    samples: int = 64
    bounces: int = 2
    purposes: tuple[str, ...] = ("proxy",)
    edit: str | None = None
    """Runs in the host before the picture, as in host_process.py."""
    later: str | None = None
    """The same after a first picture, of which nothing is asked."""
    unlike: Mapping[tuple[int, int], Value] = dataclasses.field(default_factory=dict)
    """Cells of which the scene-index front end of Hydra hands over something else, and what they must show there."""
    variant: str = ""
    """Tells cases of one file apart."""
    says: tuple[str, ...] = ()
    """Texts that the host's log must contain."""
    silent: bool = False
    """The log must have no warning."""
    covers: bool = False
    """The values are shares of the cells that are covered (alpha), which need no light."""
    front_end: str = ""
    """The only front end that it is for, where hosts differ: "legacy" or "scene_index"."""

    @property
    def name(self) -> str:
        return f"{self.file}-{self.variant}" if self.variant else self.file

    def render(self, host) -> np.ndarray:
        """(height, width, 3) in f64, row 0 at the bottom; asserts what the log must say."""
        settings = {"oocpt:samplesPerPixel": self.samples, "oocpt:maxBounces": self.bounces}
        size = (self.size[0] * self.pixels, self.size[1] * self.pixels)
        path = str(FOLDER / f"{self.file}.usda")
        with host.open(path, size, camera="/Cam", settings=settings, purposes=self.purposes) as view:
            if self.edit:
                view.edit(self.edit)
            picture = view.render()
            if self.later:
                view.edit(self.later)
                picture = view.render()
        for text in self.says:
            assert text in picture.log, f"{self.name} does not say {text!r}:\n{picture.log}"
        if self.silent:
            assert "warning" not in picture.log.lower(), f"{self.name} warns:\n{picture.log}"
        color = picture["color"].astype(np.float64)
        return np.repeat(color[..., 3:], 3, axis=2) if self.covers else color[..., :3]

    def compare(self, made: np.ndarray, scene_index: bool = False) -> list[str]:
        """A line for each cell whose mean is not as it must be."""
        cut = round(self.inset * self.pixels)
        wrong = []
        for (x, y), value in {**self.cells, **(self.unlike if scene_index else {})}.items():
            rows = slice(y * self.pixels + cut, (y + 1) * self.pixels - cut)
            columns = slice(x * self.pixels + cut, (x + 1) * self.pixels - cut)
            mean = made[rows, columns].mean(axis=(0, 1))
            want = np.broadcast_to(np.asarray(value, dtype=np.float64), 3)
            if not np.allclose(mean, want, rtol=self.relative, atol=self.absolute):
                wrong.append(f"cell {x} {y}: {np.round(mean, 4).tolist()}, must be {np.round(want, 4).tolist()}")
        return wrong
