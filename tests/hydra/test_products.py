# SPDX-License-Identifier: Apache-2.0
"""Render products: files that a batch render writes, with their cameras, sizes, windows and layers."""

import os
import subprocess

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest
from pxr import Gf

import compare
import exr
import small

CAMERA = """
def Camera "Eye"
{{
    float horizontalAperture = {width}
    float verticalAperture = {height}
    float horizontalApertureOffset = 1.371
    float focalLength = 30
    double3 xformOp:translate = (0.2131, 0.1173, 6.071)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
SETTINGS = """
def RenderSettings "Settings"
{{
    rel camera = </Eye>
    rel products = [{targets}]
    int oocpt:samplesPerPixel = 4
    int oocpt:maxBounces = 1
    {settings}
    {products}
}}
def Scope "Vars"
{{
    {vars}
}}
"""
SIZE = (64, 48)


def var(name, source, data_type="float", kind="raw", more=""):
    return (
        f'def RenderVar "{name}"\n{{\n    uniform token dataType = "{data_type}"\n'
        f'    uniform string sourceName = "{source}"\n    uniform token sourceType = "{kind}"\n    {more}\n}}\n'
    )


VARS = {
    "beauty": var("beauty", "Ci", "color4f"),
    "ids": var("ids", "primId", "int"),
    "N": var("N", "Nn", "normal3f"),
    "depth": var("depth", "z", "half"),
    "direct": var("direct", "C<RD>L", "color3f", "lpe"),
    "indirect": var("indirect", "color lpe:C(<RD>.+)?[<L.>O]", "color3f"),
    "wrong": var("wrong", "C<RQ>L", "color3f", "lpe"),
    "volume": var("volume", "CV+L", "color3f", "lpe"),
}
# Lights of pure colours, each with its group as another renderer names it, or by a primvar; one has none.
GROUPS = {
    "ours": ("SphereLight", "(1, 0, 0)", 'string inputs:oocpt:lightGroup = "ours"'),
    "primvar": ("DiskLight", "(0, 1, 0)", 'string primvars:oocpt:lightGroup = "primvar"'),
    "ri": ("RectLight", "(0, 0, 1)", 'string inputs:ri:light:lightGroup = "ri"'),
    "karma": ("DomeLight", "(1, 0, 0)", 'string inputs:karma:light:lpetag = "karma"'),
    "arnold": ("DistantLight", "(0, 1, 0)", 'string primvars:arnold:aov = "arnold"'),
    "default": ("SphereLight", "(0, 0, 1)", ""),
}


def product(name, file, names=("ids",), size=SIZE, more=""):
    targets = ", ".join(f"</Vars/{name}>" for name in names)
    return (
        f'def RenderProduct "{name}"\n{{\n    token productName = "{file}"\n    rel orderedVars = [{targets}]\n'
        f"    uniform int2 resolution = {tuple(size)}\n    {more}\n}}\n"
    )


def stage(products, settings="", aperture=(24, 18), camera=CAMERA):
    """A scene; `products` by name."""
    targets = ", ".join(f"</Settings/{name}>" for name in products)
    return (
        f'#usda 1.0\n(\n    renderSettingsPrimPath = "/Settings"\n    subLayers = [@{small.FOLDER}/cameras.usda@]\n)\n'
        + camera.format(width=aperture[0], height=aperture[1])
        + SETTINGS.format(
            targets=targets, settings=settings, products="".join(products.values()), vars="".join(VARS.values())
        )
    )


# Hydra's front ends: `usdrecord`'s default one, and in the test of layers, or with all tests, the other.
BOTH = pytest.mark.parametrize("record", ["0", "1"], ids=["legacy", "scene_index"], indirect=True)


@pytest.fixture(params=["0", "1"] if os.environ.get("OOCPT_TEST_FULL") else ["0"])
def record(request, tmp_path):
    """Runs usdrecord in a folder of its own; returns the finished process and the folder."""

    def run(text, *flags, out="out.exr", fails=False, **environment):
        scene = tmp_path / "scene.usda"
        scene.write_text(text)
        variables = dict(os.environ, USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX=request.param, OOCPT_VALIDATION="1")
        variables.update(environment)
        variables.pop("PYTHONPATH", None)
        done = subprocess.run(
            ["usdrecord", "--disableCameraLight", *flags, str(scene), str(tmp_path / out)], cwd=tmp_path,
            env=variables, capture_output=True, text=True, timeout=120, check=False, start_new_session=True,
        )
        assert (done.returncode != 0) == fails, done.stderr
        return done, tmp_path

    return run


def channels(path):
    """Arrays by channel, row 0 at the bottom, and the header."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels[::-1] for name, channel in file.channels().items()}, dict(file.header())


