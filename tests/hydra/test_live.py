# SPDX-License-Identifier: Apache-2.0
"""A live host, without a window: what it shows while its user moves the camera, zooms, walks, resizes and edits is
always a whole picture, follows, and rebuilds nothing that stays as it is. By counts: no clock decides."""

from __future__ import annotations

import pytest
from pxr import UsdGeom

import compare
import small

SIZE = (160, 96)
AOVS = ["color", "depth", "primId", "sampleCount"]
# Samples enough for every move to come before the last one.
MANY = {"oocpt:samplesPerPixel": 4096, "oocpt:maxBounces": 2}
CUBE = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
FACES = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]
SIDE = 33


def scene(stage):
    """A limit surface, three balls and a terrain in a world of radiance 1: no part of a picture is black."""
    solid = small.mesh(stage, "/World/Solid", CUBE, [4] * 6, FACES, (0.5, 0.5, 0.5))
    solid.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.catmullClark)
    for number in range(3):
        ball = UsdGeom.Sphere.Define(stage, f"/World/Ball{number}")
        ball.AddTranslateOp().Set((2.5 * number - 2.5, 0.3, -3.0))
        ball.CreateDisplayColorAttr([(0.6, 0.5, 0.4)])
    places = [(x, z) for z in range(SIDE) for x in range(SIDE)]
    points = [(2.0 * x - 32, (0.4 if (x + z) % 3 == 0 else 0.0) - 2, 2.0 * z - 32) for x, z in places]
    faces = [
        corner
        for z in range(SIDE - 1)
        for x in range(SIDE - 1)
        for corner in (z * SIDE + x, (z + 1) * SIDE + x, (z + 1) * SIDE + x + 1, z * SIDE + x + 1)
    ]
    terrain = small.mesh(stage, "/World/Terrain", points, [4] * (len(faces) // 4), faces, (0.4, 0.5, 0.4))
    terrain.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.catmullClark)
    small.dome(stage)
    small.camera(stage, "/World/Camera", (0.0, 1.0, 9.0), (0, 0, 0))


PRELUDE = """
camera = UsdGeom.Camera(stage.GetPrimAtPath('/World/Camera'))
if not hasattr(view, 'start'):
    view.start = UsdGeom.Xformable(camera).GetLocalTransformation()
    view.matrix = UsdGeom.Xformable(camera).MakeMatrixXform()
    view.focal = camera.GetFocalLengthAttr().Get()
"""


def turn(degrees):
    return PRELUDE + (
        f"view.matrix.Set(Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 1, 0), {degrees})) * view.start)"
    )


def walk(distance):
    return PRELUDE + f"view.matrix.Set(view.start * Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 0, {-distance})))"


def zoom(factor):
    return PRELUDE + f"camera.GetFocalLengthAttr().Set(view.focal * {factor})"


@pytest.fixture(params=[MANY, {**MANY, "oocpt:adaptiveSampling": True}], ids=["plain", "adaptive"])
def settings(request):
    return request.param


@pytest.fixture
def view(host, settings):
    stage = small.build(scene, "what a live host looks at")
    with host.open(stage, SIZE, settings=settings, aovs=AOVS) as view:
        # The first picture is there, and on the screen.
        view.edit("view.prepare(); view.step()\nwhile aov_reader.read(engine, 'sampleCount').min() < 1: view.step()\n"
                  "aov_reader.read(engine, 'color')")
        yield view


def live(view, steps, **arguments):
    """Plays `steps`; each picture that was shown was whole, and without a period each step has its own."""
    rows = view.host.call("live", viewer=view.name, steps=list(steps), **arguments)
    view.pending_log += view.host.log
    for number, row in enumerate(rows):
        assert row["sampleCount"] >= 1, f"step {number}: a pixel without a sample was shown: {row}"
        # One sample of a crevice may find no light.
        assert row["black"] < 0.1, f"step {number}: a picture with black parts was shown: {row}"
        assert row["commitsInHostThread"] == 0, f"step {number}: the host's thread was held by a commit: {row}"
    assert rows[-1]["commits"] > 1, f"nothing was committed beside it either: {rows[-1]}"
    return rows


def made(rows):
    """Meshes built after the first step."""
    return rows[-1]["meshes"] - rows[0]["meshes"]


def test_each_move_shows_another_whole_picture(view):
    rows = live(view, [turn(0.4 * k) for k in range(12)])
    assert made(rows) == 0, "looking around builds nothing"
    rows = live(view, [zoom(1.05**k) for k in range(20)] + [zoom(1.05 ** (k % 7)) for k in range(20)])
    assert made(rows) <= 6, f"{made(rows)} meshes built for two surfaces in a zoom of 2.5"
    rows = live(view, [walk(0.05 * k) for k in range(40)])
    assert made(rows) <= 6, f"{made(rows)} meshes built in a walk of 2 units"
    assert view.pending_log == "", "without a message"


def test_moves_that_do_not_wait_show_whole_pictures_too(view):
    rows = live(view, [turn(0.3 * k) for k in range(60)], period=1 / 30)
    changed = [row["changed"] for row in rows]
    assert sum(changed) >= 10, f"frozen: {changed}"
    assert made(rows) == 0, "and build nothing"


def test_another_size_shows_the_picture_before_until_there_is_one(view):
    sizes = [(200, 96), (200, 150), (90, 64), SIZE]
    resize = "engine.SetRenderBufferSize(Gf.Vec2i{0}); " \
             "engine.SetFraming(CameraUtil.Framing(Gf.Rect2i(Gf.Vec2i(0, 0), *{0})))"
    rows = live(view, [resize.format(size) for size in sizes])
    assert made(rows) <= 2, "sizes within a factor of two build nothing, but for the first"
    state = view.edit("result = aov_reader.read(engine, 'primId').shape")
    assert tuple(state) == SIZE[::-1], "the buffers have the size that was asked for last"


def test_edits_show_whole_pictures_and_build_what_changed(view):
    light = "UsdLux.DomeLight(stage.GetPrimAtPath('/World/Dome')).GetIntensityAttr().Set({})"
    rows = live(view, [light.format(1.0 + 0.1 * k) for k in range(1, 8)])
    assert made(rows) == 0, "a light builds no mesh"
    ball = "UsdGeom.Xformable(stage.GetPrimAtPath('/World/Ball1')).GetOrderedXformOps()[0].Set(Gf.Vec3d(0, {}, -3))"
    rows = live(view, [ball.format(0.1 * k) for k in range(1, 8)])
    assert made(rows) == 0, "a placement builds no mesh"
    rows = live(view, ["points = UsdGeom.Mesh(stage.GetPrimAtPath('/World/Solid')).GetPointsAttr()\n"
                       "points.Set([p * 1.02 for p in points.Get()])"] * 3)
    assert made(rows) == 2, "an edit of one mesh builds one mesh"


def test_ids_and_depth_follow_with_the_colour(view):
    live(view, [turn(k) for k in (10, 20, 30)])
    view.edit("view.step(); view.picture = [aov_reader.read(engine, name) for name in ('primId', 'depth')]")
    share = view.edit("ids, depth = view.picture; result = float(((ids >= 0) == (depth < 1)).mean())")
    assert share == 1, "what has an id has a depth"


def test_a_picture_after_moves_is_that_of_a_view_that_never_moved(host):
    """Of polygons: limit surfaces of a live view keep rates that are finer than it needs."""
    stage = small.FOLDER / "nested.usda"
    settings = {"oocpt:samplesPerPixel": 3, "oocpt:maxBounces": 2}
    with host.open(stage, SIZE, settings=settings, aovs=AOVS) as view:
        view.render()
        view.host.call("live", viewer=view.name, steps=[turn(0.5 * k) for k in range(30)], period=0.005)
        view.edit(turn(0.0))
        moved = view.render()
    compare.same_picture(moved, host.picture(stage, SIZE, settings=settings, aovs=AOVS), "after moves")


def test_moves_leave_nothing_behind(view):
    """In one of three series of moves: what is left behind is so in each, but allocators and drivers keep some more
    where threads want memory at other times."""
    live(view, [turn(0.3 * k) for k in range(50)], period=0.005)
    after = view.host.call("held")
    grown = []
    for _ in range(3):
        before = after
        live(view, [turn(0.3 * k) for k in range(300)], period=0.005)
        after = view.host.call("held")
        grown.append({what: after[what] - before[what] for what in ("mappings", "files", "threads", "resident")})
        if all(grown[-1][what] <= 4 for what in ("mappings", "files", "threads")) and grown[-1]["resident"] < 64 << 20:
            return
    raise AssertionError(f"grown by {grown}")


# Orbits, resizes and edits as Blender's viewport does; buffers are mapped after each execution and never resolved.
AS_BLENDER = """
from pxr import CameraUtil
result = []
for angle, size, intensity in {draws}:
    turn = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 1, 0), angle))
    frustum = Gf.Frustum()
    frustum.SetPerspective(40, size[0] / size[1], 0.1, 100)
    engine.SetCameraState(turn * Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 0, -9)), frustum.ComputeProjectionMatrix())
    engine.SetRenderBufferSize(Gf.Vec2i(size))
    engine.SetFraming(CameraUtil.Framing(Gf.Rect2i(Gf.Vec2i(0, 0), *size)))
    UsdLux.DomeLight(stage.GetPrimAtPath('/World/Dome')).GetIntensityAttr().Set(intensity)
    row = dict(shapes=[], black=0.0)
    end = time.monotonic() + 60
    while True:
        converged = view.step()
        pixels = aov_reader.read(engine, 'color', resolves=False)
        row['shapes'] = sorted({{*map(tuple, row['shapes']), pixels.shape}})
        if result:
            row['black'] = max(row['black'], float((pixels[..., :3].max(axis=-1) <= 0).mean()))
        if converged or time.monotonic() > end:
            break
        time.sleep(0.004)
    depth = aov_reader.read(engine, 'depth', resolves=False)
    row.update(mean=float(pixels[..., :3].mean()), seen=float((depth < 1).mean()), converged=converged)
    result.append(row)
"""


@pytest.mark.both_front_ends
def test_a_host_that_never_resolves_sees_the_picture_of_each_draw(host):
    stage = small.build(scene, "what a viewport looks at")
    draws = [(0, (64, 48), 1), (20, (64, 48), 1), (20, (97, 31), 1), (20, (32, 80), 1), (20, (32, 80), 2)]
    settings = {"oocpt:samplesPerPixel": 2, "oocpt:maxBounces": 1}
    with host.open(stage, draws[0][1], settings=settings, aovs=["color", "depth"]) as view:
        view.edit("view.prepare()")
        rows = view.edit(AS_BLENDER.format(draws=draws))
    for (_, size, _), row in zip(draws, rows, strict=True):
        assert row["converged"] and row["shapes"] == [[*size[::-1], 4]], f"{size}: {row}"
        assert row["black"] < 0.1 and 0.2 < row["seen"] < 1, f"{size}: {row}"
    assert rows[0]["mean"] != rows[1]["mean"], "another direction"
    assert rows[4]["mean"] == pytest.approx(2 * rows[3]["mean"], rel=1e-5), "twice the light"
