# SPDX-License-Identifier: Apache-2.0
"""Edits in a live engine: after each, the picture is bit for bit that of a fresh engine on the edited stage, and
differs from before."""

import pytest

import compare
import small
from host import HostError

pytestmark = pytest.mark.both_front_ends

AOVS = ["color", "depth", "elementId", "instanceId"]
SETTINGS = {"oocpt:samplesPerPixel": 4, "oocpt:maxBounces": 2, "oocpt:seed": 3}
SIZE = (28, 28)

EDITS = {
    "transform": "UsdGeom.Xformable(at('/World/Box')).GetOrderedXformOps()[0].Set(Gf.Vec3d(0.6, 0.5, -0.4))",
    # The camera stays: a world that moves with its camera shows the same picture, bit for bit.
    "parent_transform": "UsdGeom.Xformable(at('/World')).AddTranslateOp().Set(Gf.Vec3d(0.1, -0.2, 0.3))\n"
                        "UsdGeom.Xformable(at('/World/Camera')).SetResetXformStack(True)",
    "points": "points = UsdGeom.Mesh(at('/World/Box')).GetPointsAttr()\n"
              "points.Set(Vt.Vec3fArray([p * 1.3 for p in points.Get()]))",
    "topology": "mesh = UsdGeom.Mesh(at('/World/Box'))\n"
                "mesh.GetFaceVertexCountsAttr().Set([4] * 5)\n"
                "mesh.GetFaceVertexIndicesAttr().Set(list(mesh.GetFaceVertexIndicesAttr().Get())[:20])",
    "prototype_points": "points = UsdGeom.Mesh(at('/World/Pebbles/Ball')).GetPointsAttr()\n"
                        "points.Set(Vt.Vec3fArray([p * 1.5 for p in points.Get()]))",
    "instance_positions": "positions = pebbles.GetPositionsAttr()\n"
                          "positions.Set(Vt.Vec3fArray([p + Gf.Vec3f(0, 0.3, 0) for p in positions.Get()]))",
    "instance_count": "pebbles.GetProtoIndicesAttr().Set([0] * 3)\n"
                      "pebbles.GetPositionsAttr().Set(list(pebbles.GetPositionsAttr().Get())[:3])\n"
                      "pebbles.GetScalesAttr().Set([Gf.Vec3f(0.3)] * 3)",
    "instance_visibility": "pebbles.CreateInvisibleIdsAttr([1, 3])",
    "new_prototype": "UsdGeom.Mesh.Define(stage, '/World/Pebbles/Tri')\n"
                     "mesh = UsdGeom.Mesh(at('/World/Pebbles/Tri'))\n"
                     "mesh.CreatePointsAttr([(-1, -1, 0), (1, -1, 0), (0, 1, 0)])\n"
                     "mesh.CreateFaceVertexCountsAttr([3])\n"
                     "mesh.CreateFaceVertexIndicesAttr([0, 1, 2])\n"
                     "pebbles.GetPrototypesRel().AddTarget('/World/Pebbles/Tri')\n"
                     "pebbles.GetProtoIndicesAttr().Set([0, 1, 0, 1, 0])",
    "light_intensity": "UsdLux.DistantLight(at('/World/Sun')).GetIntensityAttr().Set(9.0)",
    "light_direction": "UsdGeom.Xformable(at('/World/Sun')).AddRotateXOp().Set(25.0)",
    "light_off": "UsdGeom.Imageable(at('/World/Sun')).MakeInvisible()",
    "light_removed": "stage.RemovePrim('/World/Dome')",
    "light_added": "light = UsdLux.DistantLight.Define(stage, '/World/Moon')\n"
                   "light.CreateIntensityAttr(1.0)\n"
                   "light.CreateAngleAttr(0.0)\n"
                   "light.CreateColorAttr(Gf.Vec3f(0.2, 0.3, 1.0))",
    "visibility": "UsdGeom.Imageable(at('/World/Veil')).MakeInvisible()",
    "purpose": "UsdGeom.Imageable(at('/World/Wall')).CreatePurposeAttr('render')",
    "color": "UsdGeom.Mesh(at('/World/Wall')).GetDisplayColorPrimvar().Set([Gf.Vec3f(0.1, 0.9, 0.2)])",
    "opacity": "UsdGeom.Mesh(at('/World/Veil')).GetDisplayOpacityPrimvar().Set([1.0])",
    "camera": "UsdGeom.Xformable(at('/World/Camera')).AddTranslateOp().Set(Gf.Vec3d(0.5, 0.2, -0.3))",
    "lens": "camera = UsdGeom.Camera(at('/World/Camera'))\n"
            "camera.CreateFStopAttr(0.3)\n"
            "camera.CreateFocusDistanceAttr(4.0)",
    "removed": "stage.RemovePrim('/World/Box')",
    "deactivated": "at('/World/Pebbles').SetActive(False)",
    "added": "sphere = UsdGeom.Sphere.Define(stage, '/World/Extra')\n"
             "sphere.CreateRadiusAttr(0.4)\n"
             "sphere.AddTranslateOp().Set(Gf.Vec3d(1, 1, 1.5))",
    "renamed_copy": "Sdf.CopySpec(stage.GetRootLayer(), '/World/Box', stage.GetRootLayer(), '/World/Twin')\n"
                    "UsdGeom.Xformable(at('/World/Twin')).GetOrderedXformOps()[0].Set(Gf.Vec3d(1.2, 0.5, 0))",
}  # fmt: skip

