# SPDX-License-Identifier: Apache-2.0
"""usdview with OocPT, by `testusdview` and `drive_usdview.py`: what a user sees is always a whole picture and follows
what he does. By counts: no clock decides.

Runs where `OOCPT_USD_ROOT` names an SDK with usdview, or `OOCPT_TESTUSDVIEW` a command that starts `testusdview` with
OocPT; without a display it is started by `xvfb-run`.
"""
import json
import os
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy
import pytest
from PIL import Image

DRIVER = Path(__file__).with_name("drive_usdview.py")
MOVES = ["tumble", "zoom", "walk", "cameras", "resize", "edit", "complexity"]
SCENE = """#usda 1.0
(
    upAxis = "Y"
)

def Xform "World"
{
    def DomeLight "Dome"
    {
        float inputs:intensity = 1
    }
    def Camera "Camera"
    {
        float focalLength = 35
        double3 xformOp:translate = (0, 1.5, 12)
        double3 xformOp:rotateXYZ = (-5, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }
    def Camera "Other"
    {
        float focalLength = 24
        double3 xformOp:translate = (10, 3, 8)
        double3 xformOp:rotateXYZ = (-2, 50, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }
    def Sphere "PickBall"
    {
        color3f[] primvars:displayColor = [(0.7, 0.3, 0.2)]
        double3 xformOp:translate = (-2.5, 0.3, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Mesh "PickSolid"
    {
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]
        point3f[] points = [(-1, -1, -1), (1, -1, -1), (-1, 1, -1), (1, 1, -1), (-1, -1, 1), (1, -1, 1), (-1, 1, 1),
            (1, 1, 1)]
        color3f[] primvars:displayColor = [(0.3, 0.5, 0.7)]
        token subdivisionScheme = "catmullClark"
    }
    def PointInstancer "PickMany"
    {
        rel prototypes = [</World/PickMany/Box>]
        int[] protoIndices = [0, 0, 0]
        point3f[] positions = [(2.1, -0.8, 0), (2.1, 0.2, 0), (2.1, 1.2, 0)]
        def Cube "Box"
        {
            double size = 0.8
            color3f[] primvars:displayColor = [(0.3, 0.6, 0.3)]
        }
    }
    def Mesh "Floor"
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-400, -1.2, 400), (400, -1.2, 400), (400, -1.2, -400), (-400, -1.2, -400)]
        color3f[] primvars:displayColor = [(0.4, 0.4, 0.4)]
        token subdivisionScheme = "none"
    }
}
"""


def starting():
    """How `testusdview` is started, as words for a process; `None` where there is none."""
    named = os.environ.get("OOCPT_TESTUSDVIEW")
    if named:
        command = shlex.split(named)
    elif (Path(os.environ.get("OOCPT_USD_ROOT") or os.devnull) / "bin/testusdview").is_file():
        command = ["bash", "-c", 'eval "$(cargo xtask env)" && exec testusdview "$@"', "testusdview"]
    else:
        return None
    return command if os.environ.get("DISPLAY") else ["xvfb-run", "-a", "-s", "-screen 0 1600x1000x24"] + command


