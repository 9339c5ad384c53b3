# SPDX-License-Identifier: Apache-2.0
"""Scenes that do not fit: the same bits at every geometry budget and under every policy, an edit included; one error
where nothing helps."""

import math
import re

import pytest

import compare
import small
from host import HostError
from parts import ball, box, camera, distant, dome, instancer, turned

AOVS = ["color", "depth", "primId", "instanceId", "elementId", "primvars:displayColor"]
SETTINGS = {"oocpt:samplesPerPixel": 2, "oocpt:maxBounces": 2, "oocpt:seed": 5, "oocpt:chunkSize": 16}
SIZE = (28, 28)
MIN_BUDGET = "smallest"
# Every policy at one budget in between and at the smallest; the budgets between under one policy.
RUNS = [
    (50, "benefit"), (25, "benefit"), (25, "priority"), (25, "sweep"), (MIN_BUDGET, "benefit"),
    (MIN_BUDGET, "priority"), (MIN_BUDGET, "sweep"),
]


def patches(stage):
    """A field of 36 patches on a floor, each four balls of a mesh of its own: one instancer, a chunk or so per
    patch."""
    scenery(stage)
    names = [f"/World/Field/Ball{kind}" for kind in range(36)]
    kinds, positions = [], []
    for kind in range(36):
        x, z = 2.0 * (kind % 6) - 5.0, 2.0 * (kind // 6) - 5.0
        for place in range(4):
            kinds.append(kind)
            positions.append((x + 0.8 * (place % 2) - 0.4, 0.3 + 0.02 * kind, z + 0.8 * (place // 2) - 0.4))
    instancer(
        stage, "/World/Field", names, kinds, positions, scales=[(1, 0.8 + 0.01 * i, 1) for i in range(len(kinds))]
    )
    for kind, name in enumerate(names):
        ball(stage, name, 0.35, 6 + kind % 2, (0.3 + 0.018 * kind, 0.8 - 0.015 * kind, 0.4))


def thickets(stage):
    """Four thickets of ten meshes each, too large to stay whole, in nine turned places: nested instancers, shared
    chunks."""
    scenery(stage)
    names = [f"/World/Places/Thicket{kind}" for kind in range(4)]
    positions = [(3.6 * (i % 3) - 3.6, 0.4, 3.6 * (i // 3) - 3.6) for i in range(9)]
    turns = [turned((0, 1, 0), 37.0 * i) for i in range(9)]
    instancer(
        stage, "/World/Places", names, [i % 4 for i in range(9)], positions, turns,
        [(1 + 0.03 * i,) * 3 for i in range(9)],
    )
    for kind, name in enumerate(names):
        meshes = [f"{name}/Ball{i}" for i in range(10)]
        around = [(1.2 * math.cos(0.6283 * i), 0.1 * i, 1.2 * math.sin(0.6283 * i)) for i in range(10)]
        instancer(stage, name, meshes, list(range(10)), around)
        for i, path in enumerate(meshes):
            ball(stage, path, 0.4 + 0.01 * i, 7 + kind % 2, (0.2 + 0.2 * kind, 0.5, 0.1 + 0.1 * i))


def scenery(stage):
    floor = box(stage, "/World/Floor", (0.6, 0.6, 0.5), 14.0)
    floor.AddTranslateOp().Set((0, -7.0, 0))
    dome(stage, 0.5)
    distant(stage, "/World/Sun", (0.5, -1.0, -0.3), 2.0)
    camera(stage, "/World/Camera", (3.0, 6.0, 13.0), (0, 0, 0))


SCENES = {"patches": patches, "thickets": thickets}


@pytest.fixture(scope="module")
def whole(pool):
    """By front end and scene: its text, its picture with everything resident, the stats of that, and the smallest
    budget in KiB."""
    made = {}

    def get(host, name):
        if (host.scene_index, name) not in made:
            text = small.text(SCENES[name])
            with host.open(text, SIZE, aovs=AOVS, settings=SETTINGS) as view:
                picture, stats = view.render(), view.stats()
            made[host.scene_index, name] = (text, picture, stats, smallest_budget(host, text))
        return made[host.scene_index, name]

    return get


def smallest_budget(host, text) -> int:
    """What the error of a hopeless budget asks for, KiB."""
    with host.open(text, SIZE, aovs=AOVS, settings=SETTINGS | {"oocpt:geometryBudget": 1}) as view:
        with pytest.raises(HostError) as raised:
            view.render(30)
    return int(re.search(r"needs (\d+) KiB at once", str(raised.value)).group(1))


def assert_everything_resident(stats):
    assert stats["oocpt:inCore"] is True and stats["oocpt:evictions"] == 0, stats
    assert stats["oocpt:chunks"] >= 20, f"too few chunks to test anything: {stats}"


def assert_within_budget(stats, kib, is_smallest):
    assert stats["oocpt:inCore"] is False and stats["oocpt:geometryBudgetBytes"] == kib << 10, stats
    assert 0 < stats["oocpt:geometryPeakBytes"] <= kib << 10, stats
    assert stats["oocpt:loads"] > 0 and stats["oocpt:bytesPaged"] > 0 and stats["oocpt:pathsLeft"] == 0, stats
    if is_smallest:
        assert stats["oocpt:evictions"] > 0 and stats["oocpt:reloads"] > 0 and stats["oocpt:hitRate"] < 1, stats


def budget_kib(stats, smallest, share) -> int:
    return smallest if share == MIN_BUDGET else max(smallest, stats["oocpt:sceneBytes"] * share // 100 >> 10)


@pytest.mark.parametrize("name", SCENES)
def test_same_bits_at_every_budget_under_every_policy(host, whole, name):
    text, expected, stats, smallest = whole(host, name)
    assert_everything_resident(stats)
    assert (
        smallest << 10 < stats["oocpt:sceneBytes"] * 0.12
    ), f"the smallest budget is {smallest} KiB of {stats['oocpt:sceneBytes'] >> 10}"
    for share, policy in RUNS:
        kib = budget_kib(stats, smallest, share)
        with host.open(
            text, SIZE, aovs=AOVS, settings=SETTINGS | {"oocpt:geometryBudget": kib, "oocpt:policy": policy}
        ) as view:
            picture = view.render()
            assert_within_budget(view.stats(), kib, share == MIN_BUDGET)
        compare.same_picture(picture, expected, f"{name}, {kib} KiB, {policy}")


@pytest.mark.parametrize("name", SCENES)
def test_an_edit_under_a_small_budget_is_a_fresh_picture(host, whole, name):
    """Instances move in a live engine that holds a few chunks of the old scene; then the budget grows and everything is
    resident."""
    text, before, _, smallest = whole(host, name)
    settings = SETTINGS | {"oocpt:geometryBudget": smallest + smallest // 2}
    path = {"patches": "/World/Field", "thickets": "/World/Places"}[name]
    with host.open(text, SIZE, aovs=AOVS, settings=settings) as view:
        compare.same_picture(view.render(), before, "before the edit")
        edited = view.edit(
            "positions ="
            f" UsdGeom.PointInstancer(stage.GetPrimAtPath('{path}')).GetPositionsAttr()\n"
            "positions.Set(Vt.Vec3fArray([p + Gf.Vec3f(0.3, 0.2 * (i % 3), 0) for i, p in"
            " enumerate(positions.Get())]))\n"
            "result = stage.GetRootLayer().ExportToString()"
        )
        after = view.render()
        assert_within_budget(view.stats(), settings["oocpt:geometryBudget"], False)
        fresh = host.picture(edited, SIZE, aovs=AOVS, settings=SETTINGS)
        compare.same_picture(after, fresh, "after the edit")
        assert (after["color"] != before["color"]).any(), "the edit does not show"
        view.edit("engine.SetRendererSetting('oocpt:geometryBudget', 0)")
        compare.same_picture(view.render(), fresh, "without a budget")
        assert_everything_resident(view.stats())


def test_budget_and_policy_may_change_in_a_live_view(host, whole):
    text, expected, stats, smallest = whole(host, "patches")
    with host.open(text, SIZE, aovs=AOVS, settings=SETTINGS) as view:
        for kib, policy in [
            (0, "sweep"),
            (smallest, "sweep"),
            (budget_kib(stats, smallest, 25), "priority"),
            (smallest, "benefit"),
            (0, "benefit"),
        ]:
            view.edit(
                f"engine.SetRendererSetting('oocpt:geometryBudget', {kib}); engine.SetRendererSetting('oocpt:policy',"
                f" '{policy}')"
            )
            compare.same_picture(view.render(), expected, f"{kib} KiB, {policy}")
            if kib:
                assert_within_budget(view.stats(), kib, False)
            else:
                assert_everything_resident(view.stats())


def test_other_chunks_are_the_same_picture_up_to_rounding(host, whole):
    """The partition is part of what decides the bits; the picture is that of the scene."""
    text, expected, _, _ = whole(host, "patches")
    other = host.picture(text, SIZE, aovs=AOVS, settings=SETTINGS | {"oocpt:chunkSize": 8192})
    assert (other["elementId"] == expected["elementId"]).mean() > 0.99
    compare.near(other["color"].mean(axis=(0, 1)), expected["color"].mean(axis=(0, 1)), 5e-3, "means")


def test_a_budget_below_the_largest_chunk_is_one_error(host, whole):
    """It says how much is needed; with that much the same engine goes on."""
    text, expected, _, smallest = whole(host, "patches")
    with host.open(text, SIZE, aovs=AOVS, settings=SETTINGS | {"oocpt:geometryBudget": smallest - 1}) as view:
        with pytest.raises(HostError, match=rf"needs {smallest} KiB at once, {smallest - 1} KiB are left") as raised:
            view.render(30)
        message = str(raised.value).partition("Traceback")[0]
        assert message.count("KiB at once") == 1 and "KiB at once" not in raised.value.log, "one error, not several"
        assert "oocpt:geometryBudget" in message and "not converged" not in message, message
        view.edit(f"engine.SetRendererSetting('oocpt:geometryBudget', {smallest})")
        compare.same_picture(view.render(), expected, "with what the error asks for")


def test_a_wrong_policy_is_refused_by_name(host):
    quick = {"oocpt:samplesPerPixel": 2, "oocpt:maxBounces": 1}
    with host.open(small.FOLDER / "glow.usda", (12, 12), settings=quick) as view:
        before = view.render()
        view.edit("engine.SetRendererSetting('oocpt:policy', 'random')")
        after = view.render()
    compare.same_picture(after, before, "after a wrong policy")
    lines = [line for line in after.log.splitlines() if "oocpt:policy" in line]
    assert len(lines) == 1 and "random" in lines[0] and "sweep, priority, benefit" in lines[0], after.log


def test_straggler_roulette_never_drops_camera_rays(host, whole):
    """Off, nothing of it is in the passes. On, paths may end: what camera rays see stays, and the bits of before come
    back with the setting."""
    text, expected, stats, smallest = whole(host, "patches")
    assert "roulette" in stats["oocpt:featuresLeftOut"] and stats["oocpt:roulettePaths"] == 0, stats
    settings = SETTINGS | {"oocpt:geometryBudget": smallest, "oocpt:stragglerRoulette": True}
    with host.open(text, SIZE, aovs=AOVS, settings=settings) as view:
        played = view.render()
        stats = view.stats()
        assert_within_budget(stats, smallest, True)
        assert "roulette" not in stats["oocpt:featuresLeftOut"], stats
        assert stats["oocpt:roulettePaths"] >= 0 and stats["oocpt:rouletteLoadsSaved"] >= 0, stats
        for name in AOVS[1:]:
            compare.same_bits(played[name], expected[name], name)
        compare.same_bits(played["color"][..., 3].copy(), expected["color"][..., 3].copy(), "alpha")
        compare.near(played["color"].mean(axis=(0, 1)), expected["color"].mean(axis=(0, 1)), 0.1, "means")
        view.edit("engine.SetRendererSetting('oocpt:stragglerRoulette', False)")
        compare.same_picture(view.render(), expected, "without it again")
