# SPDX-License-Identifier: Apache-2.0
"""Visibility by kind of ray and mattes by primvars of other renderers, and render passes, in real runs of usdrecord."""

import os
import re
import subprocess

import numpy as np
import OpenEXR
import pytest

CARDS = ("A", "B", "C", "D", "E")
"""Cards side by side before a white wall; each shines into a channel of its own, over a floor."""
CHANNELS = {"A": 0, "B": 1, "C": 0, "D": 1, "E": 2}

HEAD = """#usda 1.0
(
    renderSettingsPrimPath = "/Render/Settings"
)
def Camera "Eye"
{
    token projection = "orthographic"
    float horizontalAperture = 100
    float verticalAperture = 60
    double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
CARD = """
    def Mesh "{name}" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        rel material:binding = </World/Looks/{look}>
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = {points}
        uniform token subdivisionScheme = "none"
        {more}
    }}
"""
LOOK = """
        def Material "{name}"
        {{
            token outputs:surface.connect = </World/Looks/{name}/S.outputs:surface>
            def Shader "S"
            {{
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = {diffuse}
                color3f inputs:emissiveColor = {emission}
                float inputs:ior = 1
                float inputs:roughness = 1
                token outputs:surface
            }}
        }}
"""
RENDER = """
def Scope "Render"
{
    def RenderSettings "Settings"
    {
        rel camera = </Eye>
        rel products = </Render/Product>
        uniform int2 resolution = (50, 30)
    }
    def RenderProduct "Product"
    {
        token productName = "PRODUCT"
        rel orderedVars = </Render/Color>
    }
    def RenderVar "Color"
    {
        token dataType = "color4f"
        string sourceName = "Ci"
    }
    def RenderPass "Pass"
    {
        rel renderSource = </Render/Settings>
        PASS
    }
}
"""


def rectangle(left, right, low, high, depth):
    return str([(left, low, depth), (right, low, depth), (right, high, depth), (left, high, depth)])


def write(folder, primvars, collections=""):
    """The scene with these primvars of its cards and these collections of its pass."""
    looks = LOOK.format(name="Wall", diffuse="(0, 0, 0)", emission="(0.5, 0.5, 0.5)")
    looks += LOOK.format(name="Floor", diffuse="(0.5, 0.5, 0.5)", emission="(0, 0, 0)")
    cards = CARD.format(name="Wall", look="Wall", points=rectangle(-5, 5, -1, 3, -2), more="")
    ground = "[(-5, -2, 3), (5, -2, 3), (5, -1, -2), (-5, -1, -2)]"
    cards += CARD.format(name="Floor", look="Floor", points=ground, more="")
    for place, name in enumerate(CARDS):
        emission = [4.0 if channel == CHANNELS[name] else 0.0 for channel in range(3)]
        looks += LOOK.format(name=name, diffuse="(0, 0, 0)", emission=tuple(emission))
        left = -4.5 + 2 * place
        points = rectangle(left, left + 1, 0, 2, 0)
        cards += CARD.format(name=name, look=name, points=points, more=primvars.get(name, ""))
    scene = folder / "scene.usda"
    render = RENDER.replace("PRODUCT", str(folder / "product.exr")).replace("PASS", collections)
    scene.write_text(f'{HEAD}def Xform "World"\n{{\n    def Scope "Looks"\n    {{\n{looks}    }}\n{cards}}}\n{render}')
    return scene


def record(scene, *words, front_end="1"):
    """`front_end`: empty is the one that the command takes."""
    variables = dict(os.environ, USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX=front_end)
    if not front_end:
        del variables["USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX"]
    variables.pop("PYTHONPATH", None)
    out = scene.with_name("out.exr")
    command = ["usdrecord", "--disableCameraLight", "--imageWidth", "50", "--samples", "16", "--camera", "Eye"]
    done = subprocess.run(
        [*command, "--set", "oocpt:maxBounces=0", *words, str(scene), str(out)], env=variables, capture_output=True,
        text=True, timeout=300, check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    written = scene.with_name("product.exr") if "-rp" in words else out
    with OpenEXR.File(str(written), separate_channels=True) as file:
        channels = file.channels()
        return np.stack([channels[name].pixels for name in "RGBA"], axis=-1).astype(np.float32), done.stderr


def middle(picture, name):
    """The colour in the middle of a card."""
    place = CARDS.index(name)
    return picture[9:11, 4 + 10 * place : 6 + 10 * place].mean(axis=(0, 1))


def own(name):
    return np.eye(3)[CHANNELS[name]] * 4.0


def floor_light(picture):
    """What the floor gets, by channel."""
    return picture[21:24, :, :3].mean(axis=(0, 1))


def expect(picture, shown):
    """`shown`: by card whether it is itself, the wall behind it, or nothing."""
    for name, what in shown.items():
        color = middle(picture, name)
        expected = {"itself": [*own(name), 1], "wall": [0.5, 0.5, 0.5, 1], "nothing": [0, 0, 0, 0]}[what]
        assert np.abs(color - expected).max() < 1e-4, f"{name} is not {what}: {color}"


PRIMVARS = {
    "own": {"A": 'string primvars:oocpt:visibility = "-camera"', "D": "bool primvars:oocpt:matte = 1"},
    "renderman": {
        "A": "int primvars:ri:attributes:visibility:camera = 0",
        "D": "int primvars:ri:attributes:Ri:Matte = 1",
    },
    "karma": {
        "A": 'string primvars:karma:object:rendervisibility = "* ^primary"',
        "D": "int primvars:karma:object:holdoutmode = 1",
    },
    "arnold": {"A": "bool primvars:arnold:visibility:camera = 0", "D": "bool primvars:arnold:matte = 1"},
    "arnold's bits": {"A": "int primvars:arnold:visibility = 254", "D": "bool primvars:arnold:matte = 1"},
}


@pytest.mark.parametrize("front_end", ["0", "1"], ids=["legacy", "scene_index"])
@pytest.mark.parametrize("renderer", PRIMVARS)
def test_primvars_hide_and_hold_out(tmp_path, renderer, front_end):
    constant = {name: f'{text} (interpolation = "constant")' for name, text in PRIMVARS[renderer].items()}
    picture, log = record(write(tmp_path, constant), front_end=front_end)
    assert "warning" not in log.lower(), log
    expect(picture, {"A": "wall", "B": "itself", "C": "itself", "D": "nothing", "E": "itself"})
    plain, _ = record(write(tmp_path, {}), front_end=front_end)
    expect(plain, dict.fromkeys(CARDS, "itself"))
    ratio = floor_light(picture) / floor_light(plain)
    assert np.abs(ratio - 1).max() < 0.05, f"the floor is lit as it was: {ratio}"


def test_what_makes_no_sense_is_named(tmp_path):
    constant = ' (interpolation = "constant")'
    primvars = {
        "A": 'string primvars:oocpt:visibility = "-gamma"' + constant,
        "B": "int primvars:karma:object:holdoutmode = 7" + constant,
    }
    picture, log = record(write(tmp_path, primvars))
    expect(picture, dict.fromkeys(CARDS, "itself"))
    assert re.search(r"/World/A.*oocpt:visibility.*gamma is no kind of ray", log), log
    assert re.search(r"/World/B.*holdoutmode.*7 is no mode", log), log


COLLECTIONS = """
        rel collection:prune:includes = </World/A>
        rel collection:renderVisibility:excludes = </World/B>
        rel collection:cameraVisibility:excludes = </World/C>
        rel collection:matte:includes = </World/D>
