# SPDX-License-Identifier: Apache-2.0
"""What is made of a USD file for Mitsuba, and what the bench says of it. Mitsuba is not needed."""

import json
import math
import pathlib
import sys
import types

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "scenes")]

import beside
import exr_pixels
import images
import mitsuba_materials
import mitsuba_process
import mitsuba_scene
import shading
from mitsuba_materials import Notes

QUAD = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
JOB = {"camera": "main_cam", "width": 32, "height": 18, "bounces": 5, "triangles": 1000, "instances": 1000}


def quad(stage, path, material=None, st="vertex"):
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(QUAD)
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    mesh.CreateSubdivisionSchemeAttr("none")
    shading.coordinates(mesh, [(0, 0), (1, 0), (1, 1), (0, 1)], st)
    if material:
        shading.bind(mesh, material)
    return mesh


@pytest.fixture
def stage():
    made = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(made, "Y")
    camera = UsdGeom.Camera.Define(made, "/World/main_cam")
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 0, 10))
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(20.25)
    camera.CreateFocalLengthAttr(20.25)
    return made


def made_of(stage, folder, **changes):
    said = mitsuba_scene.translate(stage, folder, {**JOB, **changes})
    return json.loads((folder / "scene.json").read_text()), said


def of_type(scene, kind):
    return [entry for entry in scene.values() if isinstance(entry, dict) and entry.get("type") == kind]


def ply(path):
    """(points with what else there is, faces)."""
    head, _, data = path.read_bytes().partition(b"end_header\n")
    words = head.decode().split()
    count, faces = (int(words[words.index(name) + 1]) for name in ("vertex", "face"))
    width = words.count("float")
    values = np.frombuffer(data, "<f4", count * width).reshape(count, width)
    listed = np.frombuffer(data, np.dtype([("n", "u1"), ("at", "<i4", 3)]), faces, values.nbytes)
    assert (listed["n"] == 3).all() and len(data) == values.nbytes + listed.nbytes
    return values, listed["at"]


def test_a_mesh_in_one_place_is_a_shape_of_the_world(stage, tmp_path):
    quad(stage, "/World/Quad").AddTranslateOp().Set(Gf.Vec3d(1, 2, 3))
    scene, said = made_of(stage, tmp_path)
    (shape,) = of_type(scene, "ply")
    assert np.array(shape["to_world"]["matrix"])[:3, 3].tolist() == [1, 2, 3] and shape["face_normals"] is True
    values, faces = ply(tmp_path / shape["filename"])
    assert values[:, :3].tolist() == [list(map(float, point)) for point in QUAD]
    assert values[:, 3:].tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert (said["triangles"], said["flattened"], said["instances"], said["left_out"]) == (2, 2, 0, [])
    assert scene["integrator"] == {"type": "path", "max_depth": 7, "rr_depth": 5}


def test_coordinates_of_corners_have_points_of_their_own(stage, tmp_path):
    mesh = UsdGeom.Mesh.Define(stage, "/World/Two")
    mesh.CreatePointsAttr([*QUAD, (3, 0, 0)])
    mesh.CreateFaceVertexCountsAttr([4, 3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3, 1, 4, 2])
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreateOrientationAttr("leftHanded")
    shading.coordinates(mesh, [(number, 0) for number in range(7)], "faceVarying")
    scene, said = made_of(stage, tmp_path)
    values, faces = ply(tmp_path / of_type(scene, "ply")[0]["filename"])
    assert said["triangles"] == 3 and len(values) == 9
    # Triangles first, as they have fewer corners; turned round for the left hand.
    assert values[faces][..., 3].tolist() == [[6, 5, 4], [2, 1, 0], [3, 2, 0]]


