# SPDX-License-Identifier: Apache-2.0
"""Depth, ids and normals against the numpy reference, pixel by pixel, for everything that places geometry."""

import numpy as np
import pytest
from pxr import UsdGeom

import compare
import reference
import small

AOVS = ["color", "depth", "cameraDepth", "primId", "instanceId", "elementId", "normal", "Neye", "albedo"]
QUICK = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0}


def check(view, stage, camera, size, policy="matchVertically", purposes=("default", "proxy")):
    """Renders and compares every geometric AOV; returns picture and reference."""
    picture = view.render()
    hits = reference.first_hits(stage, camera, *size, policy, purposes)
    clear = compare.clear_pixels(hits.unclear, camera)
    hit, miss = (hits.item >= 0) & clear, (hits.item < 0) & clear
    assert hit.any(), "nothing in the picture"
    compare.near(picture["cameraDepth"][hit] / hits.camera_depth[hit], 1.0, 2e-6, "cameraDepth")
    compare.near(picture["depth"][hit], hits.depth[hit], 2e-6, "depth")
    assert (picture["elementId"][hit] == hits.face[hit]).all(), "elementId"
    compare.near(picture["normal"][hit], hits.normal[hit], 2e-5, "normal")
    for aov, clear_value in (
        ("cameraDepth", 0.0),
        ("depth", 1.0),
        ("primId", -1),
        ("instanceId", -1),
        ("elementId", -1),
        ("normal", 0.0),
    ):
        assert (picture[aov][miss] == clear_value).all(), f"clear value of {aov}"
    check_ids(view, picture, hits, hit)
    return picture, hits


def check_ids(view, picture, hits, hit):
    """The ids must lead Hydra back to the prim and, level by level, to the instance."""
    found = {}
    for row, column in np.argwhere(hit):
        pair = (int(picture["primId"][row, column]), int(picture["instanceId"][row, column]))
        found.setdefault(pair, set()).add(int(hits.item[row, column]))
    decoded = view.decode(found)
    for (pair, items), answer in zip(found.items(), decoded):
        assert len(items) == 1, f"ids {pair} stand for several placements: {[hits.items[item].path for item in items]}"
        item = hits.items[items.pop()]
        assert answer is not None, f"ids {pair} of {item.path} lead nowhere"
        assert answer["prim"] == item.path, f"ids {pair}"
        points = [tuple(level) for level in answer["levels"] if level[0] in {path for path, _ in item.levels}]
        assert points == list(item.levels), f"ids {pair} of {item.path}: {answer}"


@pytest.mark.parametrize(
    "scene",
    [
        small.nested, small.flattened, small.hidden_instances, small.polygons, small.mirrored, small.transforms,
        small.native,
    ],
    ids=lambda scene: scene.__name__,
)  # fmt: skip
def test_first_hits(host, scene):
    stage = small.build(scene)
    with host.open(stage, (40, 40), aovs=AOVS, settings=QUICK) as view:
        check(view, stage, "/World/Camera", (40, 40))


@pytest.mark.parametrize("camera", ["Plain", "Orthographic", "Offset", "Lens"])
def test_cameras(host, camera):
    """Lens: the geometric AOVs are those of the pinhole."""
    stage, path = small.build(small.cameras), f"/World/{camera}"
    with host.open(stage, (40, 40), camera=path, aovs=AOVS, settings=QUICK) as view:
        check(view, stage, path, (40, 40))


@pytest.mark.parametrize("policy", ["matchVertically", "matchHorizontally", "fit", "crop", "dontConform"])
def test_conform_policies(host, policy):
    """A picture whose shape is not the camera's, under each of CameraUtil's window policies."""
    stage = small.build(small.cameras)
    name = policy[0].upper() + policy[1:]
    for camera, size in (("Wide", (36, 30)), ("Tall", (48, 24))):
        with host.open(stage, size, camera=f"/World/{camera}", aovs=AOVS, settings=QUICK) as view:
            view.edit(f"engine.SetOverrideWindowPolicy(CameraUtil.{name})")
            check(view, stage, f"/World/{camera}", size, policy)


