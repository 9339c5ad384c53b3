# SPDX-License-Identifier: Apache-2.0
"""Named colour spaces become linear Rec. 709: against published matrices, with a configuration of the user's, and names
that nobody knows."""

from __future__ import annotations

import numpy as np
import pytest
from image_host import Reader, noise, write_exr

# Published to some digits: the Academy's "ACES to Rec. 709" by Bradford, ITU-R BT.2087 (709 from 2020), Apple's P3 to
# sRGB.
MATRICES = {
    "ACEScg": [[1.70505, -0.62179, -0.08326], [-0.13026, 1.14080, -0.01055], [-0.02400, -0.12897, 1.15297]],
    "ACES2065-1": [[2.52169, -1.13413, -0.38756], [-0.27648, 1.37272, -0.09624], [-0.01538, -0.15298, 1.16835]],
    "lin_rec2020": [[1.66049, -0.58764, -0.07285], [-0.12455, 1.13290, -0.00835], [-0.01815, -0.10058, 1.11873]],
    "lin_p3d65": [[1.22494, -0.22494, 0.0], [-0.04206, 1.04206, 0.0], [-0.01964, -0.07864, 1.09828]],
    "lin_adobergb": [[1.39836, -0.39836, 0.0], [0.0, 1.0, 0.0], [0.0, -0.04293, 1.04293]],
    "lin_ciexyzd65": [[3.24097, -1.53738, -0.49861], [-0.96924, 1.87597, 0.04156], [0.05563, -0.20398, 1.05697]],
}
SAME = {
    "lin_ap1": "ACEScg", "lin_ap1_scene": "ACEScg", "acescg": "ACEScg", "lin_ap0": "ACES2065-1",
    "lin_displayp3": "lin_p3d65", "CIEXYZ": "lin_ciexyzd65", "lin_rec2020_scene": "lin_rec2020",
}
CURVES = {
    "srgb_texture": lambda v: np.where(v <= 0.04045, v / 12.92, ((np.maximum(v, 0) + 0.055) / 1.055) ** 2.4),
    "g18_rec709": lambda v: v**1.8,
    "g22_rec709": lambda v: v**2.2,
    "g24_rec709": lambda v: v**2.4,
}
MIXED = {
    "g22_ap1": ("g22_rec709", "ACEScg"), "g18_ap1": ("g18_rec709", "ACEScg"), "srgb_ap1": ("srgb_texture", "ACEScg"),
    "srgb_p3d65": ("srgb_texture", "lin_p3d65"), "srgb_displayp3": ("srgb_texture", "lin_p3d65"),
}
TEXELS = np.array([
    [0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.18, 0.18, 0.18], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0],
    [0.02, 0.3, 0.9], [0.7, 0.01, 0.4],
])


def converted(reader, name: str, texels: np.ndarray) -> np.ndarray:
    answer = reader.ask("convert", name, texels.shape[-1], " ".join(f"{v:.9g}" for v in texels.ravel()))
    assert "error" not in answer, answer
    return np.array(answer["texels"]).reshape(texels.shape)


@pytest.mark.parametrize("name", [*MATRICES, *SAME])
def test_linear_spaces_are_their_matrices(reader, name):
    matrix = np.array(MATRICES[SAME.get(name, name)])
    np.testing.assert_allclose(converted(reader, name, TEXELS), TEXELS @ matrix.T, atol=3e-5)
    bright = converted(reader, name, TEXELS * 50)
    np.testing.assert_allclose(bright, TEXELS @ matrix.T * 50, atol=2e-3)


@pytest.mark.parametrize("name", ["ACEScg", "ACES2065-1", "lin_rec2020", "lin_p3d65", "lin_adobergb"])
def test_white_stays_white(reader, name):
    np.testing.assert_allclose(converted(reader, name, np.ones((1, 3))), 1.0, atol=2e-6)


@pytest.mark.parametrize("name", CURVES)
def test_transfer_curves_match_their_definitions(reader, name):
    np.testing.assert_allclose(converted(reader, name, TEXELS), CURVES[name](TEXELS), atol=2e-6)


@pytest.mark.parametrize("name", MIXED)
def test_spaces_with_curve_and_matrix(reader, name):
    curve, matrix = MIXED[name]
    np.testing.assert_allclose(
        converted(reader, name, TEXELS), CURVES[curve](TEXELS) @ np.array(MATRICES[matrix]).T, atol=3e-5
    )


