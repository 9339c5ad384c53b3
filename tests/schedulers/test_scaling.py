# SPDX-License-Identifier: Apache-2.0
"""The simulation of farms against closed forms."""

import dataclasses
import math
import pathlib
import subprocess
import sys

import pytest

FARM = pathlib.Path(__file__).resolve().parents[2] / "plugin/schedulers"
sys.path.insert(0, str(FARM))
import oocpt_scaling  # noqa: E402

COSTS = oocpt_scaling.FarmCosts(start=5.0, sample=0.25, part=1.0, picture=2.0, merge=0.125)


@pytest.mark.parametrize(("blocks", "workers"), [(1, 1), (16, 1), (16, 4), (16, 5), (16, 16), (16, 10_000), (512, 100)])
def test_equal_blocks_are_done_in_rounds(blocks, workers):
    run = oocpt_scaling.simulate(COSTS, 1024, blocks, workers)
    block = 5.0 + 0.25 * 1024 / blocks + 1.0
    if 1024 % blocks == 0:
        assert run.seconds == pytest.approx(math.ceil(blocks / workers) * block + 2.0 + 0.125 * blocks)
    assert run.work == pytest.approx(blocks * 6.0 + 0.25 * 1024) and run.deaths == 0


def test_uneven_blocks_have_each_sample_once():
    assert oocpt_scaling.simulate(COSTS, 1000, 7, 3).work == pytest.approx(7 * 6.0 + 250.0)
    assert oocpt_scaling.simulate(COSTS, 3, 8, 8).work == pytest.approx(8 * 6.0 + 0.75), "blocks without samples"


def test_parts_that_are_merged_as_they_come_cost_the_end_one_merge_or_all():
    """As long as a merge takes less than a block, and where the merges are what takes the time."""
    costs = dataclasses.replace(COSTS, as_they_come=True)
    assert oocpt_scaling.simulate(costs, 1024, 16, 1).seconds == pytest.approx(16 * 22.0 + 0.125 + 2.0)
    slow = dataclasses.replace(costs, merge=10.0)
    assert oocpt_scaling.simulate(slow, 1024, 16, 16).seconds == pytest.approx(22.0 + 16 * 10.0 + 2.0)


def test_the_first_task_of_a_worker_fills_its_caches():
    cold = dataclasses.replace(COSTS, cold=20.0)
    run = oocpt_scaling.simulate(cold, 1024, 16, 4)
    assert run.work == pytest.approx(16 * 6.0 + 256.0 + 4 * 20.0)
    assert run.seconds == pytest.approx(20.0 + 4 * (5.0 + 16.0 + 1.0) + 2.0 + 16 * 0.125)


def test_deaths_cost_what_the_exponential_law_says():
    """The expected time of work T that begins anew at each death, of rate r, with a pause p: (exp(r T) - 1)(1 / r + p).
    Its
    standard deviation is below 1.2 times that here, so 4000 blocks give the mean to 2 %: three deviations are 6 %."""
    costs = oocpt_scaling.FarmCosts(start=300.0, sample=1.0, deaths=6.0, back=60.0)
    rate, time = 6.0 / 3600.0, 301.0
    run = oocpt_scaling.simulate(costs, 4000, 4000, 1, seed=3)
    expected = 4000 * (math.exp(rate * time) - 1.0) * (1.0 / rate + 60.0)
    assert run.seconds == pytest.approx(expected, rel=0.06)
    assert run.deaths == pytest.approx(4000 * (math.exp(rate * time) - 1.0), rel=0.1)
    assert run.work == pytest.approx(run.seconds - 60.0 * run.deaths), "nobody works in the pauses"


def test_slow_workers_hold_up_the_end_and_do_less():
    """Of a quarter of the workers, each four times as slow: blocks go to who is free."""
    slow = dataclasses.replace(COSTS, slow=0.25, slowest=4.0)
    runs = [oocpt_scaling.simulate(slow, 65_536, 1024, 64, seed) for seed in range(10)]
    even = oocpt_scaling.simulate(COSTS, 65_536, 1024, 64).seconds
    # 48 fast workers and 16 of a quarter are as fast as 52: 64/52 of the time, and one slow block more at most.
    for run in runs:
        assert even < run.seconds < 3.0 * even, "far from four times"
    assert sum(run.seconds for run in runs) / 10 == pytest.approx(even * 64 / 52, rel=0.15)


def test_no_frame_is_shorter_than_its_work_or_its_longest_block():
    hard = dataclasses.replace(COSTS, cold=30.0, deaths=0.5, spread=0.2, slow=0.02)
    for workers in (1, 3, 64, 1000):
        for blocks in (1, 64, 256):
            run = oocpt_scaling.simulate(hard, 4096, blocks, workers, seed=workers + blocks)
            assert run.seconds >= run.work / workers
            assert run == oocpt_scaling.simulate(hard, 4096, blocks, workers, seed=workers + blocks), "the same seed"
    assert oocpt_scaling.simulate(hard, 4096, 64, 9, 1) != oocpt_scaling.simulate(hard, 4096, 64, 9, 2), "another"


def test_the_best_number_of_blocks_is_one_each_where_starts_are_all_there_is_to_save():
    blocks, seconds, _ = oocpt_scaling.best(dataclasses.replace(COSTS, merge=0.0), 1024, 64, 1)
    assert (blocks, seconds) == (64, 5.0 + 4.0 + 1.0 + 2.0)
    assert oocpt_scaling.efficiency(COSTS, 1024, 64, seconds) == pytest.approx(256.0 / (64 * 12.0))


def test_ten_thousand_workers_are_a_table():
    line = [sys.executable, FARM / "oocpt_scaling.py", "--start=5", "--sample=0.5", "--samples=65536"]
    done = subprocess.run(
        [*line, "--workers=1,10000", "--blocks=10000", "--seeds=1"], capture_output=True, text=True, check=True
    )
    one, many = (row.split() for row in done.stdout.splitlines()[1:])
    assert one[:4] == ["1", "10000", "82768.0", "0.40"] and many[:4] == ["10000", "10000", "8.5", "0.39"], done.stdout
