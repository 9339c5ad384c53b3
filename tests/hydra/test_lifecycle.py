# SPDX-License-Identifier: Apache-2.0
"""Hundreds of engines made, rendered and destroyed in one process do not grow it by one byte each.

The process runs on jemalloc, which gives a new object the lowest free address of its size. USD names paths after the
addresses of engines and keeps the names: with glibc's allocator, which hands out ever other addresses, its tables grow
by some hundred bytes an engine, and what leaks cannot be told from them.
"""

import os
import pathlib

import numpy as np
import pytest

import small

EVERY, WARM_UP = 20, 100
CYCLES = 2000 if "OOCPT_TEST_FULL" in os.environ else 500
PLANTED_CYCLES = 300
# Of the allocator. Nothing is allowed but rounding: a leak of the smallest object is 8 bytes.
ALLOWED_BYTES_PER_CYCLE = 1
PLANTED_BYTES_PER_CYCLE = 8
# Of the system: pages that do not come from the allocator, where one page per cycle would be a leak.
ALLOWED_RESIDENT_PER_CYCLE = 2048
# One arena, and no caches of threads, which count as used and make addresses differ.
ENVIRONMENT = {"OOCPT_VALIDATION": "0", "LD_PRELOAD": "libjemalloc.so.2", "MALLOC_CONF": "tcache:false,narenas:1"}


def growth(held: list[dict], what: str) -> float:
    """Growth per cycle after the warm-up: the median slope between all pairs of measurements (Theil 1950, Sen 1968),
    which a step changes little."""
    measured = np.array([entry[what] for entry in held[WARM_UP // EVERY :]], dtype=np.float64)
    first, last = np.triu_indices(len(measured), k=1)
    return float(np.median((measured[last] - measured[first]) / ((last - first) * EVERY)))


def measure(host, count: int, planted: int = 0) -> list[dict]:
    scene = str(small.FOLDER / "hidden_instances.usda")
    return host.call("cycles", stage=scene, count=count, every=EVERY, planted=planted, patience=900.0)


@pytest.mark.parametrize("scene_index", [False, True], ids=["legacy", "scene_index"])
def test_many_cycles_do_not_grow(fresh_host, scene_index):
    """Without the validation layer, which keeps some kilobytes of records of its own for every engine that was."""
    held = measure(fresh_host(scene_index, **ENVIRONMENT), CYCLES)
    assert len(held) == CYCLES // EVERY
    assert all(entry["allocated"] > 1 << 20 for entry in held), "jemalloc is not in the process"
    allocated, resident = growth(held, "allocated"), growth(held, "resident")
    assert (
        allocated <= ALLOWED_BYTES_PER_CYCLE
    ), f"{allocated:.0f} bytes per cycle: {[entry['allocated'] for entry in held]}"
    assert (
        resident <= ALLOWED_RESIDENT_PER_CYCLE
    ), f"{resident:.0f} bytes per cycle: {[entry['resident'] for entry in held]}"
    settled, last = held[WARM_UP // EVERY], held[-1]
    # Those of one engine would be hundreds by now; a few come and go with the host's pools.
    for what in ("mappings", "files", "threads"):
        assert last[what] <= settled[what] + 8, f"{what}: {[entry[what] for entry in held]}"


@pytest.mark.parametrize("scene_index", [False, True], ids=["legacy", "scene_index"])
def test_a_planted_leak_shows(fresh_host, scene_index):
    """The same measurement sees a leak of one small allocation per engine."""
    held = measure(fresh_host(scene_index, **ENVIRONMENT), PLANTED_CYCLES, PLANTED_BYTES_PER_CYCLE)
    assert growth(held, "allocated") > ALLOWED_BYTES_PER_CYCLE


def test_the_validation_layer_watches(host):
    """The canary of all these tests is alive: the layer is in the rendering process."""
    with host.open(small.FOLDER / "hidden_instances.usda", (8, 8), settings={"oocpt:samplesPerPixel": 1}) as view:
        view.render()
        assert (
            "validation" in pathlib.Path(f"/proc/{host.pid}/maps").read_text().lower()
        ), "no validation layer in the process"
