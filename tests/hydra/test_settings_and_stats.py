# SPDX-License-Identifier: Apache-2.0
"""Settings from hosts, environment and stage; statistics; pause, stop, restart."""

import json
import time

import pytest

import compare
import small

PATH = small.FOLDER / "glow.usda"
QUICK = {"oocpt:samplesPerPixel": 4, "oocpt:maxBounces": 1}
KEYS = [
    "percentDone", "fractionDone", "totalClockTime", "numCompletedSamples", "gpuMemoryUsed", "totalMemory",
    "peakMemory", "oocpt:hostMemory", "oocpt:hostPeakMemory",
    "rendererName", "rendererVersion", "renderProgressAnnotation", "oocpt:raysPerSecond", "oocpt:dropped",
    "oocpt:inCore", "oocpt:chunks", "oocpt:chunkInstances", "oocpt:residentChunks", "oocpt:loads", "oocpt:reloads",
    "oocpt:evictions",
    "oocpt:bytesPaged", "oocpt:hitRate", "oocpt:waitingRays", "oocpt:stragglers", "oocpt:geometryPeakBytes",
    "oocpt:mappedBytes", "oocpt:isSplit", "oocpt:treesBuilt", "oocpt:treesRefitted",
    "oocpt:roulettePaths", "oocpt:rouletteShadowRays", "oocpt:rouletteLoadsSaved",
    "oocpt:errorSamples", "oocpt:errorSeconds", "oocpt:errorEstimate", "oocpt:errorLow", "oocpt:errorHigh",
    "oocpt:errorWorstPixels",
    "oocpt:features", "oocpt:featuresLeftOut", "oocpt:passes", "oocpt:passesLeftOut",
    "oocpt:pipelines", "oocpt:buffers",
    "oocpt:buffersLeftOut", "oocpt:bufferBytes", "oocpt:bytesLeftOut", "oocpt:primvars", "oocpt:primvarsLeftOut",
    "oocpt:maxLevels", "oocpt:stackSize", "oocpt:traversalBackend", "oocpt:traversalReason",
    "oocpt:samplesKept", "oocpt:filmWindows", "oocpt:commits", "oocpt:commitsInHostThread", "oocpt:commitPending",
    "oocpt:secondsTracing", "oocpt:secondsLoading", "oocpt:secondsWaiting", "oocpt:secondsOverlapped",
]  # fmt: skip
LISTED = [
    "oocpt:samplesPerPixel", "oocpt:maxBounces", "oocpt:seed", "oocpt:clamp", "oocpt:timeLimit", "oocpt:memoryBudget",
    "oocpt:device", "oocpt:devices",
    "oocpt:chunkSize", "oocpt:geometryBudget", "oocpt:hostMemoryBudget", "oocpt:dicingRate",
    "oocpt:report", "oocpt:targetError",
    "oocpt:stragglerRoulette", "oocpt:adaptiveSampling", "oocpt:textureCache", "oocpt:textureCacheSize",
    "oocpt:geometryCache", "oocpt:geometryCacheSize", "oocpt:pipelineCache",
    "oocpt:maxDiffuseBounces", "oocpt:maxSpecularBounces", "oocpt:maxTransmissionBounces",
    "oocpt:pixelFilter", "oocpt:pixelFilterWidth", "oocpt:filterAovs", "oocpt:denoise",
    "oocpt:denoiserLibrary", "oocpt:products",
    "oocpt:checkpoint", "oocpt:checkpointInterval", "oocpt:filmPart", "oocpt:sampleRange",
    "convergedSamplesPerPixel", "enableInteractive", "domeLightCameraVisibility", "enableSceneLights",
]  # fmt: skip
# Tools for developing the renderer: they work wherever a setting can be given, and no host lists them.
UNLISTED = [
    "oocpt:traversal", "oocpt:policy", "oocpt:chunkReport", "oocpt:materialReport", "oocpt:reference",
]  # fmt: skip