def seen(host, size=SIZE, aperture=(24, 18), aovs=("primId",)):
    settings = {"oocpt:samplesPerPixel": 4, "oocpt:maxBounces": 1, "oocpt:filterAovs": True}
    return host.picture(stage({}, aperture=aperture), size, camera="/Eye", aovs=list(aovs), settings=settings)


def as_ids(pixels):
    return pixels.astype(np.uint32).view(np.int32)


@BOTH
def test_layers_of_a_product_are_the_images_of_the_host(record, pool):
    products = {
        "All": product("All", "all.<F4>.exr", ["beauty", "ids", "N", "depth", "direct", "indirect", "wrong", "volume"]),
        "Volume": product("Volume", "volume.exr", more='token productType = "deepVolume"'),
    }
    flags = ["--products", "--enableDomeLightVisibility", "--frames", "7"]
    done, folder = record(stage(products), *flags, out="out.#.exr")
    layers, header = channels(folder / "all.0007.exr")
    parts = [f"{name}.{channel}" for name in ["direct", "indirect", "volume"] for channel in "BGR"]
    assert sorted(layers) == ["A", "B", "G", "N.X", "N.Y", "N.Z", "R", "Z", *parts[:3], "ids", *parts[3:]]
    for name in "RGB":
        both = layers[f"direct.{name}"] + layers[f"indirect.{name}"]
        np.testing.assert_allclose(both, layers[name], rtol=1e-5, atol=1e-7)
    assert (layers["indirect.R"] > 0).any() and not layers["volume.R"].any()
    expected = seen(pool.get("legacy"), aovs=("color", "primId", "normal", "cameraDepth"))
    compare.same_bits(np.stack([layers[name] for name in "RGBA"], -1), expected["color"], "colour")
    compare.same_bits(np.stack([layers[f"N.{name}"] for name in "XYZ"], -1), expected["normal"], "normals")
    assert (as_ids(layers["ids"]) == expected["primId"]).all() and (expected["primId"] >= 0).any()
    compare.same_bits(layers["Z"], expected["cameraDepth"].astype(np.float16), "depth as half floats")
    assert header["oocpt:samples"] == 4.0 and header["oocpt:frame"] == 7.0, header
    assert "C<RQ>L: character 4: 'Q' is no event" in done.stderr and "no light path is of CV+L" in done.stderr
    assert "/Settings/Volume: the product is not written" in done.stderr, done.stderr
    assert done.stderr.count("samples, ") == 1, f"the product is the host's picture: {done.stderr}"


@BOTH
def test_light_groups_by_the_names_of_each_renderer(record):
    """Each group has the channel of its light's colour alone, and what has no label is in the default group."""
    kinds = [
        f'def {kind} "{name}"\n{{\n    color3f inputs:color = {color}\n    float inputs:intensity = 3\n    {label}\n'
        f"    double3 xformOp:translate = ({at - 2}, 2, 4)\n"
        f'    uniform token[] xformOpOrder = ["xformOp:translate"]\n}}\n'
        for at, (name, (kind, color, label)) in enumerate(GROUPS.items())
    ]
    board = """
    def Mesh "Board"
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-9, -9, -2), (9, -9, -2), (9, 9, -2), (-9, 9, -2)]
        color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
        string primvars:LABEL = "board"
    }
    """
    more = {name: var(name, f"C.*<[LO].'{name}'>", "color3f", "lpe") for name in GROUPS}
    more["board"] = var("board", "C<RD'board'>L", "color3f", "lpe")
    for label in ["oocpt:lightGroup", "ri:attributes:identifier:lpegroup", "karma:object:lpetag"]:
        own = {"All": product("All", "all.exr", ["beauty", *more])}
        text = stage(own).replace(f"subLayers = [@{small.FOLDER}/cameras.usda@]", "").replace(
            'def Scope "Vars"\n{', 'def Scope "Vars"\n{' + "".join(more.values()))
        done, folder = record(text + "".join(kinds) + board.replace("LABEL", label), "--products")
        layers, _ = channels(folder / "all.exr")
        sums = {name: [layers[f"{name}.{channel}"].sum() for channel in "RGB"] for name in more}
        for name, (_, color, _) in GROUPS.items():
            expected = [number == "1" for number in color.strip("()").split(", ")]
            assert [value > 0 for value in sums[name]] == expected, (name, sums, done.stderr)
        for channel in "RGB":
            everything = sum(layers[f"{name}.{channel}"] for name in GROUPS)
            np.testing.assert_allclose(everything, layers[channel], rtol=1e-5, atol=1e-7)
            assert 0 < layers[f"board.{channel}"].sum() <= layers[channel].sum(), "what the board's label shows"
        if os.environ.get("OOCPT_TEST_FULL") is None:
            break


