# SPDX-License-Identifier: Apache-2.0
"""Deep render products, read by OpenImageIO and OpenEXR: flattened by code of their own they are the flat picture.

The scene has what puts several things into a pixel: hair, motion, depth of field, nested instances, a surface of which
a third is there, glass, a dome that is seen.
"""

import json
import os
import re
import subprocess

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest

import test_cryptomatte

SIZE = (64, 48)
GLASS = """
    def Sphere "Glass" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        rel material:binding = </World/Looks/Clear>
        double radius = 0.5
        double3 xformOp:translate = (1.2, 0.9, 0.8)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Mesh "Veil" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        rel material:binding = </World/Looks/Thin>
        double3 xformOp:scale = (3, 2, 1)
        double3 xformOp:translate = (-0.4, -0.3, 1.6)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
"""
SKY = 'def DomeLight "Sky"\n{\n    float inputs:intensity = 0.7\n    color3f inputs:color = (0.3, 0.6, 1)\n}\n'
CLEAR = "float inputs:opacity = 0\n            float inputs:ior = 1.5\n            int inputs:useSpecularWorkflow = 0"


def material(name, color, more):
    text = test_cryptomatte.MATERIAL.format(name=name, color=color)
    return text.replace("float inputs:ior = 1\n", more + "\n")


LOOKS = material("Thin", (0.2, 0.1, 0.3), "float inputs:ior = 1\n            float inputs:opacity = 0.34")
LOOKS += material("Clear", (0, 0, 0), CLEAR)
VARS = {
    "beauty": ("Ci", "color4f"),
    "halves": ("Ci", "color4h"),
    "prim": ("primId", "int"),
    "instance": ("instanceId", "int"),
    "CryptoObject": ("CryptoObject", "float"),
    "CryptoAsset": ("CryptoAsset", "float"),
}
DEEP = 'token productType = "deepRaster"'


def product(name, names=("beauty",), more=""):
    targets = ", ".join(f"</Vars/{var}>" for var in names)
    return (
        f'def RenderProduct "{name}"\n{{\n    token productName = "{name}.exr"\n    rel orderedVars = [{targets}]\n'
        f"    uniform int2 resolution = {SIZE}\n    {more}\n}}\n"
    )


def stage(products, settings="", things=True):
    """The scene; `products` by name."""
    body = test_cryptomatte.SCENE.replace("#usda 1.0\n(", '#usda 1.0\n(\n    renderSettingsPrimPath = "/Settings"')
    looks = '    def Scope "Looks"\n    {\n'
    body = body.replace(looks, looks + LOOKS, 1)
    if things:
        mover = '    def Mesh "Mover"'
        body = body.replace(mover, GLASS + test_cryptomatte.CARD + "    }\n" + mover, 1) + SKY
    variables = "".join(
        f'def RenderVar "{name}"\n{{\n    uniform token dataType = "{kind}"\n'
        f'    uniform string sourceName = "{source}"\n}}\n'
        for name, (source, kind) in VARS.items()
    )
    targets = ", ".join(f"</Settings/{name}>" for name in products)
    return (
        f'{body}\ndef RenderSettings "Settings"\n{{\n    rel camera = </Eye>\n    rel products = [{targets}]\n'
        f"    int oocpt:samplesPerPixel = 24\n    int oocpt:maxBounces = 2\n    {settings}\n"
        + "".join(product(name, *rest) for name, rest in products.items())
        + f'}}\ndef Scope "Vars"\n{{\n{variables}}}\n'
    )


