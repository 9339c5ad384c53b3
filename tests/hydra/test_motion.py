# SPDX-License-Identifier: Apache-2.0
"""Motion through both front ends: the shutter of the camera, samples of transforms and points, velocities, cameras
that move, ribbons and widths that change, against closed forms of coverage; and what turns motion off."""

from __future__ import annotations

import os
import subprocess

import numpy as np
import pytest

import compare
import exr

SIZE = (64, 64)
WIDTH = 2.0
SETTINGS = {"oocpt:samplesPerPixel": 1024, "oocpt:maxBounces": 0}
AT_FIVE = "view.params.frame = Usd.TimeCode(5)"

STAGE = """#usda 1.0
(
    timeCodesPerSecond = 24
    upAxis = "Y"
)
def Xform "World"
{{
    def Camera "Camera"
    {{
        float horizontalAperture = 20
        float verticalAperture = 20
        token projection = "orthographic"
        {shutter}
        {camera}
        uniform token[] xformOpOrder = ["xformOp:translate"]
        float2 clippingRange = (0.1, 100)
    }}
    {content}
}}
{more}
"""
STILL_CAMERA = "double3 xformOp:translate = (0, 0, 10)"
HALF = "double shutter:open = -0.25\n double shutter:close = 0.25"
CARD = """
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-0.2, -0.2, 0), (0.2, -0.2, 0), (0.2, 0.2, 0), (-0.2, 0.2, 0)]
        uniform bool doubleSided = 1
        uniform token subdivisionScheme = "none"
"""
# Two units in two frames: half a unit while the shutter is open for half a frame.
SLIDING = 'def Mesh "Card"\n{' + CARD + """
        double3 xformOp:translate.timeSamples = { 4: (-1, 0.5, 0), 6: (1, 0.5, 0) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
}"""


def stage(shutter=HALF, camera=STILL_CAMERA, content=SLIDING, more=""):
    return STAGE.format(shutter=shutter, camera=camera, content=content, more=more)


def coverage(host, text, edit=AT_FIVE):
    """Alpha of every pixel at frame 5, and what the host said."""
    with host.open(text, SIZE, settings=SETTINGS) as view:
        view.edit(edit)
        picture = view.render()
    return picture["color"][..., 3].astype(np.float64), picture.log


def streak(center, way, half, times=256):
    """Coverage of a square that moves by `way` about `center`."""
    edges = np.arange(SIZE[0] + 1) / SIZE[0] * WIDTH - WIDTH / 2

    def share(middle, half):
        low, high = np.maximum(edges[:-1], middle - half), np.minimum(edges[1:], middle + half)
        return np.maximum(high - low, 0) / (edges[1] - edges[0])

    sum_ = np.zeros(SIZE[::-1])
    for part in (np.arange(times) + 0.5) / times - 0.5:
        sum_ += np.outer(share(center[1] + part * way[1], half), share(center[0] + part * way[0], half))
    return sum_ / times


def agree(met, known, what):
    assert known.max() > 0.1, what
    off = np.abs(met - known)
    assert off.max() < 0.04 and off.mean() < 0.003, f"{what}: {off.max()} at most, {off.mean()} in the mean"


def test_transform_samples_leave_a_streak_of_known_coverage(host):
    met, log = coverage(host, stage())
    agree(met, streak((0, 0.5), (0.5, 0), 0.2), "a card")
    assert "OocPT" not in log, log


def test_many_motion_samples_are_thinned(host):
    dense = ", ".join(f"{4 + 2 * i / 2000}: ({-1 + 2 * i / 2000}, 0.5, 0)" for i in range(2001))
    met, log = coverage(host, stage(content=SLIDING.replace("4: (-1, 0.5, 0), 6: (1, 0.5, 0)", dense)))
    agree(met, streak((0, 0.5), (0.5, 0), 0.2), "a card")
    assert "OocPT" not in log, log