BOARDS = """
def Mesh "Board"
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    float[] primvars:dust = [-3, -1, 3, 1] (interpolation = "vertex")
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "faceVarying")
    int primvars:part = 16777215
    color3f[] primvars:tint = [(0.25, 0.5, 0.75)] (interpolation = "uniform")
}
def PointInstancer "Many"
{
    rel prototypes = </Many/Small>
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(-0.5, 0, 1), (0, 0.1, 1), (0.5, 0, 1)]
    float[] primvars:dust = [10, 20, 30] (interpolation = "vertex")
    def Mesh "Small"
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-0.15, -0.15, 0), (0.15, -0.15, 0), (0.15, 0.15, 0), (-0.15, 0.15, 0)]
    }
}
"""


@BOTH
def test_primvars_are_layers(record):
    """Values of each kind of primvar against the point that a pixel shows; filtered ones are means of them."""
    more = {
        "P": var("P", "P", "point3f"), "dust": var("dust", "dust", "float", "primvar"),
        "st": var("st", "st", "texCoord2f", "primvar"), "part": var("part", "part", "int", "primvar"),
        "tint": var("tint", "primvars:tint", "color4f"), "none": var("none", "nothing", "float", "primvar"),
    }  # fmt: skip
    VARS.update(more)
    files = {}
    try:
        names = ["P", "dust", "st", "part", "tint", "none"]
        products = {"All": product("All", "all.exr", ["ids", *names])}
        camera = CAMERA + BOARDS.replace("{", "{{").replace("}", "}}")
        for filters in (0, 1):
            text = stage(products, f"bool oocpt:filterAovs = {filters}", camera=camera)
            done, folder = record(text, "--products")
            files[filters] = channels(folder / "all.exr")[0]
        warned = [line for line in done.stderr.splitlines() if "4 primvars at most" in line]
        assert len(warned) == 1 and "/Vars/none" in warned[0], done.stderr
    finally:
        for name in more:
            del VARS[name]
    centred = files[0]
    x, y, z = (centred[f"P.{axis}"] for axis in "XYZ")
    hit = as_ids(centred["ids"]) >= 0
    board, small = hit & (np.abs(z) < 1e-3) & (centred["part"] != 0), hit & (np.abs(z - 1) < 1e-3)
    assert board.sum() > 100 and small.sum() > 20, (board.sum(), small.sum())
    compare.near(centred["dust"][board], (x + 2 * y)[board], 1e-5, "a value by vertex")
    compare.near(centred["st.X"][board], (x[board] + 1) / 2, 1e-6, "coordinates by corner")
    compare.near(centred["st.Y"][board], (y[board] + 1) / 2, 1e-6, "coordinates by corner")
    assert centred["part"].dtype == np.uint32 and (centred["part"][board] == 16777215).all(), "a whole number"
    for channel, value in zip("RGBA", (0.25, 0.5, 0.75, 1.0), strict=True):
        assert (centred[f"tint.{channel}"][board] == value).all() and not centred[f"tint.{channel}"][~board].any()
    expected = np.select([x[small] < -0.3, x[small] < 0.3], [10.0, 20.0], 30.0)
    assert (centred["dust"][small] == expected).all() and len(set(expected)) == 3, "a value by instance"
    for name in ("dust", "st.X", "st.Y", "part"):
        assert not centred[name][~hit].any(), f"{name} where nothing is"
    filtered = files[1]
    assert np.array_equal(filtered["part"], centred["part"]), "whole numbers have no mean"
    means = filtered["dust"][board] - (filtered["P.X"] + 2 * filtered["P.Y"])[board]
    assert np.quantile(np.abs(means), 0.7) < 1e-4, "the mean of a linear value is the value at the mean"
    assert not np.array_equal(filtered["dust"], centred["dust"])
    edge = filtered["tint.A"][(filtered["tint.A"] > 0) & (filtered["tint.A"] < 1)]
    assert len(edge) > 10 and "none" not in filtered, "coverage at edges"


