# SPDX-License-Identifier: Apache-2.0
"""Pictures whose values are known: furnaces and Lambert's law."""

import math

import numpy as np
import pytest

import compare
import reference
import small

QUICK = {"oocpt:samplesPerPixel": 16, "oocpt:maxBounces": 3}


@pytest.mark.parametrize("camera", ["Perspective", "Orthographic", "Lens", "Shifted"])
def test_white_furnace_is_exactly_one(host, camera):
    """A white ball in a white world cannot be seen, whatever the camera."""
    stage = small.FOLDER / "furnace.usda"
    picture = host.picture(stage, (24, 24), camera=f"/World/{camera}", aovs=["color", "primId"], settings=QUICK)
    assert (picture["primId"] >= 0).mean() > 0.1, "the ball must be in the picture"
    compare.near(picture["color"], 1.0, 1e-3, f"furnace, {camera}")


def test_grey_furnace_is_half(host):
    """A grey convex ball returns its albedo of the light; the world behind it stays 1."""
    text = (small.FOLDER / "furnace.usda").read_text().replace("[(1, 1, 1)]", "[(0.5, 0.25, 0.125)]")
    picture = host.picture(text, (24, 24), camera="/World/Orthographic", aovs=["color", "primId"], settings=QUICK)
    ball = picture["primId"] >= 0
    # Away from the silhouette, where pixels hold both.
    inside = ball & np.roll(ball, 1, 0) & np.roll(ball, -1, 0) & np.roll(ball, 1, 1) & np.roll(ball, -1, 1)
    outside = ~(ball | np.roll(ball, 1, 0) | np.roll(ball, -1, 0) | np.roll(ball, 1, 1) | np.roll(ball, -1, 1))
    assert inside.sum() > 40 and outside.sum() > 40
    compare.near(picture["color"][inside], [0.5, 0.25, 0.125, 1.0], 2e-3, "ball")
    compare.near(picture["color"][outside], 1.0, 1e-6, "world")


def test_lambert_under_a_distant_light(host):
    """Radiance = albedo / pi * irradiance * cos(tilt), without noise."""
    stage = small.build(small.lambert)
    hits = reference.first_hits(stage, "/World/Camera", 48, 48)
    picture = host.picture(stage, (48, 48), settings={"oocpt:samplesPerPixel": 4, "oocpt:maxBounces": 0})
    for tilt in (0, 30, 60, 85):
        item = next(n for n, item in enumerate(hits.items) if item.path.endswith(f"/Tilt{tilt}"))
        on = hits.item == item
        on = on & np.roll(on, 1, 0) & np.roll(on, -1, 0) & np.roll(on, 1, 1) & np.roll(on, -1, 1)
        assert on.sum() >= 20, f"tilt {tilt} fills only {on.sum()} pixels"
        expected = np.array([0.8, 0.4, 0.2]) / math.pi * 3.0 * math.cos(math.radians(tilt))
        compare.near(picture["color"][on][:, :3], expected, 2e-5, f"tilt {tilt}")
        compare.near(picture["color"][on][:, 3], 1.0, 1e-6, "alpha")
    empty = hits.item == -1
    empty = empty & np.roll(empty, 1, 0) & np.roll(empty, -1, 0) & np.roll(empty, 1, 1) & np.roll(empty, -1, 1)
    compare.near(picture["color"][empty], 0.0, 0.0, "nothing")


def test_wide_sun_and_dome_add_up(host):
    """A normalised sun gives its intensity whatever its angle; the dome adds pi times its radiance."""
    picture = host.picture(
        small.FOLDER / "sun_disk.usda", (16, 16), settings={"oocpt:samplesPerPixel": 256, "oocpt:maxBounces": 2}
    )
    irradiance = 2.0 * math.cos(math.radians(40)) * np.array([1.0, 0.5, 0.25]) + 0.3 * math.pi
    mean = picture["color"][..., :3].astype(np.float64).mean(axis=(0, 1))
    compare.near(mean, 0.5 / math.pi * irradiance, 2e-3, "sun and dome")


