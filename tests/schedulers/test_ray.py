# SPDX-License-Identifier: Apache-2.0
"""Ray's driver: which blocks it hands out and merges, when it stops, and, where `ray` is installed (`OOCPT_RAY_PYTHON`
names its Python), a frame on a cluster of this machine."""

import os
import pathlib
import subprocess
import sys

import pytest

import compare
import exr
import small

FARM = pathlib.Path(__file__).resolve().parents[2] / "plugin/schedulers"
sys.path.insert(0, str(FARM))
import oocpt_farm  # noqa: E402  beside the driver
import oocpt_ray  # noqa: E402

PYTHON = os.environ.get("OOCPT_RAY_PYTHON", sys.executable)
FRAME = oocpt_ray.RayFrame(scene="s.usda", folder="parts", frame=7, samples=100, out="o.exr", blocks=8)


def played(plan, most, order, is_enough=lambda plan: False):
    """The driver's loop with workers that give back, of the blocks under way, the one that `order` chooses; the blocks
    of each merge, and the blocks that were under way at the end."""
    under_way, merges = [], []
    while True:
        if taken := plan.take():
            merges.append(taken)
        if plan.is_whole():
            if plan.open == plan.blocks or is_enough(plan):
                return merges, under_way
            plan.widen()
            continue
        while len(under_way) < most and (block := plan.next()) is not None:
            under_way.append(block)
        plan.came(under_way.pop(order(under_way)))


def first(_under_way):
    return 0


def last(_under_way):
    return -1


@pytest.mark.parametrize("order", [first, last])
def test_every_block_is_merged_once(order):
    for blocks, most in ((1, 1), (5, 2), (8, 3), (8, 100)):
        for has_target in (False, True):
            merges, under_way = played(oocpt_ray.BlockPlan(blocks, has_target), most, order)
            assert sorted(sum(merges, [])) == list(range(1, blocks + 1)) and not under_way, merges


def test_an_error_is_asked_for_where_samples_double_and_ends_the_frame_there():
    """Whatever number of workers there is, and whichever block comes first."""
    for most, order in ((1, first), (3, first), (3, last), (100, last)):
        asked = []
        is_enough = lambda plan: asked.append(sorted(plan.merged)) or len(plan.merged) == 4  # noqa: E731
        merges, under_way = played(oocpt_ray.BlockPlan(16, True), most, order, is_enough)
        assert asked == [[1], [1, 2], [1, 2, 3, 4]], "no block beyond them was merged before the decision"
        assert sorted(sum(merges, [])) == [1, 2, 3, 4]
        assert len(under_way) < most, "what is given up"


def test_a_frame_goes_on_from_what_is_merged():
    merges, _ = played(oocpt_ray.BlockPlan(8, False, {2, 3}), 2, first)
    assert sorted(sum(merges, [])) == [1, 4, 5, 6, 7, 8]
    asked = []
    plan = oocpt_ray.BlockPlan(8, True, {1, 2, 3})
    played(plan, 1, first, lambda plan: asked.append(len(plan.merged)))
    assert asked == [4], "block 3 was merged, so two were not enough"


def test_the_error_is_small_enough_as_in_a_render():
    def row(samples, high):
        return {"samples": samples, "estimate": high and {"relMse": high / 2, "low": high / 3, "high": high}}

    assert oocpt_ray.is_enough([row(16, 1e-3), row(32, 1e-4)], 1e-4), "the upper end, not above the target"
    assert not oocpt_ray.is_enough([row(32, 1.1e-4)], 1e-4)
    assert not oocpt_ray.is_enough([row(8, 1e-6)], 1e-4), "of so few samples it says little"
    assert not oocpt_ray.is_enough([row(48, 1e-6)], 1e-4), "no power of two"
    assert not oocpt_ray.is_enough([row(64, None)], 1e-4) and not oocpt_ray.is_enough([], 1e-4)