COMMAND = starting()
needs_usdview = pytest.mark.skipif(
    COMMAND is None, reason="neither OOCPT_USD_ROOT nor OOCPT_TESTUSDVIEW names a usdview"
)


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """What the driver saw: its log by step, and the folder of the shots."""
    folder = tmp_path_factory.mktemp("usdview")
    scene = folder / "scene.usda"
    scene.write_text(SCENE)
    variables = dict(os.environ, OOCPT_USDVIEW_OUT=str(folder), OOCPT_SAMPLES_PER_PIXEL="16")
    if os.environ.get("OOCPT_USD_ROOT"):
        # Those of the wheel host's plugin, which no other OpenUSD can load.
        for name in ["PXR_PLUGINPATH_NAME", "PYTHONPATH", "PXR_MTLX_STDLIB_SEARCH_PATHS"]:
            variables.pop(name, None)
    done = subprocess.run(
        [*COMMAND, "--renderer", "OocPT", "--camera", "Camera", "--testScript", str(DRIVER), str(scene)],
        env=variables, capture_output=True, text=True, timeout=1800, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    kept = os.environ.get("OOCPT_KEEP_PICTURES")
    if kept:
        shutil.copytree(folder, Path(kept) / "usdview", dirs_exist_ok=True)
    assert done.returncode == 0, done.stderr
    for word in ["Traceback", "ERROR", "Coding Error", "Failed verification"]:
        assert word not in done.stderr, done.stderr
    log = {row["step"]: row for row in json.loads((folder / "log.json").read_text())}
    failed = {step: row["error"] for step, row in log.items() if "error" in row}
    assert not failed, failed
    return log, folder


def pixels(folder, shot):
    return numpy.asarray(Image.open(folder / shot["file"]).convert("RGB")).astype(float)


def holes(picture):
    """Share of bands of pixels, sky above and floor below, that are darker than any sample can leave them.

    Every ray of the scene ends at a dome of radiance 1 or on the lit floor; only contact shadows are dark, and single
    samples in them black. So the upper and the lower sixth of the picture, in bands of two rows, are bright. The
    overlay's lines of words are thin and dark brown: the median does not see them.
    """
    height = picture.shape[0]
    rows = numpy.median(picture.max(axis=2), axis=1)
    edge = height // 6
    bands = numpy.concatenate([rows[:edge], rows[-edge:]])
    return float((bands < 40).mean())


def test_a_hole_in_a_picture_is_seen():
    """The judge of all other tests, on pictures that it must refuse."""
    whole = numpy.full((120, 160, 3), 180.0)
    assert holes(whole) == 0
    black, upper, lower = numpy.zeros_like(whole), whole.copy(), whole.copy()
    upper[:60], lower[60:] = 0, 0
    assert holes(black) == 1 and holes(upper) > 0.4 and holes(lower) > 0.4


@needs_usdview
@pytest.mark.parametrize("step", MOVES)
def test_every_picture_is_whole_and_newer_than_the_one_before(driven, step):
    log, folder = driven
    shots = log[step]["shots"]
    assert len(shots) >= 2
    for shot in shots:
        assert holes(pixels(folder, shot)) == 0, shot
        assert shot["changed"], f"{shot} shows what was shown before"


@needs_usdview
def test_a_click_selects_what_is_under_it(driven):
    log, _ = driven
    paths = {place: row["paths"] for place, row in log["pick"]["picked"].items()}
    assert paths == {
        "/World/PickBall": {"/World/PickBall": [0]},
        "/World/PickSolid": {"/World/PickSolid": [0]},
        "/World/PickMany": {"/World/PickMany": [1]},
    }


@needs_usdview
def test_the_picture_has_the_size_of_the_view(driven):
    log, folder = driven
    for size, shot in zip(log["resize"]["sizes"], log["resize"]["shots"], strict=True):
        assert list(Image.open(folder / shot["file"]).size) == size


@needs_usdview
def test_an_edit_of_a_light_and_of_a_place_is_seen(driven):
    log, folder = driven
    first, last = (pixels(folder, log["edit"]["shots"][at]) for at in (0, -1))
    sky = [picture[: picture.shape[0] // 8].mean(axis=(0, 1)) for picture in (first, last)]
    assert sky[1][1] < sky[0][1] - 5, "the light turns red, step by step"
    assert abs(sky[1][0] - sky[0][0]) < 3


@needs_usdview
def test_planes_are_in_the_menu_and_are_shown(driven):
    log, folder = driven
    assert log["aovs"]["aovs"][0] == "color" and {"primId", "depth", "normal", "Neye"} <= set(log["aovs"]["aovs"])
    shown = [pixels(folder, shot).tobytes() for shot in log["aovs"]["shots"]]
    assert len(set(shown)) == len(shown), "each is another picture"


@needs_usdview
def test_a_pause_holds_the_picture_and_a_stop_ends(driven):
    log, folder = driven
    assert log["pause"]["supported"] and log["pause"]["paused"] and log["pause"]["converged"]
    before, held, _ = (pixels(folder, shot).tobytes() for shot in log["pause"]["shots"])
    assert before == held
    assert log["stop"]["supported"] and log["stop"]["converged"]


@needs_usdview
def test_the_panel_lists_and_sets_our_settings(driven):
    log, folder = driven
    row = log["settings"]
    assert {"oocpt:samplesPerPixel", "oocpt:maxBounces", "oocpt:memoryBudget"} <= set(row["names"])
    assert row["before"] > 0 and row["after"] == 0
    none, many = (pixels(folder, shot).mean() for shot in row["shots"])
    assert none < many, "no light that was reflected twice"


@needs_usdview
def test_another_renderer_and_back(driven):
    log, folder = driven
    assert log["renderers"]["renderers"] == {"HdStormRendererPlugin": "Storm", "HdOocPTRendererPlugin": "OocPT"}
    other, back = (pixels(folder, shot) for shot in log["renderers"]["shots"])
    assert numpy.abs(other - back).mean() > 1 and holes(back) == 0
    assert log["window"]["renderer"] == "HdOocPTRendererPlugin"


@needs_usdview
def test_the_window_closes_while_it_renders(driven):
    log, _ = driven
    assert log["closing"] == {"step": "closing", "shots": [], "converged": False}
