# SPDX-License-Identifier: Apache-2.0
"""Every kind of image file, written by another program (Pillow, tifffile, OpenEXR, a newer OpenImageIO) or by hand,
texel by texel.

Each file is read in one box and decoded as a whole; both must be what the writer was given.
"""

from __future__ import annotations

import handmade
import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest
import tifffile
from image_host import HEIGHT, WIDTH, noise, write_exr
from PIL import Image

RGB = noise((HEIGHT, WIDTH, 3), np.uint8)
RGBA = noise((HEIGHT, WIDTH, 4), np.uint8)
GREY = noise((HEIGHT, WIDTH, 1), np.uint8)
GREY_ALPHA = noise((HEIGHT, WIDTH, 2), np.uint8)
INDEX = noise((HEIGHT, WIDTH), np.uint8)
PALETTE = noise((256, 3), np.uint8)


def holds(reader, path, expected: np.ndarray, scale: float = 1.0, tolerance: float = 0.0) -> dict:
    """The file has these texels, however it is read."""
    facts = reader.facts(path)
    assert facts["levels"][0] == [expected.shape[1], expected.shape[0]], facts
    assert facts["channels"] == expected.shape[2], facts
    for found in (reader.texels(path), reader.decoded(path)):
        np.testing.assert_allclose(
            found.astype(np.float64) * scale, expected.astype(np.float64), rtol=0, atol=tolerance
        )
    return facts


def write_oiio(path, texels: np.ndarray, **attributes) -> None:
    """By the OpenImageIO of the test environment, which is not the one that reads."""
    kind = {np.uint8: "uint8", np.uint16: "uint16", np.uint32: "uint32", np.float16: "half", np.float32: "float"}[
        texels.dtype.type
    ]
    spec = oiio.ImageSpec(texels.shape[1], texels.shape[0], texels.shape[2], kind)
    for name, value in attributes.items():
        if name == "tiles":
            spec.tile_width, spec.tile_height = value
        else:
            spec.attribute(name.replace("__", ":"), value)
    output = oiio.ImageOutput.create(str(path))
    assert (
        output and output.open(str(path), spec) and output.write_image(np.ascontiguousarray(texels)) and output.close()
    ), output.geterror()


@pytest.mark.parametrize("texels", [GREY, GREY_ALPHA, RGB, RGBA], ids=["1", "2", "3", "4"])
@pytest.mark.parametrize("interlaced", [False, True], ids=["plain", "interlaced"])
@pytest.mark.parametrize("deep", [False, True], ids=["8", "16"])
def test_png(reader, folder, texels, interlaced, deep):
    texels = (texels.astype(np.uint32) * 255 + 11).astype(np.uint16) if deep else texels
    (folder / "k.png").write_bytes(handmade.png(texels, interlaced))
    facts = holds(reader, folder / "k.png", texels, 65535.0 if deep else 1.0, 1e-2 if deep else 0.0)
    assert facts["format"] == (2 if deep else 0)


@pytest.mark.parametrize("bits", [1, 2, 4, 8])
@pytest.mark.parametrize("clear", [False, True], ids=["opaque", "tRNS"])
def test_png_with_a_palette(reader, folder, bits, clear):
    index = INDEX & ((1 << bits) - 1)
    image = Image.fromarray(index, "P")
    image.putpalette(PALETTE[: 1 << bits].tobytes())
    opacity = bytes((7 * i + 3) % 256 for i in range(1 << bits))
    image.save(folder / "p.png", bits=bits, **({"transparency": opacity} if clear else {}))
    expected = PALETTE[index]
    if clear:
        expected = np.concatenate([expected, np.frombuffer(opacity, np.uint8)[index][:, :, None]], axis=2)
    holds(reader, folder / "p.png", expected)


def test_png_with_a_transparent_color_key(reader, folder):
    Image.fromarray(GREY[:, :, 0]).save(folder / "t.png", transparency=int(GREY[3, 4, 0]))
    alpha = np.where(GREY == GREY[3, 4, 0], 0, 255)
    holds(reader, folder / "t.png", np.concatenate([GREY, alpha], axis=2))
    Image.fromarray(RGB).save(folder / "t3.png", transparency=tuple(int(v) for v in RGB[3, 4]))
    alpha = np.where((RGB == RGB[3, 4]).all(axis=2, keepdims=True), 0, 255)
    holds(reader, folder / "t3.png", np.concatenate([RGB, alpha], axis=2))


