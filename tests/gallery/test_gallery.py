# SPDX-License-Identifier: Apache-2.0
"""The gallery's scenes can be written, hold together, and are the same twice; the contact sheet shows what it is
given."""

import pathlib
import sys

import numpy as np
import pytest
from PIL import Image
from pxr import Sdf, Usd, UsdGeom, UsdShade, UsdUtils

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import contact_sheet
import gallery

SMALL = {
    "woods": {"kinds": 2, "size": 32, "cards": 10, "trees": 8, "detail": 4}, "lanterns": {"lights": 20},
    "bush": {"leaves": 20},
}


@pytest.mark.parametrize("name", gallery.NAMES)
def test_gallery_scenes_are_complete(name, tmp_path):
    """Every file it names is there, every material it binds has a surface, there is a camera of 16:9 and something to
    see."""
    path = gallery.write(name, tmp_path, SMALL.get(name))
    _, _, missing = UsdUtils.ComputeAllDependencies(Sdf.AssetPath(str(path)))
    # Tiles are looked up by whoever draws them.
    assert [file for file in missing if "<UDIM>" not in file] == []
    stage = Usd.Stage.Open(str(path))
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera")).GetCamera(Usd.TimeCode.Default())
    assert camera.aspectRatio == pytest.approx(16 / 9)
    meshes = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    assert meshes
    for prim in meshes:
        material, relation = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        assert not relation or material.ComputeSurfaceSource()[0], f"{prim.GetPath()} has a material without a surface"


@pytest.mark.parametrize("name", ["glass", "woods"])
def test_same_arguments_same_scene(name, tmp_path):
    first, second = (gallery.write(name, tmp_path / folder, SMALL.get(name)) for folder in "ab")
    assert [path.name for path in sorted(first.parent.iterdir())] == [
        path.name for path in sorted(second.parent.iterdir())
    ]
    for path in first.parent.iterdir():
        if path.suffix == ".usdc":
            texts = [Sdf.Layer.OpenAsAnonymous(str(file)).ExportToString() for file in (first, second)]
            assert texts[0] == texts[1]
        else:
            assert path.read_bytes() == (second.parent / path.name).read_bytes(), path.name


def test_sizes_are_as_asked(tmp_path):
    gallery.write("woods", tmp_path, {**SMALL["woods"], "kinds": 3, "size": 1024})
    pictures = sorted((tmp_path / "woods").glob("bark[0-9].png"))
    assert len(pictures) == 3
    with Image.open(pictures[0]) as picture:
        assert picture.size == (1024, 1024)


def test_the_sheet_orders_pictures_and_marks_missing_ones():
    red, blue = Image.new("RGB", (64, 36), (255, 0, 0)), Image.new("RGB", (64, 36), (0, 0, 255))
    page = np.array(contact_sheet.sheet([("a", red), ("b", None), ("c", blue)], 2, 64))
    height = 36 + contact_sheet.LINE + contact_sheet.GAP
    assert page.shape == (contact_sheet.GAP + 2 * height, contact_sheet.GAP + 2 * (64 + contact_sheet.GAP), 3)
    assert page[contact_sheet.GAP + 5, contact_sheet.GAP + 5].tolist() == [255, 0, 0]
    assert page[contact_sheet.GAP + height + 5, contact_sheet.GAP + 5].tolist() == [0, 0, 255]
    assert page[contact_sheet.GAP, 2 * contact_sheet.GAP + 64].tolist() == list(
        contact_sheet.INK
    ), "the frame of what is missing"


def test_nan_pixels_are_marked_on_the_sheet():
    values = np.array([[[0.0, 0.0, 0.0], [np.nan, 1.0, 1.0], [5.0, 1.0, 0.5]]])
    assert contact_sheet.shown(values)[0].tolist() == [[0, 0, 0], [255, 0, 255], [255, 255, 188]]
