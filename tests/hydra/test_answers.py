# SPDX-License-Identifier: Apache-2.0
"""The closed forms that the feature tests rest on agree with quadrature and with each other; so does the comparison
with what it should refuse."""

import math

import answers
import featured
import numpy as np
import pytest
from pxr import Gf

POINTS = answers.floor_points(4, over=1)


def _down(position):
    """A light's matrix that makes its -z point down, as USD writes it."""
    return np.array(
        Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), -90)) * Gf.Matrix4d().SetTranslate(Gf.Vec3d(*position))
    )


def test_polygon_is_the_sum_of_its_pieces():
    corners = np.array([(x, 1.5, z) for x, z in ((-0.3, -0.6), (0.9, -0.6), (0.9, 0.2), (-0.3, 0.2))])
    pieces = answers.quadrature(POINTS, *answers.rect_pieces(_down((0.3, 1.5, -0.2)), 1.2, 0.8, 80))
    assert np.abs(answers.polygon(POINTS, corners) / pieces - 1).max() < 2e-4


def test_disk_is_the_sum_of_its_pieces_and_a_square_far_away():
    pieces = answers.quadrature(POINTS, *answers.disk_pieces((-0.2, 1.4, 0.1), 0.6, 60, 120))
    assert np.abs(answers.disk(POINTS, (-0.2, 1.4, 0.1), 0.6) / pieces - 1).max() < 1e-4
    below = np.zeros((1, 3))
    assert answers.disk(below, (0, 2.0, 0), 0.5)[0] == pytest.approx(
        math.pi * 0.25 / (4 + 0.25)
    ), "on its axis: pi r^2 / (r^2 + h^2)"


def test_ball_is_as_bright_as_its_disk_far_away():
    below = np.zeros((1, 3))
    assert answers.ball(below, (0, 50.0, 0), 0.5)[0] == pytest.approx(
        answers.disk(below, (0, 50.0, 0), 0.5)[0], rel=2e-4
    )


def test_thin_tube_is_a_line():
    """A line source of unit length, h above the point below its middle: radiance times width 2 r, integral of cos^2
    over the square of the distance... in closed form."""
    matrix = np.array(Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 2.0, 0)))
    found = answers.quadrature(np.zeros((1, 3)), *answers.tube_pieces(matrix, 1.0, 1e-4))[0]
    half, h = 0.5, 2.0
    line = 2e-4 * (h * half / (h * h + half * half) + math.atan(half / h)) / h
    assert found == pytest.approx(line, rel=1e-3)


def test_the_comparison_refuses_a_per_cent_and_forgives_noise():
    random = np.random.default_rng(3)
    expected = np.full((32, 32, 3), 0.7)
    noisy = lambda bias: [expected * bias + 0.05 * random.standard_normal(expected.shape) for _ in range(4)]
    featured.agree(noisy(1.0), expected, "same")
    with pytest.raises(AssertionError, match="off"):
        featured.agree(noisy(1.01), expected, "one per cent brighter")
    with pytest.raises(AssertionError, match="noise"):
        featured.agree(
            [expected + random.standard_normal(expected.shape) for _ in range(4)], expected, "too noisy to tell"
        )
