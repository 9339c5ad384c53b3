# SPDX-License-Identifier: Apache-2.0
"""What people get has nothing of what only tests turn on: no specialisation constant of faults in the passes, none of
the functions that stand before the driver's."""

import os
import pathlib
import re

import pytest

# OpDecorate, 4 words: any result, SpecId, the constant's number.
DECORATION = rb"\x47\x00\x04\x00....\x01\x00\x00\x00%s\x00\x00\x00"
STACK_SIZE, FAULT = (re.compile(DECORATION % number, re.DOTALL) for number in (rb"\x01", rb"\x04"))
WATCH, QUEUE = b"9oocpt_gpu5watch", b"9oocpt_gpu5queue"


def products():
    build = pathlib.Path(os.environ["OOCPT_BUILD"])
    plugin = next(iter(build.glob("plugin/**/hdOocPT.so")), None) or next(iter(build.glob("**/hdOocPT*.so")))
    return {"plugin": plugin, "command": pathlib.Path(os.environ["OOCPT_CLI"])}


@pytest.mark.parametrize("name", ["plugin", "command"])
def test_the_product_has_no_faults(name):
    data = products()[name].read_bytes()
    # The command renders nothing: benches are a program of their own.
    has_passes = name == "plugin"
    assert bool(STACK_SIZE.search(data)) == has_passes, "passes are found where they are, and nowhere else"
    assert not FAULT.search(data), "the passes were compiled with the faults of tests"
    if QUEUE in data:  # not stripped
        assert WATCH not in data, "calls of the driver are watched"
