# SPDX-License-Identifier: Apache-2.0
"""plugin/usdrecord without a renderer: flags, colour, files, exit statuses. Runs in the wheel host's Python."""
import importlib.machinery
import importlib.util
import os
import pathlib
import subprocess
import sys

import numpy
import pytest

RUNNER = pathlib.Path(__file__).parents[2] / "plugin" / "usdrecord"
SCENE = '#usda 1.0\n(\n    startTimeCode = 7\n)\ndef Sphere "ball"\n{\n    double radius = 1\n}\n'


@pytest.fixture(scope="module")
def runner():
    loader = importlib.machinery.SourceFileLoader("usdrecord", str(RUNNER))
    sys.dont_write_bytecode = True
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("usdrecord", loader))
    loader.exec_module(module)
    return module


def start(*arguments):
    command = [sys.executable, "-I", str(RUNNER), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, stdin=subprocess.DEVNULL)


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.usda"
    path.write_text(SCENE)
    return path


def test_defaults_match_pixars_usdrecord(runner):
    args = runner.make_parser().parse_args(["scene.usda", "out.png"])
    assert (args.imageWidth, args.purposes, args.colorCorrectionMode) == (960, "proxy", "sRGB")
    assert args.complexity.id == "low"
    assert (args.camera, args.frames, args.mask, args.sessionLayer) == (None, None, None, None)
    assert not (args.defaultTime or args.disableCameraLight or args.enableDomeLightVisibility or args.disableDrawMode)


def test_short_flags(runner):
    words = "-cam /a -f 1:3 -c high -color disabled -r Storm -w 0 -rp /p -rs /s scene.usda out.###.png".split()
    args = runner.make_parser().parse_args(words)
    assert str(args.camera) == "/a" and args.frames == "1:3" and args.complexity.id == "high"
    assert args.colorCorrectionMode == "disabled" and args.imageWidth == 1
    assert (args.renderPassPrimPath, args.renderSettingsPrimPath) == ("/p", "/s")


@pytest.mark.parametrize(
    "frames, output, expected",
    [
        ("1:3", "a.####.exr", ["a.0001.exr", "a.0002.exr", "a.0003.exr"]),
        ("5", "a.#.png", ["a.5.png"]),
        ("1:2x0.5", "a.###.#.png", ["a.001.0.png", "a.001.5.png", "a.002.0.png"]),
        ("1,10", "a_##.png", ["a_01.png", "a_10.png"]),
        (None, "a.png", ["a.png"]),
    ],
)
def test_frame_placeholders(runner, scene, frames, output, expected):
    from pxr import Usd, UsdAppUtils

    parser = runner.make_parser()
    args = parser.parse_args([str(scene), output] + (["--frames", frames] if frames else []))
    stage = Usd.Stage.Open(str(scene))
    UsdAppUtils.framesArgs.ValidateCmdlineArgs(parser, args, stage, frameFormatArgName="outputImagePath")
    assert [runner.frame_path(args.outputImagePath, time) for time in args.frames] == expected


def test_braces_in_a_path_are_no_placeholder(runner):
    assert runner.frame_path("dir{0}/{x}.png", 3.0) == "dir{0}/{x}.png"


def test_srgb_matches_the_standard(runner):
    linear = numpy.array([[-1.0, 0.0, 0.5, 0.25], [0.0031308, 0.214041, numpy.nan, 2.0]], dtype=numpy.float32)
    encoded = runner.srgb_from_linear(linear)
    # IEC 61966-2-1; the fourth channel is alpha and stays linear.
    expected = [[0.0, 0.0, 0.735357, 0.25], [0.04045, 0.5, 0.0, 1.0]]
    numpy.testing.assert_allclose(encoded, expected, atol=2e-5)


@pytest.mark.parametrize("extension, channels", [("png", 4), ("tga", 4), ("bmp", 3), ("jpg", 3)])
@pytest.mark.parametrize("mode, byte", [("sRGB", 188), ("disabled", 128)])
def test_eight_bit_files_stay_premultiplied(runner, tmp_path, extension, channels, mode, byte):
    import OpenImageIO as oiio

    pixels = numpy.zeros((4, 6, 4), dtype=numpy.float32)
    pixels[...] = (0.50196, 0.50196, 0.50196, 0.6)
    linear, target = tmp_path / "linear.exr", tmp_path / f"out.{extension}"
    output = oiio.ImageOutput.create(str(linear))
    assert (
        output.open(str(linear), oiio.ImageSpec(6, 4, 4, oiio.FLOAT)) and output.write_image(pixels) and output.close()
    )
    runner.convert(str(linear), str(target), mode)
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)  # read what the file holds
    image = oiio.ImageInput.open(str(target), config)
    read = image.read_image(oiio.UINT8)
    assert read.shape == (4, 6, channels)
    # jpg is lossy.
    assert numpy.abs(read[..., :3].astype(int) - byte).max() <= (2 if extension == "jpg" else 0)
    if channels == 4:
        assert (read[..., 3] == 153).all()


