# SPDX-License-Identifier: Apache-2.0
"""What the renderer is told of materials, subsets, primvars and lights, as its log has it (`OOCPT_LOG`): the same from
both front ends of Hydra.

What becomes of it in pictures is tested elsewhere.
"""

from __future__ import annotations

import re

import pytest

from conftest import MODES

SCENE = """#usda 1.0
( upAxis = "Y" )
def Xform "World"
{
    def Camera "Camera"
    { double3 xformOp:translate = (0, 0, 10); uniform token[] xformOpOrder = ["xformOp:translate"]; }
    def Mesh "Quad" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        int[] faceVertexCounts = [4, 4]
        int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 5, 2]
        point3f[] points = [(-1, -1, 0), (0, -1, 0), (0, 1, 0), (-1, 1, 0), (1, -1, 0), (1, 1, 0)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "faceVarying" )
        int[] primvars:st:indices = [0, 1, 2, 3, 0, 1, 2, 3]
        float primvars:weight = 0.5
        string primvars:label = "hello"
        rel material:binding = </World/Looks/Textured>
        rel material:binding:preview = </World/Looks/Plain>
        def GeomSubset "Right" ( prepend apiSchemas = ["MaterialBindingAPI"] )
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [1]
            rel material:binding = </World/Looks/Plain>
        }
        def GeomSubset "Group" { uniform token elementType = "face"; int[] indices = [0]; }
    }
    def Cube "Cube" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    { rel material:binding:full = </World/Looks/Plain>; }
    def Scope "Looks"
    {
        def Material "Textured"
        {
            float inputs:rough = 0.3
            token outputs:surface.connect = </World/Looks/Textured/Surface.outputs:surface>
            def Shader "Surface"
            {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </World/Looks/Textured/Texture.outputs:rgb>
                float inputs:roughness.connect = </World/Looks/Textured.inputs:rough>
                int inputs:useSpecularWorkflow = 1
                token outputs:surface
            }
            def Shader "Texture"
            {
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @TEXTURE@ ( colorSpace = "sRGB" )
                token inputs:wrapS = "repeat"
                float4 inputs:fallback = (1, 0, 1, 1)
                float2 inputs:st.connect = </World/Looks/Textured/Move.outputs:result>
                float3 outputs:rgb
            }
            def Shader "Move"
            {
                uniform token info:id = "UsdTransform2d"
                float2 inputs:scale = (2, 2)
                float2 inputs:in.connect = </World/Looks/Textured/Reader.outputs:result>
                float2 outputs:result
            }
            def Shader "Reader"
            {
                uniform token info:id = "UsdPrimvarReader_float2"
                string inputs:varname = "st"
                float2 outputs:result
            }
        }
        def Material "Other" { }
        def Material "Plain"
        {
            token outputs:surface.connect = </World/Looks/Plain/Surface.outputs:surface>
            def Shader "Surface"
            {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = (0, 1, 0)
                token outputs:surface
            }
        }
    }
    def PointInstancer "Swarm"
    {
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 0, -5), (3, 0, -5)]
        color3f[] primvars:tint = [(1, 0, 0), (0, 1, 0)] ( interpolation = "vertex" )
        rel prototypes = </World/Swarm/Lamp>
        def SphereLight "Lamp" { float inputs:radius = 0.1; }
    }
    def DistantLight "Sun" ( prepend apiSchemas = ["ShadowAPI"] )
    {
        float inputs:intensity = 2
        bool inputs:shadow:enable = 0
        color3f inputs:shadow:color = (0.25, 0, 0)
        float inputs:diffuse = 0.5
    }
    def DomeLight "Dome" { asset inputs:texture:file = @TEXTURE@; token inputs:texture:format = "latlong"; }
    def DomeLight_1 "Pole" { uniform token poleAxis = "Z"; }
    def RectLight "Rect" ( prepend apiSchemas = ["ShapingAPI", "CollectionAPI:lightLink", "CollectionAPI:shadowLink"] )
    {
        float inputs:width = 2
        float inputs:height = 3
        asset inputs:texture:file = @TEXTURE@
        float inputs:shaping:cone:angle = 30
        float inputs:shaping:cone:softness = 0.25
        float inputs:shaping:focus = 2
        color3f inputs:shaping:focusTint = (0.5, 0.25, 0.125)
        asset inputs:shaping:ies:file = @TEXTURE@
        float inputs:shaping:ies:angleScale = 0.5
        bool inputs:shaping:ies:normalize = 1
        bool collection:lightLink:includeRoot = 0
        rel collection:lightLink:includes = </World/Quad>
        bool collection:shadowLink:includeRoot = 0
        rel collection:shadowLink:includes = </World/Cube>
        bool primvars:ri:attributes:visibility:camera = 0
    }
    def SphereLight "Sphere"
    {
        float inputs:radius = 0.25
        bool treatAsPoint = 1
        bool inputs:normalize = 1
        bool inputs:enableColorTemperature = 1
        float inputs:colorTemperature = 3000
    }
    def CylinderLight "Cylinder"
    {
        float inputs:length = 3
        float inputs:radius = 0.125
        bool treatAsLine = 1
        float inputs:exposure = 2
        float inputs:specular = 0.25
    }
    def DiskLight "Disk" { float inputs:radius = 2; color3f inputs:color = (1, 0.5, 0.25); }
}
"""
QUICK = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0}
COLORS = re.compile(r"\x1b\[[0-9;]*m")


