# SPDX-License-Identifier: Apache-2.0
"""Outputs: formats, clear values, sizes, any choice of AOVs, convergence."""

import numpy as np
import pytest

import compare
import small

FORMATS = {
    "color": ("Float32Vec4", 0.0), "depth": ("Float32", 1.0), "cameraDepth": ("Float32", 0.0), "primId": ("Int32", -1),
    "instanceId": ("Int32", -1), "elementId": ("Int32", -1), "normal": ("Float32Vec3", 0.0),
    "Neye": ("Float32Vec3", 0.0),
    "albedo": ("Float32Vec3", 0.0), "motion": ("Float32Vec3", 0.0), "motionBoth": ("Float32Vec4", 0.0),
    "position": ("Float32Vec3", 0.0), "Peye": ("Float32Vec3", 0.0), "Ng": ("Float32Vec3", 0.0),
    "variance": ("Float32Vec3", 0.0), "error": ("Float32", 0.0),
    "materialId": ("Int32", -1), "shadow": ("Float32Vec4", 0.0), "shadowCatcher": ("Float32", 0.0),
    "loadWaits": ("Float32", 0.0),
}  # fmt: skip
QUICK = {"oocpt:samplesPerPixel": 2, "oocpt:maxBounces": 0}


def test_formats_sizes_and_clear_values(host):
    """A stage with nothing but a camera: every buffer holds its clear value."""
    with host.open(small.FOLDER / "glow.usda", (17, 9), aovs=list(FORMATS), settings=QUICK) as view:
        view.edit(
            "[child.SetActive(False) for child in stage.GetPrimAtPath('/World').GetChildren() if child.GetName() !="
            " 'Camera']"
        )
        picture = view.render()
    for aov, (kind, clear) in FORMATS.items():
        state = picture.buffers[aov]
        assert (state["format"], state["width"], state["height"], state["converged"]) == (
            kind, 17, 9, True
        ), f"{aov}: {state}"
        assert (picture[aov] == clear).all(), f"clear value of {aov}: {np.unique(picture[aov])[:4]}"


def test_ids_come_as_floats_to_hosts_that_take_nothing_else(host):
    """Beside the whole numbers, and alone."""
    ids = ["primId", "instanceId", "elementId"]
    floats = [f"{name}Float" for name in ids]
    path = small.FOLDER / "nested.usda"
    whole = host.picture(path, (24, 18), aovs=ids + floats, settings=QUICK)
    alone = host.picture(path, (24, 18), aovs=floats, settings=QUICK)
    for name, number in zip(floats, ids, strict=True):
        assert whole.buffers[name]["format"] == "Float32" and whole.buffers[number]["format"] == "Int32"
        assert len(np.unique(whole[number])) > 1 and (whole[name] == whole[number]).all(), name
        compare.same_bits(alone[name], whole[name], name)


@pytest.mark.parametrize("filtered", [False, True])
@pytest.mark.parametrize("aovs", [["color"], ["depth", "primId"], ["normal"], ["albedo", "color"]], ids=",".join)
def test_any_choice_of_aovs(host, aovs, filtered):
    """Each AOV is the same whatever else is asked for."""
    path, settings = small.FOLDER / "glow.usda", QUICK | {"oocpt:filterAovs": filtered}
    everything = host.picture(path, (24, 18), aovs=list(FORMATS), settings=settings)
    some = host.picture(path, (24, 18), aovs=aovs, settings=settings)
    for aov in aovs:
        compare.same_bits(some[aov], everything[aov], aov)


def test_sample_count_tells_where_adaptive_sampling_went(host):
    """As many as asked for everywhere; with adaptive sampling what the stats say. Nobody asks: no pass, no image. Both
    front ends."""
    path, plain = small.FOLDER / "glow.usda", {"oocpt:samplesPerPixel": 64, "oocpt:maxBounces": 1}
    with host.open(path, (24, 18), aovs=["color"], settings=plain) as view:
        view.render()
        assert (
            "count_samples" in view.stats()["oocpt:passesLeftOut"]
            and "image sampleCount" not in view.stats()["oocpt:buffers"]
        )
    with host.open(path, (24, 18), aovs=["color", "sampleCount"], settings=plain) as view:
        even = view.render()
        assert even.buffers["sampleCount"]["format"] == "Float32", even.buffers["sampleCount"]
        assert (even["sampleCount"] == 64).all(), np.unique(even["sampleCount"])
        view.edit("engine.SetRendererSetting('oocpt:adaptiveSampling', True)")
        uneven, stats = view.render(), view.stats()
    counts = uneven["sampleCount"].astype(np.float64)
    assert (counts.min(), counts.max()) == (
        stats["oocpt:adaptiveFewestSamples"],
        stats["oocpt:adaptiveMostSamples"],
    ), stats
    assert counts.min() < 64 < counts.max() and 62 <= counts.mean() <= 64, counts.mean()
    alone = host.picture(path, (24, 18), aovs=["sampleCount"], settings=plain | {"oocpt:adaptiveSampling": True})
    compare.same_bits(alone["sampleCount"], uneven["sampleCount"], "samples are taken for it alone too")


def test_normals_turn_with_the_camera(host):
    """Neye is the normal seen from the camera; both are of unit length, and zero where nothing is hit."""
    with host.open(small.FOLDER / "glow.usda", (24, 18), aovs=["normal", "Neye", "primId"], settings=QUICK) as view:
        picture = view.render()
        rows = view.edit(
            "result = [list(row) for row in"
            " UsdGeom.Camera(stage.GetPrimAtPath('/World/Camera')).GetCamera(0).transform.GetInverse()]"
        )
    hit = picture["primId"] >= 0
    assert hit.any() and not hit.all()
    to_view = np.array(rows)[:3, :3]
    compare.near(picture["Neye"][hit], picture["normal"][hit].astype(np.float64) @ to_view, 1e-5, "Neye")
    compare.near(np.linalg.norm(picture["normal"][hit], axis=-1), 1.0, 1e-5, "length")
    compare.near(picture["Neye"][~hit], 0.0, 0.0, "nothing")


