# SPDX-License-Identifier: Apache-2.0
"""The arithmetic of time to error. (Nothing that needs Mitsuba is tested: it is a tool, and may be absent.)"""

import pathlib
import sys

import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import time_to_error


def test_the_time_is_read_off_between_two_rows():
    rows = [(n, 0.5 * n, 0.08 / n) for n in (1, 2, 4, 8, 16)]
    assert time_to_error.time_to(rows, 0.0062) == pytest.approx(0.5 * 0.08 / 0.0062), "error falls as one over time: exact in log-log"
    assert time_to_error.time_to(rows[:1], 0.1) == 0.5, "met at once"
    assert time_to_error.time_to(rows, 1e-3) is None, "not met"


def test_relative_mse_is_the_mean_of_squares_over_squares():
    reference = np.array([[[1.0, 0.0, 3.0]]])
    assert time_to_error.relative_mse(reference + 0.1, reference) == pytest.approx((0.01 / 1.01 + 1.0 + 0.01 / 9.01) / 3)