def test_light_inputs_multiply(host):
    """intensity * 2^exposure * colour, as UsdLux says; seen directly in the dome."""
    with host.open(small.FOLDER / "furnace.usda", (8, 8), camera="/World/Perspective", settings=QUICK) as view:
        view.edit("stage.GetPrimAtPath('/World/Ball').SetActive(False)")
        view.edit(
            "light = UsdLux.DomeLight(stage.GetPrimAtPath('/World/Dome'))\n"
            "light.CreateIntensityAttr(3.0); light.CreateExposureAttr(-1.5); light.CreateColorAttr(Gf.Vec3f(1.0, 0.5,"
            " 0.25))"
        )
        expected = 3.0 * 2.0**-1.5 * np.array([1.0, 0.5, 0.25, 0.0]) + [0, 0, 0, 1]
        compare.near(view.render()["color"], expected, 1e-5, "dome")


def test_dome_visibility_changes_only_the_background(host):
    with host.open(
        small.FOLDER / "furnace.usda", (24, 24), camera="/World/Perspective", aovs=["color", "primId"], settings=QUICK
    ) as view:
        view.edit("engine.SetRendererSetting('domeLightCameraVisibility', False)")
        picture = view.render()
        ball = picture["primId"] >= 0
        inside = ball & np.roll(ball, 1, 0) & np.roll(ball, -1, 0) & np.roll(ball, 1, 1) & np.roll(ball, -1, 1)
        compare.near(picture["color"][inside], 1.0, 1e-3, "ball")
        compare.near(picture["color"][:2], 0.0, 0.0, "background")


def test_cages_of_subdivision_surfaces_shade_smoothly_and_polygon_meshes_flat(host):
    stage = small.build(small.smooth)
    hits = reference.first_hits(stage, "/World/Camera", 40, 40)
    settings = {"oocpt:samplesPerPixel": 4, "oocpt:maxBounces": 0, "oocpt:dicingRate": 0.0}
    picture = host.picture(stage, (40, 40), aovs=["color", "normal"], settings=settings)
    flat = next(n for n, item in enumerate(hits.items) if item.path == "/World/none")
    clear = compare.clear_pixels(hits.unclear, "smooth")
    on_flat, on_smooth = (hits.item == flat) & clear, (hits.item == 1 - flat) & clear
    compare.near(picture["normal"][on_flat], hits.normal[on_flat], 1e-5, "flat normals")
    compare.near(np.linalg.norm(picture["normal"][on_smooth], axis=-1), 1.0, 1e-5, "unit normals")
    # Vertex normals of an octahedron point from its centre: so must the interpolated ones, about.
    rays = reference.pixel_rays(stage, "/World/Camera", 40, 40)
    centre = np.array([-1.2, 0, 0])
    points = (rays.origins + rays.directions * hits.camera_depth.reshape(-1, 1)).reshape(40, 40, 3)[on_smooth] - centre
    compare.near(
        picture["normal"][on_smooth], points / np.linalg.norm(points, axis=-1, keepdims=True), 1e-4, "smooth normals"
    )


def test_camera_light_shows_a_scene_without_lights(host, tmp_path):
    """FrameRecorder's light at the camera: a square seen straight on is lit, and without the light it is black."""
    import exr

    scene = tmp_path / "dark.usda"
    stage = small.build(
        lambda stage: (
            small.quad(stage, "/World/Square", 2.0),
            small.camera(stage, "/World/Camera", (0, 0, 3), (0, 0, 0)),
        ),
        doc="dark",
    )
    stage.GetRootLayer().Export(str(scene))
    pictures = []
    for on in (True, False):
        out = tmp_path / f"{on}.exr"
        host.call("record", stage=str(scene), out=str(out), width=16, camera_light=on)
        pictures.append(exr.read(out))
    lit, dark = pictures
    assert lit[8, 8, :3].min() > 0.05, f"camera light gives {lit[8, 8]}"
    compare.near(dark[8, 8], [0, 0, 0, 1], 0.0, "no light at all")
