# SPDX-License-Identifier: Apache-2.0
"""Mitsuba's scenes of hairs, balls and meshes are those of `oocpt bench curves`; and the arithmetic of the table."""

import pathlib
import sys

import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import curves


def test_scenes_are_those_of_the_bench():
    """The numbers are also in the test of `rust/scenes/src/fur.rs`."""
    points, width = curves.hairs(3)
    assert points[2, 0] == pytest.approx([0.11838902, -0.08247532, -0.7868811], abs=1e-6), "root of the third hair"
    assert points[2, 4] == pytest.approx([0.19086766, -0.22842777, -1.0048903], abs=1e-6), "its tip"
    assert width == pytest.approx(0.6 / 3**0.5)
    centers, width = curves.balls(8)
    assert centers[2] == pytest.approx([-0.6403253, 0.15604632, -0.22094716], abs=1e-6), "third ball"
    assert width == pytest.approx(0.5)
    corners, faces = curves.creature(18)
    assert len(corners) == 25 and len(faces) == 32, "4 x 4 quads"
    assert corners[13] == pytest.approx([0, 0, -0.92], abs=1e-6)
    assert faces[:2].tolist() == [[0, 5, 1], [1, 5, 6]], "as the bench cuts a quad"


def test_pinned_curves_begin_and_end_at_their_outer_points():
    points = np.array([[[0, 0, 0], [1, 2, 0], [3, 1, 4], [2, 2, 2], [5, 0, 1]]], np.float32)
    made = curves.pinned(points)[0]
    start = lambda a, b, c, _: (a + 4 * b + c) / 6  # a uniform cubic B-spline at 0
    assert start(*made[:4]) == pytest.approx(points[0, 0])
    assert (made[-3] + 4 * made[-2] + made[-1]) / 6 == pytest.approx(points[0, 4])


def test_rates_are_of_the_median_render():
    made = curves.rates({"seconds": [9.0, 2.0, 4.0], "rays": 24_000_000}, 8_000_000)
    assert made["median"] == 4 and made["mpaths_per_sec"] == pytest.approx(2)
    assert made["mrays_per_sec"] == pytest.approx(6) and made["rays_per_path"] == pytest.approx(3)


def test_a_mesh_in_place_of_a_limit_surface_has_as_many_triangles():
    _, faces = curves.creature(curves.refined_count(501_094))
    assert len(faces) == pytest.approx(501_094, rel=3e-3)


def test_counts_are_read_or_refused():
    assert curves.counts_of("hair=7,limit=5") == {**curves.COUNTS, "hair": 7, "limit": 5}
    for bad in ("wool=3", "hair", "hair=0", "hair=-1"):
        with pytest.raises(SystemExit):
            curves.counts_of(bad)


def test_a_row_says_both_sides_and_their_ratio():
    side = {"mpaths_per_sec": 6.0, "mrays_per_sec": 12.0, "rays_per_path": 2.0, "mean": 0.5, "count": 9, "memory": 70}
    row = curves.line({"subject": "hair", "ours": side, "mitsuba": {**side, "mpaths_per_sec": 2.0, "memory": 90}})
    assert row == "| hair, 9 | 6 | 2 | 3.00 | 12 (2.00) | 70 | 90 | 0.5000 | 0.5000 |"
    assert curves.line({"subject": "hair", "ours": side}).startswith("| hair, 9 | 6 | - | - |"), "one side only"