def test_nested_instances_are_one_level(stage, tmp_path):
    """An instancer of two places of a group that holds an instancer of three, in a turned and scaled world."""
    UsdGeom.Xform.Define(stage, "/World").AddScaleOp().Set(Gf.Vec3f(2))
    outer = UsdGeom.PointInstancer.Define(stage, "/World/Outer")
    inner = UsdGeom.PointInstancer.Define(stage, "/World/Outer/Group/Inner")
    UsdGeom.Xform.Define(stage, "/World/Outer/Group").AddTranslateOp().Set(Gf.Vec3d(0, 5, 0))
    quad(stage, "/World/Outer/Group/Inner/Leaf").AddTranslateOp().Set(Gf.Vec3d(0, 0, 7))
    outer.CreatePrototypesRel().SetTargets([Sdf.Path("/World/Outer/Group")])
    inner.CreatePrototypesRel().SetTargets([Sdf.Path("/World/Outer/Group/Inner/Leaf")])
    outer.CreateProtoIndicesAttr([0, 0])
    outer.CreatePositionsAttr([(0, 0, 0), (100, 0, 0)])
    inner.CreateProtoIndicesAttr([0, 0, 0, 0])
    inner.CreatePositionsAttr([(0, 0, 0), (10, 0, 0), (20, 0, 0), (30, 0, 0)])
    inner.CreateInvisibleIdsAttr([1])
    scene, said = made_of(stage, tmp_path)
    (group,) = of_type(scene, "shapegroup")
    assert list(group) == ["type", "shape0"] and "to_world" not in group["shape0"]
    (entry,) = [value for value in scene.values() if isinstance(value, dict) and "places" in value]
    places = np.load(tmp_path / entry["places"])
    assert sorted(places[:, 0, 3]) == [0, 40, 60, 200, 240, 260], "all but the one that is invisible"
    assert (places[:, 1, 3] == 10).all() and (places[:, 2, 3] == 14).all() and (places[:, 0, 0] == 2).all()
    assert (said["triangles"], said["flattened"], said["instances"], said["groups"]) == (2, 12, 6, 1)


def test_native_instances_share_a_group_unless_they_are_bound_apart(stage, tmp_path):
    quad(stage, "/Model/Quad")
    stage.GetPrimAtPath("/Model").SetSpecifier(Sdf.SpecifierClass)
    looks = [shading.material(stage, f"/World/Looks/L{number}", roughness=0.1 * (number + 1)) for number in range(2)]
    for number in range(4):
        made = UsdGeom.Xform.Define(stage, f"/World/I{number}")
        made.GetPrim().GetReferences().AddInternalReference("/Model")
        made.GetPrim().SetInstanceable(True)
        shading.bind(made, looks[number // 2])
    scene, said = made_of(stage, tmp_path)
    groups = of_type(scene, "shapegroup")
    assert len(groups) == 2 and said["instances"] == 4
    roughness = [scene[group["shape0"]["bsdf"]["id"]]["bsdf"]["roughness"]["value"] for group in groups]
    assert roughness == pytest.approx([0.1, 0.2])


def test_what_is_not_shown_is_not_there(stage, tmp_path):
    quad(stage, "/World/Hidden").CreateVisibilityAttr("invisible")
    quad(stage, "/World/Guide").CreatePurposeAttr("guide")
    quad(stage, "/World/Render").CreatePurposeAttr("render")
    quad(stage, "/World/Proxy").CreatePurposeAttr("proxy")
    scene, _ = made_of(stage, tmp_path)
    assert len(of_type(scene, "ply")) == 1


@pytest.mark.parametrize(("limit", "reason"), [("triangles", "more than 1 triangles"), ("instances", "1 instances, m")])
def test_a_scene_above_a_limit_is_refused(stage, tmp_path, limit, reason):
    quad(stage, "/World/Quad")
    quad(stage, "/World/Other")
    with pytest.raises(mitsuba_scene.TooLarge, match=reason.replace("1 instances, m", "instances in one level")):
        made_of(stage, tmp_path, **{limit: 1})


def test_subsets_have_materials_of_their_own(stage, tmp_path):
    mesh = quad(stage, "/World/Quad", shading.material(stage, "/World/Looks/A", roughness=0.25))
    mesh.CreateFaceVertexCountsAttr([3, 3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 0, 2, 3])
    shading.subset(mesh, "Part", [1], shading.material(stage, "/World/Looks/B", roughness=0.75))
    scene, _ = made_of(stage, tmp_path)
    found = {scene[one["bsdf"]["id"]]["bsdf"]["roughness"]["value"]: one["filename"] for one in of_type(scene, "ply")}
    assert sorted(found) == [0.25, 0.75]
    values, faces = ply(tmp_path / found[0.75])
    assert values[faces[0], :2].tolist() == [[-1, -1], [1, 1], [-1, 1]] and len(values) == 3


def test_a_texture_with_a_threshold_is_a_mask_and_rays_go_through_it(stage, tmp_path):
    images.png(tmp_path / "leaf.png", np.full((2, 2, 4), 200, np.uint8))
    stage.GetRootLayer().Export(str(tmp_path / "a.usda"))
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))
    moved = shading.transform2d(stage, "/World/Looks/Leaf/Moved", shading.primvar(stage, "/World/Looks/Leaf/St", "st"),
        (2, 3), 90.0, (0.5, 0.25))  # fmt: skip
    cut = lambda output: shading.sample(stage, "/World/Looks/Leaf/Cut", "./leaf.png", output, moved, scale=(1, 1, 1, 2))
    leaf = shading.material(
        stage, "/World/Looks/Leaf", diffuseColor=cut("rgb"), opacity=cut("a"), opacityThreshold=0.5, metallic=0.25
    )
    quad(stage, "/World/Quad", leaf)
    scene, _ = made_of(stage, tmp_path)
    assert scene["integrator"]["type"] == "volpath"
    (mask,) = of_type(scene, "mask")
    file = [[str(tmp_path / "leaf.png"), 0, 0]]
    own = {"files": file, "space": "auto", "channels": "a", "scale": [2], "bias": [0], "threshold": 0.5}
    assert mask["opacity"]["picture"] == own and mask["opacity"]["filter_type"] == "nearest"
    assert mask["opacity"]["to_uv"]["matrix"] == [pytest.approx(row) for row in ([0, -3, 0.5], [2, 0, 0.25], [0, 0, 1])]
    assert mask["bsdf"]["type"] == "twosided" and mask["bsdf"]["bsdf"]["type"] == "principled"
    color = mask["bsdf"]["bsdf"]["base_color"]
    assert color["picture"]["channels"] == "rgb" and "threshold" not in color["picture"]
    assert mask["bsdf"]["bsdf"]["metallic"] == {"type": "uniform", "value": 0.25}


