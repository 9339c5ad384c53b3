# SPDX-License-Identifier: Apache-2.0
"""Farms: what the job template and the array script start, killed and started again, gives the bits of one process."""

import json
import os
import pathlib
import re
import shutil
import signal
import stat
import subprocess
import sys
import time

import pytest

import compare
import exr
import small

FARM = pathlib.Path(__file__).resolve().parents[2] / "plugin/schedulers"
sys.path.insert(0, str(FARM))
import oocpt_farm  # noqa: E402  beside the template

SCENE = small.FOLDER / "nested.usda"
SAMPLES, BLOCKS = 1024, 3
WHERE = ("--frame", 1, "--samples", SAMPLES, "--blocks", BLOCKS)
VIEW = ("--camera", "/World/Camera", "--width", 48)


@pytest.fixture
def variables(tmp_path):
    """The environment of a worker, with commands of a scheduler that write down what they are asked."""
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "oocpt").symlink_to(os.environ["OOCPT_CLI"])
    for name, answer in (("sbatch", "7"), ("scontrol", "")):
        script = folder / name
        script.write_text(f'#!/bin/sh\necho "{name} $*" >> "{tmp_path}/asked"\necho {answer}\n', encoding="utf-8")
        script.chmod(script.stat().st_mode | stat.S_IXUSR)
    path = f"{folder}{os.pathsep}{os.environ['PATH']}"
    variables = dict(os.environ, PATH=path, OOCPT_MAX_BOUNCES="2", OOCPT_CHECKPOINT_INTERVAL="0")
    variables.pop("PYTHONPATH", None)
    return variables


