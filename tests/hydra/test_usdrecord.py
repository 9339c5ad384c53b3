# SPDX-License-Identifier: Apache-2.0
"""The command line: the `usdrecord` in PATH (ours on the wheel host, Pixar's with an SDK) and its exit status."""

import os
import subprocess

import numpy as np
import pytest

import compare
import exr
import small
import test_textures


@pytest.fixture(params=["0", "1"], ids=["legacy", "scene_index"])
def usdrecord(request, tmp_path):
    """Runs usdrecord; returns the finished process, and the path of its picture."""

    def run(scene, *flags, name="out.exr", **environment):
        out = tmp_path / name
        variables = dict(os.environ, USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX=request.param, OOCPT_VALIDATION="1")
        variables.update({"OOCPT_SAMPLES_PER_PIXEL": "4", "OOCPT_MAX_BOUNCES": "1"} | environment)
        variables.pop("PYTHONPATH", None)
        command = [
            "usdrecord", "--renderer", "OocPT", "--disableGpu", "--disableCameraLight", *flags, str(scene), str(out)
        ]
        done = subprocess.run(
            command, env=variables, capture_output=True, text=True, timeout=120, check=False, start_new_session=True
        )
        return done, out

    return run


def test_exr_holds_the_bits_of_the_buffer(usdrecord, pool):
    done, out = usdrecord(
        small.FOLDER / "glow.usda", "--camera", "/World/Camera", "--imageWidth", "24", "--enableDomeLightVisibility"
    )
    assert done.returncode == 0, done.stderr
    settings = {"oocpt:samplesPerPixel": 4, "oocpt:maxBounces": 1}
    expected = pool.get("legacy").picture(small.FOLDER / "glow.usda", (24, 24), settings=settings)["color"]
    compare.same_bits(exr.read(out), expected, "usdrecord against the render buffer")


def test_dome_is_hidden_by_default_as_in_pixars(usdrecord):
    done, out = usdrecord(small.FOLDER / "furnace.usda", "--camera", "/World/Perspective", "--imageWidth", "16")
    assert done.returncode == 0, done.stderr
    picture = exr.read(out)
    compare.near(picture[8, 8], 1.0, 2e-3, "ball")
    compare.near(picture[0, 0], 0.0, 0.0, "background")


def test_png_is_srgb(usdrecord):
    from PIL import Image

    done, out = usdrecord(
        small.FOLDER / "sun_disk.usda", "--camera", "/World/Camera", "--imageWidth", "16", name="out.png",
        OOCPT_SAMPLES_PER_PIXEL="64",
    )
    assert done.returncode == 0, done.stderr
    mean = np.asarray(Image.open(out).convert("RGB"), dtype=np.float64).mean(axis=(0, 1)) / 255
    linear = 0.5 / np.pi * (2.0 * np.cos(np.radians(40)) * np.array([1.0, 0.5, 0.25]) + 0.3 * np.pi)
    compare.near(mean, 1.055 * linear ** (1 / 2.4) - 0.055, 0.012, "sRGB")


@pytest.mark.parametrize(
    "scene, flags, environment, words",
    [
        ("no_such_file.usda", [], {}, "no_such_file"),
        ("furnace.usda", ["--imageWidth", "8"], {"OOCPT_DEVICE": "no such device"}, "no such device"),
        ("furnace.usda", ["--imageWidth", "64"], {"OOCPT_MEMORY_BUDGET": "1"}, "emory"),
        ("furnace.usda", ["--imageWidth", "150000"], {}, ""),
    ],
    ids=["file", "device", "budget", "size"],
)
def test_fatal_errors_exit_with_one_and_say_why(usdrecord, scene, flags, environment, words):
    done, _ = usdrecord(small.FOLDER / scene, "--camera", "/World/Perspective", *flags, **environment)
    assert done.returncode == 1, f"status {done.returncode}: {done.stderr}"
    assert words in done.stderr and done.stderr.strip(), done.stderr