def preview(**changes):
    notes = Notes()
    return *mitsuba_materials.preview({**mitsuba_materials.PREVIEW, **changes}, Usd.Prim(), notes), notes


def test_clear_surfaces_are_dielectrics():
    clear, _, _ = preview(opacity=0.0, ior=1.3, roughness=0.0, diffuseColor=(0.5, 0.6, 0.7))
    tint = {"type": "rgb", "value": [0.5, 0.6, 0.7]}
    assert clear == {"type": "dielectric", "int_ior": 1.3, "ext_ior": 1.0, "specular_transmittance": tint}
    rough, _, _ = preview(opacity=0.25, roughness=0.5)
    assert (rough["type"], rough["weight"], rough["second"]["type"]) == ("blendbsdf", 0.25, "principled")
    assert (rough["first"]["type"], rough["first"]["alpha"]) == ("roughdielectric", 0.25)
    assert preview(opacity=0.25, opacityThreshold=0.5)[0] == {"type": "null"}
    assert preview(opacity=0.75, opacityThreshold=0.5)[0]["type"] == "twosided"


def test_coats_normals_and_glow_of_preview_surfaces():
    picture = mitsuba_materials.picture([["n.png", 0, 0]], "raw", "rgb", "repeat", np.eye(3), (2, 2, 2), (-1, -1, -1))
    made, glow, _ = preview(clearcoat=0.5, clearcoatRoughness=0.1, normal=picture, emissiveColor=(1.0, 2.0, 3.0))
    assert glow == {"type": "rgb", "value": [1, 2, 3]}
    bent = made["bsdf"]
    assert bent["type"] == "normalmap" and bent["normalmap"]["picture"]["scale"] == [1, 1, 1]
    assert bent["normalmap"]["picture"]["bias"] == [0, 0, 0], "values of 0 to 1"
    assert bent["bsdf"]["clearcoat"] == {"type": "uniform", "value": 0.5}
    assert bent["bsdf"]["clearcoat_gloss"] == pytest.approx((0.1 - 0.01) / 0.099)


