# SPDX-License-Identifier: Apache-2.0
"""A ground to the horizon and a wall along the view, through the host, against the same pictures without a filter
(`scenes/filtering.py`)."""

from __future__ import annotations

import numpy as np
import pytest

import filtering

SIZE = (96, 54)
SETTINGS = {"oocpt:samplesPerPixel": 64, "oocpt:maxBounces": 0}

# relMSE and edges kept at 64 samples. A filter by the longer axis has 6e-2 and 0.51, 3e-2 and 0.60 (at 160 x 90).
BOUNDS = {"ground": (1e-3, 0.95), "wall": (1e-3, 0.92)}


@pytest.mark.parametrize("name", filtering.SCENES)
def test_grazing_views_match_the_unfiltered_picture(host, tmp_path, name):
    filtering.write(tmp_path)
    color = host.picture(tmp_path / f"{name}.usda", SIZE, aovs=["color"], settings=SETTINGS)["color"]
    seen = np.asarray(color, dtype=np.float64)[::-1, :, 0]
    expected = filtering.reference(name, SIZE[0], samples=32)
    error, edges = filtering.error(seen, expected), filtering.sharpness(seen, expected)
    assert error < BOUNDS[name][0] and BOUNDS[name][1] < edges < 1.02, f"{name}: relMSE {error}, edges {edges}"
    blurred = (expected[:, :-2] + expected[:, 1:-1] + expected[:, 2:]) / 3
    assert filtering.sharpness(blurred, expected[:, 1:-1]) < BOUNDS[name][1], "the measure sees a blur of three pixels"
    assert filtering.error(blurred, expected[:, 1:-1]) > BOUNDS[name][0], "so does the error"