def told(log: str, path: str) -> str:
    """The last description of a prim."""
    lines = [
        line
        for line in COLORS.sub("", log).splitlines()
        if "upsert" in line and re.search(rf'path: "{re.escape(path)}"', line)
    ]
    # A material names its nodes, a mesh its material: the prim itself comes first in the line.
    own = [line for line in lines if re.search(r'path: "([^"]*)"', line)[1] == path]
    assert own, f"nothing was said of {path}"
    return own[-1]


# Edits of everything that the tests below look at; tests/asan makes them, too.
EDITS = [
    "stage.GetPrimAtPath('/World/Looks/Plain/Surface').GetAttribute('inputs:diffuseColor').Set(Gf.Vec3f(0, 0, 1))",
    "stage.GetPrimAtPath('/World/Quad').GetRelationship('material:binding').SetTargets(['/World/Looks/Other'])",
    "stage.GetPrimAtPath('/World/Rect').GetRelationship('collection:lightLink:includes').SetTargets(['/World/Cube'])",
    "stage.GetPrimAtPath('/World/Disk').GetAttribute('inputs:radius').Set(4.0)",
    "UsdGeom.PrimvarsAPI(stage.GetPrimAtPath('/World/Quad')).CreatePrimvar('more', Sdf.ValueTypeNames.Float).Set(1.0)",
    "stage.GetPrimAtPath('/World/Quad/Right').GetAttribute('indices').Set(Vt.IntArray([0, 1]))",
    "stage.RemovePrim('/World/Quad/Right')",
    "stage.RemovePrim('/World/Rect')",
    "stage.RemovePrim('/World/Looks/Textured')",
]


class Arrival:
    """The scene in a live view, and what has been said of it."""

    def __init__(self, host, folder) -> None:
        (folder / "a.1001.png").write_bytes(b"one")
        (folder / "scene.usda").write_text(
            SCENE.replace("@TEXTURE@", f"@{folder}/a.<UDIM>.png@", 1).replace("@TEXTURE@", "@./a.1001.png@")
        )
        self.folder = folder
        self.view = host.open(folder / "scene.usda", (4, 4), settings=QUICK)
        self.log = self.view.render().log

    def after(self, code: str) -> str:
        self.view.edit(code)
        return self.view.render().log


@pytest.fixture(scope="module", params=list(MODES))
def arrival(request, tmp_path_factory):
    from host import Host

    folder = tmp_path_factory.mktemp("arrivals")
    host = Host(folder, MODES[request.param], {"OOCPT_LOG": "oocpt_bridge=debug"})
    arrival = Arrival(host, folder)
    with arrival.view:
        yield arrival
    host.close()


def holds(text: str, *parts: str) -> None:
    for part in parts:
        assert part in text, f"no {part} in\n{text}"