def test_instances_move_by_their_velocities_and_with_their_instancer(host):
    content = """
    def PointInstancer "Row"
    {
        int[] protoIndices = [0, 0]
        point3f[] positions = [(-0.5, -0.3, 0), (0.5, 0.3, 0)]
        vector3f[] velocities = [(0, -24, 0), (24, 0, 0)]
        rel prototypes = </World/Row/Proto>
        def Mesh "Proto"
        {""" + CARD + """
        }
    }"""
    met, log = coverage(host, stage(content=content))
    agree(met, streak((-0.5, -0.3), (0, -0.5), 0.2) + streak((0.5, 0.3), (0.5, 0), 0.2), "velocities")
    assert "OocPT" not in log, log
    moved = content.replace("vector3f[] velocities = [(0, -24, 0), (24, 0, 0)]", """
        double3 xformOp:translate.timeSamples = { 4: (0, -1, 0), 6: (0, 1, 0) }
        uniform token[] xformOpOrder = ["xformOp:translate"]""")
    met, log = coverage(host, stage(content=moved))
    agree(met, streak((-0.5, -0.3), (0, 0.5), 0.2) + streak((0.5, 0.3), (0, 0.5), 0.2), "an instancer")
    sampled = content.replace("vector3f[] velocities = [(0, -24, 0), (24, 0, 0)]", "").replace(
        "point3f[] positions = [(-0.5, -0.3, 0), (0.5, 0.3, 0)]",
        "point3f[] positions.timeSamples = {\n 4: [(-1.5, -0.3, 0), (0.5, -0.7, 0)],\n"
        " 6: [(0.5, -0.3, 0), (0.5, 1.3, 0)]\n}",
    )
    met, log = coverage(host, stage(content=sampled))
    agree(met, streak((-0.5, -0.3), (0.5, 0), 0.2) + streak((0.5, 0.3), (0, 0.5), 0.2), "samples of positions")


def test_a_moving_camera_blurs_static_objects(host):
    content = 'def Mesh "Card"\n{' + CARD + "}"
    camera = "double3 xformOp:translate.timeSamples = { 4: (-1, 0, 10), 6: (1, 0, 10) }"
    met, log = coverage(host, stage(camera=camera, content=content))
    agree(met, streak((0, 0), (-0.5, 0), 0.2), "a camera")
    assert "OocPT" not in log, log