def test_points_are_where_the_camera_sees_them(host):
    """Peye is position seen from the camera, as far away as cameraDepth, on the ray of the pixel's centre; Ng is of
    unit length. Filtered, they are means: at edges normals are shorter than 1, and nothing is 0."""
    aovs, size = ["color", "position", "Peye", "Ng", "normal", "cameraDepth", "primId"], (24, 18)
    with host.open(small.FOLDER / "glow.usda", size, aovs=aovs, settings=QUICK) as view:
        picture = view.render()
        camera = "UsdGeom.Camera(stage.GetPrimAtPath('/World/Camera')).GetCamera(0)"
        rows = view.edit(f"result = [list(row) for row in {camera}.transform.GetInverse()]")
        window = view.edit(f"w = {camera}.frustum.window; result = [w.GetSize()[0], w.GetSize()[1]]")
        view.edit("engine.SetRendererSetting('oocpt:filterAovs', True)")
        view.edit("engine.SetRendererSetting('oocpt:samplesPerPixel', 64)")
        filtered = view.render()
    hit = picture["primId"] >= 0
    assert hit.any() and not hit.all()
    world = np.concatenate([picture["position"][hit].astype(np.float64), np.ones((hit.sum(), 1))], axis=1)
    eye = picture["Peye"][hit].astype(np.float64)
    compare.near(eye, (world @ np.array(rows))[:, :3], 1e-4, "Peye")
    compare.near(-eye[:, 2], picture["cameraDepth"][hit], 1e-4, "cameraDepth")
    compare.near(np.linalg.norm(picture["Ng"][hit], axis=-1), 1.0, 1e-5, "length of Ng")
    columns = np.broadcast_to((np.arange(size[0]) + 0.5) / size[0] - 0.5, (size[1], size[0]))[hit]
    across = window[1] * size[0] / size[1]  # the window is widened to the picture's sides
    compare.near(eye[:, 0] / -eye[:, 2], columns * across, 1e-4, "columns")
    compare.same_bits(filtered["primId"], picture["primId"], "ids are those of pixel centres")
    lengths = np.linalg.norm(filtered["normal"], axis=-1)
    assert (lengths < 1 + 1e-5).all() and ((lengths > 0.05) & (lengths < 0.95)).sum() > 5, np.sort(lengths.ravel())
    assert (filtered["position"][~hit & (lengths == 0)] == 0).all(), "nothing"


@pytest.mark.parametrize("size", [(1, 1), (1, 33), (65, 3), (8, 8)], ids=lambda size: f"{size[0]}x{size[1]}")
def test_odd_sizes(host, size):
    picture = host.picture(small.FOLDER / "furnace.usda", size, camera="/World/Perspective", settings=QUICK)
    assert picture["color"].shape == (size[1], size[0], 4)
    compare.near(picture["color"], 1.0, 1e-3, "furnace")


def test_resizing_a_live_view(host):
    path = small.FOLDER / "glow.usda"
    with host.open(path, (24, 18), aovs=["color", "depth"], settings=QUICK) as view:
        first = view.render()
        view.edit("view.size = (13, 30)")
        compare.same_picture(
            view.render(), host.picture(path, (13, 30), aovs=["color", "depth"], settings=QUICK), "13 x 30"
        )
        view.edit("view.size = (24, 18)")
        compare.same_picture(view.render(), first, "back to 24 x 18")


def test_more_aovs_later(host):
    path = small.FOLDER / "glow.usda"
    with host.open(path, (24, 18), aovs=["color"], settings=QUICK) as view:
        first = view.render()
        view.edit("view.aovs = ['color', 'depth', 'instanceId']")
        picture = view.render()
    compare.same_bits(picture["color"], first["color"], "color")
    compare.same_bits(picture["depth"], host.picture(path, (24, 18), aovs=["depth"], settings=QUICK)["depth"], "depth")


def test_an_unknown_aov_spoils_nothing(host):
    """The engine may refuse it; the delegate must not fail, and color goes on."""
    path = small.FOLDER / "glow.usda"
    with host.open(path, (24, 18), aovs=["color"], settings=QUICK) as view:
        view.edit("view.prepare(); aov_reader.set_aovs(engine, ['color', 'somethingElse']); view.step()")
        compare.same_picture(view.render(), host.picture(path, (24, 18), settings=QUICK), "color")


def test_opacity_zero_is_not_there_and_alpha_is_coverage(host):
    with host.open(small.FOLDER / "glow.usda", (24, 18), aovs=["color", "primId"], settings=QUICK) as view:
        before = view.render()
        view.edit("UsdGeom.Mesh(stage.GetPrimAtPath('/World/Veil')).GetDisplayOpacityPrimvar().Set([0.0])")
        gone = view.render()
        view.edit("UsdGeom.Imageable(stage.GetPrimAtPath('/World/Veil')).MakeInvisible()")
        hidden = view.render()
    assert (before["primId"] != gone["primId"]).any(), "the veil was in the picture"
    assert ((gone["primId"] == -1) == (hidden["primId"] == -1)).all(), "opacity 0 covers nothing"
    compare.near(gone["color"], hidden["color"], 1e-6, "opacity 0 is as good as invisible")