def test_png_of_one_bit(reader, folder):
    bits = INDEX > 127
    Image.fromarray(bits).save(folder / "bits.png")
    holds(reader, folder / "bits.png", bits[:, :, None] * 255.0)


def smooth(channels: int) -> np.ndarray:
    x, y = np.meshgrid(np.linspace(0, 250, 64), np.linspace(0, 250, 48))
    return np.stack([x, y, (x + y) / 2, 250 - x][:channels], axis=-1).astype(np.uint8)


@pytest.mark.parametrize("progressive", [False, True])
@pytest.mark.parametrize("channels", [1, 3])
def test_jpeg(reader, folder, progressive, channels):
    image = Image.fromarray(smooth(channels).squeeze())
    image.save(folder / "j.jpg", quality=100, subsampling=0, progressive=progressive)
    holds(reader, folder / "j.jpg", np.asarray(Image.open(folder / "j.jpg")).reshape(smooth(channels).shape), 1.0, 1)


def test_cmyk_jpeg(reader, folder):
    """Adobe writes CMYK inverted and says so, and so does Pillow."""
    inks = smooth(4)
    Image.fromarray(inks, "CMYK").save(folder / "cmyk.jpg", quality=100, subsampling=0)
    paper = 255.0 - inks.astype(np.float64)
    holds(reader, folder / "cmyk.jpg", paper[:, :, :3] * paper[:, :, 3:] / 255.0, 1.0, 4)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation_is_ignored(reader, folder, orientation):
    """Hydra's own readers of images know no orientation either, and texture coordinates were made for what they
    show."""
    exif = Image.Exif()
    exif[0x112] = orientation
    Image.fromarray(smooth(3)).save(folder / "turned.jpg", quality=100, subsampling=0, exif=exif)
    holds(reader, folder / "turned.jpg", smooth(3), 1.0, 4)
    tifffile.imwrite(
        folder / "turned.tif", RGB, photometric="rgb", extratags=[(274, 3, 1, orientation, True)], metadata=None
    )
    holds(reader, folder / "turned.tif", RGB)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32, np.float16, np.float32])
@pytest.mark.parametrize("tile", [None, (16, 32)], ids=["strips", "tiles"])
@pytest.mark.parametrize("planar", ["contig", "separate"])
@pytest.mark.parametrize("order", ["<", ">"], ids=["little", "big"])
def test_tiff(reader, folder, kind, tile, planar, order):
    texels = noise((HEIGHT, WIDTH, 3), np.float64)
    whole = np.issubdtype(kind, np.integer)
    texels = (texels * np.iinfo(kind).max).astype(kind) if whole else texels.astype(kind)
    data = texels if planar == "contig" else np.moveaxis(texels, 2, 0)
    tifffile.imwrite(
        folder / "k.tif", data, photometric="rgb", planarconfig=planar, tile=tile, byteorder=order, metadata=None,
        **({} if tile else {"rowsperstrip": 7}),
    )
    integer = {np.uint8: 1.0, np.uint16: 65535.0, np.uint32: 4294967295.0}.get(kind, 1.0)
    tolerance = (
        0.0
        if kind in (np.uint8, np.float16, np.float32)
        else 1e-2 if kind == np.uint16 else 300.0 if kind == np.uint32 else 0.0
    )
    facts = holds(reader, folder / "k.tif", texels, integer, tolerance)
    assert facts["tiled"] == bool(tile)


def test_tiff_of_64_bits_is_refused(reader, folder):
    """OpenImageIO 2.4 gives zeros."""
    tifffile.imwrite(folder / "d.tif", noise((HEIGHT, WIDTH, 3), np.float64), photometric="rgb", metadata=None)
    assert "64 bits" in reader.ask("facts", folder / "d.tif").get("error", "")


@pytest.mark.parametrize("texels", [GREY, GREY_ALPHA, RGBA], ids=["1", "2", "4"])
@pytest.mark.parametrize("planar", ["contig", "separate"])
def test_tiff_of_other_channels(reader, folder, texels, planar):
    data = texels if planar == "contig" else np.moveaxis(texels, 2, 0)
    grey = texels.shape[2] < 3
    alpha = ["unassalpha"] if texels.shape[2] in (2, 4) else None
    if texels.shape[2] == 1:
        data = texels[:, :, 0]
    tifffile.imwrite(
        folder / "c.tif", data, photometric="minisblack" if grey else "rgb", planarconfig=planar if alpha else None,
        extrasamples=alpha, metadata=None,
    )
    holds(reader, folder / "c.tif", texels)