def test_a_material_network(arrival):
    line = told(arrival.log, "/World/Looks/Textured")
    kinds = re.findall(r'NodeDesc \{ path: "([^"]*)", kind: "([^"]*)"', line)
    nodes = {path.rpartition("/")[2]: kind for path, kind in kinds}
    assert nodes == {
        "Move": "UsdTransform2d", "Reader": "UsdPrimvarReader_float2", "Surface": "UsdPreviewSurface",
        "Texture": "UsdUVTexture",
    }
    assert all(path.startswith("/World/Looks/Textured/") for path, _ in kinds), "nodes have whole paths, for messages"
    number = {name: i for i, name in enumerate(path.rpartition("/")[2] for path, _ in kinds)}
    holds(line, f"surface: Some({number['Surface']})")
    for source, target, entry, output in [
        ("Texture", "Surface", "diffuseColor", "rgb"),
        ("Move", "Texture", "st", "result"),
        ("Reader", "Move", "in", "result"),
    ]:
        holds(line, f'ConnectionDesc {{ input: "{entry}", node: {number[source]}, output: "{output}" }}')
    holds(
        line, '"roughness", value: Float(0.3)', '"useSpecularWorkflow", value: Int(1)', '"wrapS", value: Text("repeat")'
    )
    holds(
        line, '"fallback", value: Vec4([1.0, 0.0, 1.0, 1.0])', '"scale", value: Vec2([2.0, 2.0])',
        '"varname", value: Text("st")',
    )


def test_asset_paths_and_color_spaces(arrival):
    line = told(arrival.log, "/World/Looks/Textured")
    path = f"{arrival.folder}/a.<UDIM>.png"
    holds(
        line, f'"file", value: Asset(AssetRef {{ authored: "{path}", resolved: "{path}" }})',
        '"colorSpace:file", value: Text("sRGB")',
    )
    assert line.count("colorSpace:") == 1, "only what is authored, and once"
    holds(told(arrival.log, "/World/Dome"), f'authored: "./a.1001.png", resolved: "{arrival.folder}/a.1001.png"')


def test_bindings_subsets_and_primvars(arrival):
    line = told(arrival.log, "/World/Quad")
    holds(
        line,
        'material: Some("/World/Looks/Textured"), subsets: [SubsetDesc { path: "/World/Quad/Right", material:'
        ' Some("/World/Looks/Plain")',
    )
    assert "/World/Quad/Group" not in line, "a subset without a material says nothing about shading"
    names = re.findall(r'NamedPrimvar \{ name: "([^"]*)", primvar: Primvar \{ interpolation: (\w+)', line)
    assert names == [("st", "FaceVarying"), ("weight", "Constant")], "text is no primvar for shaders"
    holds(told(arrival.log, "/World/Cube"), 'material: Some("/World/Looks/Plain"), subsets: []')


def test_primvars_of_instances(arrival):
    line = told(arrival.log, "/World/Swarm")
    assert re.findall(r'NamedPrimvar \{ name: "([^"]*)", primvar: Primvar \{ interpolation: (\w+)', line) == [
        ("tint", "Instance")
    ]


def test_lights_of_every_kind(arrival):
    holds(
        told(arrival.log, "/World/Sun"), "Distant { angle_degrees: 0.53 }", "intensity: 2.0", "diffuse: 0.5",
        "shadow_enable: false", "shadow_color: [0.25, 0.0, 0.0]",
    )
    holds(told(arrival.log, "/World/Dome"), "Dome { texture: Some(", "format: Latlong")
    holds(told(arrival.log, "/World/Pole"), "Dome { texture: None, format: Automatic }")
    holds(told(arrival.log, "/World/Rect"), "Rect { width: 2.0, height: 3.0, texture: Some(", "camera_visible: false")
    holds(
        told(arrival.log, "/World/Sphere"), "Sphere { radius: 0.25, treat_as_point: true }", "normalize: true",
        "color_temperature: Some(3000.0)", "shadow_enable: true", "camera_visible: true",
    )
    holds(
        told(arrival.log, "/World/Cylinder"), "Cylinder { length: 3.0, radius: 0.125, treat_as_line: true }",
        "exposure: 2.0", "specular: 0.25",
    )
    holds(told(arrival.log, "/World/Disk"), "Disk { radius: 2.0 }", "color: [1.0, 0.5, 0.25]", "shaping: None")


