# SPDX-License-Identifier: Apache-2.0
"""Checkpoints through `usdrecord`: killed at random moments, a render goes on to the bits and the error of one that was
never stopped; signals; files that are another's, damaged or cannot be written."""

import os
import random
import shlex
import signal
import subprocess

import OpenEXR
import pytest

import compare
import exr
import small
import test_nonfinite_samples
from test_interrupt import Running, is_running

SCENE = small.FOLDER / "nested.usda"
KILLS = 50 if os.environ.get("OOCPT_TEST_FULL") else 3
MANY = 1 << 20
# In core by the shaders, by the host, and with a scene that does not fit.
WAYS = {
    "core": {"OOCPT_TRAVERSAL": "compute"},
    "native": {"OOCPT_TRAVERSAL": "native"},
    "streaming": {"OOCPT_CHUNK_SIZE": "16", "OOCPT_CHUNK_REPORT": "report.json"},
}


def words(out, film, samples, *flags, scene=SCENE, camera="/World/Camera"):
    kept = ["--checkpoint", film, "--set", "checkpointInterval=0"] if film else []
    return [
        "usdrecord", "--disableGpu", "--disableCameraLight", "--camera", camera, "--imageWidth", "64",
        "--samples", str(samples), *kept, *flags, scene, out,
    ]  # fmt: skip