def test_the_camera_is_named_or_of_the_settings_or_primary(runner, capsys):
    from pxr import Usd, UsdGeom, UsdRender, UsdUtils

    stage = Usd.Stage.CreateInMemory()
    assert not runner.find_camera(stage, None, None), "no camera at all: the recorder frames the scene"
    primary = UsdGeom.Camera.Define(stage, f"/rig/{UsdUtils.GetPrimaryCameraName()}")
    other = UsdGeom.Camera.Define(stage, "/rig/other")
    settings = UsdRender.Settings.Define(stage, "/Render/settings")
    assert runner.find_camera(stage, None, None).GetPath() == primary.GetPath()
    assert runner.find_camera(stage, "other", None).GetPath() == other.GetPath()
    assert runner.find_camera(stage, None, settings.GetPath()).GetPath() == primary.GetPath()
    settings.GetCameraRel().SetTargets([other.GetPath()])
    assert runner.find_camera(stage, None, settings.GetPath()).GetPath() == other.GetPath()
    assert capsys.readouterr().err == ""
    assert runner.find_camera(stage, "absent", None).GetPath() == primary.GetPath()
    assert "No camera absent" in capsys.readouterr().err


def test_failures_end_with_one_and_a_message(scene, tmp_path):
    missing = start(tmp_path / "missing.usda", tmp_path / "out.png")
    assert missing.returncode == 1 and "missing.usda" in missing.stderr
    broken = tmp_path / "broken.usda"
    broken.write_text("#usda 1.0\ndef Sphere {{{")
    syntax = start(broken, tmp_path / "out.png")
    assert syntax.returncode == 1 and "broken.usda" in syntax.stderr
    settings = start("-rs", "/nothing", scene, tmp_path / "out.png", "-r", "Storm")
    assert settings.returncode == 1 and "/nothing" in settings.stderr
    assert not (tmp_path / "out.png").exists()


@pytest.mark.parametrize(
    "flags, message",
    [
        (["--frames", "1:2", "out.png"], "placeholder"),
        (["out.###.png"], "placeholder"),
        (["--renderer", "NoSuchRenderer", "out.png"], "NoSuchRenderer"),
        (["--aov", "albedo", "out.png"], "needs an EXR image"),
    ],
)
def test_bad_arguments_end_with_two(scene, flags, message):
    done = start(*flags[:-1], scene, flags[-1])
    assert done.returncode == 2 and message in done.stderr


def test_pythonpath_of_the_user_is_ignored(scene, tmp_path):
    (tmp_path / "pxr").mkdir()
    (tmp_path / "pxr" / "__init__.py").write_text("raise SystemExit(99)")
    command = [sys.executable, "-I", str(RUNNER), "--help"]
    environment = dict(os.environ, PYTHONPATH=str(tmp_path))
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and "usdFilePath" in done.stdout


@pytest.mark.parametrize("status", [0, 1])
def test_exiting_does_not_finalize_python(tmp_path, status):
    """Threads of USD's that take the interpreter's lock while it is, abort the process. All that was said still comes
    out."""
    code = (
        f"import atexit, runpy, sys; atexit.register(lambda: print('at exit')); run = runpy.run_path({str(RUNNER)!r});"
        f" print('said'); run['leave']({status})"
    )
    done = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (status, "said\n", ""), done


def test_the_runner_exits_without_finalizing_python(scene):
    """The way out of the script itself, with a file that is not there."""
    code = (
        "import atexit, sys, runpy; atexit.register(lambda: print('at exit')); sys.argv = ['usdrecord',"
        f" {str(scene) + 'x'!r}, 'out.exr']; runpy.run_path({str(RUNNER)!r}, run_name='__main__')"
    )
    done = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1 and "Could not open layer" in done.stderr and "at exit" not in done.stdout, done