def test_stats_of_a_finished_render(host):
    with host.open(PATH, (24, 24), settings=QUICK) as view:
        view.render()
        stats = view.stats()
    missing = [key for key in KEYS if key not in stats]
    assert not missing, f"missing {missing} in {sorted(stats)}"
    assert stats["percentDone"] == 100 and stats["fractionDone"] == 1, stats
    assert stats["numCompletedSamples"] == 4 and stats["rendererName"] == "OocPT"
    assert stats["totalClockTime"] > 0 and stats["oocpt:raysPerSecond"] > 0
    assert 0 < stats["gpuMemoryUsed"] <= stats["peakMemory"] and stats["oocpt:dropped"] == 0
    # A process with Python, USD and a Vulkan driver.
    assert 32 << 20 < stats["oocpt:hostPeakMemory"] < 1 << 40, stats["oocpt:hostPeakMemory"]
    # Floor, wall, box of 6 quads, veil, 5 balls of 5 rings.
    ball = 10 * (2 + 2 * 3)
    assert stats["oocpt:triangles"] == 2 + 2 + 12 + 2 + 5 * ball and stats["oocpt:instances"] == 9


def test_settings_are_listed_with_types_usdview_knows(host):
    with host.open(PATH, settings=QUICK) as view:
        listed = view.edit(
            "result = [(s.key, s.name, type(s.defValue).__name__) for s in engine.GetRendererSettingsList()]"
        )
    by_key = {key: (name, kind) for key, name, kind in listed}
    ours = {key for key in by_key if key.startswith("oocpt:")}
    assert set(LISTED) <= set(by_key) and ours <= set(LISTED), sorted(ours ^ set(LISTED))
    for key, (name, kind) in by_key.items():
        assert kind in ("bool", "int", "float", "str") and name, f"{key}: {name!r} {kind}"


def test_settings_of_developers_work_although_no_host_lists_them(host, fresh_host, tmp_path):
    """From the host and from the environment."""
    by_host, by_variable = (tmp_path / f"{place}.json" for place in ("host", "variable"))
    with host.open(PATH, (16, 16), settings=QUICK | {"oocpt:chunkReport": str(by_host)}) as view:
        view.render()
    other = fresh_host(host.scene_index, OOCPT_CHUNK_REPORT=str(by_variable))
    other.picture(PATH, (16, 16), settings=QUICK)
    for report in (by_host, by_variable):
        assert json.loads(report.read_text())["chunks"], report


def test_samples_setting_and_its_common_name(host):
    for key in ("oocpt:samplesPerPixel", "convergedSamplesPerPixel"):
        with host.open(PATH, (16, 16), settings={key: 7, "oocpt:maxBounces": 0}) as view:
            view.render()
            assert view.stats()["numCompletedSamples"] == 7, key


def test_settings_of_a_live_view(host):
    with host.open(PATH, (16, 16), settings=QUICK) as view:
        view.render()
        view.edit("engine.SetRendererSetting('oocpt:samplesPerPixel', 9)")
        picture = view.render()
        assert view.stats()["numCompletedSamples"] == 9
    compare.same_picture(
        picture, host.picture(PATH, (16, 16), settings=QUICK | {"oocpt:samplesPerPixel": 9}), "9 samples"
    )


def test_adaptive_sampling_is_a_setting_with_stats(host):
    """Off by default and then without a word; on, samples go where they are worth most, the picture stays, and the
    budget changes no bit."""
    plain = {"oocpt:samplesPerPixel": 64, "oocpt:maxBounces": 1}
    adaptive = plain | {"oocpt:adaptiveSampling": True}
    with host.open(PATH, (24, 24), settings=plain) as view:
        even = view.render()
        assert (
            "oocpt:adaptiveEpochs" not in view.stats() and "adaptive sampling" in view.stats()["oocpt:featuresLeftOut"]
        )
        view.edit("engine.SetRendererSetting('oocpt:adaptiveSampling', True)")
        uneven = view.render()
        stats = view.stats()
    assert stats["numCompletedSamples"] == 64 and stats["oocpt:adaptiveEpochs"] == 3, stats
    assert stats["oocpt:adaptiveFewestSamples"] < 64 < stats["oocpt:adaptiveMostSamples"], stats
    assert 0 < stats["oocpt:errorLow"] < stats["oocpt:errorEstimate"] < stats["oocpt:errorHigh"], stats
    difference = abs(uneven["color"][..., :3] - even["color"][..., :3])
    assert 0 < difference.mean() < 0.02, difference.mean()
    capped = host.picture(PATH, (24, 24), settings=adaptive | {"oocpt:geometryBudget": 64, "oocpt:chunkSize": 16})
    compare.same_picture(
        host.picture(PATH, (24, 24), settings=adaptive | {"oocpt:chunkSize": 16}), capped, "under a budget"
    )
    compare.same_picture(uneven, host.picture(PATH, (24, 24), settings=adaptive), "switched on in a live view")