def test_free_camera_without_prim(host):
    """A camera state of matrices, as viewers use it, sees what the prim sees."""
    stage = small.build(small.cameras)
    with host.open(stage, (32, 32), camera="/World/Plain", aovs=AOVS, settings=QUICK) as view:
        by_prim = view.render()
        view.edit(
            "frustum = UsdGeom.Camera(stage.GetPrimAtPath('/World/Plain')).GetCamera(0).frustum\n"
            "view.camera = (frustum.ComputeViewMatrix(), frustum.ComputeProjectionMatrix())"
        )
        by_state = view.render()
        # Matrices instead of attributes: equal up to rounding.
        clear = compare.clear_pixels(reference.first_hits(stage, "/World/Plain", 32, 32).unclear, "cameras")
        compare.near(by_state["cameraDepth"][clear], by_prim["cameraDepth"][clear], 1e-5, "cameraDepth")
        assert (by_state["primId"][clear] == by_prim["primId"][clear]).all(), "primId"


@pytest.mark.parametrize("data", [(0, 0, 40, 40), (6, 12, 26, 30), (17, 3, 40, 22)], ids=["all", "crop", "corner"])
@pytest.mark.parametrize("display", [(0, 0, 40, 40), (-8, -4, 48, 52)], ids=["view", "larger_view"])
def test_framing(host, display, data):
    """The camera's view lands on the display window, the pixels of the data window are rendered, the rest of the buffer
    is clear. Windows count in pixels of the buffer, y down, as CameraUtilFraming defines them."""
    stage, full = small.build(small.cameras), 40
    left, top, right, bottom = display
    whole = reference.first_hits(stage, "/World/Offset", right - left, bottom - top)
    cut = np.s_[bottom - full : bottom, -left : full - left]
    item, face, depth, unclear = (plane[cut] for plane in (whole.item, whole.face, whole.camera_depth, whole.unclear))
    x0, y0, x1, y1 = data
    rendered = np.zeros((full, full), dtype=bool)
    rendered[full - y1 : full - y0, x0:x1] = True
    with host.open(stage, (full, full), camera="/World/Offset", aovs=AOVS, settings=QUICK) as view:
        view.edit(
            f"view.framing = CameraUtil.Framing(Gf.Range2f(Gf.Vec2f({left}, {top}), Gf.Vec2f({right}, {bottom})),"
            f" Gf.Rect2i(Gf.Vec2i({x0}, {y0}), Gf.Vec2i({x1 - 1}, {y1 - 1})))"
        )
        picture = view.render()
    clear = compare.clear_pixels(unclear, "framing") & rendered
    assert (item[clear] >= 0).any() and (item[clear] < 0).any()
    assert ((picture["primId"] >= 0) == (item >= 0))[clear].all(), "outline"
    compare.near(picture["cameraDepth"][clear], depth[clear], 3e-5, "cameraDepth")
    assert (picture["elementId"] == np.where(item >= 0, face, -1))[clear].all(), "elementId"
    for aov, value in (("primId", -1), ("depth", 1.0), ("cameraDepth", 0.0), ("color", 0.0)):
        assert (picture[aov][~rendered] == value).all(), f"{aov} outside the data window"


def test_depth_of_field_blurs_by_the_circle_of_confusion(host):
    """The edge of a half plane at twice the focus distance: coverage across it is that of a disk of the known
    radius."""
    distance, focus, lens_radius = 8.0, 4.0, 1.0

    def edge(stage):
        """A half plane and a lens."""
        half = small.quad(stage, "/World/Half", 40.0)
        half.AddTranslateOp().Set((-20.0, 0.0, -distance))
        lens = small.camera(stage, "/World/Camera", (0, 0, 0), (0, 0, -1))
        # Focal length 30 tenths of a unit; diameter of the lens = focal length / f-number.
        lens.CreateFStopAttr(3.0 / (2.0 * lens_radius))
        lens.CreateFocusDistanceAttr(focus)

    settings = {"oocpt:samplesPerPixel": 256, "oocpt:maxBounces": 0}
    picture = host.picture(small.build(edge), (32, 8), settings=settings)
    profile = picture["color"][..., 3].astype(np.float64).mean(axis=0)
    radius = lens_radius * (distance - focus) / focus
    # 24 / 30 * 8 = 6.4 units high at the plane, 8 pixels; square pixels.
    x = (np.arange(32) + 0.5 - 16) * 6.4 / 8 / radius
    fine = (x[:, None] + np.linspace(-0.5, 0.5, 65) * 0.8 / radius).clip(-1, 1)
    covered = 0.5 - (fine * np.sqrt(1 - fine * fine) + np.arcsin(fine)) / np.pi
    compare.near(profile, covered.mean(axis=1), 0.02, "coverage across the edge")
    assert 0.01 < profile[15] < 0.99, "the edge must be blurred"