def test_tiles_parts_and_attributes(record):
    """The same numbers in lines, tiles and parts; attributes of the scene's are in the header."""
    kinds = {
        "lines": "",
        "tiles": "bool oocpt:tiled = 1\nint oocpt:tileSize = 16",
        "karma": 'token driver:parameters:OpenEXR:storage = "tiled"',
        "parts": (
            "bool driver:parameters:OpenEXR:multipart = 1\nstring driver:parameters:artist = \"A. Painter\"\n"
            "int driver:parameters:OpenEXR:shot = 7\nfloat driver:parameters:OpenEXR:lens:focal = 35.5\n"
            'string driver:parameters:OpenEXR:channels = "none"'
        ),
    }
    layers = ("beauty", "ids", "N", "depth")
    products = {name: product(name, f"{name}.exr", layers, more=more) for name, more in kinds.items()}
    done, folder = record(stage(products), "--products")
    assert "'channels' has another meaning" in done.stderr.replace('"', "'"), done.stderr
    expected, _ = channels(folder / "lines.exr")
    for name, side in (("tiles", 16), ("karma", 64)):
        found, header = channels(folder / f"{name}.exr")
        assert (header["tiles"].xSize, header["tiles"].ySize) == (side, side)
        assert found.keys() == expected.keys() and all(np.array_equal(found[c], expected[c]) for c in expected), name
    with OpenEXR.File(str(folder / "parts.exr"), separate_channels=True) as file:
        found = {}
        for part in file.parts:
            found.update({name: channel.pixels[::-1] for name, channel in part.channels.items()})
        assert sorted(part.header["name"] for part in file.parts) == ["N", "Z", "ids", "rgba"]
        assert found.keys() == expected.keys() and all(np.array_equal(found[c], expected[c]) for c in expected)
        for part in file.parts:
            assert part.header["artist"] == "A. Painter" and part.header["shot"] == 7
            assert part.header["lens:focal"] == 35.5 and part.header["oocpt:samples"] == 4.0


@BOTH
def test_headers_say_when_and_by_what(record):
    """The frame, its rate and the shutter, as OpenEXR and OpenImageIO read them; a shutter of its own is told."""
    other = CAMERA.replace("Eye", "Late").replace("{{\n", "{{\n    double shutter:close = 0.25\n", 1)
    camera = CAMERA.replace("{{\n", "{{\n    double shutter:open = -0.25\n    double shutter:close = 0.25\n", 1)
    products = {
        "A": product("A", "a.####.exr", ("beauty",), (8, 6)),
        "B": product("B", "b.####.exr", ("beauty",), (8, 6), more="rel camera = </Late>"),
    }
    text = stage(products, camera=camera + other).replace("(\n", "(\n    timeCodesPerSecond = 25\n", 1)
    done, folder = record(text, "--products", "--frames", "1001:1001", out="out.####.exr")
    warned = [line for line in done.stderr.splitlines() if "other times than that of the host's camera" in line]
    assert len(warned) == 1 and "/Settings/B" in warned[0], done.stderr
    header = channels(folder / "a.1001.exr")[1]
    rate = header["framesPerSecond"]
    assert (rate.numerator, rate.denominator) == (25, 1) and header["frame"] == 1001.0
    assert header["software"] == header["oocpt:renderer"] and header["software"].startswith("OocPT ")
    assert header["expTime"] == pytest.approx(0.5 / 25) and header["oocpt:timeCodesPerSecond"] == 25.0
    assert (header["oocpt:shutterOpen"], header["oocpt:shutterClose"], header["oocpt:frame"]) == (-0.25, 0.25, 1001.0)
    code = header["timeCode"]
    assert [code.hours, code.minutes, code.seconds, code.frame] == [0, 0, 40, 1]
    spec = oiio.ImageInput.open(str(folder / "a.1001.exr")).spec()
    assert spec.getattribute("FramesPerSecond") == (25, 1) and spec.getattribute("frame") == 1001.0
    assert spec.getattribute("ExposureTime") == pytest.approx(0.5 / 25)


