# SPDX-License-Identifier: Apache-2.0
"""Random render settings, products and vars as hostile or careless files have them. A seed gives the same text always.

Pictures are a few pixels, and sizes are small or too large for any device, so that a stage of a hundred products takes
a few seconds. Names stay in the folder of the test, but for devices and what no name of a picture can write.
"""

from __future__ import annotations

import random

STAGE = """#usda 1.0
(
    renderSettingsPrimPath = "/Settings"
    timeCodesPerSecond = {rate}
)
def Camera "Eye"
{{
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def Camera "Broken"
{{
    float horizontalAperture = {aperture}
    float verticalAperture = 0
    float focalLength = {focal}
    float2 clippingRange = (nan, -1)
    double shutter:open = inf
    float fStop = -3
}}
def Sphere "Ball"
{{
    string primvars:dept = "ball"
    float[] primvars:odd = [1, 2, 3] (interpolation = "uniform")
    rel camera = </Ball.camera>
}}
def SphereLight "Lamp"
{{
    double3 xformOp:translate = (3, 3, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def RenderSettings "Settings"
{{
    rel camera = </Eye>
    rel products = [{products}]
    uniform int2 resolution = (8, 6)
    int oocpt:samplesPerPixel = 1
    int oocpt:maxBounces = 1
{settings}
}}
{prims}
"""
NUMBERS = ["0", "1", "2.5", "-1", "nan", "inf", "-inf", "1e30", "1e-30"]
SIZES = ["(8, 6)"] * 16 + ["(6, 8)", "(0, 8)", "(-4, 4)", "(2147483647, 2147483647)", "(65537, 1)", "(-2147483648, 1)"]
KINDS = ["raster"] * 30 + ["", "deep", "deepRaster", "arnold", "volume", "ra\\u0000ster", "é字", "x" * 3000]
SOURCES = [
    "Ci", "a", "z", "N", "albedo", "primId", "motion", "CryptoObject", "CryptoMaterial", "CryptoAsset:dept",
    "CryptoObject:", "crypto_object01", "st", "primvars:dept", "primvars:", "denoisd", "", " ", "é字", "lpe:C<RD>L",
    "color lpe:", "..", "/etc/passwd", "variance", "error", "RGBA_", "RGBA_é字", "sampleCount", "a" * 5000,
]  # fmt: skip
PATHS = [
    "C<RD>L", "C.*[LO]", "C", "", "C(((((((((L", "C" + "(.|" * 300, "[^", "C<.'" + "k" * 900 + "'>L", "unoccluded;CL",
    "shadows;CL", "C.{1,3000}L", "C*" * 200, "é字",
]  # fmt: skip
TYPES = ["color3f"] * 4 + ["", "float", "half", "int", "string", "token", "color4h", "matrix4d", "float99", "é字", "[]"]
SETTINGS = [
    ("string oocpt:compression", ['"zip"', '"dwaa"', '"é字"', '""', '"' + "z" * 500 + '"']),
    ("bool oocpt:tiled", ["0", "1"]),
    ("int oocpt:tileSize", ["16", "0", "-1", "2147483647"]),
    ("bool oocpt:multipart", ["0", "1"]),
    ("int oocpt:deepSamples", ["4", "0", "-9", "1000000"]),
    ("float oocpt:deepTolerance", NUMBERS),
    ("float arnold:depth_tolerance", NUMBERS),
    ("token arnold:driver", ['"driver_deepexr"', '"driver_tiff"', '""']),
    ("string driver:parameters:OpenEXR:channels", ['"none"']),
    ("string driver:parameters:OpenEXR:é", ['"x"']),
    ("string driver:parameters:artist", ['"' + "é字" * 3000 + '"']),
    ("matrix4d driver:parameters:OpenEXR:place", ["((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,nan))"]),
    ("float[] driver:parameters:OpenEXR:many", ["[1, nan]"]),
    ("bool oocpt:temporary", ["0"]),
    ("asset arnold:compression", ["@./a.exr@"]),
    ("double oocpt:seed", ["nan"]),
]
VAR_SETTINGS = [
    ("string driver:parameters:aov:name", ['"é字"', '""', '"a.b.c"', '"R"', '"' + "n" * 900 + '"', '"../x"']),
    ("string driver:parameters:aov:format", ['"half"', '"color3h"', '"é字"', '""']),
    ("bool driver:parameters:aov:cryptomatte", ["0", "1"]),
    ("string oocpt:cryptomattePrimvar", ['"dept"', '"odd"', '"nobody"', '""']),
    ("float[] driver:parameters:aov:list", ["[]"]),
]
TARGETS = [
    "</Eye>", "</Eye>", "</Broken>", "</Ball>", "</Nobody>", "</Settings>", "</Ball.points>", "</V0>",
]  # fmt: skip


