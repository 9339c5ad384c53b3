# SPDX-License-Identifier: Apache-2.0
"""Whatever comes in: one clear message with the prim's path, nothing else lost, the host lives.

Not here: instancers that hold each other. UsdImaging 25.08 itself recurses without end over them, in both front ends,
before a delegate sees anything; the scene database's own tests cover cycles.
"""

import re

import numpy as np
import pytest

import compare
import small
from host import HostError

pytestmark = pytest.mark.both_front_ends

QUICK = {"oocpt:samplesPerPixel": 2, "oocpt:maxBounces": 1}
GOOD = small.FOLDER / "furnace.usda"


def still_works(host):
    """The host renders a good scene afterwards, exactly."""
    assert host.alive
    compare.near(
        host.picture(GOOD, (8, 8), camera="/World/Perspective", settings=QUICK)["color"], 1.0, 1e-3, "afterwards"
    )


def warnings_about(log: str, path: str) -> list[str]:
    return [line for line in log.splitlines() if re.search(re.escape(path) + r"(?![\w/])", line)]


@pytest.fixture(scope="module")
def bad(pool):
    """The picture of the scene of faults, by front end."""
    made = {}

    def get(host):
        if host.scene_index not in made:
            with host.open(
                small.FOLDER / "bad_data.usda", (48, 48), aovs=["color", "primId", "cameraDepth"], settings=QUICK
            ) as view:
                picture = view.render()
                ids = sorted(set(picture["primId"].ravel()) - {-1})
                paths = {number: answer["prim"] for number, answer in zip(ids, view.decode([(i, 0) for i in ids]))}
                made[host.scene_index] = (picture, paths, view.stats())
        return made[host.scene_index]

    return get


@pytest.mark.parametrize("name", sorted(small.BAD_PRIMS))
def test_each_fault_is_reported_with_its_path(host, bad, name):
    picture, _, _ = bad(host)
    lines = warnings_about(picture.log, f"/World/{name}")
    assert lines, f"no warning names /World/{name}"
    assert len(lines) <= 2, "one message per prim, not one per element:\n" + "\n".join(lines)


def test_good_prims_beside_bad_ones_are_seen(host, bad):
    picture, paths, stats = bad(host)
    assert np.isfinite(picture["color"]).all() and np.isfinite(picture["cameraDepth"]).all()
    assert paths[int(picture["primId"][24, 24])] == "/World/Good"
    assert not warnings_about(picture.log, "/World/Good"), "no warning about what is good"
    # Good parts of prims with a fault in something else stay: the second instance, the mesh with a hole out of range.
    assert {"/World/Swarm/Quad", "/World/HoleOutOfRange"} <= set(paths.values()), sorted(paths.values())
    assert stats["oocpt:dropped"] >= len(small.BAD_PRIMS) - 3, stats
    assert stats["oocpt:droppedData"], stats


def test_warnings_come_once(host):
    """A second render of the same scene does not repeat them."""
    with host.open(small.FOLDER / "bad_data.usda", (16, 16), settings=QUICK) as view:
        assert warnings_about(view.render().log, "/World/NanPoint")
        view.edit("engine.SetRendererSetting('oocpt:seed', 5)")
        assert not warnings_about(view.render().log, "/World/NanPoint")


@pytest.mark.parametrize(
    "code",
    [
        "camera.GetHorizontalApertureAttr().Set(0.0); camera.GetVerticalApertureAttr().Set(0.0)",
        "camera.GetFocalLengthAttr().Set(float('nan'))",
        "camera.GetClippingRangeAttr().Set(Gf.Vec2f(5.0, 5.0))",
        "UsdGeom.Xformable(camera).ClearXformOpOrder(); UsdGeom.Xformable(camera).AddScaleOp().Set(Gf.Vec3f(0, 0, 0))",
        "camera.CreateFStopAttr(float('nan')); camera.CreateFocusDistanceAttr(-1.0)",
    ],
    ids=["aperture", "focal_length", "clipping", "transform", "lens"],
)
def test_broken_cameras(host, code):
    """A picture without camera may be empty, or an error; never a crash, a hang or a NaN."""
    with host.open(GOOD, (8, 8), camera="/World/Perspective", settings=QUICK) as view:
        view.edit(f"camera = UsdGeom.Camera(stage.GetPrimAtPath('/World/Perspective'))\n{code}")
        try:
            assert np.isfinite(view.render(20).arrays.get("color", np.zeros(1))).all()
        except HostError as error:
            assert "not converged" not in str(error), "a camera that cannot be used must not leave the host waiting"
    still_works(host)


def test_a_missing_camera_prim(host):
    with host.open(GOOD, (8, 8), camera="/World/NoSuchCamera", settings=QUICK) as view:
        try:
            view.render(20)
        except HostError as error:
            assert "not converged" not in str(error)
    still_works(host)


@pytest.mark.parametrize(
    "size", [(100_000, 100_000), (1 << 30, 1), (0, 0), (16, 0), (-5, 16)], ids=lambda size: f"{size[0]}x{size[1]}"
)
def test_absurd_sizes(host, size):
    """Too large: an error that says so. Empty: nothing, at once."""
    with host.open(GOOD, size, camera="/World/Perspective", settings=QUICK) as view:
        if min(size) > 1000 or max(size) > 1 << 20:
            with pytest.raises(HostError) as raised:
                view.render(30)
            assert re.search(r"(?i)memory|size|large|pixels", str(raised.value)) and "not converged" not in str(
                raised.value
            ), str(raised.value)
        else:
            try:
                view.render(20)
            except HostError as error:
                assert "not converged" not in str(error)
    still_works(host)