def record(folder, text, *flags):
    scene = folder / "scene.usda"
    scene.write_text(text)
    variables = dict(os.environ, OOCPT_VALIDATION="1")
    variables.pop("PYTHONPATH", None)
    words = ["--disableCameraLight", "--enableDomeLightVisibility", "--products", "--frames", "1:1", *flags]
    done = subprocess.run(
        ["usdrecord", *words, str(scene), str(folder / "out.#.exr")], cwd=folder, env=variables, capture_output=True,
        text=True, timeout=300, check=False, start_new_session=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done


def flat(path):
    """Arrays by channel, top row first, and the header."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}, dict(file.header())


def samples(path):
    """For each pixel, top row first, a dictionary of arrays by channel; and the header."""
    layers, header = flat(path)
    assert header["type"] == OpenEXR.deepscanline, header["type"]
    height, width = layers["Z"].shape
    none = np.zeros(0, np.float32)
    pixels = [
        [{name: none if of[y, x] is None else of[y, x] for name, of in layers.items()} for x in range(width)]
        for y in range(height)
    ]
    return pixels, header


def over(pixel):
    """What is seen of each sample: what those in front of it leave."""
    alpha = pixel["A"].astype(np.float64)
    return np.concatenate([[1.0], np.cumprod(1.0 - alpha)[:-1]]) if len(alpha) else alpha


def flattened(pixels, names="RGBA"):
    return np.array(
        [[[(pixel[name] * over(pixel)).sum() for name in names] for pixel in row] for row in pixels], dtype=np.float64
    )


def by_oiio(path, names="RGBA"):
    image = oiio.ImageBuf(str(path))
    assert image.spec().deep, path
    result = oiio.ImageBufAlgo.flatten(image)
    assert not result.has_error, result.geterror()
    order = [result.spec().channelnames.index(name) for name in names]
    return result.get_pixels(oiio.FLOAT)[..., order]


def of_flat(path, names="RGBA"):
    layers, header = flat(path)
    return np.stack([layers[name] for name in names], -1).astype(np.float64), header


def close(a, b, relative, what):
    difference = np.abs(a - b) - relative * np.maximum(np.abs(b), 1.0)
    assert difference.max() <= 0, f"{what}: by up to {np.abs(a - b).max():g} at {np.argmax(difference)}"


CROP = "uniform float4 dataWindowNDC = (0.25, 0, 0.75, 0.75)"
OVERSCAN = "uniform float4 dataWindowNDC = (-0.125, -0.125, 1.125, 1.125)"
PAIRS = {
    "whole": "",
    "crop": CROP,
    "over": OVERSCAN,
    "none": 'string oocpt:compression = "none"',
    "few": "int oocpt:deepSamples = 2",
    "coarse": "float oocpt:deepTolerance = 0.5",
}


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Each product flat and deep, rendered at once."""
    folder = tmp_path_factory.mktemp("deep")
    names = ("beauty", "prim", "instance", "CryptoObject", "CryptoAsset")
    products = {name: (("beauty", "CryptoObject"), more if "Window" in more else "") for name, more in PAIRS.items()}
    products |= {f"{name}_deep": (names, f"{DEEP}\n    {more}") for name, more in PAIRS.items()}
    products["half_deep"] = (("halves",), DEEP)
    done = record(folder, stage(products))
    assert "warning" not in done.stderr.lower(), done.stderr
    return folder


@pytest.mark.parametrize("name", PAIRS)
def test_a_flattened_image_is_the_flat_picture(pictures, name):
    expected, header = of_flat(pictures / f"{name}.exr")
    pixels, deep = samples(pictures / f"{name}_deep.exr")
    close(flattened(pixels), expected, 2e-6, "by numpy")
    close(by_oiio(pictures / f"{name}_deep.exr"), expected, 2e-6, "by OpenImageIO")
    for key in ("dataWindow", "displayWindow", "worldToNDC", "pixelAspectRatio"):
        assert np.array_equal(np.asarray(header[key]), np.asarray(deep[key])), key
    counts = np.array([[len(pixel["Z"]) for pixel in row] for row in pixels])
    assert counts.max() == deep["maxSamplesPerPixel"] <= (2 if name == "few" else 16)
    assert (counts > 1).mean() > 0.2, "pixels show several things"
    for pixel in (pixel for row in pixels for pixel in row):
        assert (np.diff(pixel["Z"]) >= 0).all() and (pixel["Z"] > 0).all(), "nearest first"
        assert ((pixel["A"] > 0) & (pixel["A"] <= 1)).all(), pixel
    # Things let through what is behind them in part, and what is last hides all: the sky.
    assert (np.array([[pixel["A"][-1] for pixel in row] for row in pixels]) > 0.999).all()


def test_halves_are_halves(pictures):
    expected, _ = of_flat(pictures / "whole.exr")
    pixels, header = samples(pictures / "half_deep.exr")
    assert pixels[0][0]["R"].dtype == np.float16 and pixels[0][0]["Z"].dtype == np.float32
    assert sorted(pixels[0][0]) == ["A", "B", "G", "R", "Z"], header
    close(flattened(pixels), expected, 4e-3, "to the precision of halves")


def manifest(header, layer):
    """Names by the hashes of a layer."""
    key = f"cryptomatte/{test_cryptomatte.murmur3(layer):08x}"[: len("cryptomatte/") + 7]
    return {int(value, 16): name for name, value in json.loads(header[f"{key}/manifest"]).items()}


def test_samples_are_of_the_things_that_are_counted(pictures):
    """By name: what is seen of a thing's samples is its share in the flat Cryptomatte layer."""
    layers, header = flat(pictures / "whole.exr")
    shares = test_cryptomatte.matte(layers, header, "CryptoObject")
    pixels, deep = samples(pictures / "whole_deep.exr")
    names, assets = manifest(deep, "CryptoObject"), manifest(deep, "CryptoAsset")
    assert set(names.values()) == set(shares), "the same names"
    seen = {name: np.zeros(SIZE[::-1]) for name in shares}
    by_ids = {}
    for y, row in enumerate(pixels):
        for x, pixel in enumerate(row):
            for at, share in enumerate(over(pixel) * pixel["A"]):
                if pixel["prim"][at] == 0xFFFFFFFF:
                    assert pixel["Z"][at] > 1e29 and pixel["CryptoObject"][at] == 0, "the sky"
                    continue
                name = names[int(pixel["CryptoObject"][at])]
                asset = f"/World/Forest[{name.split('[')[1][0]}]" if "[" in name else "/World"
                assert assets[int(pixel["CryptoAsset"][at])] == asset, name
                seen[name][y, x] += share
                by_ids.setdefault((pixel["prim"][at], pixel["instance"][at]), name)
                assert by_ids[pixel["prim"][at], pixel["instance"][at]] == name
    for name, share in shares.items():
        close(seen[name], share, 1e-5, name)
    assert len(by_ids) == len(shares) > 8, by_ids


def test_depths_are_along_the_view_axis(pictures):
    pixels, header = samples(pictures / "whole_deep.exr")
    key = next(key for key in header if key.startswith("cryptomatte/") and key.endswith("/manifest"))
    hashes = {name: int(value, 16) for name, value in json.loads(header[key]).items()}
    # The camera looks along -z from z = 9.
    planes = {"Mover": 8.5, "Veil": 7.4}
    for end, depth in planes.items():
        value = next(hashed for name, hashed in hashes.items() if name.endswith(end))
        depths = [pixel["Z"][pixel["CryptoObject"] == value] for row in pixels for pixel in row]
        assert max(len(of) for of in depths) == 1, "one sample of a card that faces the camera"
        depths = np.concatenate(depths)
        assert len(depths) > 50 and np.abs(depths - depth).max() < 1e-5, (end, depths.min(), depths.max())


def test_a_coarse_tolerance_leaves_one_sample_of_a_thing(pictures):
    count = {}
    for name in ("whole", "coarse"):
        pixels, _ = samples(pictures / f"{name}_deep.exr")
        things = [len(set(zip(p["prim"], p["instance"]))) for row in pixels for p in row]
        count[name] = (sum(len(p["Z"]) for row in pixels for p in row), sum(things))
    assert count["coarse"][0] == count["coarse"][1] == count["whole"][1] < count["whole"][0], count


def test_merged_images_of_two_things_are_the_image_of_both(tmp_path):
    """Nothing lights anything else here. Where the card in front of the trees covers all or nothing of a pixel, over is
    exact; where it covers a part, over takes coverages as independent."""
    images = {}
    for name, hidden in (("both", ()), ("front", ("Forest", "Hair")), ("back", ("Mover",))):
        text = stage({"deep": (("beauty",), DEEP)}, things=False)
        text = re.sub("xformOp:translate.timeSamples = .*", "xformOp:translate = (-0.8, -0.5, 0.5)", text)
        for kind in hidden:
            behind, count = re.subn(f'"{kind}" .prepend', f'"{kind}" (\nactive = false\nprepend', text)
            text = behind if count else text.replace(f'"{kind}"', f'"{kind}" (active = false)', 1)
        folder = tmp_path / name
        folder.mkdir()
        record(folder, text)
        images[name] = folder / "deep.exr"
    merged = oiio.ImageBufAlgo.deep_merge(oiio.ImageBuf(str(images["front"])), oiio.ImageBuf(str(images["back"])))
    merged = oiio.ImageBufAlgo.flatten(merged).get_pixels(oiio.FLOAT)[..., :4]
    parts = [by_oiio(images[name])[..., 3] for name in ("front", "back")]
    both = by_oiio(images["both"])
    is_clear = (parts[0] < 1e-6) | (parts[0] > 1 - 1e-6)
    assert 0.3 < is_clear.mean() < 0.98 and (parts[0] > 0).sum() > 100 and (parts[1] > 0).sum() > 100
    in_both = (parts[0] > 0) & (parts[1] > 0)
    assert (in_both & is_clear).sum() > 20, "one is before the other"
    close(merged[is_clear], both[is_clear], 2e-6, "where one covers all or nothing")
    assert np.abs(merged - both).mean() < 0.02


def test_settings_that_make_no_sense_are_told(tmp_path):
    more = f"""{DEEP}
    int oocpt:deepSamples = 1000
    float oocpt:deepTolerance = -1
    string arnold:depth_tolerance = "deep"
    string oocpt:compression = "dwaa\""""
    VARS["albedo"] = ("albedo", "color3f")
    try:
        done = record(tmp_path, stage({"deep": (("beauty", "albedo"), more)}))
    finally:
        del VARS["albedo"]
    told = ["oocpt:deepSamples cannot be 1000", "oocpt:deepTolerance cannot be -1", "arnold:depth_tolerance cannot be",
            "zips is used", "deep samples have no albedo"]  # fmt: skip
    for words in told:
        assert words in done.stderr, (words, done.stderr)
    assert sorted(samples(tmp_path / "deep.exr")[0][0][0]) == ["A", "B", "G", "R", "Z"]