def _some(dice: random.Random, rows, most: int) -> str:
    chosen = dice.sample(rows, dice.randrange(most))
    return "".join(f"    {name} = {dice.choice(values)}\n" for name, values in chosen)


def _var(dice: random.Random, name: str) -> str:
    is_path = dice.random() < 0.2
    kind = "lpe" if is_path else dice.choice(["raw", "raw", "raw", "intrinsic", "primvar", "", "é字"])
    source = dice.choice(PATHS if is_path else SOURCES)
    return (
        f'def RenderVar "{name}"\n{{\n    uniform token dataType = "{dice.choice(TYPES)}"\n'
        f'    uniform string sourceName = "{source}"\n    uniform token sourceType = "{kind}"\n'
        f"{_some(dice, VAR_SETTINGS, 3)}}}\n"
    )


def names(dice: random.Random, folder: str, at: int) -> str:
    """A name of a file: usable ones, and others."""
    return dice.choice(
        [f"p{at}.exr"] * 40
        + [
            "same.exr", f"{folder}/sub/{at}/../p{at}.exr", f"./a/b/c/p{at}.exr", "", " ", ".exr", "..", "../..", "exr",
            f"p{at}.tif", "/dev/null", "/dev/full", "full.exr", "pipe.exr", "folder.exr", "loop.exr",
            "folder.exr/x.exr", "text.exr", "text.exr/x.exr", "sky é字.exr", f"{'n' * 300}.exr",
            f"{'d/' * 3000}x.exr", f"{'l' * 5000}.exr", "a<F4>.exr", "$F99.exr", "<F999999>.exr", "#" * 300 + ".exr",
            "nul\\u0000.exr", "new\\nline.exr", "/proc/self/x.exr", "file://x.exr", "%s%n.exr", "-rf.exr", "~/x.exr",
        ]
    )  # fmt: skip


def _product(dice: random.Random, folder: str, at: int, variables: list[str]) -> str:
    targets = [f"</{name}>" for name in dice.sample(variables, dice.randrange(5))]
    if dice.random() < 0.1:
        targets.append(dice.choice(TARGETS + [f"</P{at}>", f"</P{at}.productName>"]))
    targets = list(dict.fromkeys(targets))
    lines = [
        f'    token productName = "{names(dice, folder, at)}"',
        f"    rel orderedVars = [{', '.join(targets)}]",
        f'    uniform token productType = "{dice.choice(KINDS)}"',
    ]
    if dice.random() < 0.3:
        lines.append(f"    uniform int2 resolution = {dice.choice(SIZES)}")
    if dice.random() < 0.15:
        lines.append(f"    rel camera = {dice.choice(TARGETS)}")
    if dice.random() < 0.1:
        lines.append(f"    uniform float pixelAspectRatio = {dice.choice(NUMBERS)}")
    if dice.random() < 0.1:
        policy = dice.choice(["cropAperture", "adjustPixelAspectRatio", "é字", ""])
        lines.append(f'    uniform token aspectRatioConformPolicy = "{policy}"')
    if dice.random() < 0.1:
        window = ", ".join(dice.choice(["0", "0.5", "1", "-0.5", *NUMBERS]) for _ in range(4))
        lines.append(f"    uniform float4 dataWindowNDC = ({window})")
    if dice.random() < 0.1:
        lines.append("    uniform bool disableDepthOfField = 1")
    body = "\n".join(lines)
    return f'def RenderProduct "P{at}"\n{{\n{body}\n{_some(dice, SETTINGS, 3)}}}\n'


def stage(seed: int, folder: str, count: int) -> str:
    """The text of a stage with `count` products, `/P0` and so on, that write below `folder` or nowhere."""
    dice = random.Random(seed)
    variables = [f"V{at}" for at in range(12)]
    prims = [_var(dice, name) for name in variables]
    prims += [_product(dice, folder, at, variables) for at in range(count)]
    products = [f"</P{at}>" for at in range(count)]
    products += [dice.choice(["</Broken>", "</Settings>", "</Nobody>", "</V0>", "</Ball>", "</V0.sourceName>"])]
    space = dice.choice(["", "acescg", "é字", "lin_rec709_scene", "raw", "x" * 400])
    settings = f'    uniform token renderingColorSpace = "{space}"\n' + _some(
        dice, [("float oocpt:tileSize", NUMBERS), ("string oocpt:unknown", ['"x"']), ("int oocpt:seed", ["-1", "7"])], 2
    )
    return STAGE.format(
        rate=dice.choice(["24", "25", "0", "1e-30", "1000"]), aperture=dice.choice(NUMBERS), focal=dice.choice(NUMBERS),
        products=", ".join(products), settings=settings, prims="".join(prims),
    )  # fmt: skip