@pytest.mark.parametrize(
    "compression", ["tiff_lzw", "tiff_adobe_deflate", "packbits", "tiff_deflate", "jpeg", "zstd", "lzma"]
)
def test_compressed_tiff(reader, folder, compression):
    Image.fromarray(RGB).save(folder / "z.tif", compression=compression)
    holds(reader, folder / "z.tif", np.asarray(Image.open(folder / "z.tif")), 1.0, 1 if compression == "jpeg" else 0)


@pytest.mark.parametrize(
    "attributes",
    [
        {"compression": "lzw"}, {"compression": "zip", "tiff__predictor": 2}, {"compression": "zip", "tiles": (16, 16)},
        {"compression": "lzw", "planarconfig": "separate"},
    ],
    ids=str,
)
@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_tiff_with_predictors(reader, folder, attributes, kind):
    texels = noise((HEIGHT, WIDTH, 3), kind)
    write_oiio(folder / "o.tif", texels, **attributes)
    holds(reader, folder / "o.tif", texels, 65535.0 if kind == np.uint16 else 1.0, 1e-2 if kind == np.uint16 else 0.0)


def test_big_tiff(reader, folder):
    tifffile.imwrite(folder / "big.tif", RGB, photometric="rgb", bigtiff=True, compression="zlib", metadata=None)
    holds(reader, folder / "big.tif", RGB)


def test_tiff_of_one_bit_and_of_a_palette(reader, folder):
    bits = np.where(INDEX > 127, 255, 0).astype(np.uint8)
    write_oiio(folder / "b.tif", bits[:, :, None], oiio__BitsPerSample=1)
    holds(reader, folder / "b.tif", bits[:, :, None])
    # Pillow leaves the number of bits out where it is one, and OpenImageIO 2.4 would take it for eight.
    Image.fromarray(INDEX > 127).save(folder / "silent.tif")
    assert "how many bits" in reader.ask("facts", folder / "silent.tif").get("error", "")
    image = Image.fromarray(INDEX, "P")
    image.putpalette(PALETTE.tobytes())
    image.save(folder / "p.tif")
    # Pillow writes 8 bits of a palette's 16, so one of 255 is lost.
    holds(reader, folder / "p.tif", PALETTE[INDEX], 1.0, 1)


def exr_channels(names: str | list[str], kind=np.float16) -> dict[str, np.ndarray]:
    texels = noise((HEIGHT, WIDTH, len(names)), kind)
    return {name: np.ascontiguousarray(texels[:, :, i]) for i, name in enumerate(names)}


