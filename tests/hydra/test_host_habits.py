# SPDX-License-Identifier: Apache-2.0
"""Hosts of other habits than usdview's: they ask the render pass alone, several times a frame or without a pause, map
without resolving, keep pixels mapped, read, render and destroy on threads of their own, and have several engines in one
process. By counts: no clock decides."""

from __future__ import annotations

import numpy as np
import pytest

import compare
import small
import test_live

SIZE = (64, 48)
PATH = small.FOLDER / "glow.usda"
QUICK = {"oocpt:samplesPerPixel": 4, "oocpt:maxBounces": 2}
ENDLESS = {"oocpt:samplesPerPixel": 1 << 20, "oocpt:maxBounces": 2}

PRELUDE = """
import ctypes, resource, threading

def on_thread(work, *arguments):
    '''Runs `work` on a thread of its own; returns what it returns, and raises what it raises.'''
    done = []
    def run():
        try:
            done.append((work(*arguments), None))
        except BaseException as error:
            done.append((None, error))
    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    if done[0][1]:
        raise done[0][1]
    return done[0][0]

def poll(patience=60.0):
    '''Asks the render pass until it says that it is done; executes and resolves nothing.'''
    end = time.monotonic() + patience
    while not engine.IsConverged():
        if time.monotonic() > end:
            raise TimeoutError(f'not converged: {view.stats()}')
        time.sleep(0.002)

def pixels(name='color'):
    return aov_reader.read(engine, name, resolves=False)
"""


def run(view, code):
    return view.edit(PRELUDE + code)


def same_as_alone(rows, host, settings=QUICK, size=SIZE):
    """Pictures, as lists of rows from the bottom, have the bits of one that an engine makes alone."""
    alone = host.picture(PATH, size, settings=settings)["color"]
    for row in rows:
        compare.same_bits(np.array(row, dtype=np.float32), alone, "a picture of another habit")


ONCE = """
view.prepare()
engine.Render(stage.GetPseudoRoot(), view.params)
{poll}
result = pixels().tolist()
"""


@pytest.mark.both_front_ends
@pytest.mark.parametrize("poll", ["poll()", "on_thread(poll)"], ids=["here", "thread"])
def test_a_host_that_executes_once_and_polls_the_pass_has_the_final_picture(host, poll):
    with host.open(PATH, SIZE, settings=QUICK) as view:
        same_as_alone([run(view, ONCE.format(poll=poll))], host)


# A frame is `asks` questions and, if the host has a window, a sleep. The count is of voluntary context switches: the
# host's own sleeps are one each, being held is 25 for a question.
FRAMES = """
view.prepare()
view.step()
def frames(count, asks, sleeps):
    before = resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw
    for _ in range(count):
        for _ in range(asks):
            assert not engine.IsConverged(), 'a million samples'
        if sleeps:
            time.sleep(0.001)
    return resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw - before
result = {result}
"""


@pytest.mark.parametrize("asks", [1, 3, 6])
def test_a_host_with_a_window_is_never_held_up(host, asks):
    with host.open(PATH, SIZE, settings=ENDLESS) as view:
        switches = run(view, FRAMES.format(result=f"frames(100, {asks}, True)"))
    assert switches < 100 + 25, f"{asks} questions a frame: {switches} sleeps in 100 frames"


def test_each_thread_that_asks_is_judged_by_itself(host):
    """The main thread has slept many times more than the other one ever will, and the reverse."""
    ways = "[frames(300, 1, True), on_thread(frames, 100, 1, True), frames(100, 1, True)]"
    with host.open(PATH, SIZE, settings=ENDLESS) as view:
        switches = run(view, FRAMES.format(result=ways))
    assert switches[1] < 125 and switches[2] < 125, f"{switches} sleeps in 300, 100, 100 frames"


def test_a_host_that_never_sleeps_waits_in_its_question(host):
    with host.open(PATH, SIZE, settings=ENDLESS) as view:
        switches = run(view, FRAMES.format(result="frames(80, 1, False)"))
    assert switches > 200, f"{switches} sleeps in 80 questions: the host takes a core from the renderer"


