# SPDX-License-Identifier: Apache-2.0
"""`oocpt report html` of renders through a host: what the page says, that it is whole in itself, and that a browser
shows it. The browser's part is skipped where Chromium is not installed."""

from __future__ import annotations

import html.parser
import json
import os
import pathlib
import shutil
import subprocess

import numpy as np
import pytest

import small

REPO = pathlib.Path(__file__).resolve().parents[2]
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
HOSTILE = "a</title><script>document.title='broken'</script>\"'&b"
VOID = {"meta", "img"}
# Attributes that make a browser ask for something, or run something.
ADDRESSES = {"src", "href", "data", "action", "poster", "srcset", "xlink:href"}


class Page(html.parser.HTMLParser):
    """Elements, texts and addresses of a page; asserts that elements nest."""

    def __init__(self, text):
        super().__init__()
        self.found, self.open, self.texts, self.addresses = [], [], [], []
        self.feed(text)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag, attributes):
        self.handle_startendtag(tag, attributes)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.found.append(tag)
        assert not [name for name, _ in attributes if name.startswith("on")], attributes
        self.addresses += [value for name, value in attributes if name in ADDRESSES]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.texts.append(data)


@pytest.fixture(scope="module")
def make():
    """Runs the command of this checkout; the page's text."""
    built = os.environ.get("OOCPT_CLI")
    cargo = "cargo run --quiet --locked --profile fast --package oocpt-cli --bin oocpt --".split()

    def run(out, *files):
        words = [*([built] if built else cargo), "report", "html", *map(str, files), "--out", str(out)]
        done = subprocess.run(words, cwd=REPO, capture_output=True, text=True, timeout=1800, start_new_session=True)
        assert done.returncode == 0, done.stderr
        return out.read_text(encoding="utf-8")

    return run


@pytest.fixture(scope="module")
def rendered(pool, tmp_path_factory):
    """A folder with the reports of two renders, and of the chunks of the second, which streams."""
    folder = tmp_path_factory.mktemp("reports")
    for name, more in [("whole", {}), ("streamed", {"oocpt:chunkReport": str(folder / "chunks.json")})]:
        settings = {"oocpt:samplesPerPixel": 16, "oocpt:maxBounces": 2, "oocpt:report": str(folder / f"{name}.jsonl")}
        settings |= {"oocpt:chunkSize": 16, "enableInteractive": False} | more
        with pool.get("legacy").open(small.FOLDER / "glow.usda", (48, 32), settings=settings) as view:
            view.render()
    return folder


def test_the_page_says_what_the_reports_say_and_loads_nothing(rendered, make):
    page = Page(make(rendered / "page.html", rendered / "whole.jsonl", rendered / "streamed.jsonl",
                     rendered / "chunks.json"))  # fmt: skip
    lines = [json.loads(line) for line in (rendered / "streamed.jsonl").read_text().splitlines()]
    usage, rows = lines[-1]["usage"], [line for line in lines if "samples" in line]
    said = " ".join(page.texts)
    assert all(0 < row["gpuBytes"] <= usage["gpuPeakBytes"] and row["hostPeakBytes"] > 1 << 20 for row in rows), rows
    for text in ("16 of 16", "48 × 32", "Memory over time", "What was left out", "textures, and ray cones for them",
                 f"{usage['chunks']}, {usage['loads']}, {usage['reloads']}", lines[0]["device"]):  # fmt: skip
        assert text in said, f"{text} in {said}"
    assert page.found.count("svg") == 2 and page.found.count("img") == 2, "two charts, and chunks by loads and rays"
    assert all(address.startswith("data:image/png;base64,") for address in page.addresses)
    assert "script" not in page.found and "link" not in page.found


def test_names_of_strangers_are_text(rendered, make, tmp_path):
    lines = (rendered / "whole.jsonl").read_text().splitlines()
    header = {**json.loads(lines[0]), "device": HOSTILE, "reference": HOSTILE}
    report = tmp_path / "a<b>&\"'.jsonl"
    report.write_text("\n".join([json.dumps(header), *lines[1:]]))
    page = Page(make(tmp_path / "page.html", report))
    assert HOSTILE in "".join(page.texts) and "script" not in page.found, page.found


@pytest.mark.skipif(BROWSER is None, reason="no Chromium here: nothing looks at the page")
def test_a_browser_shows_the_page(rendered, make, tmp_path):
    import OpenImageIO as oiio

    make(tmp_path / "page.html", rendered / "whole.jsonl", rendered / "streamed.jsonl", rendered / "chunks.json")
    shot = tmp_path / "page.png"
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--enable-logging=stderr"]
    flags += [f"--user-data-dir={tmp_path}/own", f"--screenshot={shot}", "--window-size=900,1400"]
    words = [BROWSER, *flags, (tmp_path / "page.html").as_uri()]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, start_new_session=True)
    assert done.returncode == 0 and shot.exists(), done.stderr
    assert "CONSOLE" not in done.stderr, f"the browser complains: {done.stderr}"
    pixels = oiio.ImageInput.open(str(shot)).read_image("unknown")[..., :3].astype(int)
    # Text and a chart in each part of it: dark on light, or light on dark.
    paper = pixels[0, 0]
    for part in np.array_split(np.abs(pixels - paper).max(axis=-1) > 60, 4):
        assert part.mean() > 0.002, "a part of the page is empty"