def test_standard_surfaces():
    made = lambda **changes: mitsuba_materials.standard(
        {**mitsuba_materials.STANDARD, **changes}, Usd.Stage.CreateInMemory().GetPseudoRoot(), notes
    )
    notes = Notes()
    solid, glow = made(base=0.5, base_color=(0.2, 0.4, 0.8), metalness=1.0, emission=2.0, emission_color=(1.0, 0.0, 0.5))
    assert solid["bsdf"]["base_color"]["value"] == pytest.approx([0.1, 0.2, 0.4])
    assert solid["bsdf"]["metallic"]["value"] == 1.0 and glow["value"] == [2, 0, 1]
    glass, _ = made(transmission=1.0, specular_roughness=0.01, transmission_color=(0.5, 0.5, 1.0))
    assert glass["type"] == "dielectric" and glass["specular_transmittance"]["value"] == [0.5, 0.5, 1]
    assert notes.told() == []
    made(sheen=1.0)
    assert notes.told() == ["sheen of a standard_surface: 1, first /"]


def test_a_mix_is_its_background(stage):
    material = UsdShade.Material.Define(stage, "/World/Looks/Glaze")
    surface = shading._shader(stage, "/World/Looks/Glaze/S", "ND_standard_surface_surfaceshader")
    mixed = shading._shader(stage, "/World/Looks/Glaze/M", "ND_mix_color3")
    mixed.CreateInput("bg", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.25, 0.5, 0.75))
    surface.CreateInput("base_color", Sdf.ValueTypeNames.Color3f).ConnectToSource(
        mixed.CreateOutput("out", Sdf.ValueTypeNames.Color3f)
    )
    material.CreateSurfaceOutput("mtlx").ConnectToSource(surface.CreateOutput("out", Sdf.ValueTypeNames.Token))
    notes = Notes()
    made, _ = mitsuba_materials.bsdf(material, Usd.TimeCode.Default(), notes)
    assert made["bsdf"]["base_color"]["value"] == [0.25, 0.5, 0.75]
    assert notes.told() == ["a mix of a material, taken as its background: 1, first /World/Looks/Glaze/M"]


def lamp(stage, kind, path="/World/Lamp", matrix=None, blocks=True, **inputs):
    light = kind.Define(stage, path)
    for name, value in inputs.items():
        light.GetPrim().GetAttribute("inputs:" + name).Set(value)
    notes = Notes()
    place = np.eye(4) if matrix is None else matrix
    return mitsuba_scene.lamp(light.GetPrim(), place, 0, (np.zeros(3), 2.0), blocks, notes), notes.told()


def test_lights_of_forms_are_shapes_that_shine(stage):
    ball, _ = lamp(stage, UsdLux.SphereLight, "/A", radius=2.0, intensity=3.0, exposure=1.0, color=Gf.Vec3f(1, 0.5, 0))
    assert (ball["type"], ball["emitter"]["radiance"]["value"]) == ("sphere", [6, 3, 0])
    assert np.diag(ball["to_world"]["matrix"]).tolist() == [2, 2, 2, 1]
    rect, _ = lamp(stage, UsdLux.RectLight, "/B", width=4.0, height=2.0, normalize=True, intensity=16.0)
    assert rect["emitter"]["radiance"]["value"] == [2, 2, 2], "what is normalized is divided by the area"
    assert np.diag(rect["to_world"]["matrix"]).tolist() == [-2, 1, -1, 1], "shines along -z"
    disk, _ = lamp(stage, UsdLux.DiskLight, "/C", radius=2.0, normalize=True, intensity=4.0, matrix=np.diag([3, 3, 3, 1]))
    assert disk["emitter"]["radiance"]["value"] == pytest.approx([1 / (9 * math.pi)] * 3)
    tube, _ = lamp(stage, UsdLux.CylinderLight, "/D", radius=0.5, length=4.0)
    ends = np.array(tube["to_world"]["matrix"]) @ [[0, 0], [0, 0], [0, 1], [1, 1]]
    assert ends[:3].T.tolist() == [[-2, 0, 0], [2, 0, 0]]
    assert lamp(stage, UsdLux.SphereLight, "/E", blocks=False)[0]["bsdf"] == {"type": "null"}