# What the host itself gets wrong: (version, edit, scene-index mode) -> the errors it posts once, without our code being
# involved. The error must come (an unexpected pass fails too, so that the entry goes when the host is mended), and the
# next render must be right.
HOST_FAULTS = {
    # Removal of a PointInstancer; mended in 26.03.
    ((0, 25, 8), "deactivated", True): "UsdImaging_InstanceProxyPathTranslationSceneIndex::_UpdateInstancerLocations",
}


def render_after_edit(view, edit):
    version = tuple(view.edit("result = Usd.GetVersion()"))
    fault = HOST_FAULTS.get((version, edit, view.host.scene_index))
    if fault:
        with pytest.raises(HostError, match=fault):
            view.render()
    return view.render()


PRELUDE = "at = stage.GetPrimAtPath\npebbles = UsdGeom.PointInstancer(at('/World/Pebbles'))\n"


@pytest.fixture(scope="module")
def live(pool):
    """One live view per front end for the whole module: every edit comes on top of the ones before, and is then
    undone."""
    views = {}

    def get(host):
        view = views.get(host.scene_index)
        if view is None or not view.host.alive or view.host is not host:
            view = views[host.scene_index] = host.open(small.FOLDER / "glow.usda", SIZE, settings=SETTINGS, aovs=AOVS)
            view.before = view.render()
        return view

    yield get
    for view in views.values():
        if view.host.alive:
            view.host.call("close", viewer=view.name)


@pytest.mark.parametrize("edit", EDITS)
def test_edit_and_undo(host, live, edit):
    view = live(host)
    view.edit("result = stage.GetRootLayer().ExportToString(); view.saved = result")
    text = view.edit(PRELUDE + EDITS[edit] + "\nresult = stage.GetRootLayer().ExportToString()")
    after = render_after_edit(view, edit)
    changed = any((after[aov] != view.before[aov]).any() for aov in AOVS)
    fresh = host.picture(text, SIZE, settings=SETTINGS, aovs=AOVS)
    view.edit("stage.GetRootLayer().ImportFromString(view.saved)")
    undone = view.render()
    compare.same_picture(after, fresh, f"after the edit `{edit}`")
    assert changed, f"the edit `{edit}` does not show"
    compare.same_picture(undone, view.before, f"after undoing `{edit}`")


def test_several_edits_at_once(host):
    edits = [
        EDITS[name] for name in ("transform", "points", "instance_positions", "light_intensity", "color", "camera")
    ]
    with host.open(small.FOLDER / "glow.usda", SIZE, settings=SETTINGS, aovs=AOVS) as view:
        view.render()
        text = view.edit(PRELUDE + "\n".join(edits) + "\nresult = stage.GetRootLayer().ExportToString()")
        compare.same_picture(view.render(), host.picture(text, SIZE, settings=SETTINGS, aovs=AOVS), "six edits")


def test_an_edit_in_the_middle_of_a_render(host):
    """The picture in progress is thrown away: no sample of the old scene may remain."""
    settings = SETTINGS | {"oocpt:samplesPerPixel": 64}
    with host.open(small.FOLDER / "glow.usda", SIZE, settings=settings, aovs=AOVS) as view:
        text = view.edit(
            PRELUDE
            + "view.prepare()\nview.step()\ntime.sleep(0.05)\nview.step()\n"
            + EDITS["light_intensity"]
            + "\nresult = stage.GetRootLayer().ExportToString()"
        )
        compare.same_picture(
            view.render(), host.picture(text, SIZE, settings=settings, aovs=AOVS), "edited while rendering"
        )


def test_time_samples(host):
    """The frame of the render parameters is what is shown."""
    with host.open(small.FOLDER / "glow.usda", SIZE, settings=SETTINGS, aovs=AOVS) as view:
        view.edit(
            "op = UsdGeom.Xformable(stage.GetPrimAtPath('/World/Box')).GetOrderedXformOps()[0]\n"
            "op.Set(Gf.Vec3d(0, 0.5, 0), 1)\n"
            "op.Set(Gf.Vec3d(1, 0.5, 0), 3)"
        )
        pictures = []
        for frame in (1, 2, 3, 1):
            view.edit(f"view.params.frame = Usd.TimeCode({frame})")
            pictures.append(view.render())
        compare.same_picture(pictures[0], pictures[3], "frame 1 again")
        for a, b in ((0, 1), (1, 2), (0, 2)):
            assert (pictures[a]["depth"] != pictures[b]["depth"]).any(), "frames must differ"
