# SPDX-License-Identifier: Apache-2.0
"""Two viewports of one render index, which share a delegate: each has its own camera, size and buffers, and its own
whole picture, whatever happens in the other one. The first is the engine's, the second one of tests/abi/viewports.cpp.
By counts: no clock decides."""

from __future__ import annotations

import os
import pathlib
import subprocess

import numpy as np
import pytest
from pxr import Usd

import compare
import small

pytestmark = pytest.mark.skipif(
    Usd.GetVersion() >= (0, 26, 3), reason="the engine of OpenUSD 26.03 hands its render index to nobody"
)
SIZE, OTHER = (64, 48), (40, 56)
QUICK = {"oocpt:samplesPerPixel": 4, "oocpt:maxBounces": 2}
ENDLESS = QUICK | {"oocpt:samplesPerPixel": 1 << 20}
# Another camera than the scene's: from the side.
SIDE = """
    def Camera "Side"
    {
        float focalLength = 30
        double3 xformOp:translate = (4.5, 1.2, 1)
        float xformOp:rotateY = 75
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]
    }
"""
PRELUDE = """
import ctypes

class Viewport:
    '''The second viewport.'''

    def __init__(self, camera, size):
        function = aov_reader._function(
            f"_ZNK{aov_reader._N}18UsdImagingGLEngine15_GetRenderIndexEv", ctypes.c_void_p, ctypes.c_void_p)
        self.library = ctypes.PyDLL(LIBRARY)
        self.library.oocpt_viewport_open.restype = ctypes.c_void_p
        self.library.oocpt_viewport_step.restype = self.library.oocpt_viewport_read.restype = ctypes.c_bool
        index = ctypes.c_void_p(function(aov_reader._engine(engine)))
        self.own, self.size = ctypes.c_void_p(self.library.oocpt_viewport_open(index, camera.encode(), *size)), size

    def step(self):
        return self.library.oocpt_viewport_step(self.own)

    def resize(self, size):
        self.size = size
        self.library.oocpt_viewport_resize(self.own, *size)

    def read(self):
        import numpy
        pixels = numpy.zeros((self.size[1], self.size[0], 4), numpy.float32)
        final = self.library.oocpt_viewport_read(self.own, ctypes.c_void_p(pixels.ctypes.data))
        return pixels, final

    def close(self):
        self.library.oocpt_viewport_close(self.own)

def pixels():
    return aov_reader.read(engine, 'color')

def settle(patience=90.0):
    '''Executes both in turn, as a host with two windows, until both say that they are final.'''
    end, mixed = time.monotonic() + patience, 0
    while True:
        final = [view.step(), view.other.step()]
        shown, (others, ready) = pixels(), view.other.read()
        mixed += int(shown.shape == others.shape and shown.any() and (shown == others).all())
        if all(final) and ready:
            return [shown.tolist(), others.tolist(), mixed]
        if time.monotonic() > end:
            raise TimeoutError(f'{final} {ready}: {view.stats()}')
        time.sleep(0.002)

light = UsdLux.DomeLight(stage.GetPrimAtPath('/World/Dome')).GetIntensityAttr()
"""


@pytest.fixture(scope="module")
def library():
    build = pathlib.Path(os.environ["OOCPT_BUILD"])
    subprocess.run(["cmake", "--build", str(build), "--target", "oocpt_viewports"], check=True)
    return build / "abi/liboocpt_viewports.so"


def scene():
    text = (small.FOLDER / "glow.usda").read_text()
    start = text.index("{", text.index('def Xform "World"')) + 1
    return text[:start] + SIDE + text[start:]


def run(view, library, code):
    return view.edit(f"LIBRARY = {str(library)!r}\n{PRELUDE}{code}")


def alone(host, camera, size, intensity=None):
    """What an engine of its own makes of it."""
    with host.open(scene(), size, camera=camera, settings=QUICK) as view:
        if intensity is not None:
            view.edit(f"UsdLux.DomeLight(stage.GetPrimAtPath('/World/Dome')).GetIntensityAttr().Set({intensity})")
        return view.render()["color"]


def same(rows, expected, what):
    compare.same_bits(np.array(rows, dtype=np.float32), expected, what)


# The first viewport's picture is final before the second one begins. A resize, an edit, and another camera follow.
STEPS = """
view.prepare()
view.finish(60.0)
view.other = Viewport('/World/Side', {size})
result = [settle()]
light.Set(2.0)
result.append(settle())
view.other.resize((56, 40))
view.camera = '/World/Side'
view.prepare()
result.append(settle())
view.other.close()
view.finish(60.0)
result.append(pixels().tolist())
"""


@pytest.mark.both_front_ends
@pytest.mark.parametrize("size", [SIZE, OTHER], ids=["same_size", "other_size"])
def test_each_viewport_has_its_own_whole_picture(host, library, size):
    with host.open(scene(), SIZE, settings=QUICK) as view:
        first, edited, moved, closed = run(view, library, STEPS.format(size=size))
    for what, (shown, others, mixed), intensity in (("first", first, None), ("edited", edited, 2.0)):
        same(shown, alone(host, "/World/Camera", SIZE, intensity), f"{what}: the engine's")
        same(others, alone(host, "/World/Side", size, intensity), f"{what}: the other one")
        assert mixed == 0, f"{what}: one was shown in the other {mixed} times"
    assert all(np.abs(np.subtract(a, b)).max() > 0.1 for a, b in zip(first[:2], edited[:2], strict=True)), "an edit"
    side = alone(host, "/World/Side", SIZE, 2.0)
    same(moved[0], side, "the engine's with another camera")
    same(moved[1], alone(host, "/World/Side", (56, 40), 2.0), "the other one, resized")
    same(closed, side, "alone again")


# Without end: the one that changed last goes on, until it is not executed any more.
HIDDEN = """
view.prepare()
end = time.monotonic() + 90
def until(is_done, *steps):
    while not is_done():
        for step in steps:
            step()
        if time.monotonic() > end:
            raise TimeoutError(str(view.stats()))
        time.sleep(0.002)
counts = lambda: aov_reader.read(engine, 'sampleCount')
view.step()
until(lambda: counts().min() >= 1, view.step)
view.other = Viewport('/World/Side', {size})
until(lambda: view.other.read()[0].any(), view.step, view.other.step)
before = pixels()
for _ in range(40):
    view.step()
    view.other.step()
kept = [(pixels() == before).all(), view.other.step()]
until(lambda: (pixels() != before).any(), view.step)
view.other.close()
view.other = Viewport('/World/Side', {size})
until(lambda: view.other.read()[0].any(), view.step, view.other.step)
own, others = pixels(), view.other.read()[0]
view.other.close()
for _ in range(20):
    view.step()
    kept.append(abs(pixels() - own).mean() < abs(pixels() - others).mean())
result = [bool(one) for one in kept]
"""


def test_a_viewport_that_is_hidden_or_closed_gives_its_turn_up(host, library):
    with host.open(scene(), SIZE, aovs=("color", "sampleCount"), settings=ENDLESS) as view:
        is_kept, is_final, *are_own = run(view, library, HIDDEN.format(size=SIZE))
    assert is_kept and not is_final, "the other one goes on, and the first one keeps what it shows"
    assert all(are_own), "the picture of the one that was closed is shown"
