# SPDX-License-Identifier: Apache-2.0
"""SIGINT and SIGTERM: every command of ours ends soon, with 130, and leaves a whole picture or none, and nothing of its
own beside it. The bounds are generous; what is interrupted would take minutes."""

import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import exr
import small

SOON = 5.0
MANY = str(1 << 20)
# A test that runs in the background of a shell hands its children an ignored SIGINT.
HEARING = "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); os.execvp(sys.argv[1], sys.argv[1:])"


def is_running(number):
    """Not when all that is left of it is to be reaped. Mesa's cache has a thread of the lowest priority: a process that
    has ended is no more than a zombie for many seconds, where others want the processors."""
    try:
        state = pathlib.Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def ends_soon(number):
    begin = time.monotonic()
    while is_running(number):
        if time.monotonic() - begin > SOON:
            return False
        time.sleep(0.02)
    return True


class Running:
    """A command under way; ended when the test is over."""

    def __init__(self, folder, *words, **environment):
        variables = dict(os.environ, **environment)
        variables.pop("PYTHONPATH", None)
        self._logs = [folder / name for name in ("stdout.log", "stderr.log")]
        with open(self._logs[0], "w") as out, open(self._logs[1], "w") as err:
            self.process = subprocess.Popen(
                [sys.executable, "-I", "-c", HEARING, *map(str, words)], env=variables, stdin=subprocess.DEVNULL,
                stdout=out, stderr=err, start_new_session=True,
            )

    def said(self):
        """Standard output and standard error until now."""
        return [log.read_text() for log in self._logs]

    def wait_for(self, condition, what):
        end = time.monotonic() + 120
        while not condition():
            assert self.process.poll() is None, f"it ended before {what}: {self.said()}"
            assert time.monotonic() < end, f"{what} takes too long: {self.said()}"
            time.sleep(0.02)

    def interrupt(self, *signals):
        """Sends them; the lines on standard error once it has ended."""
        for number in signals:
            self.process.send_signal(number)
        assert ends_soon(self.process.pid), f"not heard: {self.said()}"
        status = self.process.wait(timeout=60)
        assert status == 130, f"status {status}: {self.said()}"
        return self.said()[1].splitlines()

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


@pytest.fixture
def start(tmp_path):
    running = []

    def begin(*words, **environment):
        running.append(Running(tmp_path, *words, **environment))
        return running[-1]

    yield begin
    for one in running:
        one.close()


@pytest.fixture
def pictures(tmp_path):
    """Where pictures go; nothing else belongs there."""
    folder = tmp_path / "pictures"
    folder.mkdir()
    return folder


def record(start, scene, out, *flags, **environment):
    words = ["usdrecord", "--disableGpu", "--camera", "/World/Camera", *flags, scene, out]
    return start(*words, **{"OOCPT_SAMPLES_PER_PIXEL": MANY, "OOCPT_MAX_BOUNCES": "1"} | environment)


def names(folder):
    return sorted(os.listdir(folder))


def wait_for_samples(run, report):
    """Until the report has a row: every pixel has a sample then."""

    def has_row():
        text = report.read_text() if report.exists() else ""
        return any('"samples"' in line and json.loads(line) for line in text.split("\n")[:-1])

    run.wait_for(has_row, "the first sample")


def with_samples(start, out, folder, width):
    """A render of a picture so wide, of which every pixel has a sample."""
    report = folder / "report.jsonl"
    run = record(start, small.FOLDER / "nested.usda", out, "--imageWidth", str(width), OOCPT_REPORT=str(report))
    wait_for_samples(run, report)
    return run


@pytest.mark.parametrize(
    "number, name", [(signal.SIGINT, "out.exr"), (signal.SIGTERM, "out.png")], ids=["SIGINT", "SIGTERM"]
)
def test_an_interrupt_writes_the_picture_so_far(start, pictures, tmp_path, number, name):
    report, out = tmp_path / "report.jsonl", pictures / name
    run = record(start, small.FOLDER / "nested.usda", out, "--imageWidth", "64", OOCPT_REPORT=str(report))
    wait_for_samples(run, report)
    assert name not in names(pictures), "only a whole picture has the name"
    said = run.interrupt(number)
    assert len(said) == 2, said
    told = re.fullmatch(rf"OocPT: interrupted after (\d+) of {MANY} samples; {re.escape(str(out))} is written", said[1])
    assert told and 1 <= int(told[1]) < int(MANY), said
    assert said[0].startswith(f"OocPT: {told[1]} samples, "), "what every render ends with"
    assert names(pictures) == [name]
    if name.endswith(".exr"):
        picture = exr.read(out)
        assert np.isfinite(picture).all() and (picture[..., 3] > 0.5).any(), "what was rendered is on it"
    else:
        from PIL import Image

        assert np.asarray(Image.open(out).convert("RGB")).max() > 0