def test_a_cone_is_a_spot_of_no_size(stage):
    UsdLux.ShapingAPI.Apply(UsdLux.DiskLight.Define(stage, "/Spot").GetPrim())
    made, told = lamp(
        stage, UsdLux.DiskLight, "/Spot", radius=2.0, intensity=5.0,
        **{"shaping:cone:angle": 40.0, "shaping:cone:softness": 0.5},
    )  # fmt: skip
    shown = (1 + math.cos(math.radians(30))) / 2
    assert made["type"] == "spot" and made["intensity"]["value"] == pytest.approx([20 * math.pi * shown] * 3)
    assert made["cutoff_angle"] == 40 and made["beam_width"] == pytest.approx(20, rel=1e-2)
    assert (np.array(made["to_world"]["matrix"]) @ [0, 0, 1, 0])[:3].tolist() == [0, 0, -1], "along -z"
    assert told == ["a light with a cone, taken as a spot of no size: 1, first /Spot"]


def test_distant_lights_are_far_disks_of_their_angle(stage):
    made, _ = lamp(stage, UsdLux.DistantLight, angle=2.0, normalize=True, intensity=3.0)
    place = np.array(made["to_world"]["matrix"])
    assert place[:3, 3].tolist() == [0, 0, 2e4] and place[:3, 2].tolist() == [0, 0, -1], "above, and shines down"
    size = np.linalg.norm(place[:3, 0])
    assert size == pytest.approx(2e4 * math.tan(math.radians(1)))
    (value, *_) = made["emitter"]["radiance"]["value"]
    assert value * math.pi * math.sin(math.radians(1)) ** 2 == pytest.approx(3.0)
    made, _ = lamp(stage, UsdLux.DistantLight, "/None", angle=0.0, intensity=3.0)
    assert (made["type"], made["direction"]) == ("directional", [0, 0, -1])


def test_domes(stage, tmp_path):
    assert lamp(stage, UsdLux.DomeLight, intensity=2.0)[0] == {
        "type": "constant", "radiance": {"type": "rgb", "value": [2, 2, 2]}
    }  # fmt: skip
    images.hdr(tmp_path / "sky.hdr", np.ones((2, 4, 3)))
    made, _ = lamp(
        stage, UsdLux.DomeLight, "/Sky", intensity=2.0, **{"texture:file": Sdf.AssetPath(str(tmp_path / "sky.hdr"))}
    )
    assert made["type"] == "envmap" and made["picture"]["scale"] == [2, 2, 2]
    scene, said = made_of(stage, tmp_path)
    assert len(of_type(scene, "constant") + of_type(scene, "envmap")) == 1
    assert any("a second dome light" in line for line in said["left_out"])


def test_what_shines_is_one_shape_with_two_sides(stage, tmp_path):
    """Two places of a mesh that is a light, one of them mirrored."""
    for number, scale in enumerate((1, -1)):
        mesh = quad(stage, f"/World/Quad{number}")
        mesh.AddTranslateOp().Set(Gf.Vec3d(10 * number, 0, 0))
        mesh.AddScaleOp().Set(Gf.Vec3f(scale, 1, 1))
        UsdLux.MeshLightAPI.Apply(mesh.GetPrim())
        UsdLux.LightAPI(mesh.GetPrim()).CreateIntensityAttr(4.0)
    scene, said = made_of(stage, tmp_path)
    front, back = of_type(scene, "ply")
    assert front["emitter"] == back["emitter"] == {"type": "area", "radiance": {"type": "rgb", "value": [4, 4, 4]}}
    for shape, sign in ((front, 1), (back, -1)):
        values, faces = ply(tmp_path / shape["filename"])
        a, b, c = (values[faces[:, corner], :3] for corner in range(3))
        assert (np.sign(np.cross(b - a, c - a)[:, 2]) == sign).all()
        assert (values[:, 2] == 0).all() if sign > 0 else (values[:, 2] < 0).all()
        assert sorted({round(float(x)) for x in values[:, 0]}) == [-1, 1, 9, 11]
    assert said["triangles"] == 8