MAPPED = """
view.prepare()
while not view.step():
    time.sleep(0.002)
token = aov_reader._tokens(['color'])
buffer = aov_reader._get_buffer(aov_reader._engine(engine), ctypes.cast(token, ctypes.POINTER(ctypes.c_uint64)))
address = aov_reader._virtual(buffer, aov_reader._MAP, ctypes.c_void_p)
read = lambda: ctypes.string_at(address, 64 * 48 * 16)
before, shapes = read(), []
def resize(size):
    '''Sets no AOVs anew: the engine would make other buffers.'''
    engine.SetRenderBufferSize(Gf.Vec2i(size))
    engine.SetFraming(CameraUtil.Framing(Gf.Rect2i(Gf.Vec2i(0, 0), *size)))
for size in ((200, 150), (32, 16), (90, 90)):
    resize(size)
    while not view.step():
        time.sleep(0.002)
    shapes.append(pixels().shape)
same = read() == before
aov_reader._virtual(buffer, aov_reader._UNMAP, None)
resize((64, 48))
while not view.step():
    time.sleep(0.002)
result = [same, shapes, pixels().tolist()]
"""


def test_pixels_that_are_mapped_stay_while_the_buffer_changes_its_size(host):
    with host.open(PATH, SIZE, settings=QUICK) as view:
        same, shapes, after = run(view, MAPPED)
    assert same, "the host's pointer leads to other pixels"
    assert shapes == [[150, 200, 4], [16, 32, 4], [90, 90, 4]], shapes
    same_as_alone([after], host)


CONVERGED = """
view.prepare()
view.step()
end = time.monotonic() + 60
while pixels('sampleCount').min() < 1 and time.monotonic() < end:
    view.step()
token = aov_reader._tokens(['color'])
buffer = aov_reader._get_buffer(aov_reader._engine(engine), ctypes.cast(token, ctypes.POINTER(ctypes.c_uint64)))
ask = lambda: aov_reader._virtual(buffer, aov_reader._IS_CONVERGED, ctypes.c_bool)
address = aov_reader._virtual(buffer, aov_reader._MAP, ctypes.c_void_p)
read = lambda: ctypes.string_at(address, 64 * 48 * 16)
old = read()
engine.SetRendererSetting('oocpt:samplesPerPixel', 4)
view.step()
poll()
held = [ask() for _ in range(3)] + [read() == old]
aov_reader._virtual(buffer, aov_reader._UNMAP, None)
freed = [ask(), ask()]
address = aov_reader._virtual(buffer, aov_reader._MAP, ctypes.c_void_p)
again = [ask(), read() != old]
aov_reader._virtual(buffer, aov_reader._UNMAP, None)
result = [held, freed, again, pixels().tolist()]
"""


def test_a_mapped_buffer_is_converged_when_it_holds_the_final_picture(host):
    with host.open(PATH, SIZE, aovs=("color", "sampleCount"), settings=ENDLESS) as view:
        held, freed, again, rows = run(view, CONVERGED)
    assert held == [False, False, False, True], "it keeps the old picture while it is mapped, and says so"
    assert freed == [True, True] and again == [True, True], (freed, again)
    same_as_alone([rows], host)


READ = """
view.prepare()
view.step()
end = time.monotonic() + 60
while pixels('sampleCount').min() < 1 and time.monotonic() < end:
    view.step()
reads, changed, black, stop = [0], [], [], threading.Event()
token = aov_reader._tokens(['color'])
buffer = aov_reader._get_buffer(aov_reader._engine(engine), ctypes.cast(token, ctypes.POINTER(ctypes.c_uint64)))
def convert():
    while not stop.is_set():
        address = aov_reader._virtual(buffer, aov_reader._MAP, ctypes.c_void_p)
        first = ctypes.string_at(address, view.size[0] * view.size[1] * 16)
        time.sleep(0.002)
        if ctypes.string_at(address, len(first)) != first:
            changed.append(reads[0])
        aov_reader._virtual(buffer, aov_reader._UNMAP, None)
        aov_reader._virtual(buffer, aov_reader._RESOLVE, None)
        black.append(float((pixels()[..., :3].max(axis=-1) <= 0).mean()))
        reads[0] += 1
thread = threading.Thread(target=convert)
thread.start()
light = UsdLux.DomeLight(stage.GetPrimAtPath('/World/Dome')).GetIntensityAttr()
for number in range(40):
    light.Set(1.0 + 0.05 * number)
    seen = reads[0]
    end = time.monotonic() + 30
    while reads[0] < seen + 2 and thread.is_alive() and time.monotonic() < end:
        view.step()
        pixels()
        time.sleep(0.001)
stop.set()
thread.join()
result = [reads[0], changed, max(black)]
"""