@pytest.mark.parametrize("extra", [(), ("guide",), ("proxy",), ("render",), ("guide", "render")])
def test_visibility_and_purposes(host, extra):
    stage = small.build(small.visibility)
    with host.open(stage, (48, 24), aovs=AOVS, settings=QUICK, purposes=extra) as view:
        _, hits = check(view, stage, "/World/Camera", (48, 24), purposes=("default", *extra))
        assert len({hits.items[item].path for item in hits.item.ravel() if item >= 0}) == 1 + len(extra)


def test_millimetres_at_ten_thousand_kilometres(host):
    stage = small.build(small.far_away)
    with host.open(stage, (40, 40), aovs=AOVS, settings=QUICK) as view:
        picture, hits = check(view, stage, "/World/Camera", (40, 40))
        assert len(set(hits.item.ravel())) == 4, "three steps and the background"


def test_implicit_shapes_are_where_they_should_be(host):
    """The cages that Hydra makes of most are inside the true shape by little: depth, and the picture's outline, within
    the error of the polygons."""
    stage = small.build(small.implicit)
    size = (180, 180)
    with host.open(stage, size, aovs=AOVS, settings={**QUICK, "oocpt:dicingRate": 0.0}) as view:
        picture = view.render()
        ids = sorted(set(picture["primId"].ravel()) - {-1})
        paths = {pair: answer["prim"] for pair, answer in zip(ids, view.decode([(i, 0) for i in ids]))}
    kinds = [UsdGeom.Sphere, UsdGeom.Cube, UsdGeom.Cylinder, UsdGeom.Cone, UsdGeom.Capsule, UsdGeom.Plane]
    assert sorted(paths.values()) == sorted(f"/World/{kind.__name__}" for kind in kinds)
    rays = reference.pixel_rays(stage, "/World/Camera", *size)
    x, y = rays.origins[:, 0].reshape(size[::-1]), rays.origins[:, 1].reshape(size[::-1])
    for number, path in paths.items():
        kind = path.rsplit("/", 1)[1]
        index = [k.__name__ for k in kinds].index(kind)
        dx = x - (1.5 * index - 3.75)
        on = picture["primId"] == number
        front = _front(kind, dx, y)
        covered, expected = on.sum(), np.isfinite(front).sum()
        assert 0.88 * expected <= covered <= 1.01 * expected, f"{kind} covers {covered} pixels, not {expected}"
        assert not (
            on & ~np.isfinite(front) & ~np.isfinite(_front(kind, dx * 0.97, y * 0.97))
        ).any(), f"{kind} sticks out"
        both = on & np.isfinite(front)
        behind = (6.0 - picture["cameraDepth"][both]) - front[both]
        assert behind.max() <= 1e-4, f"{kind}: {behind.max()} in front of the true surface"
        allowed = {"Cube": 1e-5, "Plane": 1e-5}.get(kind, 0.12)
        assert -np.median(behind) <= allowed, f"{kind}: {-np.median(behind)} behind the true surface"


def _front(kind: str, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """z of the true front surface at (x, y); NaN outside."""
    with np.errstate(invalid="ignore"):
        round_about = lambda r: np.sqrt(r * r - x * x)
        if kind == "Sphere":
            return np.sqrt(0.36 - x * x - y * y)
        if kind == "Cube":
            return np.where((np.abs(x) < 0.5) & (np.abs(y) < 0.5), 0.5, np.nan)
        if kind == "Cylinder":
            return np.where(np.abs(y) < 0.6, round_about(0.45), np.nan)
        if kind == "Cone":
            return np.where(np.abs(y) < 0.6, round_about(np.clip(0.45 * (0.6 - y) / 1.2, 0, None)), np.nan)
        if kind == "Capsule":
            beyond = np.maximum(np.abs(x) - 0.3, 0)
            return np.sqrt(0.45**2 - y * y - beyond * beyond)
        return np.where((np.abs(x) < 0.6) & (np.abs(y) < 0.45), 0.0, np.nan)
