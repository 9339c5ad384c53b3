# SPDX-License-Identifier: Apache-2.0
"""Processes that are stopped in the middle of writing a file, so that a test can kill them there."""

import os
import pathlib
import signal
import time


def _is_stopped(process):
    return pathlib.Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[0] in "TZ"


def while_it_writes(start, find):
    """A process that is stopped, not ended, while the file that `find()` gives is half written, and that file.
    `start()` begins the process in a session of its own and removes what an earlier one left: one that was quicker than
    the signal is begun again."""
    for _ in range(20):
        process = start()
        end = time.monotonic() + 120
        while (file := find()) is None and process.poll() is None and time.monotonic() < end:
            time.sleep(2e-4)
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGSTOP)
            while not _is_stopped(process):
                time.sleep(2e-4)
            if file is not None and file.exists():
                return process, file
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
    raise AssertionError("twenty processes were not seen writing")