def test_parts_of_light_are_images_of_hosts(pool):
    pictures = seen(pool.get("legacy"), aovs=("color", "lpe:C<RD>L", "lpe:C<RD>.+L", "lpe:CL"))
    parts = [pictures[f"lpe:{name}"] for name in ["C<RD>L", "C<RD>.+L", "CL"]]
    assert all(part.shape == (*SIZE[::-1], 3) for part in parts) and parts[0].any() and parts[1].any()
    np.testing.assert_allclose(sum(parts), pictures["color"][..., :3], rtol=1e-5, atol=1e-7)


def test_an_aov_that_is_no_expression_is_a_warning(pool):
    picture = pool.get("legacy").picture(stage({}), SIZE, camera="/Eye", aovs=["color", "lpe:C<RD"])
    told = [line for line in picture.log.splitlines() if "lpe:C<RD is left out" in line and "character 5" in line]
    assert len(told) == 1 and picture["color"].any(), picture.log


def test_every_policy_for_another_aspect_ratio(record, pool):
    """The camera's aperture is 4 : 3; a picture of 2 : 1 widens or cuts it, or has other pixels."""
    wide = (64, 32)
    apertures = {
        "expandAperture": (36, 18), "cropAperture": (24, 12), "adjustApertureWidth": (36, 18),
        "adjustApertureHeight": (24, 12),
    }  # fmt: skip
    products = {
        policy: product(policy, f"{policy}.exr", size=wide, more=f'uniform token aspectRatioConformPolicy = "{policy}"')
        for policy in [*apertures, "adjustPixelAspectRatio"]
    }
    third = 'uniform float pixelAspectRatio = 0.3333333333\nuniform token aspectRatioConformPolicy = "expandAperture"'
    products["Narrow"] = product("Narrow", "narrow.exr", size=(96, 32), more=third)
    _, folder = record(stage(products), "-rs", "/Settings")
    host = pool.get("legacy")
    for policy, aperture in apertures.items():
        ids = as_ids(channels(folder / f"{policy}.exr")[0]["ids"])
        expected = seen(host, wide, aperture)["primId"]
        assert (ids >= 0).any() and (ids == expected).all(), f"{policy}: {(ids != expected).sum()} pixels"
    _, header = channels(folder / "adjustPixelAspectRatio.exr")
    compare.near(header["pixelAspectRatio"], 24 / 18 / 2, 1e-6, "wider than the picture by so much")
    layers, header = channels(folder / "narrow.exr")
    compare.near(header["pixelAspectRatio"], 1 / 3, 1e-6, "as authored")
    square = seen(host, (32, 32), (24, 24))["primId"]
    assert (as_ids(layers["ids"])[:, 1::3] == square).all(), "three pixels where others have one"