def test_environment_mirrors_settings(host, fresh_host):
    other = fresh_host(host.scene_index, OOCPT_SAMPLES_PER_PIXEL="5", OOCPT_MAX_BOUNCES="1", OOCPT_SEED="21")
    with other.open(PATH, (16, 16)) as view:
        picture = view.render()
        assert view.stats()["numCompletedSamples"] == 5
    settings = {"oocpt:samplesPerPixel": 5, "oocpt:maxBounces": 1, "oocpt:seed": 21}
    compare.same_picture(picture, host.picture(PATH, (16, 16), settings=settings), "environment against settings")


def test_render_settings_prim_reaches_the_delegate(host, tmp_path):
    """Through FrameRecorder, as usdrecord does: namespaced settings of the active prim give the same bits as settings
    of the engine."""
    import exr

    text = PATH.read_text() + (
        'def RenderSettings "Settings" {\n'
        "  int oocpt:samplesPerPixel = 5\n"
        "  int oocpt:maxBounces = 1\n"
        "  int oocpt:seed = 33\n"
        "  rel camera = </World/Camera>\n"
        "}\n"
    )
    scene = tmp_path / "settings.usda"
    scene.write_text(text)
    out = tmp_path / "settings.exr"
    host.call("record", stage=str(scene), out=str(out), width=16, render_settings="/Settings")
    expected = host.picture(
        PATH, (16, 16), settings={"oocpt:samplesPerPixel": 5, "oocpt:maxBounces": 1, "oocpt:seed": 33}
    )
    compare.same_bits(exr.read(out, expected["color"].dtype), expected["color"], "settings prim")


def test_a_scene_sets_nothing_that_belongs_to_the_machine(fresh_host, host, tmp_path):
    """Each is one warning by name and has no effect: the environment's counts. What else the scene sets does."""
    import exr

    wanted, unwanted = tmp_path / "wanted.json", tmp_path / "unwanted"
    of_machine = {
        "oocpt:memoryBudget": "int = 1", "oocpt:geometryBudget": "int = 1", "oocpt:hostMemoryBudget": "int = 1",
        "oocpt:device": 'string = "no such device"', "oocpt:devices": 'string = "nor such"',
        "oocpt:chunkSize": "int = 16", "oocpt:policy": 'string = "sweep"',
        "oocpt:traversal": 'string = "compute"', "oocpt:hostMappedGeometry": 'string = "on"',
        "oocpt:textureCacheSize": "int = 1", "oocpt:geometryCacheSize": "int = 1",
        **{
            f"oocpt:{name}": f'string = "{unwanted}"'
            for name in ("report", "chunkReport", "materialReport", "reference", "textureCache", "geometryCache",
                         "pipelineCache")
        },
    }  # fmt: skip
    lines = "".join(
        f"  {kind.split(' = ')[0]} {key} = {kind.split(' = ')[1]}\n" for key, kind in of_machine.items()
    )
    scene = tmp_path / "settings.usda"
    scene.write_text(
        PATH.read_text() + 'def RenderSettings "Settings" {\n'
        "  int oocpt:samplesPerPixel = 5\n  int oocpt:maxBounces = 1\n  int oocpt:seed = 33\n"
        f"{lines}  rel camera = </World/Camera>\n}}\n"
    )
    other = fresh_host(host.scene_index, OOCPT_CHUNK_REPORT=str(wanted))
    out = tmp_path / "settings.exr"
    other.call("record", stage=str(scene), out=str(out), width=16, render_settings="/Settings")
    for key in of_machine:
        assert other.log.count(f"the scene sets {key}, which belongs to the machine") == 1, (key, other.log)
    assert other.log.count("which belongs to the machine") == len(of_machine), other.log
    assert json.loads(wanted.read_text())["chunks"] and not unwanted.exists()
    expected = host.picture(
        PATH, (16, 16), settings={"oocpt:samplesPerPixel": 5, "oocpt:maxBounces": 1, "oocpt:seed": 33}
    )
    compare.same_bits(exr.read(out, expected["color"].dtype), expected["color"], "settings of the scene")