@pytest.mark.parametrize("name", ["ACEScg", "g22_rec709", "srgb_ap1", "lin_p3d65"])
def test_other_numbers_of_channels(reader, name):
    """Alpha stays; grey is red of r = g = b. More texels than are widened at a time."""
    colors = noise((2500, 3), np.float32)
    four = np.concatenate([colors, noise((2500, 1), np.float32) * 7 - 3], axis=1)
    found = converted(reader, name, four)
    np.testing.assert_array_equal(found[:, 3].astype(np.float32), four[:, 3])
    np.testing.assert_allclose(found[:, :3], converted(reader, name, colors), atol=1e-7)
    grey = converted(reader, name, np.repeat(colors[:, :1], 3, axis=1))[:, :1]
    np.testing.assert_allclose(converted(reader, name, colors[:, :1]), grey, atol=1e-7)
    two = converted(reader, name, four[:, [0, 3]])
    np.testing.assert_allclose(two[:, :1], grey, atol=1e-7)
    np.testing.assert_array_equal(two[:, 1].astype(np.float32), four[:, 3])


def test_unknown_color_spaces_are_refused(reader):
    for name in ("no such space", "", "lin_rec710"):
        assert f"`{name}` is not known" in reader.ask("convert", name, 3, "1 2 3").get("error", "")
    for channels, text in ((0, ""), (5, "1 2 3 4 5"), (3, "1 2")):
        assert "not whole" in reader.ask("convert", "ACEScg", channels, text)["error"]


CONFIG = """ocio_profile_version: 2
roles: {{ default: working, scene_linear: working{roles} }}
displays: {{ d: [ !<View> {{ name: v, colorspace: working }} ] }}
colorspaces:
  - !<ColorSpace> {{ name: working }}
  - !<ColorSpace> {{ name: aces,
      to_scene_reference: !<MatrixTransform> {{ matrix: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] }} }}
  - !<ColorSpace> {{ name: Studio Half,
      to_scene_reference: !<MatrixTransform> {{ matrix: [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1] }} }}
  - !<ColorSpace> {{ name: Plates, isdata: true }}
{more}"""


@pytest.fixture
def reader_with(image_build, tmp_path, monkeypatch):
    """Makes readers whose $OCIO is a file of this text."""
    started = []

    def make(text: str) -> Reader:
        (tmp_path / "config.ocio").write_text(text)
        monkeypatch.setenv("OCIO", str(tmp_path / "config.ocio"))
        write_exr(tmp_path / "own.exr", noise((8, 8, 3), np.float16))
        started.append(Reader(image_build, tmp_path / "own.exr"))
        return started[-1]

    yield make
    for reader in started:
        reader.close()


def test_the_users_configuration_comes_first(reader_with):
    reader = reader_with(CONFIG.format(roles="", more="  - !<ColorSpace> { name: lin_rec709 }"))
    np.testing.assert_allclose(converted(reader, "Studio Half", TEXELS), TEXELS / 2, atol=1e-6)
    np.testing.assert_array_equal(converted(reader, "Plates", TEXELS).astype(np.float32), TEXELS.astype(np.float32))
    np.testing.assert_allclose(converted(reader, "scene_linear", TEXELS), TEXELS, atol=1e-6)
    # What it does not have is still known by its common name.
    np.testing.assert_allclose(
        converted(reader, "lin_p3d65", TEXELS), TEXELS @ np.array(MATRICES["lin_p3d65"]).T, atol=3e-5
    )


def test_a_configuration_without_rec709_is_reached_through_aces(reader_with):
    reader = reader_with(CONFIG.format(roles=", aces_interchange: aces", more=""))
    np.testing.assert_allclose(
        converted(reader, "Studio Half", TEXELS), TEXELS @ np.array(MATRICES["ACES2065-1"]).T / 2, atol=3e-5
    )


@pytest.mark.parametrize("text", ["this is no configuration", CONFIG.format(roles="", more="")])
def test_an_unusable_ocio_configuration_gives_a_reason(reader_with, text):
    error = reader_with(text).ask("convert", "Studio Half", 3, "1 1 1").get("error", "")
    assert "Studio Half" in error and "cannot be converted" in error