def test_blocks_are_tasks_of_the_farm():
    arguments = oocpt_farm.parser().parse_args(FRAME.words(3))
    assert (arguments.frame, arguments.samples, arguments.blocks, arguments.block) == (7, 100, 8, (3, 3))
    assert FRAME.span(3) == (25, 37) and FRAME.part(3).name == "samples.00000025-00000037.film"
    assert pathlib.Path(arguments.scene).is_absolute() and pathlib.Path(arguments.folder).is_absolute()
    given = oocpt_ray.parser().parse_args(
        ["--scene=s", "--folder=f", "--frame=1", "--samples=4", "--out=o", "--target-error=1e-3", "--", "--progress"]
    )
    assert (given.target_error, given.flags) == (1e-3, ["--progress"])


def test_a_film_of_other_blocks_is_refused(tmp_path, monkeypatch):
    frame = oocpt_ray.RayFrame(scene="s", folder=str(tmp_path), frame=1, samples=64, out="o", blocks=4)
    film = oocpt_ray.FrameFilm(frame)
    assert film.blocks() == set(), "there is none"
    for samples, blocks in (([(0, 16)], {1}), ([(0, 16), (32, 64)], {1, 3, 4}), ([(0, 20)], None), ([(8, 16)], None)):
        rows = [{"begin": begin, "end": end} for begin, end in samples]
        monkeypatch.setattr(film, "facts", lambda rows=rows: {"samples": rows})
        if blocks is not None:
            assert film.blocks() == blocks
        else:
            with pytest.raises(oocpt_ray.FrameError, match="are no blocks of this frame"):
                film.blocks()


def test_one_program_merges_a_frame(tmp_path):
    frame = ["--scene=s", f"--folder={tmp_path}", "--frame=1", "--samples=4", "--out=o"]
    code = "import sys; sys.path.insert(0, sys.argv.pop(1)); import oocpt_ray; oocpt_ray.FrameFilm(oocpt_ray.RayFrame("
    code += "scene='s', folder=sys.argv[1], frame=1, samples=4, out='o'))"
    held = oocpt_ray.FrameFilm(oocpt_ray.RayFrame(scene="s", folder=str(tmp_path), frame=1, samples=4, out="o"))
    other = [sys.executable, "-c", code, str(FARM), str(tmp_path)]
    done = subprocess.run(other, capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "another program merges this frame" in done.stderr, (frame, done.stderr)
    held.lock.close()
    assert subprocess.run(other, capture_output=True, check=False).returncode == 0


def has_ray():
    return subprocess.run([PYTHON, "-c", "import ray"], capture_output=True, check=False).returncode == 0


def test_a_frame_of_a_cluster_has_the_bits_of_one_process(tmp_path):
    """A target error ends it before its samples do."""
    if not has_ray():
        pytest.skip("ray is not installed: OOCPT_RAY_PYTHON names a Python that has it")
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "oocpt").symlink_to(os.environ["OOCPT_CLI"])
    variables = dict(os.environ, PATH=f"{folder}{os.pathsep}{os.environ['PATH']}", RAY_AUTH_MODE="disabled")
    variables |= {"OOCPT_MAX_BOUNCES": "2", "RAY_ENABLE_UV_RUN_RUNTIME_ENV": "0"}
    variables.pop("PYTHONPATH", None)
    view = ["--scene", small.FOLDER / "nested.usda", "--camera", "/World/Camera", "--width", "48", "--frame", "1"]

    def run(python, program, *words):
        line = [python, FARM / program, *words, "--", "--disableCameraLight"]
        done = subprocess.run(
            list(map(str, line)), env=variables, cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True,
            timeout=300, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout

    cluster = [*view, "--folder", "parts", "--samples", "512", "--blocks", "16", "--target-error", "5e-4"]
    said = run(PYTHON, "oocpt_ray.py", *cluster, "--out", "picture.%04d.exr")
    samples = int(said.splitlines()[-1].split(": ")[1].split()[0])
    assert samples in (32, 64, 128, 256), said
    run(sys.executable, "oocpt_farm.py", "part", *view, "--folder", "whole", "--samples", samples, "--block", "1")
    film = tmp_path / f"whole/frame.0001/samples.00000000-{samples:08d}.film"
    line = [folder / "oocpt", "film", "picture", film, "--out", tmp_path / "alone.exr"]
    subprocess.run(line, check=True, capture_output=True)
    compare.same_bits(exr.read(tmp_path / "picture.0001.exr"), exr.read(tmp_path / "alone.exr"), said)