def test_time_limit_ends_a_render(host):
    settings = {"oocpt:samplesPerPixel": 1 << 20, "oocpt:timeLimit": 0.5}
    with host.open(PATH, (32, 32), settings=settings) as view:
        start = time.monotonic()
        view.render(60)
        assert time.monotonic() - start < 20
        assert 0 < view.stats()["numCompletedSamples"] < 1 << 20


def test_pause_stops_progress_and_resume_ends_with_the_same_bits(host):
    settings = {"oocpt:samplesPerPixel": 256, "oocpt:maxBounces": 2}
    expected = host.picture(PATH, (24, 24), settings=settings)
    with host.open(PATH, (24, 24), settings=settings) as view:
        assert view.edit("result = engine.IsPauseRendererSupported()") is True
        samples = view.edit(
            "view.prepare(); view.step()\n"
            "result = [engine.PauseRenderer()]\n"
            "time.sleep(0.3)\n"
            "for _ in range(3):\n"
            "    result.append(view.stats()['numCompletedSamples'])\n"
            "    time.sleep(0.15)\n"
            "    view.step()\n"
            "result.append(engine.IsConverged())\n"
            "result.append(engine.ResumeRenderer())"
        )
        assert samples[0] is True and samples[-1] is True, samples
        assert samples[1] == samples[2] == samples[3] < 256, f"samples while paused: {samples}"
        assert samples[4] is False, "a paused render is not converged"
        compare.same_picture(view.render(), expected, "paused and resumed")


def test_stop_converges_at_once_and_restart_renders_all(host):
    settings = {"oocpt:samplesPerPixel": 1 << 20, "oocpt:maxBounces": 2}
    with host.open(PATH, (24, 24), settings=settings) as view:
        assert view.edit("result = engine.IsStopRendererSupported()") is True
        stopped = view.edit(
            "view.prepare(); view.step(); time.sleep(0.2); view.step()\n"
            "result = [engine.StopRenderer()]\n"
            "start = time.monotonic()\n"
            "while not view.step() and time.monotonic() - start < 20:\n"
            "    time.sleep(0.01)\n"
            "result += [engine.IsConverged(), time.monotonic() - start, view.stats()['numCompletedSamples']]"
        )
        assert stopped[0] is True and stopped[1] is True, f"stopped: {stopped}"
        assert stopped[2] < 5.0 and stopped[3] < 1 << 20, f"stopped: {stopped}"
        view.edit("engine.SetRendererSetting('oocpt:samplesPerPixel', 4)\nengine.RestartRenderer()")
        compare.same_picture(
            view.render(), host.picture(PATH, (24, 24), settings=settings | {"oocpt:samplesPerPixel": 4}), "restarted"
        )


@pytest.mark.parametrize("when", ["before", "during"])
def test_an_engine_may_be_destroyed_at_any_time(host, when):
    view = host.open(PATH, (32, 32), settings={"oocpt:samplesPerPixel": 1 << 20})
    if when == "during":
        view.edit("view.prepare(); view.step(); time.sleep(0.05)")
    start = time.monotonic()
    host.call("close", viewer=view.name)
    assert time.monotonic() - start < 10, "a render in progress must not hold up the end of its engine"
    compare.near(
        host.picture(small.FOLDER / "furnace.usda", (8, 8), camera="/World/Perspective", settings=QUICK)["color"], 1.0,
        1e-3, "afterwards",
    )


def test_two_engines_side_by_side(host):
    expected = host.picture(PATH, (24, 24), settings=QUICK)
    with (
        host.open(PATH, (24, 24), settings=QUICK) as one,
        host.open(small.FOLDER / "nested.usda", (24, 24), settings=QUICK) as two,
    ):
        first, second = one.render(), two.render()
        compare.same_picture(one.render(), first, "first again")
    compare.same_picture(first, expected, "side by side")
    assert (second["color"] != first["color"]).any()