"""


def test_a_pass_prunes_hides_and_holds_out(tmp_path):
    scene = write(tmp_path, {}, COLLECTIONS)
    plain, _ = record(scene)
    expect(plain, dict.fromkeys(CARDS, "itself"))
    picture, log = record(scene, "-rp", "/Render/Pass", front_end="")
    assert "warning" not in log.lower(), log
    expect(picture, {"A": "wall", "B": "wall", "C": "wall", "D": "nothing", "E": "itself"})
    # A and C shine red, B and D green: half of each is left out with its card.
    ratio = floor_light(picture) / floor_light(plain)
    assert (ratio[:2] < 0.9).all() and (ratio[:2] > 0.2).all(), f"what is left out does not shine: {ratio}"
    assert abs(ratio[2] - 1) < 0.05, f"E does: {ratio}"


def test_expressions_over_paths_count_and_others_are_named(tmp_path):
    collections = """
        pathExpression collection:matte:membershipExpression = "/World/D + /World/E"
        pathExpression collection:prune:membershipExpression = "//{isa:Mesh}"
    """
    picture, log = record(write(tmp_path, {}, collections), "-rp", "/Render/Pass")
    expect(picture, {"A": "itself", "B": "itself", "C": "itself", "D": "nothing", "E": "nothing"})
    assert re.search(r"/Render/Pass.*prune uses more than paths", log), log


def test_what_is_below_a_pruned_prim_is_pruned(tmp_path):
    collections = 'pathExpression collection:prune:membershipExpression = "/World"'
    picture, log = record(write(tmp_path, {}, collections), "-rp", "/Render/Pass")
    assert "warning" not in log.lower(), log
    expect(picture, dict.fromkeys(CARDS, "nothing"))


def test_the_old_front_end_says_that_it_hands_over_no_passes(tmp_path):
    picture, log = record(write(tmp_path, {}, COLLECTIONS), "-rp", "/Render/Pass", front_end="0")
    expect(picture, dict.fromkeys(CARDS, "itself"))
    assert re.search(r"/Render/Pass.*not handed over", log), log


LIVE = {"oocpt:samplesPerPixel": 16, "oocpt:maxBounces": 0}
PASS = "engine.SetActiveRenderPassPrimPath(Sdf.Path({path!r}))"
IS_THERE = "collection = Usd.CollectionAPI.Get(stage, Sdf.Path('/Render/Pass.collection:{name}'))\n"


def live(view):
    """The picture of a live engine with the first row at the top, as files have it."""
    return view.render()["color"][::-1]


def test_a_live_host_changes_the_pass_and_its_collections(tmp_path, fresh_host):
    host = fresh_host(scene_index=True)
    scene = write(tmp_path, {}, COLLECTIONS)
    with host.open(str(scene), (50, 30), camera="/Eye", settings=LIVE) as view:
        expect(live(view), dict.fromkeys(CARDS, "itself"))
        view.edit(PASS.format(path="/Render/Pass"))
        expect(live(view), {"A": "wall", "B": "wall", "C": "wall", "D": "nothing", "E": "itself"})
        view.edit(IS_THERE.format(name="prune") + "collection.GetIncludesRel().SetTargets(['/World/E'])")
        expect(live(view), {"A": "itself", "B": "wall", "C": "wall", "D": "nothing", "E": "wall"})
        view.edit(IS_THERE.format(name="matte") + "collection.GetIncludesRel().SetTargets(['/World/C', '/World/A'])")
        expect(live(view), {"A": "nothing", "B": "wall", "C": "wall", "D": "itself", "E": "wall"})
        view.edit(PASS.format(path=""))
        expect(live(view), dict.fromkeys(CARDS, "itself"))


@pytest.mark.parametrize("scene_index", [False, True], ids=["legacy", "scene_index"])
def test_a_live_host_edits_primvars(tmp_path, fresh_host, scene_index):
    host = fresh_host(scene_index=scene_index)
    primvar = "UsdGeom.PrimvarsAPI(stage.GetPrimAtPath('/World/{}'))"
    primvar += ".CreatePrimvar({!r}, Sdf.ValueTypeNames.Int).Set({})"
    camera, matte = "ri:attributes:visibility:camera", "arnold:matte"
    scene = write(tmp_path, {})
    with host.open(str(scene), (50, 30), camera="/Eye", settings=LIVE) as view:
        expect(live(view), dict.fromkeys(CARDS, "itself"))
        view.edit(primvar.format("B", camera, 0))
        expect(live(view), {"B": "wall", "C": "itself", "E": "itself"})
        view.edit(primvar.format("C", matte, 1))
        expect(live(view), {"B": "wall", "C": "nothing", "E": "itself"})
        view.edit(primvar.format("B", camera, 1) + "\n" + primvar.format("C", matte, 0))
        expect(live(view), dict.fromkeys(CARDS, "itself"))


NATIVE = """
        rel collection:matte:includes = [</Set/One>, </Set/Two>]
        rel collection:cameraVisibility:excludes = </Set/Points/Card>