def test_shaping(arrival):
    line = told(arrival.log, "/World/Rect")
    holds(
        line,
        "cone_angle_degrees: 30.0, cone_softness: 0.25, focus: 2.0, focus_tint: [0.5, 0.25, 0.125], ies: Some(AssetRef",
        "ies_angle_scale: 0.5, ies_normalize: true",
    )


def test_the_dome_pole_axis_is_in_its_transform(arrival):
    """The texture's +y goes to +z."""
    assert re.search(
        r"y_axis: DVec4\(0\.0, \d\.\d+e-1\d, 1\.0, 0\.0\)|y_axis: DVec4\(0\.0, 0\.0, 1\.0, 0\.0\)",
        told(arrival.log, "/World/Pole"),
    ), told(arrival.log, "/World/Pole")


def test_links(arrival):
    rect = told(arrival.log, "/World/Rect")
    light, shadow = (re.search(rf'{kind}_link: Some\("([^"]+)"\)', rect)[1] for kind in ("light", "shadow"))
    assert light != shadow
    members = {
        name: re.search(r"categories: \[([^\]]*)\]", told(arrival.log, f"/World/{name}"))[1]
        for name in ("Quad", "Cube")
    }
    assert light in members["Quad"] and light not in members["Cube"], members
    assert shadow in members["Cube"] and shadow not in members["Quad"], members
    holds(told(arrival.log, "/World/Sphere"), "light_link: None, shadow_link: None")


def test_lights_inside_instancers(arrival):
    line = next(
        line for line in COLORS.sub("", arrival.log).splitlines() if "upsert" in line and "Sphere { radius: 0.1" in line
    )
    holds(line, 'instanced_by: [InstancedBy { instancer: "/World/Swarm"')


def test_edits_of_materials(arrival):
    log = arrival.after(
        "stage.GetPrimAtPath('/World/Looks/Plain/Surface').GetAttribute('inputs:diffuseColor').Set(Gf.Vec3f(0, 0, 1))"
    )
    holds(told(log, "/World/Looks/Plain"), '"diffuseColor", value: Vec3([0.0, 0.0, 1.0])')


def test_edits_of_bindings(arrival):
    bind = "stage.GetPrimAtPath('/World/Quad').GetRelationship('material:binding').SetTargets(['/World/Looks/{}'])"
    holds(
        told(arrival.after(bind.format("Other")), "/World/Quad"),
        'material: Some("/World/Looks/Other"), subsets: [SubsetDesc',
    )
    holds(
        told(arrival.after(bind.format("Textured")), "/World/Quad"),
        'material: Some("/World/Looks/Textured"), subsets: [SubsetDesc',
    )


def test_edits_of_subsets(arrival):
    log = arrival.after(
        "stage.GetPrimAtPath('/World/Quad/Right').GetRelationship('material:binding')"
        ".SetTargets(['/World/Looks/Other'])"
    )
    holds(
        told(log, "/World/Quad"),
        'SubsetDesc { path: "/World/Quad/Right", material: Some("/World/Looks/Other"), faces: TypedArray(I32 x 1)',
    )
    log = arrival.after("stage.GetPrimAtPath('/World/Quad/Right').GetAttribute('indices').Set(Vt.IntArray([0, 1]))")
    holds(told(log, "/World/Quad"), "faces: TypedArray(I32 x 2)")
    log = arrival.after("stage.RemovePrim('/World/Quad/Right')")
    holds(told(log, "/World/Quad"), "subsets: []")


def test_edits_of_primvars(arrival):
    log = arrival.after(
        "UsdGeom.PrimvarsAPI(stage.GetPrimAtPath('/World/Quad')).CreatePrimvar('more',"
        " Sdf.ValueTypeNames.Float).Set(1.0)"
    )
    holds(told(log, "/World/Quad"), 'NamedPrimvar { name: "more"')


def test_edits_of_lights(arrival):
    log = arrival.after("stage.GetPrimAtPath('/World/Disk').GetAttribute('inputs:radius').Set(4.0)")
    holds(told(log, "/World/Disk"), "Disk { radius: 4.0 }")
    log = arrival.after(
        "stage.GetPrimAtPath('/World/Rect').GetAttribute('primvars:ri:attributes:visibility:camera').Set(True)"
    )
    holds(told(log, "/World/Rect"), "camera_visible: true")


