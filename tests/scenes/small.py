#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The small test scenes, one function each. `small.py` writes them all as .usda beside this file, into `small/`.

Each function fills an empty y-up stage with a unit of one metre; what is special about the scene stands in its
docstring. Needs any pxr, nothing else. The committed files are checked against this source by test_scenes.py.
"""

from __future__ import annotations

import math
import pathlib
import sys

from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from damaged import BAD_PRIMS, bad_data  # noqa: F401  the tests ask for both here
from parts import ball, box, camera, distant, dome, instancer, mesh, orthographic, quad, turned

FOLDER = pathlib.Path(__file__).parent / "small"


def furnace(stage):
    """A white sphere in a white world: every camera must see exactly 1 everywhere."""
    ball(stage, "/World/Ball", color=(1, 1, 1))
    dome(stage, 1.0)
    camera(stage, "/World/Perspective", (0, 0.5, 4), (0, 0, 0))
    orthographic(stage, "/World/Orthographic", (3, 2, 4), (0, 0, 0), 3.0)
    lens = camera(stage, "/World/Lens", (1, 1, 4), (0, 0, 0))
    lens.CreateFStopAttr(0.5)
    lens.CreateFocusDistanceAttr(3.0)
    shifted = camera(stage, "/World/Shifted", (-2, 0.5, 3.5), (0, 0, 0))
    shifted.CreateHorizontalApertureOffsetAttr(5.0)
    shifted.CreateVerticalApertureOffsetAttr(-3.0)


def lambert(stage):
    """Squares tilted by 0, 30, 60 and 85 degrees away from a sun straight above, side by side under a camera that looks
    down."""
    for index, tilt in enumerate((0, 30, 60, 85)):
        prim = quad(stage, f"/World/Tilt{tilt}", 1.6, (0.8, 0.4, 0.2))
        # First face up, then tilt about x; stretched so that it still fills its cell when seen from above.
        prim.AddTranslateOp().Set(Gf.Vec3d(2.0 * index - 3.0, 0, 0))
        prim.AddRotateXOp().Set(-90.0 + tilt)
        prim.AddScaleOp().Set(Gf.Vec3f(1.0, 1.0 / math.cos(math.radians(tilt)), 1.0))
    distant(stage, "/World/Sun", (0, -1, 0), 3.0)
    orthographic(stage, "/World/Camera", (0, 40, 0), (0, 0, 0), 8.0, up=(0, 0, -1))


def sun_disk(stage):
    """As `lambert`'s first square, under a wide normalised sun 40 degrees off, and a dome: sums and angles of
    lights."""
    quad(stage, "/World/Floor", 4.0, (0.5, 0.5, 0.5)).AddRotateXOp().Set(-90.0)
    lean = math.radians(40)
    distant(stage, "/World/Sun", (math.sin(lean), -math.cos(lean), 0), 2.0, angle=10.0, color=(1.0, 0.5, 0.25))
    dome(stage, 0.3)
    orthographic(stage, "/World/Camera", (0, 5, 0), (0, 0, 0), 2.0, up=(0, 0, -1))


CLUSTER = [((0.0, 0.0, 0.0), 0, 1.0), ((0.9, 0.2, 0.1), 40, 0.6), ((-0.7, 0.5, -0.4), 75, 0.8)]
PLACES = [
    ((-2.0, 0.0, 0.0), 15, 1.0), ((1.5, -0.5, -1.0), 100, 0.8), ((0.5, 1.6, 0.5), -60, 0.7),
    ((2.3, 1.0, -2.0), 10, 1.2),
]


def nested(stage):
    """Boxes and balls in clusters, clusters in the world: a point instancer of point instancers. Twin of
    `flattened`."""
    twin_stage_lights_and_camera(stage)
    instancer(stage, "/World/Outer", ["/World/Outer/Cluster"], [0] * len(PLACES), *places(PLACES))
    instancer(
        stage, "/World/Outer/Cluster", ["/World/Outer/Cluster/Box", "/World/Outer/Cluster/Ball"], [0, 1, 0],
        *places(CLUSTER),
    )
    box(stage, "/World/Outer/Cluster/Box", (0.8, 0.3, 0.2))
    ball(stage, "/World/Outer/Cluster/Ball", 0.6, 6, (0.2, 0.5, 0.8))


def flattened(stage):
    """The same placements as `nested`, each mesh by itself: no instancing at all."""
    twin_stage_lights_and_camera(stage)
    for outer_index, outer in enumerate(PLACES):
        for inner_index, inner in enumerate(CLUSTER):
            path = f"/World/Item_{outer_index}_{inner_index}"
            if inner_index == 1:
                prim = ball(stage, path, 0.6, 6, (0.2, 0.5, 0.8))
            else:
                prim = box(stage, path, (0.8, 0.3, 0.2))
            prim.AddTransformOp().Set(place_matrix(inner) * place_matrix(outer))


def places(table):
    return (
        [p for p, _, _ in table], [turned((0, 1, 0), angle) for _, angle, _ in table], [(s, s, s) for _, _, s in table]
    )


def place_matrix(place):
    """The matrix that an instancer makes of a row of `places`."""
    position, angle, scale = place
    turn = Gf.Quatd(*turned((0, 1, 0), angle))
    matrix = Gf.Matrix4d().SetScale(scale) * Gf.Matrix4d().SetRotate(turn)
    return matrix * Gf.Matrix4d().SetTranslate(Gf.Vec3d(*position))


def twin_stage_lights_and_camera(stage):
    dome(stage, 0.5)
    distant(stage, "/World/Sun", (0.4, -1.0, -0.6), 2.0)
    camera(stage, "/World/Camera", (0.5, 2.0, 8.0), (0.3, 0.4, 0.0))


def native(stage):
    """Native instances: three of one asset that itself holds two instances of another, plus an overridden ancestor
    transform."""
    stage.CreateClassPrim("/Parts")
    UsdGeom.Xform.Define(stage, "/Parts/Post")
    box(stage, "/Parts/Post/Shape", (0.7, 0.6, 0.2)).AddScaleOp().Set(Gf.Vec3f(0.3, 1.6, 0.3))
    UsdGeom.Xform.Define(stage, "/Parts/Gate")
    quad(stage, "/Parts/Gate/Beam", 1.0, (0.3, 0.7, 0.4)).AddTransformOp().Set(
        Gf.Matrix4d().SetScale(Gf.Vec3d(1.6, 0.3, 1)) * Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 0.7, 0.1))
    )
    for index, x in enumerate((-0.6, 0.6)):
        post = UsdGeom.Xform.Define(stage, f"/Parts/Gate/Post{index}")
        post.GetPrim().GetReferences().AddInternalReference("/Parts/Post")
        post.GetPrim().SetInstanceable(True)
        post.AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
    for index, (x, turn) in enumerate(((-2.2, 20), (0.0, 0), (2.2, -25))):
        gate = UsdGeom.Xform.Define(stage, f"/World/Gate{index}")
        gate.GetPrim().GetReferences().AddInternalReference("/Parts/Gate")
        gate.GetPrim().SetInstanceable(True)
        gate.AddTranslateOp().Set(Gf.Vec3d(x, 0, -0.5 * index))
        gate.AddRotateYOp().Set(turn)
    twin_stage_lights_and_camera(stage)


def hidden_instances(stage):
    """A row of seven places of three prototypes with authored ids; two are invisible, one is inactive."""
    kinds = [0, 1, 2, 0, 1, 2, 0]
    prim = instancer(
        stage, "/World/Row", [f"/World/Row/{name}" for name in ("Box", "Ball", "Quad")], kinds,
        [(1.2 * i - 3.6, 0, 0) for i in range(7)],
    )
    prim.CreateIdsAttr(Vt.Int64Array([100, 101, 102, 103, 104, 105, 106]))
    prim.CreateInvisibleIdsAttr(Vt.Int64Array([101, 105]))
    prim.GetPrim().SetMetadata("inactiveIds", Sdf.Int64ListOp.CreateExplicit([103]))
    box(stage, "/World/Row/Box", (0.8, 0.2, 0.2), 0.8)
    ball(stage, "/World/Row/Ball", 0.45, 6, (0.2, 0.8, 0.2))
    quad(stage, "/World/Row/Quad", 0.9, (0.2, 0.2, 0.8))
    dome(stage)
    orthographic(stage, "/World/Camera", (0, 0, 6), (0, 0, 0), 9.0)


def implicit(stage):
    """Sphere, cube, cylinder, cone, capsule and plane, in a row; the last two along other axes."""
    kinds = [UsdGeom.Sphere, UsdGeom.Cube, UsdGeom.Cylinder, UsdGeom.Cone, UsdGeom.Capsule, UsdGeom.Plane]
    for index, kind in enumerate(kinds):
        prim = kind.Define(stage, f"/World/{kind.__name__}")
        prim.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set(
            Vt.Vec3fArray([Gf.Vec3f(0.2 + 0.12 * index, 0.5, 0.9 - 0.14 * index)])
        )
        prim.AddTranslateOp().Set(Gf.Vec3d(1.5 * index - 3.75, 0, 0))
        if kind is UsdGeom.Sphere:
            prim.CreateRadiusAttr(0.6)
        elif kind is UsdGeom.Cube:
            prim.CreateSizeAttr(1.0)
        elif kind is UsdGeom.Plane:
            prim.CreateWidthAttr(1.2)
            prim.CreateLengthAttr(0.9)
            prim.CreateAxisAttr(UsdGeom.Tokens.z)
        else:
            prim.CreateRadiusAttr(0.45)
            prim.CreateHeightAttr(0.6 if kind is UsdGeom.Capsule else 1.2)
            prim.CreateAxisAttr(UsdGeom.Tokens.x if kind is UsdGeom.Capsule else UsdGeom.Tokens.y)
    dome(stage)
    orthographic(stage, "/World/Camera", (0, 0, 6), (0, 0, 0), 9.0)


def polygons(stage):
    """Pentagon and hexagon in one mesh, a concave arrow, a comb with a hole face, a left-handed square: all in planes z
    = const."""
    ngon = lambda n, x, y, r: [
        (x + r * math.cos(2 * math.pi * k / n + 0.3), y + r * math.sin(2 * math.pi * k / n + 0.3), 0.0)
        for k in range(n)
    ]
    mesh(stage, "/World/Convex", ngon(5, -2.4, 1.2, 0.9) + ngon(6, -0.3, 1.2, 0.9), [5, 6], range(11), (0.8, 0.3, 0.3))
    arrow = [(0.9, 0.4, 0.5), (3.2, 1.2, 0.5), (0.9, 2.0, 0.5), (1.7, 1.2, 0.5)]
    mesh(stage, "/World/Arrow", arrow, [4], range(4), (0.3, 0.8, 0.3))
    spiral = [
        (-3.2, -2.2), (-0.4, -2.2), (-0.4, -0.2), (-2.6, -0.2), (-2.6, -1.5), (-1.2, -1.5), (-1.2, -1.1), (-2.2, -1.1),
        (-2.2, -0.6), (-0.8, -0.6), (-0.8, -1.8), (-3.2, -1.8),
    ]
    mesh(stage, "/World/Spiral", [(x, y, -0.5) for x, y in spiral], [12], range(12), (0.3, 0.3, 0.8))
    grid = [(0.3 + 0.9 * i, -2.2 + 0.9 * j, 0.25) for j in range(3) for i in range(4)]
    cells = [c for j in range(2) for i in range(3) for c in (4 * j + i, 4 * j + i + 1, 4 * j + i + 5, 4 * j + i + 4)]
    holes = mesh(stage, "/World/Holes", grid, [4] * 6, cells, (0.7, 0.7, 0.2))
    holes.CreateHoleIndicesAttr(Vt.IntArray([1, 3]))
    left = quad(stage, "/World/LeftHanded", 0.8, (0.2, 0.7, 0.7))
    left.CreateOrientationAttr(UsdGeom.Tokens.leftHanded)
    left.CreateFaceVertexIndicesAttr(Vt.IntArray([0, 3, 2, 1]))
    left.AddTranslateOp().Set(Gf.Vec3d(-3.0, 2.6, -0.2))
    dome(stage)
    orthographic(stage, "/World/Camera", (0, 0, 6), (0, 0, 0), 7.0)


def mirrored(stage):
    """A tetrahedron and its mirror image (negative scale), and one placed by an instancer with a negative scale."""
    points = [(0, 0, 0.9), (0.8, -0.5, 0), (0, 0.9, 0), (-0.8, -0.5, 0)]
    faces = [0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2]
    for index, scale in enumerate(((1, 1, 1), (-1, 1, 1))):
        prim = mesh(stage, f"/World/Tetra{index}", points, [3] * 4, faces, (0.6, 0.5, 0.3))
        prim.AddTranslateOp().Set(Gf.Vec3d(2.2 * index - 2.2, 0, 0))
        prim.AddScaleOp().Set(Gf.Vec3f(*scale))
    instancer(stage, "/World/Mirror", ["/World/Mirror/Tetra"], [0], [(2.2, 0, 0)], scales=[(1, -1, 1)])
    mesh(stage, "/World/Mirror/Tetra", points, [3] * 4, faces, (0.6, 0.5, 0.3))
    distant(stage, "/World/Sun", (0.3, -0.2, -1), 2.0)
    orthographic(stage, "/World/Camera", (0, 0, 6), (0, 0, 0), 7.0)


INTERPOLATIONS = ("constant", "uniform", "varying", "vertex", "faceVarying")


def primvars(stage):
    """A patch of 2 x 1 quads per interpolation (columns) and kind (rows): colours, indexed colours, opacities,
    normals."""
    points = [(0.45 * i - 0.45, 0.45 * j - 0.225, 0) for j in range(2) for i in range(3)]
    indices = [0, 1, 4, 3, 1, 2, 5, 4]
    sizes = {"constant": 1, "uniform": 2, "varying": 6, "vertex": 6, "faceVarying": 8}
    for column, interpolation in enumerate(INTERPOLATIONS):
        count = sizes[interpolation]
        colors = [
            Gf.Vec3f(0.1 + 0.8 * k / max(count - 1, 1), 0.9 - 0.7 * k / max(count - 1, 1), 0.25 if k % 2 else 0.75)
            for k in range(count)
        ]
        for row, kind in enumerate(("color", "indexed", "opacity", "normals")):
            path = f"/World/{kind}_{interpolation}"
            prim = mesh(stage, path, points, [4, 4], indices, None if row < 2 else (0.6, 0.6, 0.6))
            prim.CreateDoubleSidedAttr(True)
            prim.AddTranslateOp().Set(Gf.Vec3d(1.1 * column - 2.2, 0.9 - 0.6 * row, 0))
            api = UsdGeom.PrimvarsAPI(prim)
            if kind == "color":
                prim.CreateDisplayColorPrimvar(interpolation).Set(Vt.Vec3fArray(colors))
            elif kind == "indexed":
                primvar = prim.CreateDisplayColorPrimvar(interpolation)
                # UsdImaging's legacy front end takes the first value of a constant colour whatever the index (25.08).
                palette = [Gf.Vec3f(0.9, 0.1, 0.1), Gf.Vec3f(0.1, 0.9, 0.1), Gf.Vec3f(0.1, 0.1, 0.9)][: min(count, 3)]
                primvar.Set(Vt.Vec3fArray(palette))
                primvar.SetIndices(Vt.IntArray([(2 * k + 1) % len(palette) for k in range(count)]))
            elif kind == "opacity":
                prim.CreateDisplayOpacityPrimvar(interpolation).Set(
                    Vt.FloatArray([0.2 + 0.6 * k / max(count - 1, 1) for k in range(count)])
                )
            else:
                tilted = [
                    Gf.Vec3f(0.5 * math.sin(2.0 * k), 0.5 * math.cos(2.0 * k), 1.0).GetNormalized()
                    for k in range(count)
                ]
                primvar = api.CreatePrimvar("normals", Sdf.ValueTypeNames.Normal3fArray, interpolation)
                primvar.Set(Vt.Vec3fArray(tilted))
    distant(stage, "/World/Sun", (0.0, 0.0, -1.0), math.pi)
    orthographic(stage, "/World/Camera", (0, 0, 6), (0, 0, 0), 5.6)


def smooth(stage):
    """One octahedron, as subdivision surface (smooth normals) and as polygon mesh (flat), without authored normals."""
    points = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    faces = [4, 0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 5, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3]
    for index, scheme in enumerate((UsdGeom.Tokens.catmullClark, UsdGeom.Tokens.none)):
        prim = mesh(stage, f"/World/{scheme}", points, [3] * 8, faces, (0.5, 0.5, 0.5))
        prim.CreateSubdivisionSchemeAttr(scheme)
        prim.AddTranslateOp().Set(Gf.Vec3d(2.4 * index - 1.2, 0, 0))
    distant(stage, "/World/Sun", (0.2, -0.3, -1.0), 2.0)
    orthographic(stage, "/World/Camera", (0, 0, 6), (0, 0, 0), 5.0)


def transforms(stage):
    """Nested transforms, one with resetXformStack, on boxes that tell where they are by colour."""
    parent = UsdGeom.Xform.Define(stage, "/World/Parent")
    parent.AddTranslateOp().Set(Gf.Vec3d(1.5, 0.5, 0))
    parent.AddRotateZOp().Set(30.0)
    box(stage, "/World/Parent/Child", (0.8, 0.2, 0.2)).AddTranslateOp().Set(Gf.Vec3d(0.6, 0, 0))
    free = box(stage, "/World/Parent/Reset", (0.2, 0.8, 0.2))
    free.AddTranslateOp().Set(Gf.Vec3d(-1.8, -0.8, 0))
    free.SetResetXformStack(True)
    skewed = box(stage, "/World/Skewed", (0.2, 0.2, 0.8))
    skewed.AddTransformOp().Set(Gf.Matrix4d(0.7, 0.2, 0, 0, -0.3, 0.9, 0.1, 0, 0, 0, 1.1, 0, -1.4, 1.3, -0.5, 1))
    dome(stage)
    camera(stage, "/World/Camera", (0, 0, 7), (0, 0, 0))


def cameras(stage):
    """Coloured boxes in a grid, and cameras that differ in one thing each."""
    for index in range(9):
        x, y = index % 3 - 1, index // 3 - 1
        prim = box(stage, f"/World/Box{index}", (0.2 + 0.3 * (x + 1), 0.2 + 0.3 * (y + 1), 0.5), 0.7)
        prim.AddTranslateOp().Set(Gf.Vec3d(1.3 * x, 1.3 * y, -0.6 * ((index * 5) % 4)))
    dome(stage)
    eye, target = (1.5, 1.0, 7.0), (0, 0, 0)
    camera(stage, "/World/Plain", eye, target)
    orthographic(stage, "/World/Orthographic", eye, target, 5.0)
    shifted = camera(stage, "/World/Offset", eye, target)
    shifted.CreateHorizontalApertureOffsetAttr(4.0)
    shifted.CreateVerticalApertureOffsetAttr(2.5)
    camera(stage, "/World/Wide", eye, target, aperture=(36.0, 18.0))
    camera(stage, "/World/Tall", eye, target, aperture=(14.0, 28.0))
    lens = camera(stage, "/World/Lens", eye, target)
    lens.CreateFStopAttr(0.4)
    lens.CreateFocusDistanceAttr(7.0)


def visibility(stage):
    """Squares that must not be seen (invisible, invisible parent, guide, proxy or render by choice) beside ones that
    must."""
    names = ["plain", "invisible", "child_of_invisible", "guide", "proxy", "render"]
    for index, name in enumerate(names):
        if name == "child_of_invisible":
            UsdGeom.Xform.Define(stage, "/World/HiddenParent").CreateVisibilityAttr(UsdGeom.Tokens.invisible)
        path = f"/World/HiddenParent/{name}" if name == "child_of_invisible" else f"/World/{name}"
        prim = quad(stage, path, 0.9, (0.1 + 0.15 * index, 0.5, 0.9 - 0.15 * index))
        prim.AddTranslateOp().Set(Gf.Vec3d(1.0 * index - 2.5, 0, 0))
        if name == "invisible":
            prim.CreateVisibilityAttr(UsdGeom.Tokens.invisible)
        if name in ("guide", "proxy", "render"):
            prim.CreatePurposeAttr(name)
    dome(stage)
    orthographic(stage, "/World/Camera", (0, 0, 6), (0, 0, 0), 6.0)


def far_away(stage):
    """Millimetre steps at ten thousand kilometres from the origin: three small squares one behind the other."""
    world = UsdGeom.Xform(stage.GetPrimAtPath("/World"))
    world.AddTranslateOp().Set(Gf.Vec3d(1.0e7, -2.0e6, 3.0e6))
    for index in range(3):
        prim = quad(stage, f"/World/Step{index}", 0.004, (0.9, 0.3 * index, 0.1))
        prim.AddTranslateOp().Set(Gf.Vec3d(0.002 * (index - 1), 0.001 * index, 0.001 * index))
    dome(stage)
    prim = orthographic(stage, "/World/Camera", (0, 0, 0.1), (0, 0, 0), 0.01)
    prim.CreateClippingRangeAttr(Gf.Vec2f(0.01, 1.0))


def glow(stage):
    """A small closed-in corner with colour bleeding, opacity, sun, dome: the picture that seeds and edits are tried
    on."""
    floor = quad(stage, "/World/Floor", 6.0, (0.6, 0.6, 0.6))
    floor.AddRotateXOp().Set(-90.0)
    wall = quad(stage, "/World/Wall", 6.0, (0.8, 0.2, 0.1))
    wall.AddTranslateOp().Set(Gf.Vec3d(-1.5, 0, 0))
    wall.AddRotateYOp().Set(90.0)
    cube = box(stage, "/World/Box", (0.2, 0.6, 0.8))
    cube.AddTranslateOp().Set(Gf.Vec3d(0, 0.5, 0))
    veil = quad(stage, "/World/Veil", 1.0, (0.9, 0.9, 0.9))
    veil.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.constant).Set(Vt.FloatArray([0.5]))
    veil.AddTranslateOp().Set(Gf.Vec3d(0.9, 0.6, 1.0))
    instancer(
        stage, "/World/Pebbles", ["/World/Pebbles/Ball"], [0] * 5, [(1.6 - 0.7 * i, 0.2, 1.4) for i in range(5)],
        scales=[(0.2, 0.2, 0.2)] * 5,
    )
    ball(stage, "/World/Pebbles/Ball", 1.0, 5, (0.9, 0.8, 0.3))
    dome(stage, 0.4)
    distant(stage, "/World/Sun", (-0.5, -1.0, -0.4), 2.5, angle=2.0, color=(1.0, 0.9, 0.8))
    camera(stage, "/World/Camera", (2.5, 2.4, 5.0), (0, 0.4, 0))


SCENES = [
    furnace, lambert, sun_disk, nested, flattened, native, hidden_instances, implicit, polygons, mirrored, primvars,
    smooth,
    transforms, cameras, visibility, far_away, bad_data, glow,
]  # fmt: skip


def build(scene, doc: str = "") -> Usd.Stage:
    """The scene on a new in-memory stage; `doc` is the layer's comment, the scene's docstring by default."""
    stage = Usd.Stage.CreateInMemory(f"{scene.__name__}.usda")
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    stage.GetRootLayer().comment = " ".join((doc or scene.__doc__).split())
    scene(stage)
    return stage


def text(scene) -> str:
    """The scene as .usda text."""
    stage = build(scene)
    return stage.GetRootLayer().ExportToString()


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for scene in SCENES:
        (FOLDER / f"{scene.__name__}.usda").write_text(text(scene))
    print(f"wrote {len(SCENES)} scenes to {FOLDER}", file=sys.stderr)


if __name__ == "__main__":
    main()