@pytest.mark.both_front_ends
def test_a_thread_that_converts_reads_whole_pictures_that_stay_while_it_reads(host):
    stage = small.build(test_live.scene, "what a viewport looks at")
    with host.open(stage, SIZE, settings=test_live.MANY, aovs=["color", "sampleCount"]) as view:
        reads, changed, black = run(view, READ)
    assert reads >= 80 and not changed, f"of {reads} mapped pictures {changed} changed"
    assert black < 0.1, f"a picture with {black:.0%} black was read"


SHARED = """
others = [type(view)(stage, view.size, view.camera, view.aovs, {settings}, ['proxy']) for _ in range(2)]
engines = busy = [view, *others]
for each in engines:
    each.prepare()
end = time.monotonic() + 90
while busy and time.monotonic() < end:
    busy = [each for each in busy if not each.step()]
    time.sleep(0.002)
stats = [each.stats() for each in engines]
keys = ['numCompletedSamples', 'gpuMemoryUsed', 'peakMemory', 'oocpt:gpuMemoryBudget']
result = [[[s[key] for key in keys] for s in stats],
          [aov_reader.read(each.engine, 'color').tolist() for each in engines]]
"""


@pytest.mark.parametrize("settings", [{}, {"oocpt:geometryBudget": 12}], ids=["fits", "streams"])
def test_viewports_of_a_process_share_a_device_and_its_budget(host, settings):
    """47 MiB, which no other test asks for: the device is of these engines alone."""
    settings = QUICK | settings
    budgeted = settings | {"oocpt:memoryBudget": 47}
    with host.open(PATH, SIZE, settings=budgeted) as view:
        stats, pictures = run(view, SHARED.format(settings=budgeted))
    assert [samples for samples, *_ in stats] == [4] * 3, stats
    assert len({used for _, used, *_ in stats}) == 1, f"not one device: {stats}"
    assert all(used <= peak <= budget == 47 << 20 for _, used, peak, budget in stats), stats
    same_as_alone(pictures, host)


DESTROYED = """
make = lambda settings: type(view)(stage, view.size, view.camera, view.aovs, settings, ['proxy'])
def endless():
    view.prepare()
    view.step()
    for _ in range(8):
        doomed = [make({endless})]
        on_thread(doomed[0].prepare)
        on_thread(doomed[0].step)
        doomed[0].step()
        ends = threading.Thread(target=doomed.clear)
        ends.start()
        while ends.is_alive():
            view.step()
            time.sleep(0.001)
        ends.join()
count = lambda: len(__import__('os').listdir('/proc/self/task'))
endless()
before = count()
endless()
after = count()
whole = [make({quick})]
on_thread(whole[0].finish, 60.0)
picture = aov_reader.read(whole[0].engine, 'color').tolist()
on_thread(whole.clear)
result = [before, after, picture]
"""


@pytest.mark.both_front_ends
def test_engines_render_and_are_destroyed_on_other_threads_while_one_goes_on(host):
    with host.open(PATH, SIZE, settings=ENDLESS) as view:
        before, after, picture = run(view, DESTROYED.format(endless=ENDLESS, quick=QUICK))
    assert after <= before + 2, f"{before} threads, then {after} after eight engines more"
    same_as_alone([picture], host)


EARLY = """
asked = [engine.IsConverged(), engine.IsPauseRendererSupported(), engine.IsStopRendererSupported(),
         len(engine.GetRendererSettingsList()), len(view.stats()), engine.GetRendererCommandDescriptors()]
for what in (engine.PauseRenderer, engine.ResumeRenderer, engine.StopRenderer, engine.RestartRenderer):
    what()
aov_reader.set_aovs(engine, ['noSuchImage'])
engine.Render(stage.GetPseudoRoot(), view.params)
asked.append(engine.IsConverged())
for key, value in (('', 1), ('oocpt:samplesPerPixel', Vt.IntArray([1])), ('karma:global:samples', 2), ('x', None)):
    engine.SetRendererSetting(key, value)
view.prepare()
while not view.step():
    time.sleep(0.002)
result = [asked[0], asked[-1], pixels().tolist()]
"""


@pytest.mark.both_front_ends
def test_questions_before_anything_is_there_have_answers(host):
    with host.open(PATH, SIZE, settings=QUICK) as view:
        new, without, picture = run(view, EARLY)
        assert "samplesPerPixel cannot hold" in view.pending_log, view.pending_log
    assert new and without, "what has nothing to do is done"
    same_as_alone([picture], host)