def vectors(host, text):
    """The image `motion` at frame 5, where something is seen, and what the host said."""
    aovs = ["color", "motion", "primId"]
    with host.open(text, SIZE, aovs=aovs, settings={"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0}) as view:
        view.edit(AT_FIVE)
        picture = view.render()
    met = picture["primId"] >= 0
    assert 100 < met.sum() < 1000, met.sum()
    compare.near(picture["motion"][~met], 0.0, 0.0, "nothing is seen")
    return picture["motion"][met], [line for line in picture.log.splitlines() if "OocPT" in line]


def test_motion_vectors_are_pixels_from_the_shutters_opening_to_its_closing(host):
    """A quarter of the picture to the right; a camera that does the same; nothing, and a word, without a shutter."""
    motion, log = vectors(host, stage())
    compare.near(motion, np.broadcast_to([16.0, 0.0, 0.0], motion.shape), 1e-3, "a card")
    assert not log, log
    still = 'def Mesh "Card"\n{' + CARD + "}"
    camera = "double3 xformOp:translate.timeSamples = { 4: (-1, -1, 11), 6: (1, 1, 9) }"
    motion, log = vectors(host, stage(camera=camera, content=still))
    compare.near(motion, np.broadcast_to([-16.0, -16.0, -0.5], motion.shape), 1e-3, "a camera")
    assert not log, log
    motion, log = vectors(host, stage(shutter=""))
    compare.near(motion, 0.0, 0.0, "no shutter")
    assert len(log) == 1 and "/World/Camera: its shutter is not open" in log[0], log


def test_a_shutter_that_is_shut_blurs_nothing_and_opens_in_a_live_view(host):
    with host.open(stage(shutter=""), SIZE, settings=SETTINGS) as view:
        view.edit(AT_FIVE)
        sharp = view.render()["color"].copy()
        agree(sharp[..., 3], streak((0, 0.5), (0, 0), 0.2), "cameras are instant by default")
        view.edit("camera = UsdGeom.Camera.Get(stage, '/World/Camera')\n"
                  "camera.CreateShutterOpenAttr(-0.25); camera.CreateShutterCloseAttr(0.25)")
        agree(view.render()["color"][..., 3], streak((0, 0.5), (0.5, 0), 0.2), "opened")
        view.edit("camera = UsdGeom.Camera.Get(stage, '/World/Camera'); camera.GetShutterCloseAttr().Set(-0.25)")
        compare.same_bits(view.render()["color"], sharp, "closed again")


def test_a_shutter_that_closes_before_it_opens_is_one_warning(host):
    met, log = coverage(host, stage(shutter="double shutter:open = 0.5\n double shutter:close = -0.5"))
    agree(met, streak((0, 0.5), (0, 0), 0.2), "as if it were shut")
    assert log.count("closes before it opens") == 1 and "/World/Camera" in log, log


def test_render_settings_turn_motion_off(host):
    name = "disableMotionBlur"
    more = 'def RenderSettings "Settings"\n{{\n    rel camera = </World/Camera>\n    {}\n}}\n'
    chosen = 'engine.SetActiveRenderSettingsPrimPath(Sdf.Path("/Settings"))\n' + AT_FIVE
    on = stage(more=more.format("rel products = </Settings/Product>\n"
                                'def RenderProduct "Product"\n{\n token productType = "raster"\n}\n'))
    agree(coverage(host, on, chosen)[0], streak((0, 0.5), (0.5, 0), 0.2), "settings that say nothing")
    off = stage(more=more.format(f"uniform bool {name} = 1\n rel products = </Settings/Product>\n"
                                 'def RenderProduct "Product"\n{\n token productType = "raster"\n}\n'))
    agree(coverage(host, off, chosen)[0], streak((0, 0.5), (0, 0), 0.2), f"{name} of the prim")
    # UsdImaging 25.08 hands instantaneousShutter, which it deprecates, to nobody.
    for name in ("disableMotionBlur", "instantaneousShutter"):
        by_host = AT_FIVE + f"\nengine.SetRendererSetting('{name}', True)"
        agree(coverage(host, stage(), by_host)[0], streak((0, 0.5), (0, 0), 0.2), f"{name} of the host")


POINTS = "point3f[] points = [(-0.2, -0.2, 0), (0.2, -0.2, 0), (0.2, 0.2, 0), (-0.2, 0.2, 0)]"


def soft(samples, more=""):
    """A card whose points have samples by frame: how far they are from the card's, two values for left and right."""
    def points(left, right):
        return f"[({left - 0.2}, -0.2, 0), ({right + 0.2}, -0.2, 0), ({right + 0.2}, 0.2, 0), ({left - 0.2}, 0.2, 0)]"

    text = ", ".join(f"{frame}: {points(*ends)}" for frame, ends in samples.items())
    return 'def Mesh "Soft"\n{' + CARD.replace(POINTS, f"point3f[] points.timeSamples = {{ {text} }}") + more + "}\n"


def edges(left, right, times=256):
    """Coverage of a card from `left(part)` to `right(part)`, about y = 0."""
    sides = np.arange(SIZE[0] + 1) / SIZE[0] * WIDTH - WIDTH / 2

    def share(low, high):
        covered = np.minimum(sides[1:], high) - np.maximum(sides[:-1], low)
        return np.maximum(covered, 0) / (sides[1] - sides[0])

    parts = (np.arange(times) + 0.5) / times
    return sum(np.outer(share(-0.2, 0.2), share(left(part), right(part))) for part in parts) / times


def test_points_of_meshes_move_by_samples(host):
    # The shutter is open from frame 4.75 to 5.25: from 3/8 to 5/8 of the way.
    met, log = coverage(host, stage(content=soft({4: (0, 0), 6: (-0.4, 0.8)})))
    assert "shutter" not in log, log
    agree(met, edges(lambda part: -0.2 - 0.4 * (0.375 + 0.25 * part), lambda part: 0.2 + 0.8 * (0.375 + 0.25 * part)),
          "two samples")
    met, _ = coverage(host, stage(content=soft({4: (0, 0), 5: (0, 0), 5.5: (0, 1)})))
    agree(met, edges(lambda part: -0.2, lambda part: 0.2 + 0.5 * max(2 * part - 1, 0)), "a sample inside the shutter")
    met, _ = coverage(host, stage(shutter="", content=soft({4: (0, 0), 6: (-0.4, 0.8)})))
    agree(met, edges(lambda part: -0.4, lambda part: 0.6), "a shutter that is shut")


def test_points_of_meshes_move_by_velocities(host):
    # 24 frames a second: half a frame at 38.4 units a second is 0.8 units.
    rates = "vector3f[] velocities = [(0, 0, 0), (38.4, 0, 0), (38.4, 0, 0), (0, 0, 0)]\n"
    content = 'def Mesh "Soft"\n{' + CARD + rates + "}\n"
    met, log = coverage(host, stage(content=content))
    assert "shutter" not in log, log
    agree(met, edges(lambda part: -0.2, lambda part: 0.2 + 0.8 * (part - 0.5)), "velocities")


def test_motion_that_cannot_be_used_is_one_warning_with_its_prim(host):
    uneven = soft({4: (0, 0), 6: (0, 1)}).replace("6: [", "6: [(0, 0, 0), ")
    met, log = coverage(host, stage(content=uneven))
    said = [line for line in log.splitlines() if "numbers of points" in line]
    assert len(said) == 1 and "/World/Soft" in said[0], log
    content = 'def Mesh "Soft"\n{' + CARD + "vector3f[] velocities = [(9, 0, 0)]\n}\n"
    met, log = coverage(host, stage(content=content))
    said = [line for line in log.splitlines() if "for each point" in line]
    assert len(said) == 1 and "/World/Soft" in said[0], log
    agree(met, edges(lambda part: -0.2, lambda part: 0.2), "as at the frame's own time")


def test_lights_that_move_leave_a_streak(host):
    """A lamp that the camera sees, and no word about it."""
    content = """
    def RectLight "Lamp"
    {
        float inputs:width = 0.4
        float inputs:height = 0.4
        double3 xformOp:translate.timeSamples = { 4: (-1, 0.5, 0), 6: (1, 0.5, 0) }
        float xformOp:rotateY = 180
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]
    }"""
    met, log = coverage(host, stage(content=content))
    agree(met, streak((0, 0.5), (0.5, 0), 0.2), "a lamp")
    assert "OocPT" not in log, log
    met, log = coverage(host, stage(shutter="", content=content))
    agree(met, streak((0, 0.5), (0, 0), 0.2), "a lamp without a shutter")
    assert "OocPT" not in log, log


def test_lights_of_prototypes_move_with_their_instances(host):
    content = """
    def PointInstancer "Row"
    {
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 0.5, 0), (0.2, -0.5, 0)]
        vector3f[] velocities = [(24, 0, 0), (0, 12, 0)]
        rel prototypes = </World/Row/Proto>
        def Xform "Proto"
        {
            def RectLight "Lamp"
            {
                float inputs:width = 0.4
                float inputs:height = 0.4
                float xformOp:rotateY = 180
                uniform token[] xformOpOrder = ["xformOp:rotateY"]
            }
        }
    }"""
    met, log = coverage(host, stage(content=content))
    assert "OocPT" not in log, log
    agree(met, streak((0, 0.5), (0.5, 0), 0.2) + streak((0.2, -0.5), (0, 0.25), 0.2), "velocities")
    met, log = coverage(host, stage(shutter="", content=content))
    assert "OocPT" not in log, log
    agree(met, streak((0, 0.5), (0, 0), 0.2) + streak((0.2, -0.5), (0, 0), 0.2), "without a shutter")


def blade(points, widths, normals):
    """A linear curve along y, a ribbon across its normals; text behind the attributes' names."""
    return f"""
    def BasisCurves "Blade"
    {{
        uniform token type = "linear"
        int[] curveVertexCounts = [2]
        point3f[] points{points}
        float[] widths (interpolation = "constant")
        float[] widths{widths}
        normal3f[] normals (interpolation = "constant")
        normal3f[] normals{normals}
    }}"""


STILL = " = [(0, -0.2, 0), (0, 0.2, 0)]"
FRONT = " = [(0, 0, 1)]"


def test_ribbons_move_by_samples_and_velocities(host):
    # Ends of ribbons are straight: a card of 0.4 by 0.4.
    sliding = ".timeSamples = { 4: [(-1, -0.2, 0), (-1, 0.2, 0)], 6: [(1, -0.2, 0), (1, 0.2, 0)] }"
    met, log = coverage(host, stage(content=blade(sliding, " = [0.4]", FRONT)))
    assert "OocPT" not in log, log
    agree(met, streak((0, 0), (0.5, 0), 0.2), "samples")
    rates = FRONT + "\n        vector3f[] velocities = [(24, 0, 0), (24, 0, 0)]"
    met, log = coverage(host, stage(content=blade(STILL, " = [0.4]", rates)))
    assert "OocPT" not in log, log
    agree(met, streak((0, 0), (0.5, 0), 0.2), "velocities")


def test_widths_and_normals_change_though_points_rest(host):
    wider = ".timeSamples = { 4: [0.4], 6: [2.0] }"
    met, log = coverage(host, stage(content=blade(STILL, wider, FRONT)))
    assert "OocPT" not in log, log

    def half(part):  # the shutter is open from 3/8 to 5/8 of the way
        return 0.2 + 0.8 * (0.375 + 0.25 * part)

    agree(met, edges(lambda part: -half(part), half), "a ribbon that widens")
    turning = ".timeSamples = { 4.75: [(0, 0, 1)], 5.25: [(1, 0, 0)] }"
    met, log = coverage(host, stage(content=blade(STILL, " = [1.6]", turning)))
    assert "OocPT" not in log, log
    # Its edges go straight to where they are behind one another.
    agree(met, edges(lambda part: -0.8 * (1 - part), lambda part: 0.8 * (1 - part)), "a ribbon that turns")
    grows = """
    def Points "Ball"
    {
        point3f[] points = [(0, 0, 0)]
        float[] widths.timeSamples = { 4.75: [0.2], 5.25: [1.6] }
    }"""
    met, log = coverage(host, stage(content=grows))
    assert "OocPT" not in log, log
    x = ((np.arange(4 * SIZE[0]) + 0.5) / (4 * SIZE[0]) - 0.5) * WIDTH
    away = np.hypot(*np.meshgrid(x, x))
    fine = np.clip((0.8 - away) / 0.7, 0, 1)
    agree(met, fine.reshape(SIZE[0], 4, SIZE[1], 4).mean(axis=(1, 3)), "a ball that grows")


@pytest.mark.parametrize("scene_index", ["0", "1"], ids=["legacy", "scene_index"])
def test_usdrecord_blurs_by_the_cameras_shutter(tmp_path, scene_index):
    environment = dict(os.environ, USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX=scene_index,
                       OOCPT_SAMPLES_PER_PIXEL="1024", OOCPT_MAX_BOUNCES="0")
    environment.pop("PYTHONPATH", None)
    for name, shutter, way in (("open", HALF, 0.5), ("default", "", 0.0)):
        (tmp_path / f"{name}.usda").write_text(stage(shutter=shutter))
        command = ["usdrecord", "--renderer", "OocPT", "--disableGpu", "--disableCameraLight", "--frames", "5",
                   "--camera", "/World/Camera", "--imageWidth", str(SIZE[0]), str(tmp_path / f"{name}.usda"),
                   str(tmp_path / f"{name}.#.exr")]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=120, check=False, start_new_session=True
        )
        assert done.returncode == 0, done.stderr
        picture = exr.read(tmp_path / f"{name}.5.exr")
        agree(picture[..., 3], streak((0, 0.5), (way, 0), 0.2), name)