def test_bad_scene_data_is_not_fatal(usdrecord):
    done, out = usdrecord(small.FOLDER / "bad_data.usda", "--camera", "/World/Camera", "--imageWidth", "24")
    assert done.returncode == 0, done.stderr
    assert "/World/NanPoint" in done.stderr and np.isfinite(exr.read(out)).all()


def test_a_prim_that_the_host_cannot_read_leaves_the_pictures(usdrecord, tmp_path):
    """Errors of USD's about the scene end nothing, as the renderer's warnings do. Stages of Omniverse have a render
    product whose camera is not saved; USD's legacy front end calls that an error."""
    scene = tmp_path / "strange.usda"
    camera = '    def Camera "Camera"\n    {\n        double3 xformOp:translate = (0, 0, 9)\n' \
        '        uniform token[] xformOpOrder = ["xformOp:translate"]\n    }\n'  # fmt: skip
    strange = '    def Sphere "Strange"\n    {\n        token strangeOp = "scale"\n' \
        '        uniform token[] xformOpOrder = ["strangeOp"]\n    }\n'  # fmt: skip
    light = '    def DomeLight "Dome"\n    {\n    }\n'
    product = '    def RenderProduct "Product"\n    {\n        rel camera = </Unsaved>\n    }\n'
    settings = f'def RenderSettings "Settings"\n{{\n    rel products = </Settings/Product>\n{product}}}\n'
    scene.write_text(f'#usda 1.0\ndef "World"\n{{\n{camera}{strange}{light}}}\n{settings}')
    done, out = usdrecord(
        scene, "--camera", "/World/Camera", "--imageWidth", "16", "--frames", "1:2", name="out.#.exr"
    )
    assert done.returncode == 0, f"status {done.returncode}: {done.stderr}"
    # The host syncs on several threads: an error of another thread than the caller's is said at once, without the time.
    said = [line for line in done.stderr.splitlines() if "</World/Strange.strangeOp>" in line]
    assert said and all(line.startswith("USD: error: ") for line in said), done.stderr
    for frame in (1, 2):
        picture = exr.read(out.with_name(f"out.{frame}.exr"))
        compare.near(picture[8, 8, 3], 1.0, 1e-6, "the ball, in its place without the operation")


def test_a_texture_path_of_windows_is_found_beside_the_scene(usdrecord, tmp_path):
    from PIL import Image

    (tmp_path / "textures").mkdir()
    Image.fromarray(np.full((4, 4, 3), (0, 255, 0), np.uint8)).save(tmp_path / "textures" / "green.png")
    scene = tmp_path / "scene.usda"
    scene.write_text(test_textures.STAGE.replace("FILE", r".\textures\green.png").replace("EXTENT", "1"))
    done, out = usdrecord(scene, "--camera", "/World/Camera", "--imageWidth", "16")
    assert done.returncode == 0 and "not found" not in done.stderr, done.stderr
    color = exr.read(out)[8, 8]
    assert color[1] > 0.5 and max(color[0], color[2]) < 0.2, color


def test_a_stage_that_names_render_settings_it_has_not_is_rendered(usdrecord, tmp_path):
    scene = tmp_path / "draft.usda"
    scene.write_text('#usda 1.0\n(\n    renderSettingsPrimPath = "/Render/Draft"\n)\ndef Sphere "Ball"\n{\n}\n')
    done, out = usdrecord(scene, "--imageWidth", "16")
    assert done.returncode == 0 and out.exists(), done.stderr
    assert len([line for line in done.stderr.splitlines() if "</Render/Draft>" in line]) == 1, done.stderr
    asked, _ = usdrecord(scene, "--imageWidth", "16", "--renderSettingsPrimPath", "/Render/Draft")
    assert asked.returncode == 1 and "Unknown render settings </Render/Draft>" in asked.stderr, asked.stderr
