# SPDX-License-Identifier: Apache-2.0
"""Pictures that must be the same, to the bit where the arithmetic is the same: seeds, front ends, twins."""

import numpy as np
import pytest

import compare
import reference
import small

AOVS = ["color", "depth", "cameraDepth", "elementId", "normal", "albedo"]
SETTINGS = {"oocpt:samplesPerPixel": 8, "oocpt:maxBounces": 2, "oocpt:seed": 11}


def test_same_seed_same_bits_and_other_seed_other_bits(host):
    path = small.FOLDER / "glow.usda"
    first = host.picture(path, (32, 32), settings=SETTINGS, aovs=AOVS)
    again = host.picture(path, (32, 32), settings=SETTINGS, aovs=AOVS)
    compare.same_picture(first, again, "same seed twice")
    other = host.picture(path, (32, 32), settings=SETTINGS | {"oocpt:seed": 12}, aovs=AOVS)
    different = (first["color"] != other["color"]).any(axis=-1)
    assert different.mean() > 0.5, "another seed must give other noise"
    for aov in AOVS[1:]:
        compare.same_bits(first[aov], other[aov], f"{aov} has no noise")


def test_a_restarted_engine_continues_with_the_same_bits(host):
    """The same picture from an engine that has rendered something else before."""
    path = small.FOLDER / "glow.usda"
    fresh = host.picture(path, (32, 32), settings=SETTINGS, aovs=AOVS)
    with host.open(path, (20, 14), settings=SETTINGS | {"oocpt:seed": 99}, aovs=AOVS) as view:
        view.render()
        view.edit("view.size = (32, 32); engine.SetRendererSetting('oocpt:seed', 11)")
        compare.same_picture(view.render(), fresh, "after another size and seed")


@pytest.mark.parametrize(
    "scene",
    [
        "small/glow", "small/nested", "small/hidden_instances", "small/polygons", "small/primvars", "small/transforms",
        "small/visibility", "small/cameras", "small/mirrored", "features/light_dome_texture", "features/light_ies",
        "features/light_links", "features/light_mesh", "features/lights_instanced", "features/material_collection",
        "features/material_cutout", "features/material_instance_primvars", "features/material_normal_map",
        "features/material_primvars", "features/material_subsets", "features/texture_transform",
        "features/texture_udim",
    ],
)
def test_both_front_ends_give_the_same_picture(pool, scene):
    """With what other tests ask of these scenes in one front end, they hold in the other, too."""
    camera = "/World/Plain" if scene == "small/cameras" else "/World/Camera"
    path = small.FOLDER.parent / f"{scene}.usda"
    legacy, modern = (
        pool.get(mode).picture(path, (32, 32), camera=camera, settings=SETTINGS, aovs=AOVS)
        for mode in ("legacy", "scene_index")
    )
    assert (legacy["cameraDepth"] > 0).any(), "nothing in the picture"
    compare.same_picture(legacy, modern, scene)


def test_both_front_ends_give_the_same_implicit_shapes_up_to_rounding(pool):
    """The old front end hands over meshes of spheres, cylinders, cones and capsules; the reader finds the shapes that
    they were made from. Cubes and planes are meshes in both."""
    legacy, modern = (
        pool.get(mode).picture(small.FOLDER / "implicit.usda", (32, 32), settings=SETTINGS, aovs=AOVS)
        for mode in ("legacy", "scene_index")
    )
    assert len(np.unique(legacy["albedo"].reshape(-1, 3), axis=0)) == 7, "six shapes and what is beside them are seen"
    compare.same_bits(legacy["elementId"], modern["elementId"], "elements")
    # Another box around the scene is another frame, so the last bits differ.
    for aov in ("cameraDepth", "normal", "albedo"):
        compare.near(legacy[aov], modern[aov], 3e-6, aov)


