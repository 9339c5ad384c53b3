# SPDX-License-Identifier: Apache-2.0
"""Each comparison, seen to fail on a planted fault; and the numpy reference against cases worked out by hand."""

import numpy as np
import pytest
from pxr import Gf

import compare
import reference
import small


def noisy(seed: int, bias: float = 1.0, shift: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    level = np.where((np.arange(32) + shift) % 8 < 4, 0.6, 0.3)[None, :, None] * np.ones((32, 32, 3))
    return (bias * level * rng.uniform(0, 2, (64, *level.shape)).mean(axis=0)).astype(np.float32)


def test_same_bits_sees_one_bit_and_nan():
    image = noisy(1)
    compare.same_bits(image, image.copy(), "equal")
    other = image.copy()
    other.view(np.uint32)[3, 4, 1] ^= 1
    with pytest.raises(AssertionError, match="1 of"):
        compare.same_bits(image, other, "one bit")
    image[0, 0, 0] = np.nan
    with pytest.raises(AssertionError, match="not finite"):
        compare.same_bits(image, image.copy(), "nan")


def test_near_sees_small_errors_and_nan():
    compare.near(np.ones((4, 4)), 1.0, 1e-6, "ones")
    for wrong in (1.0 + 2e-6, np.nan):
        values = np.ones((4, 4))
        values[2, 1] = wrong
        with pytest.raises(AssertionError):
            compare.near(values, 1.0, 1e-6, "planted")
    with pytest.raises(AssertionError):
        compare.near(np.ones(0), 1.0, 1e-6, "nothing at all")


def test_means_agree_accepts_noise_and_sees_bias_and_shift():
    first = compare.batches([noisy(seed) for seed in range(4, 12)])
    second = compare.batches([noisy(seed) for seed in range(20, 28)])
    # Eight batches know their deviation only roughly: the tests use the known one.
    deviation = np.where(first[0] > 0.45, 0.6, 0.3) / np.sqrt(3 * 64 * 8)
    compare.means_agree(first[0], deviation, second[0], deviation, "honest")
    for name, arguments in (("bias of 2 %", {"bias": 1.02}), ("shift by a pixel", {"shift": 1})):
        wrong, _ = compare.batches([noisy(seed, **arguments) for seed in range(20, 28)])
        with pytest.raises(AssertionError):
            compare.means_agree(first[0], deviation, wrong, deviation, name)


def test_unclear_pictures_are_refused():
    compare.clear_pixels(np.zeros((8, 8), dtype=bool), "clear")
    with pytest.raises(AssertionError, match="unclear"):
        compare.clear_pixels(np.ones((8, 8), dtype=bool), "unclear")


def square(stage):
    """A unit square and a camera."""
    small.quad(stage, "/World/Square")
    small.orthographic(stage, "/World/Camera", (0, 0, 6), (0, 0, 0), 4.0)


def test_reference_knows_a_square():
    """A unit square at distance 6 under an orthographic camera 4 wide: a quarter of each side, depth 6, face 0."""
    hits = reference.first_hits(small.build(square), "/World/Camera", 16, 16)
    inside = np.zeros((16, 16), dtype=bool)
    inside[6:10, 6:10] = True
    assert ((hits.item == 0) == inside).all()
    compare.near(hits.camera_depth[inside], 6.0, 1e-9, "distance")
    compare.near(hits.depth[inside], (6.0 - 0.1) / 999.9, 1e-6, "window depth")
    assert (hits.face[inside] == 0).all() and (hits.depth[~inside] == 1.0).all()
    compare.near(hits.normal[inside], [0, 0, 1], 1e-9, "normal")


def test_reference_respects_concavity_holes_and_hidden_instances():
    polygons = reference.first_hits(small.build(small.polygons), "/World/Camera", 28, 28)
    seen = {
        (polygons.items[item].path, face)
        for item, face in zip(polygons.item.ravel(), polygons.face.ravel())
        if item >= 0
    }
    assert {("/World/Holes", face) for face in (0, 2, 4, 5)} <= seen, "faces around the holes"
    assert not {("/World/Holes", 1), ("/World/Holes", 3)} & seen, "hole faces"
    # The notch of the arrow and the inside of the spiral are empty.
    at = lambda x, y: polygons.item[int((y + 3.5) * 4), int((x + 3.5) * 4)]
    assert at(1.1, 1.2) == -1 and at(-1.7, -0.9) == -1, "concave parts"
    row = reference.flatten(small.build(small.hidden_instances))
    assert sorted(item.levels[0][1] for item in row) == [0, 2, 4, 6], "two invisible, one inactive"


def test_reference_twins_have_the_same_points():
    nested = reference.flatten(small.build(small.nested))
    flat = reference.flatten(small.build(small.flattened))
    assert len(nested) == len(flat) == 12
    key = lambda item: tuple(np.round(item.points.mean(axis=0), 3))
    for a, b in zip(sorted(nested, key=key), sorted(flat, key=key)):
        compare.near(a.points, b.points, 2e-6, f"{a.levels} against {b.path}")


def test_reference_conforms_windows():
    """CameraUtil's policies on a 2:1 window and a square picture."""
    stage = small.build(small.cameras)
    for policy, half in (
        ("matchVertically", (1, 1)),
        ("matchHorizontally", (2, 2)),
        ("fit", (2, 2)),
        ("crop", (1, 1)),
        ("dontConform", (2, 1)),
    ):
        rays = reference.pixel_rays(stage, "/World/Wide", 2, 2, policy)
        to_view = Gf.Matrix4d(rays.camera.transform.GetInverse())
        corner = to_view.TransformDir(Gf.Vec3d(*rays.directions[3]))
        # 36 x 18 mm at 30 mm: tangents 0.6 and 0.3; the centre of the last of two pixels is half way to the edge.
        compare.near([corner[0], corner[1]], [0.15 * half[0], 0.15 * half[1]], 1e-6, policy)
