# SPDX-License-Identifier: Apache-2.0
"""Two thousand engines made, rendered and destroyed in one process do not grow it."""

import pathlib

import numpy as np
import pytest

import small

CYCLES, EVERY, WARM_UP = 2000, 50, 500
# A leak of one engine's smallest part would be kilobytes each time; this much may come from the host's own logs and caches.
ALLOWED_BYTES_PER_CYCLE = 512


def growth(resident: list[int]) -> float:
    """Bytes per cycle after the warm-up: the median slope between all pairs of measurements (Theil 1950, Sen 1968).

    A steady leak shows in every pair; a step, as allocators make now and then, in few.
    """
    settled = np.array(resident[WARM_UP // EVERY :], dtype=np.float64)
    first, last = np.triu_indices(len(settled), k=1)
    return float(np.median((settled[last] - settled[first]) / ((last - first) * EVERY)))


@pytest.mark.parametrize("scene_index", [False, True], ids=["legacy", "scene_index"])
def test_two_thousand_cycles_do_not_grow(fresh_host, scene_index):
    """Without the validation layer, which keeps some kilobytes of records of its own for every engine that was."""
    host = fresh_host(scene_index, OOCPT_VALIDATION="0")
    run = lambda: host.call("cycles", stage=str(small.FOLDER / "hidden_instances.usda"), count=CYCLES, every=EVERY, patience=600.0)
    resident = run()
    for _ in range(2):
        # Memory is taken from the system in steps of a megabyte, now and then two of them in one run; what leaks grows in every run.
        if growth(resident) > ALLOWED_BYTES_PER_CYCLE:
            resident = run()
    assert len(resident) == CYCLES // EVERY
    assert growth(resident) <= ALLOWED_BYTES_PER_CYCLE, f"{growth(resident):.0f} bytes per cycle: {resident}"


def test_the_validation_layer_watches(host):
    """The canary of all these tests is alive: the layer is in the rendering process."""
    with host.open(small.FOLDER / "hidden_instances.usda", (8, 8), settings={"oocpt:samplesPerPixel": 1}) as view:
        view.render()
        assert "validation" in pathlib.Path(f"/proc/{host.pid}/maps").read_text().lower(), "no validation layer in the process"


def test_growth_sees_a_leak():
    """A planted leak of 1 KiB per cycle under the steps of an allocator is above the limit; the steps alone are below."""
    rng = np.random.default_rng(1)
    cycles = np.arange(EVERY, CYCLES + 1, EVERY)
    steps = (300 << 20) + np.cumsum(rng.choice([0, 1 << 20], len(cycles), p=[0.93, 0.07])) + rng.integers(0, 64 << 10, len(cycles))
    assert growth(list(steps + 1024 * cycles)) > ALLOWED_BYTES_PER_CYCLE
    quiet = (300 << 20) + rng.integers(0, 64 << 10, len(cycles))
    quiet[len(quiet) // 2 :] += 2 << 20
    assert growth(list(quiet)) <= ALLOWED_BYTES_PER_CYCLE