def test_windows_crop_and_add_overscan(record, pool):
    overscan = "uniform float4 dataWindowNDC = (-0.25, -0.25, 1.25, 1.25)"
    crop = "uniform float4 dataWindowNDC = (0.25, 0, 0.5, 0.75)"
    none = "uniform float4 dataWindowNDC = (0.5, 0.5, 0.5, 0.5)"
    products = {
        name: product(name, f"{name}.exr", ["ids", "beauty"], more=more)
        for name, more in [("Over", overscan), ("Crop", crop), ("No", none)]
    }
    done, folder = record(stage(products), "--products", "--enableDomeLightVisibility")
    expected = seen(pool.get("legacy"), aovs=("primId", "color"))
    whole = expected["primId"]
    width, height = SIZE
    layers, header = channels(folder / "Over.exr")
    low, high = header["dataWindow"]
    assert tuple(low) == (-16, -12) and tuple(high) == (width + 15, height + 11), header["dataWindow"]
    assert tuple(header["displayWindow"][1]) == (width - 1, height - 1)
    ids = as_ids(layers["ids"])
    inner = ids[12:-12, 16:-16]
    assert (inner == whole).all(), f"what the display window shows: {np.argwhere(inner != whole)}"
    layers, header = channels(folder / "Crop.exr")
    low, high = header["dataWindow"]
    assert tuple(low) == (16, 12) and tuple(high) == (31, height - 1), "y goes down"
    assert (as_ids(layers["ids"]) == whole[: height - 12, 16:32]).all() and (whole[: height - 12, 16:32] >= 0).any()
    compare.same_bits(exr.read(folder / "Crop.exr"), expected["color"][: height - 12, 16:32], "of the whole picture")
    assert "/Settings/No: the product is not written" in done.stderr, done.stderr


def test_a_product_overwrites_pictures_alone(record, tmp_path):
    (tmp_path / "notes.exr").write_text("a text")
    sky = np.ones((4, 8, 3), dtype=np.float32)
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": sky}) as file:
        file.write(str(tmp_path / "sky.exr"))
        file.write(str(tmp_path / "old.exr"))
    before = (tmp_path / "sky.exr").read_bytes()
    dome = 'def DomeLight "Sky"\n{\n    asset inputs:texture:file = @./sky.exr@\n}\n'
    products = {
        name: product(name, file)
        for name, file in [("Notes", "notes.exr"), ("Sky", "./sky.exr"), ("Old", "old.exr"), ("Script", "run.sh")]
    }
    done, folder = record(stage(products, camera=CAMERA + dome.replace("{", "{{").replace("}", "}}")), "--products",
                          fails=True)  # fmt: skip
    assert (folder / "notes.exr").read_text() == "a text" and (folder / "sky.exr").read_bytes() == before
    assert "ids" in channels(folder / "old.exr")[0] and not (folder / "run.sh").exists()
    for name, words in [("Notes", "is no EXR file"), ("Sky", "the scene reads"), ("Script", "is no EXR file")]:
        assert any(name in line and words in line for line in done.stderr.splitlines()), (name, done.stderr)


def test_nobody_asked_for_products(record):
    products = {"Only": product("Only", "only.exr", ["beauty"], (8, 8))}
    done, folder = record(stage(products), "--imageWidth", "16")
    assert exr.read(folder / "out.exr").shape[:2] == (12, 16) and not (folder / "only.exr").exists()
    assert "have 1 product; --products" in done.stderr, done.stderr
    done, _ = record(stage({}), "--products", fails=True)
    assert "have no products" in done.stderr
    unnamed = stage(products).replace('renderSettingsPrimPath = "/Settings"', "")
    done, _ = record(unnamed, "--products", fails=True)
    assert "names no render settings" in done.stderr and "Traceback" not in done.stderr, done.stderr


def test_a_product_without_a_size_is_told_where_it_was_wanted(record):
    empty = stage({"Only": product("Only", "only.exr", ["beauty"], (0, 8))})
    done, _ = record(empty, "--imageWidth", "8")
    assert "is not written" not in done.stderr, done.stderr
    done, folder = record(empty, "--products")
    assert "/Settings/Only: the product is not written" in done.stderr, done.stderr
    assert not (folder / "only.exr").exists()


def test_interactive_hosts_write_nothing(host, tmp_path):
    text = stage({"Only": product("Only", f"{tmp_path}/only.exr", ["beauty"], (16, 12))})
    activate = 'engine.SetActiveRenderSettingsPrimPath(Sdf.Path("/Settings"))'
    for interactive in (True, False):
        with host.open(text, (16, 12), camera="/Eye", settings={"enableInteractive": interactive}) as view:
            view.edit(activate)
            view.render()
        assert (tmp_path / "only.exr").exists() != interactive


