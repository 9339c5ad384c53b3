# SPDX-License-Identifier: Apache-2.0
"""`usdrecord --renderer OocPT` as a user starts it: from PATH, files in, files out. Runs in the wheel host's Python."""
import os
import subprocess

import numpy
import pytest

SCENE = """#usda 1.0
def Sphere "ball" { double radius = 1
  color3f[] primvars:displayColor = [(0.8, 0.4, 0.1)] }
def Camera "front" { double3 xformOp:translate = (0, 0, 10)
  uniform token[] xformOpOrder = ["xformOp:translate"] }
def DomeLight "sky" { float inputs:intensity = 0.5 }
"""


def usdrecord(*arguments, **environment):
    """The finished process; few samples, and no word of it may be lost."""
    variables = dict(os.environ, OOCPT_SAMPLES_PER_PIXEL="4", **environment)
    command = ["usdrecord", *map(str, arguments)]
    return subprocess.run(
        command, env=variables, capture_output=True, text=True, timeout=300, stdin=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip


def read(path):
    """The pixels as the file holds them, shape (height, width, channels)."""
    import OpenImageIO as oiio

    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    image = oiio.ImageInput.open(str(path), config)
    assert image, oiio.geterror()
    return image.read_image("unknown")


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.usda"
    path.write_text(SCENE.replace("{ ", "{\n  ").replace(" }\n", "\n}\n"))
    return path


@pytest.mark.parametrize("front_end", ["0", "1"], ids=["legacy", "scene_index"])
def test_exr_is_linear_and_png_is_its_srgb_twin(scene, tmp_path, front_end):
    linear, display = tmp_path / "out.exr", tmp_path / "out.png"
    for target in (linear, display):
        done = usdrecord("--renderer", "OocPT", "--imageWidth", 48, "--camera", "front", "--disableCameraLight",
                         scene, target,
                         USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX=front_end)  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert "Camera: /front" in done.stdout and "Renderer plugin: HdOocPTRendererPlugin" in done.stdout
    pixels = read(linear)
    assert pixels.dtype == numpy.float32 and pixels.shape[1:] == (48, 4)
    middle = pixels[pixels.shape[0] // 2, 24]
    # A convex body under a dome that sends 0.5 everywhere, seen from outside: exactly albedo * 0.5.
    numpy.testing.assert_allclose(middle, [0.4, 0.2, 0.05, 1.0], rtol=2e-3)
    # Same seed, same samples: the bytes follow from the floats.
    color = numpy.clip(pixels[..., :3].astype(numpy.float64), 0, 1)
    expected = numpy.where(color <= 0.0031308, 12.92 * color, 1.055 * color ** (1 / 2.4) - 0.055)
    difference = numpy.abs(read(display)[..., :3] - expected * 255)
    assert difference.max() <= 0.51


def test_frames_and_widths(scene, tmp_path):
    done = usdrecord("--frames", "1:2", "-w", 16, scene, tmp_path / "out.##.exr")
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in tmp_path.glob("*.exr")) == ["out.01.exr", "out.02.exr"]
    assert read(tmp_path / "out.01.exr").shape[1] == 16
    assert done.stdout.count("Recording time code") == 2


def test_a_mask_and_purposes_leave_prims_out(tmp_path):
    scene = tmp_path / "two.usda"
    scene.write_text('#usda 1.0\ndef Sphere "a"\n{\n}\ndef Sphere "b"\n{\n    uniform token purpose = "render"\n}\n')

    def covered(*flags):
        target = tmp_path / "out.exr"
        done = usdrecord("-w", 16, *flags, scene, target)
        assert done.returncode == 0, done.stderr
        return (read(target)[..., 3] > 0).any()

    assert covered() and covered("--mask", "/a")
    assert not covered("--mask", "/b"), "what is left is for rendering only"
    assert covered("--mask", "/b", "--purposes", "render")


def test_a_fatal_setting_ends_with_one_and_its_reason(scene, tmp_path):
    done = usdrecord("-w", 16, scene, tmp_path / "out.exr", OOCPT_DEVICE="no-such-device")
    assert done.returncode == 1
    assert "no-such-device" in done.stderr


def test_an_unwritable_picture_ends_with_one(scene, tmp_path):
    for target in (tmp_path / "absent" / "out.exr", tmp_path / "out.nosuchformat"):
        done = usdrecord("-w", 16, scene, target)
        assert done.returncode == 1 and str(target) in done.stderr, (target, done.stderr)
