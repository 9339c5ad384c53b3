# SPDX-License-Identifier: Apache-2.0
"""Windows of the picture: the host's framing and the render settings' dataWindowNDC. What is outside of them is clear
and costs nothing."""

import os
import subprocess

import numpy as np
import pytest

import compare
import exr
import small

SETTINGS = {"oocpt:samplesPerPixel": 4, "oocpt:maxBounces": 1}
SIZE = 40
STAGE = """#usda 1.0
(
    renderSettingsPrimPath = "/Settings"
    subLayers = [@{folder}/cameras.usda@]
)
def RenderSettings "Settings"
{{
    rel camera = </World/Plain>
    float4 dataWindowNDC = {window}
    rel products = </Settings/Product>
    def RenderProduct "Product"
    {{
        token productType = "raster"
        {product}
    }}
}}
"""
ACTIVE = 'engine.SetActiveRenderSettingsPrimPath(Sdf.Path("/Settings"))'


def stage(window="(0, 0, 1, 1)", product=""):
    return STAGE.format(folder=small.FOLDER, window=window, product=product)


def inside(left, bottom, right, top, size=SIZE):
    """Pixels whose centres are in a window of NDC; rows from the bottom, as arrays have them."""
    at = (np.arange(size) + 0.5) / size
    return ((at >= bottom) & (at < top))[:, None] & ((at >= left) & (at < right))[None, :]


def rendered(host, text, code=ACTIVE):
    """Images, rays and log of a stage, after `code`."""
    with host.open(text, (SIZE, SIZE), camera="/World/Plain", aovs=["color", "primId"], settings=SETTINGS) as view:
        view.edit(code)
        picture = view.render()
        return picture, view.stats()["oocpt:raysTraced"]


def expect(picture, whole, mask):
    assert (picture["color"][mask] == whole["color"][mask]).all(), "the bits of the whole picture"
    assert (picture["primId"][mask] == whole["primId"][mask]).all()
    assert (picture["color"][~mask] == 0).all() and (picture["primId"][~mask] == -1).all(), "clear outside"
    assert (whole["primId"][mask] >= 0).any() and (whole["color"][~mask] != 0).any(), "there is something to see"


@pytest.mark.parametrize(
    "window", [(0.2, 0.3, 0.7, 0.6), (-0.5, 0.51, 0.4, 1.5)], ids=["crop", "corner"]
)
def test_render_settings_crop(host, window):
    whole, all_rays = rendered(host, stage())
    picture, rays = rendered(host, stage(str(window)))
    mask = inside(*window)
    expect(picture, whole, mask)
    assert rays < 2 * all_rays * mask.mean(), f"{rays} rays of {all_rays} for {mask.mean():.2f} of the picture"


def test_the_window_of_a_product_wins_and_overscan_is_cut(host):
    whole, all_rays = rendered(host, stage())
    own = "float4 dataWindowNDC = (0.5, 0.25, 1, 0.75)"
    expect(rendered(host, stage("(0, 0, 0.1, 0.1)", own))[0], whole, inside(0.5, 0.25, 1, 0.75))
    overscan, rays = rendered(host, stage("(-0.1, -0.1, 1.1, 1.1)"))
    compare.same_bits(overscan["color"], whole["color"], "there are no pixels for overscan")
    assert rays == all_rays


def test_the_hosts_framing_and_the_settings_windows_meet(host):
    framing = (
        f"view.framing = CameraUtil.Framing(Gf.Range2f(Gf.Vec2f(0, 0), Gf.Vec2f({SIZE}, {SIZE})),"
        " Gf.Rect2i(Gf.Vec2i(6, 12), Gf.Vec2i(25, 29)))"
    )
    framed, framed_rays = rendered(host, stage(), framing)
    mask = np.zeros((SIZE, SIZE), dtype=bool)
    mask[SIZE - 30 : SIZE - 12, 6:26] = True
    assert (framed["primId"][~mask] == -1).all() and (framed["primId"][mask] >= 0).any()
    picture, rays = rendered(host, stage("(0.4, 0, 1, 1)"), f"{framing}\n{ACTIVE}")
    expect(picture, framed, mask & inside(0.4, 0, 1, 1))
    assert 0 < rays < framed_rays


def test_a_window_that_moves_is_followed(host):
    whole, _ = rendered(host, stage())
    with host.open(stage(), (SIZE, SIZE), camera="/World/Plain", aovs=["color", "primId"], settings=SETTINGS) as view:
        view.edit(ACTIVE)
        view.render()
        for left in (0.1, 0.3, 0.25):
            window = (left, 0.2, left + 0.5, 0.9)
            view.edit(f'stage.GetPrimAtPath("/Settings").GetAttribute("dataWindowNDC").Set(Gf.Vec4f{window})')
            expect(view.render(), whole, inside(*window))


def test_a_window_without_pixels_is_clear_and_told(host):
    with host.open(stage("(2, 2, 3, 3)"), (SIZE, SIZE), camera="/World/Plain", settings=SETTINGS) as view:
        view.edit(ACTIVE)
        picture = view.render()
        assert (picture["color"] == 0).all() and view.stats()["oocpt:raysTraced"] == 0
        assert "has no pixel in the picture of 40 x 40" in picture.log, picture.log


@pytest.mark.parametrize("scene_index", ["0", "1"], ids=["legacy", "scene_index"])
def test_usdrecord_renders_the_window_of_the_settings(tmp_path, scene_index):
    def record(window):
        scene, out = tmp_path / "scene.usda", tmp_path / "out.exr"
        scene.write_text(stage(window))
        variables = dict(os.environ, USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX=scene_index, OOCPT_VALIDATION="1")
        variables.update({"OOCPT_SAMPLES_PER_PIXEL": "4", "OOCPT_MAX_BOUNCES": "1"})
        variables.pop("PYTHONPATH", None)
        done = subprocess.run(
            ["usdrecord", "--renderer", "OocPT", "--disableGpu", "--camera", "/World/Plain", "-w", str(SIZE),
             str(scene), str(out)],
            env=variables, capture_output=True, text=True, timeout=120, check=False, start_new_session=True,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return exr.read(out), done.stderr

    whole, _ = record("(0, 0, 1, 1)")
    picture, _ = record("(0.2, 0.3, 0.7, 0.6)")
    mask = inside(0.2, 0.3, 0.7, 0.6)
    assert (picture[mask] == whole[mask]).all() and (picture[~mask] == 0).all() and (whole[~mask] != 0).any()
    nothing, said = record("(2, 2, 3, 3)")
    assert (nothing == 0).all() and f"no pixel in the picture of {SIZE} x" in said, said
