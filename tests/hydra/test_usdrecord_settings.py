# SPDX-License-Identifier: Apache-2.0
"""Settings on the command line of our usdrecord, and the line with which a batch render ends in every host."""

import os
import re
import subprocess

import pytest

import small

CLOSING = (
    r"OocPT: {samples} samples, \d+\.\d s, relMSE \d\.\de-?\d+ \(\d\.\de-?\d+ to \d\.\de-?\d+\), "
    r"\d+(\.\d)? [MG]iB of device memory, in core"
)
SETTINGS = """
def RenderSettings "Settings"
{
    custom int oocpt:samplesPerPixel = 2
}
"""


@pytest.fixture
def usdrecord(tmp_path):
    """Runs usdrecord on a square under a light whose render settings ask for two samples."""
    scene = tmp_path / "scene.usda"
    header = '#usda 1.0\n(\n    renderSettingsPrimPath = "/Settings"\n    subLayers = [@{}@]\n)\n'
    scene.write_text(header.format(small.FOLDER / "glow.usda") + SETTINGS)

    def run(*flags, **environment):
        command = ["usdrecord", "--disableGpu", "--camera", "/World/Camera", "-w", "16", *flags]
        variables = dict(os.environ, **environment)
        variables.pop("PYTHONPATH", None)
        return subprocess.run(
            [*command, str(scene), str(tmp_path / "out.exr")],
            env=variables, capture_output=True, text=True, timeout=120, check=False, start_new_session=True,
        )

    return run


def closing(done, samples):
    pattern = CLOSING.format(samples=samples)
    return [line for line in done.stderr.splitlines() if re.fullmatch(pattern, line)]


def test_a_batch_render_ends_with_one_line_about_its_error(usdrecord):
    done = usdrecord(OOCPT_SAMPLES_PER_PIXEL="8")
    assert done.returncode == 0 and len(closing(done, 2)) == 1, done.stderr


@pytest.mark.parametrize(
    "flags",
    [["--samples", "4"], ["--set", "samplesPerPixel=3", "--set", "oocpt:samplesPerPixel=4"]],
    ids=["own", "any"],
)
def test_the_command_line_is_above_the_scene(usdrecord, flags):
    done = usdrecord(*flags, OOCPT_SAMPLES_PER_PIXEL="8")
    assert done.returncode == 0 and len(closing(done, 4)) == 1, done.stderr


def test_the_command_line_sets_what_belongs_to_the_machine(usdrecord):
    done = usdrecord("--set", "device=no such device")
    assert done.returncode == 1 and "no such device" in done.stderr, done.stderr
    done = usdrecord("--memory-budget", "1")
    assert done.returncode == 1 and "emory" in done.stderr, done.stderr


@pytest.mark.parametrize(
    "flags, words",
    [
        (["--set", "samplePerPixels=4"], "did you mean oocpt:samplesPerPixel?"),
        (["--set", "maxBounces=many"], "expected an integer"),
        (["--target-error", "-1"], "outside 0 to"),
        (["--set", "maxBounces"], "is not KEY=VALUE"),
    ],
    ids=["name", "type", "range", "form"],
)
def test_a_wrong_setting_is_an_error_that_says_what_is_meant(usdrecord, flags, words):
    done = usdrecord(*flags)
    assert done.returncode == 2 and words in done.stderr, done.stderr


def test_an_unknown_setting_of_a_scene_is_a_warning_that_says_the_nearest(usdrecord, tmp_path):
    scene = tmp_path / "scene.usda"
    samples = "custom int oocpt:samplesPerPixel = 2"
    scene.write_text(scene.read_text().replace(samples, f"{samples}\n    custom int oocpt:maxDifuseBounces = 1"))
    done = usdrecord()
    assert done.returncode == 0 and len(closing(done, 2)) == 1, done.stderr
    assert "no setting oocpt:maxDifuseBounces; did you mean oocpt:maxDiffuseBounces?" in done.stderr, done.stderr


def test_a_render_that_shows_pictures_on_the_way_ends_without_words(host):
    quick = {"oocpt:samplesPerPixel": 2, "oocpt:maxBounces": 0}
    said = {}
    for interactive in (False, True):
        settings = quick | {"enableInteractive": interactive}
        with host.open(small.FOLDER / "glow.usda", (16, 16), camera="/World/Camera", settings=settings) as view:
            said[interactive] = "2 samples, " in view.render().log
    assert said == {False: True, True: False}