def stacked(channels: dict[str, np.ndarray], names) -> np.ndarray:
    return np.stack([getattr(channels[name], "pixels", channels[name]) for name in names], axis=2)


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS", "ZIP", "PIZ"])
@pytest.mark.parametrize("tiled", [False, True], ids=["scanlines", "tiles"])
@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_exr(reader, folder, compression, tiled, kind):
    header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION")}
    if tiled:
        header |= {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    texels = noise((HEIGHT, WIDTH, 3), kind)
    write_exr(folder / "k.exr", texels, **header)
    facts = holds(reader, folder / "k.exr", texels)
    assert (facts["format"], facts["tiled"]) == (1 if kind == np.float16 else 2, tiled)


@pytest.mark.parametrize(
    "names, wanted",
    [
        (["R"], ["R"]),
        (["Y"], ["Y"]),
        (["Z"], ["Z"]),
        (["A"], ["A"]),
        (["Y", "A"], ["Y", "A"]),
        (["Y", "Z"], ["Y"]),
        (["R", "G", "B", "Z"], ["R", "G", "B"]),
        (["R", "G", "B", "A", "Z", "id"], ["R", "G", "B", "A"]),
        (["r", "g", "b"], ["r", "g", "b"]),
        (["diffuse.R", "diffuse.G", "diffuse.B"], ["diffuse.R", "diffuse.G", "diffuse.B"]),
        (["B", "G", "R", "albedo.B", "albedo.G", "albedo.R", "albedo.A"], ["R", "G", "B"]),
        (["N.X", "N.Y", "N.Z"], ["N.X", "N.Y", "N.Z"]),
        (["X", "Y", "Z"], ["X", "Y", "Z"]),
        (["u", "v"], ["u", "v"]),
        # OpenImageIO has these in the order R, G, B, real, A.
        (["R", "G", "B", "A", "real"], ["R", "G", "B", "A"]),
        (["red", "green", "blue"], ["red", "green", "blue"]),
        (["L.red", "L.green", "L.blue", "L.alpha"], ["L.red", "L.green", "L.blue", "L.alpha"]),
        (["Y", "A", "Z"], ["Y", "A"]),
        (["a.B", "a.G", "a.R", "z.A", "z.R", "z.G", "z.B"], ["a.R", "a.G", "a.B"]),
        (["left.x", "left.y", "right.r", "right.b", "right.g", "right.mask"], ["right.r", "right.g", "right.b"]),
    ],
    ids=lambda names: "+".join(names),
)
def test_exr_channels_by_name(reader, folder, names, wanted):
    channels = exr_channels(names)
    OpenEXR.File({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}, channels).write(
        str(folder / "n.exr")
    )
    holds(reader, folder / "n.exr", stacked(channels, wanted))


def test_exr_precision_is_that_of_the_channels_read(reader, folder):
    channels = exr_channels("RGB") | {"Z": noise((HEIGHT, WIDTH), np.float32)}
    OpenEXR.File({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}, channels).write(
        str(folder / "m.exr")
    )
    assert holds(reader, folder / "m.exr", stacked(channels, "RGB"))["format"] == 1


@pytest.mark.parametrize("at", [(7, 5), (-20, -9), (100, 1000)], ids=str)
@pytest.mark.parametrize("tiles", [None, (16, 16)], ids=["scanlines", "tiles"])
def test_the_data_window_is_the_image(reader, folder, at, tiles):
    """As for Hydra's own reader: what lies between it and the display window is not part of the texture."""
    texels = noise((HEIGHT, WIDTH, 3), np.float16)
    spec = oiio.ImageSpec(WIDTH, HEIGHT, 3, "half")
    spec.x, spec.y, spec.full_x, spec.full_y, spec.full_width, spec.full_height = *at, 0, 0, 64, 64
    if tiles:
        spec.tile_width, spec.tile_height = tiles
    output = oiio.ImageOutput.create(str(folder / "w.exr"))
    assert output.open(str(folder / "w.exr"), spec) and output.write_image(texels) and output.close(), output.geterror()
    holds(reader, folder / "w.exr", texels)


def test_exr_of_several_parts_is_its_first(reader, folder):
    first, second = exr_channels("RGB"), exr_channels("RGBA", np.float32)
    parts = [
        OpenEXR.Part({"type": OpenEXR.scanlineimage, "name": name}, channels)
        for name, channels in (("beauty", first), ("other", second))
    ]
    OpenEXR.File(parts).write(str(folder / "parts.exr"))
    holds(reader, folder / "parts.exr", stacked(first, "RGB"))


@pytest.mark.parametrize("name", ["m.tx", "m.exr", "m.tex"])
@pytest.mark.parametrize("kind", [np.uint8, np.float16])
def test_textures_by_maketx_have_their_levels(reader, folder, name, kind):
    if (kind == np.uint8) == (name == "m.exr"):
        pytest.skip("TIFF for integers, EXR for floats")
    source = oiio.ImageBuf(oiio.ImageSpec(256, 128, 3, "uint8" if kind == np.uint8 else "half"))
    source.set_pixels(
        oiio.ROI(0, 256, 0, 128, 0, 1, 0, 3), noise((128, 256, 3), kind if kind == np.uint8 else np.float32)
    )
    path = folder / name
    made = folder / ("made.tif" if kind == np.uint8 else "made.exr")
    assert oiio.ImageBufAlgo.make_texture(oiio.MakeTxTexture, source, str(made)), oiio.geterror()
    made.rename(path)
    facts = reader.facts(path)
    assert (
        facts["levels"] == [[max(1, 256 >> level), max(1, 128 >> level)] for level in range(9)] and facts["tiled"]
    ), facts
    for level in range(9):
        expected = oiio.ImageBuf(str(path), 0, level).get_pixels(oiio.UINT8 if kind == np.uint8 else oiio.HALF)
        for found in (reader.texels(path, level), reader.decoded(path, level)):
            np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("mode", ["MIPMAP_LEVELS", "RIPMAP_LEVELS"])
def test_exr_with_levels_by_openexr(reader, folder, mode):
    """The finest one is the image; of rip maps no others are used."""
    tiles = OpenEXR.TileDescription()
    tiles.xSize, tiles.ySize, tiles.mode = 16, 16, getattr(OpenEXR, mode)
    channels = exr_channels("RGB")
    OpenEXR.File({"type": OpenEXR.tiledimage, "tiles": tiles}, channels).write(str(folder / "levels.exr"))
    facts = holds(reader, folder / "levels.exr", stacked(channels, "RGB"))
    halved = [[max(1, WIDTH >> level), max(1, HEIGHT >> level)] for level in range(6)]
    assert facts["levels"] == (halved if mode == "MIPMAP_LEVELS" else [[WIDTH, HEIGHT]]), facts


def test_radiance_uncompressed_and_old_rle(reader, folder):
    rgbe = noise((HEIGHT, WIDTH, 4), np.uint8)
    rgbe[:, :, 3] = 129
    rgbe[:, 0, :2] = 77
    rgbe[5, 10:30] = (50, 60, 70, 130)
    rgbe[9, :] = (150, 60, 70, 130)
    (folder / "r.hdr").write_bytes(handmade.hdr(rgbe))
    holds(reader, folder / "r.hdr", (rgbe[:, :, :3] + 0.5) * 2.0 ** (rgbe[:, :, 3:].astype(float) - 136), 1.0, 2 / 128)
    # The kind of 1985, which OpenImageIO does not know: no texels rather than wrong ones.
    (folder / "old.hdr").write_bytes(handmade.hdr(rgbe, old_runs=True))
    assert "cannot be decoded" in reader.ask("walk", folder / "old.hdr", 0).get("error", "")


def test_radiance_with_new_rle(reader, folder):
    texels = noise((HEIGHT, WIDTH, 3), np.float32) * 40
    texels[7, 5:40] = (1, 2, 3)
    write_oiio(folder / "o.hdr", texels)
    holds(reader, folder / "o.hdr", texels, 1.0, 0.26)


@pytest.mark.parametrize("order", ["+Y {h} +X {w}", "-Y {h} -X {w}", "+X {w} -Y {h}", "+X {w} +Y {h}"])
def test_radiance_in_other_scanline_orders_is_refused(reader, folder, order):
    (folder / "turned.hdr").write_bytes(handmade.hdr(noise((HEIGHT, WIDTH, 4), np.uint8), order))
    assert "-Y" in reader.ask("facts", folder / "turned.hdr").get("error", "")


@pytest.mark.parametrize("compression", [None, "tga_rle"])
@pytest.mark.parametrize("texels", [GREY, RGB, RGBA], ids=["1", "3", "4"])
@pytest.mark.parametrize("orientation", [1, -1], ids=["top", "bottom"])
def test_tga(reader, folder, compression, texels, orientation):
    Image.fromarray(texels.squeeze()).save(folder / "k.tga", compression=compression, orientation=orientation)
    holds(reader, folder / "k.tga", texels)


def test_tga_with_a_palette_and_of_16_bits(reader, folder):
    body = INDEX[::-1].tobytes()
    (folder / "p.tga").write_bytes(handmade.tga(WIDTH, HEIGHT, 1, 8, body, PALETTE[:, ::-1].tobytes(), 24))
    holds(reader, folder / "p.tga", PALETTE[INDEX])
    (folder / "pt.tga").write_bytes(
        handmade.tga(WIDTH, HEIGHT, 1, 8, INDEX.tobytes(), PALETTE[:, ::-1].tobytes(), 24, True)
    )
    holds(reader, folder / "pt.tga", PALETTE[INDEX])
    five = noise((HEIGHT, WIDTH, 3), np.uint8) >> 3
    packed = five[:, :, 0].astype("<u2") << 10 | five[:, :, 1].astype("<u2") << 5 | five[:, :, 2] | 0x8000
    (folder / "s.tga").write_bytes(handmade.tga(WIDTH, HEIGHT, 2, 16, packed[::-1].astype("<u2").tobytes()))
    found = reader.texels(folder / "s.tga")
    assert np.abs(found[:, :, :3].astype(float) - five * 255.0 / 31.0).max() < 8, "five bits each"
    np.testing.assert_array_equal(found[:, :, :3] >> 3, five)


@pytest.mark.parametrize("top_down", [False, True])
@pytest.mark.parametrize("bits", [1, 4, 8])
def test_bmp_with_a_palette(reader, folder, bits, top_down):
    index = INDEX & ((1 << bits) - 1)
    (folder / "p.bmp").write_bytes(handmade.bmp(index, PALETTE[: 1 << bits], bits, top_down))
    holds(reader, folder / "p.bmp", PALETTE[index])


@pytest.mark.parametrize("top_down", [False, True])
@pytest.mark.parametrize("texels", [RGB, RGBA], ids=["24", "32"])
def test_bmp(reader, folder, texels, top_down):
    (folder / "k.bmp").write_bytes(handmade.bmp_true(texels, top_down))
    holds(reader, folder / "k.bmp", texels)