def test_native_instances_are_the_same_up_to_rounding_in_both_front_ends(pool):
    """UsdImaging multiplies the matrices of native instances in another order in each front end: the last bit of a
    depth may differ."""
    aovs = [*AOVS, "Neye"]
    legacy, modern = (
        pool.get(mode).picture(small.FOLDER / "native.usda", (32, 32), settings=SETTINGS, aovs=aovs)
        for mode in ("legacy", "scene_index")
    )
    for aov, tolerance in (("depth", 3e-7), ("normal", 1e-6), ("albedo", 0.0), ("elementId", 0.0)):
        compare.near(legacy[aov], modern[aov], tolerance, aov)
    # The slope of a face magnifies the rounding of its distance: compare the distances of the planes. The camera's
    # tangent is 0.4.
    across = 0.4 * ((np.arange(32) + 0.5) / 16 - 1)
    rays = np.stack([*np.meshgrid(across, across), -np.ones((32, 32))], axis=-1)
    slope = np.abs((legacy["Neye"] * rays).sum(axis=-1))
    compare.near(legacy["cameraDepth"] * slope, modern["cameraDepth"] * slope, 2e-6, "cameraDepth")
    twins_agree(legacy["color"], modern["color"])


def test_nested_instancers_equal_their_flattened_twin(host):
    """Other matrices are multiplied in other order, so bits may differ, but the random numbers are the same: only paths
    that pass an edge within rounding may part. Depth and faces agree exactly where they are clear."""
    stages = [small.build(scene) for scene in (small.nested, small.flattened)]
    nested, flat = (
        host.picture(stage, (40, 40), settings=SETTINGS | {"oocpt:samplesPerPixel": 32}, aovs=AOVS) for stage in stages
    )
    clear = compare.clear_pixels(reference.first_hits(stages[0], "/World/Camera", 40, 40).unclear, "twins")
    compare.near(nested["cameraDepth"][clear], flat["cameraDepth"][clear], 1e-5, "cameraDepth")
    assert (nested["elementId"][clear] == flat["elementId"][clear]).all(), "elementId"
    compare.near(nested["albedo"][clear], flat["albedo"][clear], 0.0, "albedo")
    twins_agree(nested["color"], flat["color"])
    shifted = np.roll(flat["color"], 1, axis=1)
    with pytest.raises(AssertionError):
        twins_agree(nested["color"], shifted)
    with pytest.raises(AssertionError):
        twins_agree(nested["color"], flat["color"] * np.float32(1.02))


def twins_agree(a: np.ndarray, b: np.ndarray) -> None:
    difference = np.abs(a.astype(np.float64) - b)
    apart = (difference > 1e-4 * (1.0 + np.abs(b))).any(axis=-1).mean()
    assert apart <= 0.05, f"{100 * apart:.1f} % of the pixels differ by more than rounding"
    mean = abs(a.astype(np.float64).mean() - b.astype(np.float64).mean()) / b.mean()
    assert mean <= 2e-3, f"means differ by {100 * mean:.2f} %"


def test_the_mean_does_not_depend_on_seed_or_sample_count(host):
    """Two estimates of one picture, by z-test with deviations measured from independent seeds."""
    path = small.FOLDER / "glow.usda"

    def estimate(seeds, samples):
        settings = SETTINGS | {"oocpt:samplesPerPixel": samples}
        pictures = [
            host.picture(path, (20, 20), settings=settings | {"oocpt:seed": seed})["color"][..., :3] for seed in seeds
        ]
        mean, deviation = compare.batches(pictures)
        # The deviation of a handful of pictures is rough: share it among neighbours.
        blocks = np.square(deviation).reshape(5, 4, 5, 4, 3).max(axis=(1, 3), keepdims=True)
        return mean, np.sqrt(np.broadcast_to(blocks, (5, 4, 5, 4, 3))).reshape(20, 20, 3)

    few, few_deviation = estimate(range(100, 108), 4)
    many, many_deviation = estimate(range(200, 204), 32)
    compare.means_agree(few, few_deviation, many, many_deviation, "4 against 32 samples")
    with pytest.raises(AssertionError):
        compare.means_agree(few * 1.1, few_deviation, many, many_deviation, "a planted bias of 10 %")


def test_clamping_and_bounces_change_the_picture(host):
    """Settings that must matter do: a test of the tests above, which would pass if settings were ignored."""
    path = small.FOLDER / "glow.usda"
    base = host.picture(path, (20, 20), settings=SETTINGS)["color"]
    for key, value in (("oocpt:maxBounces", 0), ("oocpt:samplesPerPixel", 9), ("oocpt:clamp", 0.05)):
        other = host.picture(path, (20, 20), settings=SETTINGS | {key: value})["color"]
        assert (other != base).any(), f"{key} changes nothing"