def record(folder, film, samples, *flags, of=None, **environment):
    """The picture, its `oocpt:` attributes, and the lines on standard error; `of`: scene and camera."""
    out = folder / "out.exr"
    out.unlink(missing_ok=True)
    variables = dict(os.environ, OOCPT_MAX_BOUNCES="2") | environment
    variables.pop("PYTHONPATH", None)
    done = subprocess.run(
        [*map(str, words(out, film, samples, *flags, **of or {}))], env=variables, cwd=folder, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with OpenEXR.File(str(out)) as file:
        told = {name: value for name, value in file.header().items() if name.startswith("oocpt:")}
        told = {name: value if isinstance(value, str) else float(value[0]) for name, value in told.items()}
    return exr.read(out), told, done.stderr.splitlines()


def error(told):
    return [told.get(f"oocpt:{name}") for name in ("samples", "errorEstimate", "errorLow", "errorHigh")]


@pytest.fixture
def start(tmp_path):
    running = []

    def begin(film, *flags, of=None, **environment):
        line = words(tmp_path / "killed.exr", film, MANY, *flags, **of or {})
        running.append(Running(tmp_path, *line, **{"OOCPT_MAX_BOUNCES": "2"} | environment))
        return running[-1]

    yield begin
    for one in running:
        one.close()


def wait_for_file(run, film):
    run.wait_for(film.exists, "the first checkpoint")


@pytest.mark.parametrize("way", WAYS)
def test_a_render_that_is_killed_goes_on_to_the_same_bits(start, tmp_path, way):
    """`kill -9` at random moments from the first checkpoint on: while the device works, while the file is written, and
    before the next one is."""
    chance, film, times = random.Random(7), tmp_path / "film", []
    environment = {name: value.replace("report", str(tmp_path / "report")) for name, value in WAYS[way].items()}
    for _ in range(KILLS):
        run = start(film, **environment)
        wait_for_file(run, film)
        before = film.stat().st_mtime_ns
        run.wait_for(lambda: film.stat().st_mtime_ns != before, "another checkpoint")
        times.append(chance.uniform(0.0, 0.3))
        with pytest.raises(subprocess.TimeoutExpired):
            run.process.wait(timeout=times[-1])
        run.process.kill()
        run.process.wait()
    # Ends at once with what the file has, and perhaps a part of a sample; then whole samples.
    _, told, _ = record(tmp_path, film, MANY, "--time-limit", "0.001", **environment)
    samples = int(told["oocpt:samples"]) + 1
    picture, told, said = record(tmp_path, film, samples, **environment)
    assert not [line for line in said if "heckpoint" in line], said
    at_once, expected, _ = record(tmp_path, None, samples, **environment)
    compare.same_bits(picture, at_once, f"after kills at {times}, {samples} samples")
    assert error(told) == error(expected) and told["oocpt:samples"] == samples, "the error too"
    assert told["oocpt:rays"] < expected["oocpt:rays"], "not all was traced again"


def test_samples_that_are_not_finite_are_counted_once(start, tmp_path):
    scene, film = tmp_path / "scene.usda", tmp_path / "film"
    scene.write_text(test_nonfinite_samples.SCENE.format(intensity="3e38"))
    of = {"scene": scene, "camera": "/Cam"}
    run = start(film, of=of)
    wait_for_file(run, film)
    run.process.kill()
    run.process.wait()
    _, told, _ = record(tmp_path, film, MANY, "--time-limit", "0.001", of=of)
    samples = int(told["oocpt:samples"]) + 1
    picture, _, said = record(tmp_path, film, samples, of=of)
    at_once, _, expected = record(tmp_path, None, samples, of=of)
    compare.same_bits(picture, at_once, f"{samples} samples")
    told = [[line for line in lines if test_nonfinite_samples.MESSAGE in line] for lines in (said, expected)]
    assert told[0] == told[1] and len(told[0]) == 1, told


def test_signals_make_checkpoints(start, tmp_path):
    film = tmp_path / "film"
    run = start(film, "--set", "checkpointInterval=1000000", "--imageWidth", "32")
    run.wait_for(lambda: "Recording time code" in run.said()[0], "recording")
    while not film.exists():  # once each pixel has a sample
        run.process.send_signal(signal.SIGUSR1)
        with pytest.raises(subprocess.TimeoutExpired):
            run.process.wait(timeout=0.2)
    asked = film.stat().st_mtime_ns
    assert is_running(run.process.pid), "it goes on"
    run.interrupt(signal.SIGTERM)
    assert film.stat().st_mtime_ns > asked, "and keeps what it has when it ends"


def test_another_scene_is_told_and_left_alone(tmp_path):
    film = tmp_path / "film"
    record(tmp_path, film, 4)
    before = film.read_bytes()
    for flags, what in [(("--set", "seed=3"), "oocpt:seed: 0 and 3"), (("--imageWidth", "48"), "size: 64 x ")]:
        _, told, said = record(tmp_path, film, 4, *flags)
        warnings = [line for line in said if "oocpt:checkpoint" in line]
        assert len(warnings) == 1 and what in warnings[0] and str(film) in warnings[0], said
        assert told["oocpt:samples"] == 4 and film.read_bytes() == before
    film.write_bytes(before[:-100])
    _, told, said = record(tmp_path, film, 6)
    assert sum("oocpt:checkpoint" in line for line in said) == 1 and told["oocpt:samples"] == 6, said
    assert film.read_bytes() == before[:-100], "a file that is cut stays as it is"


# A file system of $1 KiB in a name space of its own; $3 renders few samples to it, $5 more of them.
FULL_DISK = """set -e
mount -t tmpfs -o size=$1k none "$2"
eval "$3"
cp "$2/film" "$4"
eval "$5" 2>"$4.said"
cmp "$2/film" "$4"
ls -A "$2"
"""


def test_a_disk_that_is_full_costs_a_warning(tmp_path):
    unshare = ["unshare", "--map-root-user", "--mount"]
    if subprocess.run([*unshare, "true"], check=False).returncode:
        pytest.skip("no name spaces of one's own here")
    disk, kept, film = tmp_path / "disk", tmp_path / "kept", tmp_path / "film"
    disk.mkdir()
    record(tmp_path, film, 4)
    kib = film.stat().st_size * 3 // 2 >> 10
    line = [shlex.join(map(str, words(tmp_path / "out.exr", disk / "film", samples))) for samples in (4, 8)]
    variables = dict(os.environ, OOCPT_MAX_BOUNCES="2")
    variables.pop("PYTHONPATH", None)
    done = subprocess.run(
        [*unshare, "sh", "-c", FULL_DISK, "sh", str(kib), str(disk), line[0], str(kept), line[1]], env=variables,
        cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    said = (tmp_path / "kept.said").read_text().splitlines()
    assert done.returncode == 0, (done.stdout, done.stderr, said)  # the old file stays
    assert done.stdout.splitlines()[-1] == "film", "and nothing is beside it"
    warnings = [line for line in said if "oocpt:checkpoint" in line]
    assert len(warnings) == 1 and "No space left" in warnings[0], said
    assert any(line.startswith("OocPT: 8 samples") for line in said), "the render lives"


def test_a_checkpoint_is_of_one_picture(tmp_path):
    line = words(tmp_path / "out.##.exr", tmp_path / "film", 4, "--frames", "1:2")
    done = subprocess.run([*map(str, line)], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 2 and "one picture" in done.stderr, done.stderr
