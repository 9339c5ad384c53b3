# SPDX-License-Identifier: Apache-2.0
"""A live host that asks for more samples gets them on top of those it has; what changes the picture begins again."""

import pytest

import compare
import small

SCENE = small.FOLDER / "nested.usda"


def settings(samples):
    return {"oocpt:samplesPerPixel": samples, "oocpt:maxBounces": 2}


def rendered(view, code=None):
    if code:
        view.edit(code)
    return view.render()["color"], view.stats()


def test_more_samples_go_on_and_other_settings_begin_again(host):
    at_once = host.picture(SCENE, (32, 24), settings=settings(12))["color"]
    with host.open(SCENE, (32, 24), settings=settings(4)) as view:
        _, first = rendered(view)
        color, stats = rendered(view, "engine.SetRendererSetting('oocpt:samplesPerPixel', 12)")
        compare.same_bits(color, at_once, "twelve samples at once")
        assert (first["oocpt:samplesKept"], stats["oocpt:samplesKept"], stats["numCompletedSamples"]) == (0, 4, 12)
        assert stats["oocpt:raysTraced"] == pytest.approx(2 * first["oocpt:raysTraced"], rel=0.1), "eight of twelve"
        _, stats = rendered(view, "engine.SetRendererSetting('oocpt:timeLimit', 100.0)")
        assert (stats["oocpt:samplesKept"], stats["oocpt:raysTraced"]) == (12, 0), "nothing is left to do"
        _, stats = rendered(view, "engine.SetRendererSetting('oocpt:seed', 1)")
        assert stats["oocpt:samplesKept"] == 0, "other samples"
        _, stats = rendered(view, "engine.SetRendererSetting('oocpt:samplesPerPixel', 3)")
        assert (stats["oocpt:samplesKept"], stats["numCompletedSamples"]) == (0, 3), "fewer"