@pytest.mark.parametrize(
    "key, value",
    [
        ("oocpt:samplesPerPixel", "'many'"), ("oocpt:samplesPerPixel", "-3"), ("oocpt:samplesPerPixel", "1 << 40"),
        ("oocpt:maxBounces", "1.5"), ("oocpt:clamp", "float('nan')"), ("oocpt:noSuchThing", "1"),
    ]
)  # fmt: skip
def test_bad_settings_are_refused_with_their_name_and_change_nothing(host, key, value):
    with host.open(small.FOLDER / "glow.usda", (12, 12), settings=QUICK) as view:
        before = view.render()
        view.edit(f"engine.SetRendererSetting({key!r}, {value})")
        after = view.render()
        compare.same_picture(after, before, f"{key} = {value}")
        assert key in after.log, f"no word about {key}: {after.log!r}"


def test_bad_environment_is_reported_and_ignored(fresh_host):
    """All in one process, each with a line of its own: a process costs more than what is asked of it."""
    bad = {"OOCPT_SAMPLES_PER_PIXEL": "lots", "OOCPT_MAX_BOUNCES": "-1", "OOCPT_CLAMP": "nan"}
    host = fresh_host(**bad)
    with host.open(GOOD, (8, 8), camera="/World/Perspective") as view:
        view.edit("engine.SetRendererSetting('oocpt:samplesPerPixel', 2)")
        picture = view.render()
    compare.near(picture["color"], 1.0, 1e-3, "furnace")
    for name, value in bad.items():
        assert any(
            name in line and value in line for line in picture.log.splitlines()
        ), f"no word of {name}: {picture.log}"


def test_unknown_device_is_an_error_that_names_it(fresh_host):
    host = fresh_host(OOCPT_DEVICE="no such device")
    with pytest.raises(HostError, match="no such device") as raised:
        host.picture(GOOD, (8, 8), camera="/World/Perspective", timeout=30)
    assert host.alive and "not converged" not in str(raised.value)


def test_a_budget_too_small_is_one_clear_error(host):
    with host.open(small.FOLDER / "glow.usda", (64, 64), settings=QUICK | {"oocpt:memoryBudget": 1}) as view:
        with pytest.raises(HostError, match="(?i)memory|budget") as raised:
            view.render(30)
        assert "not converged" not in str(raised.value)
    still_works(host)


def test_other_input_that_must_not_matter(host):
    """Prims of other kinds, unknown types, empty instancers, materials: rendered without, or around, them."""
    text = (
        GOOD.read_text()
        + 'def Xform "Other" {\n'
        '  def NurbsCurves "Curve" { int[] curveVertexCounts = [4]; int[] order = [4]; point3f[] points = [(900,0,0),'
        ' (901,0,0), (901,1,0), (900,1,0)]; double[] knots = [0, 0, 0, 0, 1, 1, 1, 1]; float[] widths = [1]; }\n'
        '  def BasisCurves "NoPoints" { int[] curveVertexCounts = [4]; }\n'
        '  def Points "NoPlace" { float[] widths = [1]; }\n'
        '  def PointInstancer "Empty" { int[] protoIndices = []; point3f[] positions = []; }\n'
        '  def PointInstancer "Dangling" { rel prototypes = </No/Such/Prim>; int[] protoIndices = [0, 0]; point3f[]'
        ' positions = [(0,0,0), (1,1,1)]; }\n'
        '  def Volume "Volume" {}\n'
        '  def NoSuchType "Strange" {}\n'
        '  def Mesh "NoAttributes" {}\n'
        '  def RectLight "Rect" { float inputs:intensity = 0; }\n'
        '  def Material "Material" { token outputs:surface.connect = </Other/Material/S.outputs:surface>\n'
        '    def Shader "S" {\n'
        ' uniform token info:id = "UsdPreviewSurface"\n'
        ' token outputs:surface\n'
        ' }\n'
        '  }\n'
        '}\n'
    )
    picture = host.picture(text, (12, 12), camera="/World/Perspective", settings=QUICK)
    compare.near(picture["color"], 1.0, 1e-3, "furnace with strangers")
    still_works(host)


def test_a_material_for_other_renderers_gives_a_warning(host, tmp_path):
    """Legacy front ends leave such materials out, so that the line is about the mesh; the new one hands over a material
    without nodes."""
    scene = tmp_path / "mdl.usda"
    scene.write_text(
        '#usda 1.0\ndef Sphere "Ball" ( prepend apiSchemas = ["MaterialBindingAPI"] )\n'
        '{\n    rel material:binding = </Mdl>\n}\n'
        'def Material "Mdl"\n{\n    token outputs:mdl:surface.connect = </Mdl/Shader.outputs:out>\n'
        '    def Shader "Shader"\n    {\n        uniform token info:implementationSource = "sourceAsset"\n'
        "        uniform asset info:mdl:sourceAsset = @OmniPBR.mdl@\n        token outputs:out\n    }\n}\n"
    )
    with host.open(scene, (8, 8), settings=QUICK) as view:
        lines = [line for line in view.render().log.splitlines() if "OocPT" in line]
    assert len(lines) == 1 and "/Mdl" in lines[0], lines
    assert "no surface that is read (UsdPreviewSurface or MaterialX)" in lines[0], lines
