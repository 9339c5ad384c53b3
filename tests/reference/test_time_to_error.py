# SPDX-License-Identifier: Apache-2.0
"""The arithmetic of time to error. (Nothing that needs Mitsuba is tested: it is a tool, and may be absent.)"""

import pathlib
import sys

import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import time_to_error


def rows_of(cost, variance, counts=(1, 2, 4, 8, 16)):
    return [{"samples": n, "seconds": cost * n, "cpu": 3 * cost * n, "relMSE": variance / n} for n in counts]


def test_the_time_is_read_off_between_two_rows():
    rows = rows_of(0.5, 0.08)
    assert time_to_error.time_to(rows, 0.0062) == pytest.approx(
        0.5 * 0.08 / 0.0062
    ), "error falls as one over time: exact in log-log"
    assert time_to_error.time_to(rows, 0.0062, "cpu") == pytest.approx(1.5 * 0.08 / 0.0062), "of processor time as well"
    assert time_to_error.time_to(rows[:1], 0.1) == 0.5, "met at once"
    assert time_to_error.time_to(rows, 1e-3) is None, "not met"


def test_variances_are_compared_at_the_most_samples_that_both_have():
    assert time_to_error.variance_ratio(rows_of(1, 0.1, (1, 2, 4)), rows_of(2, 0.3, (1, 2, 4, 8))) == pytest.approx(3)


def test_a_reference_has_the_samples_that_its_time_allows():
    assert time_to_error.reference_count(4096, 100, 0.1) == 4096, "16 samples in 0.1 s: all of them take 26 s"
    assert time_to_error.reference_count(4096, 20, 0.1) == 2048, "13 s"
    assert time_to_error.reference_count(4096, 0.0, 0.1) == time_to_error.PROBE, "never less than were made to find out"


def test_processor_time_of_another_process_is_its_own():
    before, mine = time_to_error.cpu_seconds(1), time_to_error.cpu_seconds()
    sum(range(3_000_000))
    assert time_to_error.cpu_seconds() > mine, "this process has worked"
    assert time_to_error.cpu_seconds(1) >= before, "the other one's field is read, whatever its name holds"


def test_relative_mse_is_the_mean_of_squares_over_squares():
    reference = np.array([[[1.0, 0.0, 3.0]]])
    assert time_to_error.relative_mse(reference + 0.1, reference) == pytest.approx(
        (0.01 / 1.01 + 1.0 + 0.01 / 9.01) / 3
    )


def test_a_scene_without_its_textures_does_not_count(capsys):
    prefix = "Warning: in DrainMessages at line 347 of session.cpp -- OocPT: "
    time_to_error.expect_whole("USD says this and that\n")
    time_to_error.expect_whole(prefix + "/World/Ball: cut more coarsely than asked for")
    assert "/World/Ball: cut more coarsely" in capsys.readouterr().out, "what is said is shown"
    lost = (
        "/World/Dome: the texture ./sky.exr is left out, the dome has its constant colour",
        "/World/Looks/Boards: texture ./boards.png: cannot be read, since the library does not load",
        "/World/Looks/Boards: texture ./boards.png: its fallback is used",
    )
    for line in lost:
        with pytest.raises(SystemExit, match="missing"):
            time_to_error.expect_whole("something\n" + prefix + line + "\nsomething")