def start(line, variables):
    return subprocess.Popen(
        list(map(str, line)), env=variables, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip


def part(folder, block, variables, *flags):
    program = [sys.executable, FARM / "oocpt_farm.py", "part", "--scene", SCENE, "--folder", folder, *WHERE, *VIEW]
    return start([*program, "--block", block, *flags, "--", "--disableCameraLight"], variables)


def ends(process, status=0):
    said = process.communicate(timeout=300)[0]
    assert process.returncode == status, said
    return said


def has_begun(folder, process):
    end = time.monotonic() + 120
    while not list(folder.glob("frame.0001/*.film")):
        assert process.poll() is None and time.monotonic() < end, process.communicate()[0]
        time.sleep(0.01)


def test_blocks_have_each_sample_once():
    for samples, blocks in ((1024, 16), (10, 3), (3, 10), (1, 1)):
        spans = [oocpt_farm.span((block, block), samples, blocks) for block in range(1, blocks + 1)]
        assert spans[0][0] == 0 and spans[-1][1] == samples, spans
        assert all(one[1] == other[0] for one, other in zip(spans, spans[1:])), spans
    assert oocpt_farm.span((2, 3), 1024, 16) == (64, 192), "a run of blocks is one part"
    assert [oocpt_farm.blocks(text) for text in ("3", "3-5", "3,4,5")] == [(3, 3), (3, 5), (3, 5)]
    for wrong in ("", "3-", "5-3", "1,3", "x", "-1", "1-9999999999"):
        with pytest.raises(oocpt_farm.argparse.ArgumentTypeError):
            oocpt_farm.blocks(wrong)
    for wrong in ((0, 1), (4, 9)):
        with pytest.raises(SystemExit):
            oocpt_farm.span(wrong, 64, 8)


def test_a_picture_takes_each_sample_from_one_part():
    """Whatever runs of blocks tasks had."""
    chain = oocpt_farm.chain
    assert chain({"a": (0, 4), "b": (4, 8), "c": (2, 6), "d": (6, 8)}, 8) == (["a", "b"], 8), "c and d overlap these"
    assert chain({"a": (0, 2), "b": (2, 4), "all": (0, 4)}, 4) == (["all"], 4), "the fewest"
    late = {"a": (0, 1), "b": (1, 2), "c": (2, 4), "d": (0, 3), "e": (3, 4)}
    assert chain(late, 4) == (["d", "e"], 4), "the fewest, though they come later"
    assert chain({"a": (0, 2), "b": (1, 4)}, 4) == (["a"], 2), "sample 1 twice"
    assert chain({"a": (0, 2), "b": (3, 4)}, 4) == (["a"], 2), "sample 2 is missing"
    assert chain({"a": (0, 8)}, 4) == ([], 0), "more than the frame has"
    assert chain({}, 4) == ([], 0)
    film = {"samples": [{"begin": 4, "end": 8}, {"begin": 0, "end": 4}, {"begin": 9, "end": 10}]}
    assert oocpt_farm.samples_of(film) == [(0, 8), (9, 10)]


def test_the_template_starts_what_the_program_takes():
    """Each step's words, with numbers where parameters are."""
    text = (FARM / "render.template.yaml").read_text(encoding="utf-8")
    steps = re.findall(r"- (part|picture)\n((?: +- \"--.*\"\n)+)", text)
    assert [name for name, _ in steps] == ["part", "picture"]
    for name, words in steps:
        line = [re.sub(r"{{[^}]*}}", "1", word) for word in re.findall(r"- \"(.*)\"", words)]
        arguments = oocpt_farm.parser().parse_args([name, *line])
        assert (arguments.frame, arguments.samples, arguments.blocks) == (1, 1, 1), arguments


def test_killed_tasks_give_the_bits_of_one_process(tmp_path, variables):
    """One is told to end, one is killed without a word, one runs; the last takes what the others left."""
    folder = tmp_path / "parts"
    told = part(folder, 1, variables)
    has_begun(folder, told)
    told.send_signal(signal.SIGTERM)
    said = ends(told, oocpt_farm.TRY_AGAIN)
    assert "are not all there" in said, said
    killed = part(folder, "2-3", variables)
    while len(list(folder.glob("frame.0001/*.film"))) < 2:
        assert killed.poll() is None, killed.communicate()[0]
        time.sleep(0.01)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate()
    out = tmp_path / "picture.%04d.exr"
    words = [sys.executable, FARM / "oocpt_farm.py", "picture", "--folder", folder, *WHERE, "--out", out]
    assert "no part has" in ends(start(words, variables), 1), "not yet"
    for block in (1, "2-3"):
        said = ends(part(folder, block, variables))
        assert "openjd_progress: 100" in said, said
    assert "is there" in ends(part(folder, 1, variables)), "a whole part is not rendered again"
    ends(start(words, variables))
    whole = [sys.executable, FARM / "oocpt_farm.py", "part", "--scene", SCENE, "--folder", tmp_path / "whole", *VIEW]
    whole += ["--frame", 1, "--samples", SAMPLES, "--block", 1, "--", "--disableCameraLight"]
    ends(start(whole, variables))
    alone = [*words[:4], tmp_path / "whole", *WHERE, "--out", tmp_path / "alone.exr"]
    ends(start(alone, variables))
    compare.same_bits(exr.read(tmp_path / "picture.0001.exr"), exr.read(tmp_path / "alone.exr"), "parts")
    # A part of another run of blocks, of the same samples as two that are there.
    [other] = (tmp_path / "whole/frame.0001").glob("*.film")
    shutil.copy(other, folder / "frame.0001" / other.name)
    (folder / "frame.0001/samples.00000000-00000341.film").unlink()
    ends(start(words, variables))
    compare.same_bits(exr.read(tmp_path / "picture.0001.exr"), exr.read(tmp_path / "alone.exr"), "one part of all")


def test_a_renderer_ends_with_its_task(tmp_path, variables):
    """A task that is killed without a word leaves none that takes the device from the next one."""
    task = part(tmp_path / "parts", "1-3", variables)
    has_begun(tmp_path / "parts", task)
    children = pathlib.Path(f"/proc/{task.pid}/task/{task.pid}/children").read_text(encoding="ascii").split()
    assert children, "the renderer"
    task.kill()
    # Its end closes the pipe of this test, which it has too.
    task.communicate(timeout=60)
    end = time.monotonic() + 60
    while any(alive(child) for child in children):
        assert time.monotonic() < end, "it still renders"
        time.sleep(0.01)
    [film] = (tmp_path / "parts/frame.0001").glob("*.film")
    line = [os.environ["OOCPT_CLI"], "film", "info", str(film), "--json"]
    facts = json.loads(subprocess.run(line, capture_output=True, text=True, check=True).stdout)
    assert oocpt_farm.samples_of(facts)[-1][1] < SAMPLES, "it rendered to its end"


def alive(process):
    try:
        return pathlib.Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_the_array_of_slurm_requeues_what_is_preempted(tmp_path, variables):
    """With commands that only write down what they are asked."""
    folder = tmp_path / "parts"
    variables |= {"SCENE": str(SCENE), "FOLDER": str(folder), "FRAME": "1", "SAMPLES": str(SAMPLES), "BLOCKS": "1"}
    variables |= {"CAMERA": "/World/Camera", "WIDTH": "48", "FLAGS": "--disableCameraLight", "SBATCH": "--gres=gpu:1"}
    script = FARM / "slurm_array.sh"
    asked = tmp_path / "asked"
    ends(start(["sh", script], variables))
    first, second = asked.read_text(encoding="utf-8").splitlines()
    assert first == f"sbatch --parsable --gres=gpu:1 --array=1-1 {script}", first
    assert second == f"sbatch --parsable --gres=gpu:1 --dependency=afterok:7 {script}", second
    task = variables | {"SLURM_JOB_ID": "9", "SLURM_ARRAY_JOB_ID": "7", "SLURM_ARRAY_TASK_ID": "1"}
    preempted = start(["sh", script], task)
    has_begun(folder, preempted)
    preempted.send_signal(signal.SIGTERM)
    ends(preempted, oocpt_farm.TRY_AGAIN)
    assert asked.read_text(encoding="utf-8").splitlines()[2:] == ["scontrol requeue 7_1"]
    ends(start(["sh", script], task))
    ends(start(["sh", script], variables | {"SLURM_JOB_ID": "10"}))
    assert exr.read(folder / "frame.0001.exr").shape[1] == 48, "the picture"
    assert len(asked.read_text(encoding="utf-8").splitlines()) == 3, "nothing else was asked"


def test_the_array_of_slurm_tries_again_what_may_succeed(tmp_path, variables):
    """With a program in the place of the task's that ends as it is told."""
    program = tmp_path / "task.py"
    program.write_text("import os, sys\nsys.exit(int(os.environ['STATUS']))\n", encoding="utf-8")
    variables |= {"SCENE": "s", "FOLDER": str(tmp_path), "FRAME": "1", "SAMPLES": "1", "BLOCKS": "1"}
    variables |= {"SLURM_JOB_ID": "9", "SLURM_ARRAY_JOB_ID": "7", "SLURM_ARRAY_TASK_ID": "1"}
    variables["OOCPT_FARM"] = str(program)
    asked = tmp_path / "asked"
    for status, restarts, is_again in ((0, 0, False), (1, 0, False), (75, 3, True), (137, 0, True), (75, 100, False)):
        told = variables | {"STATUS": str(status), "SLURM_RESTART_COUNT": str(restarts)}
        ends(start(["sh", FARM / "slurm_array.sh"], told), status)
        assert asked.exists() == is_again, f"{status} after {restarts} restarts"
        asked.unlink(missing_ok=True)


def test_a_worker_without_oocpt_says_so(tmp_path, variables):
    words = [sys.executable, FARM / "oocpt_farm.py", "picture", "--folder", tmp_path, *WHERE, "--out", "o.exr"]
    (tmp_path / "frame.0001").mkdir()
    (tmp_path / "frame.0001/samples.00000000-00000001.film").touch()
    said = ends(start(words, variables | {"PATH": str(tmp_path)}), 1)
    assert said == "openjd_fail: oocpt is not in the path of this worker\n", said