def test_an_edit_of_a_product_writes_it_again(host, tmp_path):
    """Nothing is traced for it: the picture is there."""
    text = stage({"Only": product("Only", f"{tmp_path}/a.exr", ["beauty"], SIZE)})
    with host.open(text, SIZE, camera="/Eye", settings={"enableInteractive": False}) as view:
        view.edit('engine.SetActiveRenderSettingsPrimPath(Sdf.Path("/Settings"))')
        view.render()
        view.edit(f'stage.GetPrimAtPath("/Settings/Only").GetAttribute("productName").Set("{tmp_path}/b.exr")')
        view.render()
    compare.same_bits(exr.read(tmp_path / "b.exr"), exr.read(tmp_path / "a.exr"), "the same picture")


def test_aovs_of_the_command_line(record):
    _, folder = record(stage({}), "--imageWidth", "32", out="plain.exr")
    done, _ = record(stage({}), "--imageWidth", "32", "--aov", "albedo,primId", "--frames", "1:2", out="with.#.exr")
    for frame in (1, 2):
        layers, header = channels(folder / f"with.{frame}.exr")
        assert sorted(layers) == ["A", "B", "G", "R", "albedo.B", "albedo.G", "albedo.R", "primId"]
        compare.same_bits(exr.read(folder / f"with.{frame}.exr"), exr.read(folder / "plain.exr"), "the same colour")
        assert header["oocpt:samples"] == 4.0, "settings of the scene hold"
    assert done.stderr.count("samples, ") == 2, f"a render a frame: {done.stderr}"
    done, _ = record(stage({}), "--aov", "albdo", fails=True)
    assert done.returncode == 2 and "did you mean albedo?" in done.stderr
    done, _ = record(stage({}), "--aov", "albedo", out="out.png", fails=True)
    assert done.returncode == 2 and "needs an EXR image" in done.stderr


@BOTH
def test_matrices_of_the_header_lead_from_points_to_pixels(record):
    """`worldToNDC` takes what a pixel shows back to the pixel, in the whole picture and in a crop with overscan."""
    window = "float4 dataWindowNDC = (-0.125, 0.25, 0.75, 1.0)"
    VARS["P"] = var("P", "P", "point3f")
    try:
        products = {
            "whole": product("whole", "whole.exr", ("P", "ids")),
            "part": product("part", "part.exr", ("P", "ids"), more=window),
        }
        _, folder = record(stage(products, settings="bool oocpt:filterAovs = 0"), "--products")
    finally:
        del VARS["P"]
    for name in ("whole", "part"):
        layers, header = channels(folder / f"{name}.exr")
        (left, top), (right, bottom) = header["dataWindow"]
        points = np.stack([layers[f"P.{axis}"] for axis in "XYZ"], -1)[::-1].astype(np.float64)
        seen_at = (layers["ids"][::-1] != np.uint32(0xFFFFFFFF)).nonzero()
        assert len(seen_at[0]) > 100
        rows = np.concatenate([points[seen_at], np.ones((len(seen_at[0]), 1))], 1)
        ndc = rows @ np.array(header["worldToNDC"], np.float64).reshape(4, 4)
        pixels = ndc[:, :2] / ndc[:, 3:] * SIZE
        centres = np.stack([seen_at[1] + left + 0.5, seen_at[0] + top + 0.5], 1)
        assert np.abs(pixels - centres).max() < 0.01, f"{name}: {np.abs(pixels - centres).max(0)}"
        assert (right - left + 1, bottom - top + 1) == points.shape[1::-1]
        behind = rows @ np.array(header["worldToCamera"], np.float64).reshape(4, 4)
        assert (behind[:, 2] < 0).all(), "the view looks along -z"


def test_denoised_pictures_say_so(record):
    _, folder = record(stage({}), "--imageWidth", "64", out="plain.exr")
    done, _ = record(stage({}), "--imageWidth", "64", "--aov", "denoised", out="layer.exr")
    layers, header = channels(folder / "layer.exr")
    assert header["oocpt:denoised"] == "layer" and header["oocpt:denoiser"].startswith("Open Image Denoise 2.")
    assert "denoised in" in done.stderr, done.stderr
    plain = exr.read(folder / "plain.exr")
    compare.same_bits(exr.read(folder / "layer.exr"), plain, "the colour as it is")
    record(stage({}), "--imageWidth", "64", "--set", "oocpt:denoise=final", out="final.exr")
    final, header = channels(folder / "final.exr")
    assert header["oocpt:denoised"] == "color"
    assert np.array_equal(final["R"], layers["denoised.R"]) and not np.array_equal(final["R"], layers["R"])


