# SPDX-License-Identifier: Apache-2.0
"""Image files as the renderer gets them: through the host's resolver and our OpenImageIO, in a process where the host's
own is in use.

Every texel of every kind of file against the array that was written; files that are damaged, missing or no images give
one reason and leave the process alive.
"""

from __future__ import annotations

import struct
import zlib

import handmade
import numpy as np
import OpenEXR
import pytest
from image_host import HEIGHT, TYPES, WIDTH, Reader, noise, write_exr, write_png16
from PIL import Image
from pxr import Sdf, Usd, UsdShade, UsdUtils


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.tga", "a.bmp"])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_eight_bit_files_texel_by_texel(reader, folder, name, channels):
    if channels != 3 and name == "a.bmp":
        pytest.skip("Pillow writes no such file")
    path, texels = folder / f"{channels}{name}", noise((HEIGHT, WIDTH, channels), np.uint8)
    Image.fromarray(texels.squeeze()).save(path)
    facts = reader.facts(path)
    assert (facts["levels"], facts["format"]) == ([[WIDTH, HEIGHT]], 0), facts
    found = reader.texels(path)
    # A file of grey may come with its one channel repeated (BMP), never with other values.
    np.testing.assert_array_equal(found[:, :, : texels.shape[2]], texels)
    assert facts["channels"] == channels


def test_a_jpeg(reader, folder):
    ramp = np.stack(np.meshgrid(np.linspace(0, 255, WIDTH), np.linspace(0, 255, HEIGHT)), axis=-1)
    texels = np.concatenate([ramp, ramp[:, :, :1]], axis=2).astype(np.uint8)
    Image.fromarray(texels).save(folder / "a.jpg", quality=100, subsampling=0)
    found = reader.texels(folder / "a.jpg").astype(int)
    assert np.abs(found - texels).max() <= 3, "within the loss of the best quality"
    assert found[0, 0, 1] < 8 and found[-1, 0, 1] > 247, "the right way up"


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_exr_files_texel_by_texel(reader, folder, channels, kind):
    path, texels = folder / f"{channels}{np.dtype(kind)}.exr", noise((HEIGHT, WIDTH, channels), kind)
    write_exr(path, texels)
    facts = reader.facts(path)
    assert (facts["channels"], TYPES[facts["format"]], facts["srgb"]) == (channels, kind, 0), facts
    np.testing.assert_array_equal(reader.texels(path), texels)


def test_a_radiance_file(reader, folder):
    rgbe = noise((HEIGHT, WIDTH, 4), np.uint8)
    rgbe[:, :, 3] = 129
    # Widths below 8 or uncompressed rows: bytes as they are. A row must not begin like a compressed one.
    rgbe[:, 0, :2] = 77
    (folder / "a.hdr").write_bytes(
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + f"-Y {HEIGHT} +X {WIDTH}\n".encode() + rgbe.tobytes()
    )
    facts = reader.facts(folder / "a.hdr")
    assert (facts["channels"], facts["format"], facts["srgb"]) == (3, 2, 0), facts
    expected = (rgbe[:, :, :3].astype(np.float64) + 0.5) / 256 * 2
    assert (
        np.abs(reader.texels(folder / "a.hdr") - expected).max() <= 2 / 256
    ), "within half a step, whichever way it is rounded"


def test_sixteen_bits_keep_all_of_them(reader, folder):
    texels = noise((HEIGHT, WIDTH, 3), np.uint16)
    write_png16(folder / "deep.png", texels)
    assert reader.facts(folder / "deep.png")["format"] == 2
    np.testing.assert_array_equal(np.rint(reader.texels(folder / "deep.png") * 65535.0).astype(np.uint16), texels)


@pytest.mark.parametrize(
    "chunks, srgb",
    [
        ((), -1),
        (((b"sRGB", b"\0"),), 1),
        (((b"gAMA", struct.pack(">I", 100000)),), 0),
        (((b"gAMA", struct.pack(">I", 45455)),), -1),
        (((b"iCCP", b"sRGB IEC61966-2.1\0\0" + zlib.compress(b"profile")),), 1),
        (((b"iCCP", b"Display P3\0\0" + zlib.compress(b"profile")),), -1),
    ],
)
def test_a_png_is_srgb_only_if_it_says_so(reader, folder, chunks, srgb):
    write_png16(folder / "space.png", noise((4, 4, 3), np.uint16), chunks)
    assert reader.facts(folder / "space.png")["srgb"] == srgb


def test_alpha_is_not_multiplied_into_color(reader, folder):
    texels = np.full((4, 4, 4), (200, 100, 50, 128), np.uint8)
    for name in ("straight.png", "straight.tif", "straight.tga"):
        Image.fromarray(texels).save(folder / name)
        np.testing.assert_array_equal(reader.texels(folder / name), texels, name)


LARGE = ["large.png", "large.jpg", "large.tif", "large.exr", "tiled_large.exr", "large.hdr", "large.tga", "large.bmp"]