def test_an_interrupt_before_the_first_sample_writes_nothing(start, pictures):
    run = record(start, small.FOLDER / "nested.usda", pictures / "out.exr", "--imageWidth", "12000")
    run.wait_for(lambda: "Recording time code" in run.said()[0] and names(pictures), "recording")
    assert run.interrupt(signal.SIGINT) == ["OocPT: interrupted before the first sample was done; nothing is written"]
    assert names(pictures) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_opening_a_stage_can_be_interrupted(start, pictures, tmp_path, number):
    """A layer that never comes: the host waits in the midst of C++."""
    scene, begin = tmp_path / "scene.usda", time.monotonic()
    os.mkfifo(scene)
    run = record(start, scene, pictures / "out.exr")

    def is_waiting():
        """As the kernel says; where it does not, after a while."""
        where = pathlib.Path(f"/proc/{run.process.pid}/wchan").read_text()
        return "partner" in where or (where in ("", "0") and time.monotonic() > begin + 10)

    run.wait_for(is_waiting, "opening the layer")
    assert run.interrupt(number) == ["OocPT: interrupted before a picture was begun; nothing is written"]
    assert names(pictures) == []


def test_a_second_signal_exits_at_once(start, pictures, tmp_path):
    run = with_samples(start, pictures / "out.exr", tmp_path, 1024)
    # It stands still between the two, so that the picture is not written meanwhile.
    run.process.send_signal(signal.SIGINT)
    time.sleep(0.02)
    run.process.send_signal(signal.SIGSTOP)
    time.sleep(1.1)
    said = run.interrupt(signal.SIGTERM, signal.SIGCONT)
    assert said == ["OocPT: interrupted a second time; nothing is written"]
    assert names(pictures) == []


def test_signals_that_come_together_are_one(start, pictures, tmp_path):
    """As of a scheduler that signals a process and its parent, which hands the signal on."""
    run = with_samples(start, pictures / "out.exr", tmp_path, 256)
    run.process.send_signal(signal.SIGSTOP)
    said = run.interrupt(signal.SIGINT, signal.SIGTERM, signal.SIGCONT)
    assert any("out.exr is written" in line for line in said) and names(pictures) == ["out.exr"], said


def test_an_interrupt_skips_the_remaining_frames(start, pictures, tmp_path):
    report = tmp_path / "report.jsonl"
    run = record(
        start, small.FOLDER / "nested.usda", pictures / "out.##.exr", "--imageWidth", "64", "--frames", "1:3",
        OOCPT_REPORT=str(report),
    )  # fmt: skip
    wait_for_samples(run, report)
    run.interrupt(signal.SIGINT)
    assert names(pictures) == ["out.01.exr"]
    assert run.said()[0].count("Recording time code") == 1


def test_a_bench_can_be_interrupted(start, tmp_path):
    run = start(os.environ["OOCPT_CLI"], "bench", "--samples", "100000", OOCPT_LOG="oocpt_render=debug")
    run.wait_for(lambda: "stage" in run.said()[1], "a render")
    assert run.interrupt(signal.SIGINT)[-1] == "oocpt: interrupted"


def sleeper(path):
    """A program in place of a host that does nothing, deaf to SIGTERM; its process id will be in the file beside it."""
    path.write_text(f"#!/bin/sh\ntrap '' TERM\necho $$ > {path}.new; mv {path}.new {path}.pid\nexec sleep 600\n")
    path.chmod(0o755)
    return path


@pytest.mark.parametrize("command", ["doctor", "texture"])
def test_child_processes_are_ended_too(start, tmp_path, command):
    host, scratch, scene = sleeper(tmp_path / "host"), tmp_path / "scratch", small.FOLDER / "nested.usda"
    scratch.mkdir()
    words = {
        "doctor": ["doctor", "--scene", scene, "--usdrecord", host],
        "texture": ["texture", "convert", "--host", host, scene],
    }[command]
    run = start(os.environ["OOCPT_CLI"], *words, TMPDIR=str(scratch))
    file = pathlib.Path(f"{host}.pid")
    run.wait_for(file.exists, "the host")
    assert bool(names(scratch)) == (command == "doctor"), "the doctor has a folder of its own"
    said = run.interrupt(signal.SIGTERM)
    assert said == ["oocpt: interrupted"]
    # It was killed before the command ended, and is gone when the kernel has found the time.
    assert ends_soon(int(file.read_text())) and names(scratch) == []


def test_an_interrupted_conversion_leaves_only_whole_entries(start, tmp_path):
    from PIL import Image

    picture, cache = tmp_path / "noise.png", tmp_path / "cache"
    texels = np.random.default_rng(1).integers(0, 256, (6000, 6000, 3), dtype=np.uint8)
    Image.fromarray(texels).save(picture, compress_level=0)
    run = start(os.environ["OOCPT_CLI"], "texture", "convert", "--quiet", picture, OOCPT_TEXTURE_CACHE=str(cache))
    run.wait_for(lambda: cache.exists() and any(name.endswith(".part") for name in names(cache)), "an entry")
    assert run.interrupt(signal.SIGINT) == ["oocpt: interrupted"]
    assert [name for name in names(cache) if not name.endswith(".tx")] == []