@pytest.mark.parametrize("basis", ["bezier", "catmullRom", "bspline"])
def test_curves_are_the_same_curves_as_b_splines(basis):
    rng = np.random.default_rng(3)
    strand = rng.random((7, 4))
    own = {"bezier": mitsuba_scene.BEZIER, "catmullRom": mitsuba_scene.CATMULL_ROM, "bspline": mitsuba_scene.BSPLINE}
    step = 3 if basis == "bezier" else 1
    powers = np.array([0.125, 0.25, 0.5, 1.0])
    wanted = [powers @ own[basis] @ strand[at : at + 4] for at in range(0, 4, step)]
    pieces = mitsuba_scene.cubic(strand, basis, False)
    found = [powers @ mitsuba_scene.BSPLINE @ one[at : at + 4] for one in pieces for at in range(len(one) - 3)]
    assert np.allclose(found, wanted)
    if basis != "bezier":
        pinned = mitsuba_scene.cubic(strand, basis, True)
        ends = [np.array([0, 0, 0, 1]) @ mitsuba_scene.BSPLINE @ pinned[0][:4], np.ones(4) @ mitsuba_scene.BSPLINE @ pinned[-1][-4:]]
        assert np.allclose(ends, strand[[0, -1]]), "it goes from the first point to the last"


def test_points_are_balls_of_the_size_one_in_a_larger_or_smaller_place(stage, tmp_path):
    points = UsdGeom.Points.Define(stage, "/World/Dots")
    points.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (2, 0, 0)])
    points.CreateWidthsAttr([0.02, 0.02, 0.04])
    scene, _ = made_of(stage, tmp_path)
    (group,) = of_type(scene, "shapegroup")
    balls = np.load(tmp_path / group["shape0"]["points"])
    assert balls[:, 3].tolist() == pytest.approx([1, 1, 2]) and balls[:, 0].tolist() == pytest.approx([0, 100, 200])
    (entry,) = [value for value in scene.values() if isinstance(value, dict) and "places" in value]
    assert np.diag(np.load(tmp_path / entry["places"])[0]).tolist() == pytest.approx([0.01] * 3 + [1])


def test_what_is_left_out_is_told(stage, tmp_path):
    quad(stage, "/World/Cage").CreateSubdivisionSchemeAttr("catmullClark")
    UsdGeom.Cone.Define(stage, "/World/Cone")
    UsdGeom.Cone.Define(stage, "/World/Other")
    _, said = made_of(stage, tmp_path, shutter=0.5)
    assert said["left_out"] == [
        "a subdivision surface, taken as its cage with smooth normals: 1, first /World/Cage",
        "Cone prims: 2, first /World/Cone", "motion: everything stands as at the frame",
    ]  # fmt: skip


def test_the_camera_is_matched_vertically(stage, tmp_path):
    scene, _ = made_of(stage, tmp_path)
    sensor = scene["sensor"]
    assert sensor["fov"] == pytest.approx(2 * math.degrees(math.atan(0.5))) and sensor["fov_axis"] == "y"
    place = np.array(sensor["to_world"]["matrix"])
    assert (place @ [0, 0, 1, 0])[:3].tolist() == [0, 0, -1] and place[:3, 3].tolist() == [0, 0, 10]
    assert (sensor["film"]["width"], sensor["film"]["rfilter"]) == (32, {"type": "box"})


def pixels(arrays, **own):
    fake = types.SimpleNamespace(Bitmap=lambda path: arrays[path])
    own = {"space": "raw", "channels": "r", "scale": [1.0], "bias": [0.0], **own}
    return mitsuba_process.pixels_of(fake, own)


