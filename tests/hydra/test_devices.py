# SPDX-License-Identifier: Apache-2.0
"""Several devices render one picture through `usdrecord`: the bits and the error of one device. The devices are two
logical ones of the first physical device."""

import compare
from test_checkpoints import error, record


def test_two_devices_record_the_bits_of_one(tmp_path):
    """The colour alone, so no warning; the closing line and the report name both."""
    report = tmp_path / "report.json"
    one, told, lines = record(tmp_path, None, 20, OOCPT_DEVICES="0")
    two, also_told, more_lines = record(tmp_path, None, 20, "--set", "devices=0,0", "--report", report)
    compare.same_bits(two, one, "two devices")
    assert one[..., 3].max() > 0.9 and error(also_told) == error(told) and None not in error(told), (told, also_told)
    for devices, said in (("1 device", lines), ("2 devices", more_lines)):
        assert sum(f"on {devices} (" in line for line in said) == 1, said
        assert not any("oocpt:devices" in line for line in said), said
    assert '"devices":[{"name":' in report.read_text(), "memory and samples of each"
