# SPDX-License-Identifier: Apache-2.0
"""Two thousand engines made, rendered and destroyed in one process do not grow it."""

import pathlib

import small

CYCLES = 2000
# Allocators and logs settle late; a leak of one engine's state would be tens of kilobytes each time.
ALLOWED_BYTES_PER_CYCLE = 2048


def growth(resident: list[int], cycles: int) -> float:
    """Bytes per cycle over the second half, after everything that is made once has been made."""
    return (resident[2] - resident[1]) / (cycles / 2)


def test_two_thousand_cycles_do_not_grow(fresh_host):
    host = fresh_host(scene_index=False)
    resident = host.call("cycles", stage=str(small.FOLDER / "hidden_instances.usda"), count=CYCLES, patience=600.0)
    assert growth(resident, CYCLES) <= ALLOWED_BYTES_PER_CYCLE, f"{growth(resident, CYCLES):.0f} bytes per cycle: {resident}"


def test_the_validation_layer_watches(host):
    """The canary of all these tests is alive: the layer is in the rendering process."""
    with host.open(small.FOLDER / "hidden_instances.usda", (8, 8), settings={"oocpt:samplesPerPixel": 1}) as view:
        view.render()
        assert "validation" in pathlib.Path(f"/proc/{host.pid}/maps").read_text().lower(), "no validation layer in the process"


def test_growth_sees_a_leak():
    """A planted leak of 4 KiB per cycle is above the limit, a settled process below."""
    start = 300 << 20
    assert growth([start, start + (1000 << 12), start + (2000 << 12)], 2000) > ALLOWED_BYTES_PER_CYCLE
    assert growth([start, start + (1 << 20), start + (2 << 20)], 2000) <= ALLOWED_BYTES_PER_CYCLE