def test_pictures_are_put_together_from_files():
    tiles = {"a": np.array([[0, 255]], np.uint8), "b": np.full((2, 2), 51, np.uint8)}
    made = pixels(tiles, files=[["a", 0, 0], ["b", 1, 1]], scale=[2.0], bias=[0.5])
    assert np.allclose(made[..., 0], [[0.5, 2.5, 0.5, 0.5], [0.5, 0.5, 0.9, 0.9]]), "row 0 is t = 0"
    row = np.array([[[0, 0, 0, 10]], [[255, 128, 0, 20]]], np.uint8)
    made = pixels({"a": row}, files=[["a", 0, 0]], channels="rgb", space="auto", scale=[1.0] * 3, bias=[0.0] * 3)
    assert np.allclose(made[0, 0], [1, 0.2158605, 0], atol=1e-6) and (made[1] == 0).all(), "sRGB, upside down"
    assert pixels({"a": row}, files=[["a", 0, 0]], channels="a")[0, 0, 0] == pytest.approx(20 / 255), "alpha is linear"


def test_a_cut_follows_the_filtered_picture():
    made = pixels({"a": np.array([[0, 255, 255, 0]], np.uint8)}, files=[["a", 0, 0]], threshold=0.5)
    assert made.shape == (4, 16, 1) and made[0, :, 0].tolist() == [0] * 4 + [1] * 8 + [0] * 4


def test_old_llvms_are_passed_over():
    listed = """
        libLLVM.so.19.1 (libc6,x86-64) => /lib/libLLVM.so.19.1
        libLLVM-15.so.1 (libc6,x86-64) => /lib/libLLVM-15.so.1
        libLLVM-17.so (libc6,x86-64) => /lib/libLLVM-17.so"""
    assert mitsuba_process.llvm(listed) == "/lib/libLLVM.so.19.1"
    assert mitsuba_process.llvm("libLLVM-15.so.1 (libc6,x86-64) => /lib/libLLVM-15.so.1") is None


def test_pictures_that_are_written_are_read(tmp_path):
    picture = np.random.default_rng(1).random((5, 7, 3)).astype(np.float32)
    exr_pixels.write(tmp_path / "a.exr", picture)
    assert (exr_pixels.colors(tmp_path / "a.exr") == picture).all()
    import OpenEXR

    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        assert (file.channels()["RGB"].pixels == picture).all(), "as others read it"


def test_a_renderer_that_is_not_there_is_one_line(tmp_path, capsys):
    asked = types.SimpleNamespace(blender=None, mitsuba=str(tmp_path / "python"))
    assert beside.others(asked) == []
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and said.startswith("Mitsuba is left out: ") and "pip install mitsuba" in said
    (tmp_path / "python").write_text("#!/bin/sh\nexit 0\n")
    (tmp_path / "python").chmod(0o755)
    (tmp_path / "bpy").mkdir()
    assert beside.others(types.SimpleNamespace(blender=tmp_path, mitsuba=asked.mitsuba)) == ["cycles", "mitsuba"]


def test_pictures_are_compared_by_region():
    ours, theirs = np.ones((6, 8, 3)), np.ones((6, 8, 3))
    theirs[2:4, 6:] = 2.0
    made = beside.apart(ours, theirs)
    assert len(made["regions"]) == 12 and made["regions"][7] == [1, 2] and made["regions"][6] == [1, 1]
    assert beside.worst_region(made["regions"]) == "region 8: 1.000, 2.000"
    side = {"frame": 1.0, "whole": 2.0, "host_peak": 1 << 20}
    result = {"scene": "a", "ours": side, "mitsuba": {"failed": "refused"}, "apart": {}}
    (row,) = beside.lines(result)
    assert row.count("|") == beside.HEAD.splitlines()[0].count("|") and "refused" in row
    result |= {"mitsuba": {**side, "frame": 3.0}, "apart": {"mitsuba": made}}
    (row,) = beside.lines(result)
    assert row.count("|") == beside.HEAD.splitlines()[0].count("|") and "| 1.00 | 3.00 | 3.00 |" in row
