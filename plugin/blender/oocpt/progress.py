# SPDX-License-Identifier: Apache-2.0
"""How far a render is, from the report that the renderer writes while it renders: Blender's engine hands on a
percentage and nothing else of the renderer's statistics.

The report has a row at each power of two of samples; between two rows samples are estimated from their rate. Errors are
the estimated relMSE.
"""

import json
import pathlib
import threading
import time

PERIOD = 0.2


class RenderProgress:
    """Reads a report in a thread of its own while the block runs, and calls `tell(fraction, text)`."""

    def __init__(self, report, title, tell):
        self._file, self._title, self._tell = pathlib.Path(report), title, tell
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="oocpt progress", daemon=True)
        self._of_row = time.monotonic()
        self._position, self._partial = self._size(), ""
        self.target, self.row = 0, None

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *exception):
        self._stop.set()
        self._thread.join()
        self._read()

    def _watch(self):
        while not self._stop.wait(PERIOD):
            self._read()
            self._tell(*self._state())

    def _size(self):
        try:
            return self._file.stat().st_size
        except OSError:
            return 0

    def _read(self):
        """Takes the lines that are new. A session empties the file when it first renders."""
        if self._size() < self._position:
            self._position, self._partial = 0, ""
        try:
            with self._file.open(encoding="utf-8") as file:
                file.seek(self._position)
                text = self._partial + file.read()
                self._position = file.tell()
        except OSError:
            return
        *lines, self._partial = text.split("\n")
        for line in lines:
            self._take(line)

    def _take(self, line):
        try:
            entry = json.loads(line)
        except ValueError:
            return
        self.target = entry.get("samplesTarget", self.target)
        if "estimate" in entry:
            self.row, self._of_row = entry, time.monotonic()

    def _state(self):
        if not self.row:
            return 0.0, f"{self._title} | Preparing"
        samples, seconds = self.row["samples"], max(self.row["seconds"], 1e-6)
        since = time.monotonic() - self._of_row
        guessed = min(samples + samples / seconds * since, 2 * samples, max(self.target, samples))
        share = guessed / self.target if self.target else 0.0
        return min(share, 1.0), f"{self._title} | {guessed:.0f} / {self.target} samples{self.error_text()}"

    def error_text(self):
        error = ((self.row or {}).get("estimate") or {}).get("relMse")
        return f" | relMSE {error:.2g}" if error else ""

    def summary(self):
        """What was reached, for the log and for files; empty if nothing was."""
        if not self.row:
            return {}
        told = {"samples": f"{self.row['samples']:g}", "seconds": f"{self.row['seconds']:.1f}"}
        estimate = self.row.get("estimate") or {}
        return told | {key: f"{estimate[key]:.3g}" for key in ("relMse", "low", "high") if estimate.get(key)}
