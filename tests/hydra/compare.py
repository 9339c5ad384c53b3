# SPDX-License-Identifier: Apache-2.0
"""The comparisons that tests rest on. Each raises AssertionError with numbers; test_comparisons.py plants a fault in
front of each."""

from __future__ import annotations

import math

import numpy as np

MAX_UNCLEAR = 0.12


def same_bits(a: np.ndarray, b: np.ndarray, what: str) -> None:
    """Equal shape, type and bits; NaN is never right."""
    assert a.shape == b.shape and a.dtype == b.dtype, f"{what}: {a.shape} {a.dtype} against {b.shape} {b.dtype}"
    assert np.isfinite(a).all(), f"{what}: not finite"
    different = a.view(np.uint8).reshape(*a.shape, -1) != b.view(np.uint8).reshape(*b.shape, -1)
    count = int(different.any(axis=-1).sum())
    if count:
        worst = float(np.abs(a.astype(np.float64) - b.astype(np.float64)).max())
        raise AssertionError(f"{what}: {count} of {a.size} values differ, by up to {worst:g}")


def same_picture(a, b, what: str) -> None:
    """All AOVs of two pictures, bit for bit."""
    assert set(a.arrays) == set(b.arrays), f"{what}: {sorted(a.arrays)} against {sorted(b.arrays)}"
    for name in a.arrays:
        same_bits(a[name], b[name], f"{what}, {name}")


def near(values: np.ndarray, expected, tolerance: float, what: str) -> None:
    """Every value within an absolute tolerance of what is expected."""
    values = np.asarray(values, dtype=np.float64)
    assert values.size, f"{what}: nothing to compare"
    error = np.abs(values - np.asarray(expected, dtype=np.float64))
    # Written so that a NaN is wrong.
    assert (
        error <= tolerance
    ).all(), f"{what}: off by up to {np.nanmax(error):g} (allowed {tolerance:g}), mean {np.nanmean(values):g}"


def clear_pixels(unclear: np.ndarray, what: str) -> np.ndarray:
    """The pixels that can be judged; most must be."""
    share = unclear.mean()
    assert share <= MAX_UNCLEAR, f"{what}: {100 * share:.1f} % of the pixels are unclear; the scene tests nothing"
    return ~unclear


def means_agree(a: np.ndarray, a_deviation: np.ndarray, b: np.ndarray, b_deviation: np.ndarray, what: str) -> None:
    """Two noisy pictures with known standard deviations of their pixels: z-test per pixel (Sidak-corrected, 99.75 %
    must pass) and of the mean.

    As Mitsuba 3's test_renders.py; the test of the picture's mean finds a small bias that no single pixel shows.
    """
    assert a.shape == b.shape, f"{what}: {a.shape} against {b.shape}"
    assert np.isfinite(a).all() and np.isfinite(b).all(), f"{what}: not finite"
    difference = a.astype(np.float64) - b.astype(np.float64)
    variance = np.square(a_deviation, dtype=np.float64) + np.square(b_deviation, dtype=np.float64)
    floor = np.square(1e-5 * np.abs(b)) + 1e-12
    z = np.abs(difference) / np.sqrt(variance + floor)
    p = np.vectorize(math.erfc)(z / math.sqrt(2.0))
    alpha = 1.0 - (1.0 - 0.01) ** (1.0 / z.size)
    passed = (p > alpha).mean()
    mean_z = abs(difference.sum()) / math.sqrt((variance + floor).sum())
    assert (
        passed >= 0.9975 and mean_z <= 3.3
    ), f"{what}: {100 * passed:.2f} % of the pixels pass, z of the mean {mean_z:.2f}"


def batches(pictures: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of the mean of pictures made with different seeds."""
    stack = np.stack([picture.astype(np.float64) for picture in pictures])
    return stack.mean(axis=0), stack.std(axis=0, ddof=1) / math.sqrt(len(pictures))