"""
INSTANCE = """
    def Xform "{name}" (
        instanceable = true
        prepend apiSchemas = ["MaterialBindingAPI"]
        references = </Prototype>
    )
    {{
        rel material:binding = </World/Looks/E>
        double3 xformOp:translate = ({x}, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
"""


def placed(folder, collections):
    """The scene with two native instances at the places of A and B, and a card of a point instancer at that of C."""
    path = write(folder, {}, collections)
    scene = path.read_text()
    for name in "ABC":
        scene = scene.replace(f'def Mesh "{name}" (', f'def Mesh "{name}" (\n        active = false')
    card = CARD.format(name="Card", look="E", points=rectangle(3.5, 4.5, 0, 2, 0), more="")
    unbound = card.replace("rel material:binding = </World/Looks/E>", "")
    more = f'over "Prototype"\n{{{unbound}}}\ndef Xform "Set"\n{{\n'
    more += INSTANCE.format(name="One", x=-8) + INSTANCE.format(name="Two", x=-6)
    more += f'def PointInstancer "Points"\n{{\n{card}\nrel prototypes = </Set/Points/Card>\n'
    more += "int[] protoIndices = [0]\npoint3f[] positions = [(-4, 0, 0)]\n}\n}\n"
    path.write_text(scene.replace('def Scope "Render"', more + 'def Scope "Render"'))
    return path


def test_instances_are_in_collections(tmp_path):
    blue, wall = [0, 0, 4, 1], [0.5, 0.5, 0.5, 1]

    def shown(collections):
        picture, log = record(placed(tmp_path, collections), "-rp", "/Render/Pass", front_end="")
        return [middle(picture, name) for name in "ABC"], log

    for collections, expected in (("", [blue] * 3), (NATIVE, [[0] * 4] * 2 + [wall])):
        colors, log = shown(collections)
        assert "warning" not in log.lower(), log
        assert np.abs(np.array(colors) - expected).max() < 1e-4, f"{collections}: {colors}"
    colors, log = shown("rel collection:matte:includes = </Set/Two>")
    assert re.search(r"/Render/Pass.*differ for /Set/One and /Set/Two", log), log
    assert np.abs(np.array(colors) - [blue] * 3).max() < 1e-4, f"the first counts: {colors}"
