# SPDX-License-Identifier: Apache-2.0
"""What a scene is made of, as a host is told it: in GetRenderStats, in the report beside a picture, by `oocpt doctor
--scene`."""

import json
import os
import pathlib
import shutil
import subprocess

import pytest

import compare
import exr
import small

REPO = pathlib.Path(__file__).resolve().parents[2]
QUICK = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 1}
PLAIN = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
)
def Xform "World" {
    def Camera "Camera" {
        double3 xformOp:translate = (0, 0, 6)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Mesh "Board" {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
        uniform token subdivisionScheme = "none"
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
        color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
    }
    def DistantLight "Sun" {}
}
"""


@pytest.fixture(scope="module")
def oocpt():
    """Runs the program of this checkout: the one that `cargo xtask test` built, else built here with its profile."""
    built = os.environ.get("OOCPT_CLI")
    base = (
        [built]
        if built
        else [
            "cargo", "run", "--quiet", "--locked", "--profile", "fast", "--package", "oocpt-cli", "--bin", "oocpt",
            "--",
        ]
    )

    def run(*arguments, **environment):
        variables = {**os.environ, "RUST_BACKTRACE": "0", **environment}
        return subprocess.run(
            base + [str(a) for a in arguments], cwd=REPO, env=variables, capture_output=True, text=True, timeout=1800,
            start_new_session=True,
        )

    return run


def names(text: str) -> list[str]:
    return [entry for entry in text.split("; ") if entry]


def test_stats_list_present_and_omitted_parts(host):
    with host.open(PLAIN, (16, 16), settings=QUICK) as view:
        view.render()
        stats = view.stats()
    assert names(stats["oocpt:features"]) == ["DISTANT", "COLORS"], stats["oocpt:features"]
    assert "shade_surface" in names(stats["oocpt:passes"]) and "count_demand" in names(stats["oocpt:passesLeftOut"])
    assert stats["oocpt:primvars"].startswith("displayColor ") and stats["oocpt:primvarsLeftOut"] == "st 32", stats[
        "oocpt:primvarsLeftOut"
    ]
    made = dict(entry.rsplit(" ", 1) for entry in names(stats["oocpt:buffers"]))
    assert int(made["film"]) > 0 and "cones" not in made and "mesh primvars" not in made, made
    assert sum(map(int, made.values())) == stats["oocpt:bufferBytes"] > 0
    assert (
        any(entry.startswith("cones ") for entry in names(stats["oocpt:buffersLeftOut"]))
        and stats["oocpt:bytesLeftOut"] > 0
    )


def test_doctor_asks_the_host_about_a_file(oocpt, tmp_path):
    scene = tmp_path / "a plain board.usda"
    scene.write_text(PLAIN)
    done = oocpt("doctor", "--scene", scene, "--camera", "/World/Camera", "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    present = [feature["name"] for feature in said["inventory"]["features"] if feature["present"]]
    assert said["width"] == 16 and present == ["DISTANT", "COLORS"], said
    assert said["bytes"] > 0 and said["pipelines"] > 0
    unread = [primvar for primvar in said["inventory"]["primvars"] if primvar["leftOut"]]
    assert [primvar["name"] for primvar in unread] == ["st"], unread
    words = oocpt("doctor", "--scene", scene)
    assert words.returncode == 0 and "left out  COAT" in words.stdout, words.stdout


@pytest.mark.parametrize(
    "text, flags, words",
    [
        (None, [], "cannot open"), ("no USD", [], "could not render"),
        (PLAIN, ["--usdrecord", "/no/host"], "cannot start the Hydra host"),
    ],
    ids=["file", "bad_file", "host"],
)
def test_doctor_reports_each_missing_thing_once(oocpt, tmp_path, text, flags, words):
    scene = tmp_path / "scene.usda"
    if text is not None:
        scene.write_text(text)
    done = oocpt("doctor", "--scene", scene, *flags)
    assert done.returncode == 1 and words in done.stderr, done.stderr
    assert not done.stdout, "nothing is told of it"


def test_doctor_names_the_device_and_scene_warnings(oocpt, tmp_path):
    """A host warns of bad data and renders the rest, and so does the doctor: one line for each prim, without where in
    our code it was said."""
    done = oocpt("doctor", "--scene", small.FOLDER / "bad_data.usda", "--camera", "/World/Camera", "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["device"], "the device that rendered has a name"
    for name in small.BAD_PRIMS:
        warned = [warning for warning in said["warnings"] if f"/World/{name}:" in warning]
        assert len(warned) == 1 and warned[0].startswith("OocPT: "), (name, said["warnings"])
    scene = tmp_path / "gone.usda"
    scene.write_text(PLAIN.replace('"Board" {', '"Board" (references = @gone_away.usda@) {'))
    words = oocpt("doctor", "--scene", scene, "--camera", "/World/Nowhere")
    assert words.returncode == 0, words.stderr
    head, _, warned = words.stdout.partition("\nthe host warned\n")
    assert said["device"] in head.splitlines()[0] and "(1 level of instances" in head, head
    assert "gone_away.usda" in warned and "/World/Nowhere" in warned and "/World/Board" in warned, words.stdout
    quiet = oocpt("doctor", "--scene", small.FOLDER / "lambert.usda", "--camera", "/World/Camera")
    assert "warned" not in quiet.stdout, quiet.stdout


def test_a_file_that_names_another_report_changes_nothing(oocpt, tmp_path):
    """Reports belong to the machine: the doctor reads its own, and nothing is written over."""
    scene, other = tmp_path / "other.usda", tmp_path / "precious.txt"
    other.write_text("precious")
    settings = (
        'def RenderSettings "Settings" {\n'
        f'  string oocpt:report = "{other}"\n'
        '  rel camera = </World/Camera>\n'
        '}\n'
    )
    default = '(\n    renderSettingsPrimPath = "/Settings"\n    defaultPrim'
    scene.write_text(PLAIN.replace("(\n    defaultPrim", default, 1) + settings)
    done = oocpt("doctor", "--scene", scene)
    assert done.returncode == 0 and "oocpt:report, which belongs to the machine" in done.stdout, done.stderr
    assert other.read_text() == "precious"


def said_of(oocpt, file) -> dict:
    done = oocpt("report", "picture", file, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_report_stands_in_for_attributes_that_hosts_do_not_write(oocpt, fresh_host, tmp_path):
    """FrameRecorder writes the file itself, with no attributes of ours: the report beside it has them."""
    scene, picture, report = tmp_path / "plain.usda", tmp_path / "plain.exr", tmp_path / "plain.jsonl"
    scene.write_text(PLAIN)
    host = fresh_host(
        False, OOCPT_REPORT=str(report), OOCPT_SAMPLES_PER_PIXEL="4", OOCPT_MAX_BOUNCES="1", OOCPT_SEED="9"
    )
    host.call("record", stage=str(scene), out=str(picture), width=16)
    bare = oocpt("report", "picture", picture)
    assert bare.returncode == 1 and "oocpt:report" in bare.stderr, f"{bare.stdout}{bare.stderr}"
    said = said_of(oocpt, report)
    assert said["samples"] == 4 and said["seed"] == 9 and said["maxBounces"] == 1 and said["rays"] > 0, said
    assert (
        0 < said["secondsTracing"] <= said["seconds"] and said["errorLow"] <= said["errorEstimate"] <= said["errorHigh"]
    ), said


def test_usdrecord_writes_the_stats_into_exr_files(oocpt, tmp_path):
    scene, report = tmp_path / "plain.usda", tmp_path / "plain.jsonl"
    scene.write_text(PLAIN)

    def record(name, **environment):
        picture = tmp_path / name
        variables = dict(os.environ, OOCPT_SAMPLES_PER_PIXEL="4", OOCPT_MAX_BOUNCES="1", **environment)
        variables.pop("PYTHONPATH", None)
        command = [
            "usdrecord", "--renderer", "OocPT", "--disableGpu", "--imageWidth", "16", "--camera", "/World/Camera",
            str(scene), str(picture),
        ]
        subprocess.run(command, env=variables, check=True, capture_output=True, timeout=300, start_new_session=True)
        return picture

    plain, told = record("plain.exr"), record("told.exr", OOCPT_REPORT=str(report))
    compare.same_bits(exr.read(told), exr.read(plain), "attributes change no pixel")
    if "cargo xtask build" in pathlib.Path(shutil.which("usdrecord")).read_text(errors="replace"):
        attributes, rows = said_of(oocpt, told), said_of(oocpt, report)
        assert attributes.keys() >= rows.keys()
        without = said_of(oocpt, plain)
        assert without.keys() == attributes.keys() and without["samples"] == 4, "a report is not needed"
        assert without["pixelFilter"] == "box" and without["pixelFilterWidth"] == 1, without
        for key, value in rows.items():
            assert attributes[key] == (value if isinstance(value, str) else pytest.approx(value, rel=1e-6)), key
        assert sorted(path.name for path in tmp_path.iterdir()) == [
            "plain.exr",
            "plain.jsonl",
            "plain.usda",
            "told.exr",
        ], "nothing is left behind"