CONFIG = """ocio_profile_version: 2
roles: {default: lin_rec709, scene_linear: lin_rec709}
displays:
  eye: [!<View> {name: dim, colorspace: shown}]
active_displays: [eye]
active_views: [dim]
colorspaces:
  - !<ColorSpace> {name: lin_rec709}
  - !<ColorSpace>
    name: shown
    from_scene_reference: !<ExponentTransform> {value: [2, 2, 2, 1]}
"""


def test_colours_are_written_in_the_rendering_space(record):
    """Colour and albedo are those of linear Rec. 709 in the space that the settings name; other layers stay."""
    names = ("beauty", "albedo", "N")
    VARS["albedo"] = var("albedo", "albedo", "color3f")

    def render(space):
        settings = f'uniform token renderingColorSpace = "{space}"' if space else ""
        done, folder = record(stage({"all": product("all", "all.exr", names)}, settings), "--products")
        return done.stderr, channels(folder / "all.exr")

    try:
        said, (plain, header) = render("")
        assert "renderingColorSpace" not in said and "chromaticities" not in header
        color = np.stack([plain[name] for name in "RGB"], axis=-1)
        assert np.ptp(color, axis=-1).max() > 0.05, "there is colour"
        mine, other = Gf.ColorSpace("lin_rec709_scene"), Gf.ColorSpace("lin_ap1_scene")
        matrix = np.array([other.Convert(mine, Gf.Vec3f(*unit)).GetRGB() for unit in np.eye(3)]).T
        said, (aces, header) = render("acescg")
        assert "files of render products" in said and "did you mean" not in said
        assert np.allclose(header["chromaticities"], (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767))
        assert header["oocpt:renderingColorSpace"] == "lin_ap1_scene"
        for layer in ("", "albedo."):
            before, after = (np.stack([file[layer + name] for name in "RGB"], axis=-1) for file in (plain, aces))
            assert np.allclose(after, before @ matrix.T, rtol=1e-5, atol=1e-6) and not np.allclose(after, before)
        for name in ("A", "N.X", "N.Y", "N.Z"):
            assert np.array_equal(aces[name], plain[name]), f"{name} is no colour"
        said, (other, header) = render("lin_ap2")
        assert "did you mean lin_ap1_scene?" in said and "chromaticities" not in header
        assert all(np.array_equal(other[name], plain[name]) for name in plain), "as without one"
    finally:
        del VARS["albedo"]


def test_a_film_that_outgrows_the_device_is_written_all_the_same(record):
    def render(**environment):
        wanted = {"all": product("all", "all.exr", ("beauty", "N", "ids", "depth"), size=(320, 240))}
        done, folder = record(stage(wanted), "--products", **environment)
        return done.stderr, channels(folder / "all.exr")[0]

    said, whole = render()
    assert "windows" not in said
    said, parts = render(OOCPT_MEMORY_BUDGET="12")
    assert "the film in " in said, said
    assert len(whole) == 9 and all(np.array_equal(parts[name], whole[name]) for name in whole)


def test_pictures_for_eyes_take_an_opencolorio_config(record, tmp_path):
    from PIL import Image

    config = tmp_path / "config.ocio"
    config.write_text(CONFIG)
    flags = ["--imageWidth", "16", "--colorCorrectionMode"]
    _, folder = record(stage({}), *flags, "disabled", out="linear.exr")
    expected = np.clip(exr.read(folder / "linear.exr")[::-1], 0, 1) ** [2, 2, 2, 1]
    record(stage({}), *flags, "openColorIO", out="of_variable.png", OCIO=str(config))
    named = stage({}).replace("(\n", "(\n    colorConfiguration = @./config.ocio@\n", 1)
    record(named, *flags, "openColorIO", out="of_stage.png", OCIO="")
    for name in ("of_variable", "of_stage"):
        shown = np.asarray(Image.open(folder / f"{name}.png"), dtype=np.float64) / 255
        compare.near(shown, expected, 0.6 / 255, name)
    done, _ = record(stage({}), *flags, "openColorIO", out="none.png", fails=True, OCIO="")
    assert "needs a config" in done.stderr and not (folder / "none.png").exists()