def write_large(path, texels) -> None:
    if path.suffix == ".exr":
        tiles = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()} if "tiled" in path.name else {}
        write_exr(path, texels.astype(np.float16) / 255, **tiles)
    elif path.suffix == ".hdr":
        path.write_bytes(handmade.hdr(np.concatenate([texels, np.full_like(texels[:, :, :1], 129)], axis=2)))
    else:
        Image.fromarray(texels).save(path, **({"compression": "tiff_lzw"} if path.suffix == ".tif" else {}))


@pytest.mark.parametrize("name", LARGE)
def test_a_level_is_decoded_in_one_pass(reader, folder, name):
    """In bands of bounded size from the top down, and no byte of the file is read twice."""
    path = folder / name
    write_large(path, noise((1700, 1100, 3), np.uint8))
    answer = reader.ask("decode", path, 0, 0)
    tops, row = answer["tops"], len(answer["texels"]) // 2 // 1700
    assert tops[0] == 0 and len(tops) > 1 and tops == sorted(set(tops)), tops
    assert answer["most"] <= 4 << 20
    assert [b - a for a, b in zip(tops, tops[1:])] == [min(answer["most"] // row, tops[1])] * (
        len(tops) - 1
    ) or "tiled" in name
    size = path.stat().st_size
    # JPEG is taken whole into memory; headers are read by us before they are by OpenImageIO.
    assert answer["read"] < 1.05 * size + 200_000, f"{answer['read']} bytes of {size}"
    np.testing.assert_array_equal(reader.decoded(path), reader.texels(path))
    stopped = reader.ask("decode", path, 0, 1)
    assert stopped["tops"] == [0] and answer["texels"].startswith(stopped["texels"]), "the sink may stop"


def test_levels_that_are_not_there_are_not_decoded(reader, folder):
    write_exr(folder / "one.exr", noise((8, 8, 3), np.float16))
    assert "no level 1" in reader.ask("decode", folder / "one.exr", 1, 0)["error"]


def test_identity_of_a_file_is_known_without_opening_it(image_build, folder):
    """In a process of its own, since the library of readers must not be loaded by that."""
    write_exr(folder / "known.exr", noise((8, 8, 3), np.float16))
    (folder / "link.exr").unlink(missing_ok=True)
    (folder / "link.exr").symlink_to(folder / "known.exr")
    reader = Reader(image_build, folder / "known.exr")
    status = (folder / "known.exr").stat()
    for path in (folder / "known.exr", folder / "link.exr", folder / "." / "known.exr"):
        facts = reader.ask("file_facts", path)
        assert facts == {
            "plain": True, "canonical": str(folder / "known.exr"), "size": status.st_size,
            "modified": status.st_mtime_ns, "loaded": False,
        }
    for path in (folder / "absent.exr", folder, f"{folder}/scene.usdz[inside.png]"):
        assert reader.ask("file_facts", path)["plain"] is False
    assert reader.ask("exists", folder / "known.exr") == {"exists": True}
    assert not reader.ask("file_facts", folder / "known.exr")["loaded"]
    reader.facts(folder / "known.exr")
    assert reader.ask("file_facts", folder / "known.exr")["loaded"], "the test sees it when it is"
    reader.close()


@pytest.mark.parametrize("name", ["part.png", "part.exr", "tiled.exr"])
def test_parts_of_an_image(reader, folder, name):
    texels = noise((130, 70, 3), np.float16 if "exr" in name else np.uint8)
    if "exr" in name:
        write_exr(
            folder / name, texels,
            **({"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()} if name == "tiled.exr" else {}),
        )
    else:
        Image.fromarray(texels).save(folder / name)
    for at, size in [
        ((0, 0), (70, 1)),
        ((0, 129), (70, 1)),
        ((3, 5), (17, 40)),
        ((33, 63), (37, 67)),
        ((69, 0), (1, 130)),
    ]:
        below = texels[::-1][at[1] : at[1] + size[1], at[0] : at[0] + size[0]][::-1]
        np.testing.assert_array_equal(reader.texels(folder / name, 0, at, size), below, f"{size} texels at {at}")
    for box in [(0, 0, 71, 1), (0, 130, 1, 1), (0, 0, 0, 1)]:
        assert "does not have" in reader.ask("read", folder / name, 0, *box)["error"], box
    assert "does not have" in reader.ask("read", folder / name, 1, 0, 0, 1, 1)["error"], "no such level"


@pytest.mark.parametrize("name", ["race.png", "race.exr"])
def test_several_threads_read_at_once(reader, folder, name):
    texels = noise((128, 96, 3), np.float16 if "exr" in name else np.uint8)
    write_exr(folder / name, texels) if "exr" in name else Image.fromarray(texels).save(folder / name)
    assert reader.ask("race", folder / name, 4, 32) == {"different": 0}


def test_more_images_than_inputs_that_are_kept(reader, folder):
    for number in range(80):
        path, texels = folder / f"many{number}.png", np.full((3, 3, 3), number, np.uint8)
        Image.fromarray(texels).save(path)
        np.testing.assert_array_equal(reader.texels(path), texels)


def test_a_member_of_a_package(reader, folder):
    texels = noise((HEIGHT, WIDTH, 3), np.uint8)
    Image.fromarray(texels).save(folder / "inside.png")
    stage = Usd.Stage.CreateNew(str(folder / "scene.usda"))
    shader = UsdShade.Shader.Define(stage, "/Texture")
    shader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("./inside.png")
    stage.GetRootLayer().Save()
    assert UsdUtils.CreateNewUsdzPackage(str(folder / "scene.usda"), str(folder / "scene.usdz"))
    member = f"{folder / 'scene.usdz'}[inside.png]"
    np.testing.assert_array_equal(reader.texels(member), texels)
    assert reader.ask("exists", member) == {"exists": True}
    assert reader.ask("exists", f"{folder / 'scene.usdz'}[other.png]") == {"exists": False}


def good_png(folder) -> bytes:
    Image.fromarray(noise((HEIGHT, WIDTH, 3), np.uint8)).save(folder / "good.png")
    return (folder / "good.png").read_bytes()


def good_exr(folder) -> bytes:
    write_exr(folder / "good.exr", noise((HEIGHT, WIDTH, 3), np.float16))
    return (folder / "good.exr").read_bytes()


BAD = {
    "empty.png": (lambda folder: b"", "is empty"),
    "text.exr": (lambda folder: b"This is no image.\n" * 40, "none of the kinds of image"),
    "mark_only.exr": (lambda folder: good_exr(folder)[:4], "cannot be read"),
    "short_head.exr": (lambda folder: good_exr(folder)[:60], "cannot be read"),
    "mark_only.png": (lambda folder: good_png(folder)[:8], "cannot be read"),
    "mark_only.jpg": (lambda folder: b"\xff\xd8\xff\xe0", "cannot be read"),
    "mark_only.tif": (lambda folder: b"II\x2a\0", "cannot be read"),
    "far_directory.tif": (lambda folder: b"II\x2a\0\xff\xff\xff\x7f", "cannot be read"),
    "noise.tga": (lambda folder: noise((100,), np.uint8).tobytes(), ""),
    "huge.hdr": (lambda folder: b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100000 +X 100000\n", ""),
    "huge.png": (
        lambda folder: good_png(folder)[:16]
        + struct.pack(">II", 30000, 30000)
        + good_png(folder)[24:29]
        + struct.pack(">I", zlib.crc32(b"IHDR" + struct.pack(">II", 30000, 30000) + good_png(folder)[24:29]))
        + good_png(folder)[33:],
        "cannot hold that many",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_files_that_are_no_images_give_a_reason(reader, folder, name):
    make, reason = BAD[name]
    (folder / name).write_bytes(make(folder))
    answer = reader.ask("facts", folder / name)
    assert reason in answer.get("error", ""), answer
    assert reader.facts(folder / "own.exr")["levels"] == [[8, 8]], "others are read as before"


@pytest.mark.parametrize("make, name", [(good_png, "cut.png"), (good_exr, "cut.exr")])
def test_files_that_end_early_open_and_then_give_a_reason(reader, folder, make, name):
    content = make(folder)
    (folder / name).write_bytes(content[: len(content) * 2 // 3])
    answer = reader.ask("read", folder / name, 0, 0, 0, WIDTH, HEIGHT)
    assert "cannot be" in answer.get("error", ""), answer


def test_every_truncation_and_many_flips_leave_the_host_alive(reader, folder):
    """No crash, no hang: what comes back is texels or a reason."""
    random = np.random.default_rng(3)
    for make, name in [(good_png, "cut.png"), (good_exr, "cut.exr")]:
        content = make(folder)
        for length in range(0, len(content), max(1, len(content) // 40)):
            (folder / name).write_bytes(content[:length])
            assert reader.ask("read", folder / name, 0, 0, 0, WIDTH, HEIGHT).keys() <= {"texels", "error"}
        for _ in range(60):
            flipped = bytearray(content)
            for place in random.integers(8, len(content), 3):
                flipped[place] ^= 1 << int(random.integers(8))
            (folder / name).write_bytes(flipped)
            assert reader.ask("read", folder / name, 0, 0, 0, WIDTH, HEIGHT).keys() <= {"texels", "error"}


def test_a_folder_and_nothing_at_all(reader, folder):
    (folder / "folder.png").mkdir(exist_ok=True)
    for path, reason in [(folder / "folder.png", "is a folder"), (folder / "absent.png", "cannot be found or opened")]:
        assert reason in reader.ask("facts", path)["error"]
        assert reader.ask("exists", path) == {"exists": False}


def test_the_bytes_of_a_file(reader, folder):
    (folder / "lamp.ies").write_bytes(bytes(range(200)))
    assert reader.ask("file", folder / "lamp.ies", 200) == {"size": 200, "sum": sum(range(200))}
    assert "more than is read" in reader.ask("file", folder / "lamp.ies", 199)["error"]
    assert "cannot be found" in reader.ask("file", folder / "none.ies", 199)["error"]