def test_edits_of_links(arrival):
    rect = "stage.GetPrimAtPath('/World/Rect').GetRelationship('collection:lightLink:includes')"
    link = re.search(r'light_link: Some\("([^"]+)"\)', told(arrival.log, "/World/Rect"))[1]
    for name, other in (("Cube", "Quad"), ("Quad", "Cube")):
        log = arrival.after(f"{rect}.SetTargets(['/World/{name}'])")
        members = {
            each: re.search(r"categories: \[([^\]]*)\]", told(log, f"/World/{each}"))[1] for each in ("Quad", "Cube")
        }
        # The old front end may give the changed collection another name.
        link = (
            re.search(r'light_link: Some\("([^"]+)"\)', told(log, "/World/Rect"))[1]
            if 'path: "/World/Rect"' in log
            else link
        )
        assert link in members[name] and link not in members[other], members


def test_a_link_to_native_instances(arrival, tmp_path):
    """Each instance is in the collections that its path is in, in both front ends; the prototype is in none itself."""
    text = (
        '#usda 1.0\ndef Xform "World"\n{\n'
        '    def Camera "Camera" { double3 xformOp:translate = (0, 0, 10); uniform token[] xformOpOrder ='
        ' ["xformOp:translate"]; }\n'
        '    def Xform "A" ( instanceable = true\n'
        ' references = </Model> ) { }\n'
        '    def Xform "B" ( instanceable = true\n'
        ' references = </Model> ) { }\n'
        '    def SphereLight "Lamp" ( prepend apiSchemas = ["CollectionAPI:lightLink"] )\n'
        '    {\n'
        '        bool collection:lightLink:includeRoot = 0\n'
        '        rel collection:lightLink:includes = [TARGETS]\n'
        '    }\n}\n'
        'def Xform "Model"\n{\n'
        '    def Mesh "M" { int[] faceVertexCounts = [3]; int[] faceVertexIndices = [0, 1, 2]; point3f[] points ='
        ' [(0, 0, 0), (1, 0, 0), (0, 1, 0)]; }\n'
        '}\n'
    )
    for targets, sets in (("</World/A>, </World/B>", 1), ("</World/A>", 2)):
        (tmp_path / "native.usda").write_text(text.replace("TARGETS", targets))
        with arrival.view.host.open(tmp_path / "native.usda", (4, 4), settings=QUICK) as view:
            log = COLORS.sub("", view.render().log)
        meshes = [line for line in log.splitlines() if "upsert mesh" in line and "instanced_by: [I" in line]
        assert len(meshes) == 1, log
        assert "categories: []" in meshes[0] and "warning" not in log.lower(), log
        link = re.search(r'light_link: Some\("([^"]+)"\)', log)[1]
        found = re.findall(r"links: InstanceLinks { sets: \[(.*?)\], of: Some\(\[([0-9, ]*)\]\)", log)
        found = [(text, numbers) for text, numbers in found if link in text]
        assert len(found) == 1, log
        assert len(set(found[0][1].split(", "))) == sets, found


def test_a_collection_by_predicates(arrival, tmp_path):
    """More than paths: a warning, and the light shines on everything."""
    if not arrival.view.host.scene_index:
        pytest.skip("the old front end works out such collections itself")
    text = (
        '#usda 1.0\ndef Xform "World"\n{\n'
        '    def Camera "Camera" { double3 xformOp:translate = (0, 0, 10); uniform token[] xformOpOrder ='
        ' ["xformOp:translate"]; }\n'
        '    def SphereLight "Lamp" ( prepend apiSchemas = ["CollectionAPI:lightLink"] )\n'
        '    {\n'
        '        bool collection:lightLink:includeRoot = 0\n'
        '        pathExpression collection:lightLink:membershipExpression = "/World//{isa:Mesh}"\n'
        '    }\n}\n'
    )
    (tmp_path / "predicate.usda").write_text(text)
    with arrival.view.host.open(tmp_path / "predicate.usda", (4, 4), settings=QUICK) as view:
        log = view.render().log
    holds(told(log, "/World/Lamp"), "light_link: None")
    assert "uses more than paths" in log, log


def test_removed_materials(arrival):
    log = COLORS.sub("", arrival.after("stage.RemovePrim('/World/Looks/Textured')"))
    assert re.search(r'remove path="/World/Looks/Textured"', log), log
