# SPDX-License-Identifier: Apache-2.0
"""Feature scenes of materials; answers in tests/hydra/test_features_materials.py. Written by features.py.

Where not said otherwise: squares in the plane z = 0 facing +z, one unit from the next, seen straight on by an
orthographic camera. Pictures are made of squares of 8 x 8 texels of one value, so that what is in their middles does
not depend on filters.
"""

from __future__ import annotations

import math

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

import images
import parts
import patterns
import shading
from feature_lights import slope_map

EIGHT = np.array(
    [
        [(200, 40, 90), (30, 180, 60), (60, 90, 220), (240, 240, 240)],
        [(128, 64, 32), (16, 32, 64), (99, 199, 149), (7, 77, 177)],
    ],
    dtype=np.uint8,
)
"""Eight colours, rows from the top."""


def write_eight(folder):
    images.png(folder / "maps/eight.png", patterns.blocks(EIGHT, 8))


def row(stage, looks, camera_width=None, size=0.9):
    """A row of squares with st, one per material, and the camera."""
    for index, look in enumerate(looks):
        square = parts.quad(stage, f"/World/Square{index}", size, None)
        square.AddTranslateOp().Set(Gf.Vec3d(index - (len(looks) - 1) / 2, 0, 0))
        shading.coordinates(square, [(0, 0), (1, 0), (1, 1), (0, 1)])
        if look is not None:
            shading.bind(square, look)
    parts.orthographic(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), camera_width or float(len(looks)))


def glow(stage, name, value, **inputs):
    """A black material that shows `value`."""
    return shading.material(
        stage, f"/World/Looks/{name}", diffuseColor=(0, 0, 0), emissiveColor=value, useSpecularWorkflow=1,
        specularColor=(0, 0, 0), roughness=1.0, **inputs,
    )


def material_emission(stage, folder):
    """Four squares that glow, in the dark."""
    row(
        stage,
        [
            glow(stage, f"Glow{index}", color)
            for index, color in enumerate(((1, 0, 0), (0.25, 0.5, 0.75), (4, 2, 1), (0, 0, 0)))
        ],
    )


def material_mirror(stage, folder):
    """Mirrors of four albedos in a white world: each shows its albedo."""
    row(
        stage,
        [
            shading.material(stage, f"/World/Looks/Mirror{index}", diffuseColor=color, metallic=1.0, roughness=0.0)
            for index, color in enumerate(MIRRORS)
        ],
    )
    parts.dome(stage)


MIRRORS = ((1, 1, 1), (0.5, 0.25, 0.125), (0.9, 0.1, 0.6), (0, 0, 0))
METAL_ROUGHNESS = (0.0, 0.15, 0.35, 0.6, 1.0)


def material_furnace_metal(stage, folder):
    """White metals of five roughnesses in a white world: nothing is lost, nothing gained."""
    row(
        stage,
        [
            shading.material(stage, f"/World/Looks/Metal{index}", diffuseColor=(1, 1, 1), metallic=1.0, roughness=value)
            for index, value in enumerate(METAL_ROUGHNESS)
        ],
    )
    parts.dome(stage)


def material_furnace_plastic(stage, folder):
    """White dielectrics of five roughnesses in a white world: nothing may be gained."""
    row(
        stage,
        [
            shading.material(stage, f"/World/Looks/Plastic{index}", diffuseColor=(1, 1, 1), roughness=value)
            for index, value in enumerate(METAL_ROUGHNESS)
        ],
    )
    parts.dome(stage)


IORS = (1.0, 1.33, 1.5, 2.0)
SPECULARS = ((0.2, 0.4, 0.6), (1, 1, 1), (0, 0, 0), (0.04, 0.04, 0.04))


def material_fresnel(stage, folder):
    """Smooth black dielectrics of four iors (lower row) and of four specular colours (upper), straight on in a white
    world: each shows its F0."""
    for index in range(4):
        for level, inputs in enumerate(
            (dict(ior=IORS[index]), dict(useSpecularWorkflow=1, specularColor=SPECULARS[index]))
        ):
            square = parts.quad(stage, f"/World/Square{level}{index}", 0.9, None)
            square.AddTranslateOp().Set(Gf.Vec3d(index - 1.5, level - 0.5, 0))
            shading.bind(
                square,
                shading.material(
                    stage, f"/World/Looks/Black{level}{index}", diffuseColor=(0, 0, 0), roughness=0.0, **inputs
                ),
            )
    parts.dome(stage)
    parts.orthographic(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), 4.0)


def material_coat(stage, folder):
    """Smooth coats of 0, 1/2 and 1 over a black base of F0 = 0, straight on in a white world."""
    looks = [
        shading.material(
            stage, f"/World/Looks/Coat{index}", diffuseColor=(0, 0, 0), useSpecularWorkflow=1, specularColor=(0, 0, 0),
            roughness=1.0, clearcoat=value, clearcoatRoughness=0.0,
        )
        for index, value in enumerate((0.0, 0.5, 1.0))
    ]
    row(stage, looks)
    parts.dome(stage)


def material_glass(stage, folder):
    """A tilted block of clear glass in a white world: all light comes out again, so it cannot be seen."""
    block = parts.box(stage, "/World/Block", None, 1.0)
    block.AddRotateXYZOp().Set(Gf.Vec3f(35, 25, 10))
    shading.bind(
        block,
        shading.material(stage, "/World/Looks/Glass", diffuseColor=(1, 1, 1), opacity=0.0, roughness=0.0, ior=1.5),
    )
    parts.dome(stage)
    parts.orthographic(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), 2.0)


def material_cutout(stage, folder):
    """A square whose opacity is 0.2, 0.4, 0.6, 0.8 from left to right with a threshold of 1/2, over a square that
    glows."""
    alpha = np.array([[51, 102, 153, 204]], dtype=np.uint8)
    images.png(folder / "maps/alpha.png", patterns.blocks(alpha[..., None], 8)[:, :, 0])
    opacity = shading.sample(stage, "/World/Looks/Leaf/Opacity", "./maps/alpha.png", "r", wrap="clamp")
    row(stage, [glow(stage, "Leaf", (1.0, 0.5, 0.25), opacity=opacity, opacityThreshold=0.5)], 1.0, 1.0)
    back = parts.quad(stage, "/World/Back", 4.0, None)
    back.AddTranslateOp().Set(Gf.Vec3d(0, 0, -1))
    shading.bind(back, glow(stage, "Back", (0.0, 0.25, 2.0)))


def material_cutout_shadow(stage, folder):
    """The same square as a roof of the floor under a sun: its shadow has the holes, texture and all."""
    parts.quad(stage, "/World/Floor", 3.0, (0.5, 0.5, 0.5)).AddRotateXOp().Set(-90.0)
    roof = parts.mesh(stage, "/World/Roof", [(-1, 2, 1), (1, 2, 1), (1, 2, -1), (-1, 2, -1)], [4], range(4), None)
    shading.coordinates(roof, [(0, 0), (1, 0), (1, 1), (0, 1)])
    images.png(
        folder / "maps/alpha.png", patterns.blocks(np.array([[[51], [102], [153], [204]]], dtype=np.uint8), 8)[:, :, 0]
    )
    opacity = shading.sample(stage, "/World/Looks/Leaf/Opacity", "./maps/alpha.png", "r", wrap="clamp")
    shading.bind(
        roof,
        shading.material(
            stage, "/World/Looks/Leaf", diffuseColor=(0, 0, 0), opacity=opacity, opacityThreshold=0.5, roughness=1.0
        ),
    )
    parts.distant(stage, "/World/Sun", (0, -1, 0), math.pi)
    parts.orthographic(stage, "/World/Camera", (0, 1, 0), (0, 0, 0), 2.0, up=(0, 0, -1))


NORMALS = ((0.0, 0.0, 1.0), (0.3, 0.0, 0.954), (0.0, 0.3, 0.954), (-0.25, -0.25, 0.935))


def material_normal_map(stage, folder):
    """Mirrors with normal maps of one direction each under a sloped latlong: the direction they show tells the normal,
    its sign and its frame."""
    slope_map(folder)
    looks = []
    for index, normal in enumerate(NORMALS):
        encoded = np.rint((np.array(normal) * 0.5 + 0.5) * 65535).astype(np.uint16)
        images.png(folder / f"maps/normal{index}.png", np.broadcast_to(encoded, (8, 8, 3)))
        path = f"/World/Looks/Bent{index}"
        looks.append(
            shading.material(
                stage, path, diffuseColor=(1, 1, 1), metallic=1.0, roughness=0.0,
                normal=shading.normal_map(stage, f"{path}/Normal", f"./maps/normal{index}.png"),
            )
        )
    row(stage, looks)
    parts.dome(stage).CreateTextureFileAttr("./maps/slope.exr")


def material_subsets(stage, folder):
    """Four faces of one mesh: two GeomSubsets with materials of their own, one face in both (the first has it), one in
    none."""
    points = [(x, y, 0) for y in (-0.5, 0.5) for x in (-2, -1, 0, 1, 2)]
    prim = parts.mesh(
        stage, "/World/Strip", points, [4] * 4, [c for i in range(4) for c in (i, i + 1, i + 6, i + 5)], None
    )
    shading.bind(prim, glow(stage, "Whole", (0.1, 0.2, 0.3)))
    shading.subset(prim, "first", [0, 1], glow(stage, "First", (1.0, 0.0, 0.5)))
    shading.subset(prim, "second", [2], glow(stage, "Second", (0.0, 1.0, 0.25)))
    parts.orthographic(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), 4.0)


def material_collection(stage, folder):
    """A binding on the parent, one on the prim, and a collection that binds one square from above."""
    row(stage, [None, None, None])
    world = stage.GetPrimAtPath("/World")
    shading.bind(world, glow(stage, "Parent", (0.5, 0.25, 0.0)))
    shading.bind(stage.GetPrimAtPath("/World/Square1"), glow(stage, "Own", (0.0, 0.5, 0.25)))
    chosen = Usd.CollectionAPI.Apply(world, "chosen")
    chosen.CreateIncludesRel().AddTarget("/World/Square2")
    picked = glow(stage, "Chosen", (0.25, 0.0, 0.5))
    UsdShade.MaterialBindingAPI.Apply(world).Bind(chosen, picked, "chosen")


def material_primvars(stage, folder):
    """Emission read from a primvar at every interpolation, and a reader's fallback where the mesh has no such
    primvar."""
    look = glow(stage, "Tint", shading.primvar(stage, "/World/Looks/Tint/Reader", "tint", "float3", (0.3, 0.6, 0.9)))
    counts = {"constant": 1, "uniform": 2, "varying": 6, "vertex": 6, "faceVarying": 8, None: 0}
    for index, (interpolation, count) in enumerate(counts.items()):
        points = [(0.45 * i - 0.45, 0.45 * j - 0.225, 0) for j in range(2) for i in range(3)]
        prim = parts.mesh(stage, f"/World/Patch{index}", points, [4, 4], [0, 1, 4, 3, 1, 2, 5, 4], None)
        prim.AddTranslateOp().Set(Gf.Vec3d(index - 2.5, 0, 0))
        shading.bind(prim, look)
        if interpolation:
            values = [Gf.Vec3f(0.125 * (k + 1), 1 - 0.0625 * k, 0.5 * (k % 2)) for k in range(count)]
            UsdGeom.PrimvarsAPI(prim).CreatePrimvar("tint", Sdf.ValueTypeNames.Float3Array, interpolation).Set(
                Vt.Vec3fArray(values)
            )
    parts.orthographic(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), 6.0)


def material_instance_primvars(stage, folder):
    """Four instances of one square; its emission is an instance-rate primvar of the instancer."""
    prim = parts.instancer(stage, "/World/Row", ["/World/Row/Square"], [0] * 4, [(k - 1.5, 0, 0) for k in range(4)])
    parts.quad(stage, "/World/Row/Square", 0.9, None)
    shading.bind(
        stage.GetPrimAtPath("/World/Row/Square"),
        glow(stage, "Tint", shading.primvar(stage, "/World/Looks/Tint/Reader", "tint", "float3", (9, 9, 9))),
    )
    values = [Gf.Vec3f(0.25 * k, 1 - 0.25 * k, 0.5) for k in range(4)]
    UsdGeom.PrimvarsAPI(prim).CreatePrimvar("tint", Sdf.ValueTypeNames.Float3Array, "vertex").Set(Vt.Vec3fArray(values))
    parts.orthographic(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), 4.0)


def material_display_color(stage, folder):
    """Meshes without a material: Lambert of displayColor, also where the instancer gives it per instance; 0.18 without
    one. Under a sun straight on."""
    prim = parts.instancer(stage, "/World/Row", ["/World/Row/Square"], [0] * 3, [(k - 1.5, 0, 0) for k in range(3)])
    parts.quad(stage, "/World/Row/Square", 0.9, None)
    UsdGeom.PrimvarsAPI(prim).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "vertex").Set(
        Vt.Vec3fArray([Gf.Vec3f(0.25 * (k + 1), 0.5, 0.1 * k) for k in range(3)])
    )
    parts.quad(stage, "/World/Grey", 0.9, None).AddTranslateOp().Set(Gf.Vec3d(1.5, 0, 0))
    parts.distant(stage, "/World/Sun", (0, 0, -1), math.pi)
    parts.orthographic(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), 4.0)


OUTER_COLORS = ((0.8, 0.2, 0.4), (0.1, 0.6, 0.3))
NATIVE_COLORS = ((0.9, 0.2, 0.1), (0.1, 0.2, 0.9))
CONSTANT_COLOR = (0.3, 0.7, 0.2)
OWN_COLOR = (0.5, 0.25, 0.75)


def colored(prim, interpolation, colors):
    """Authors displayColor."""
    values = Vt.Vec3fArray([Gf.Vec3f(*color) for color in colors])
    UsdGeom.PrimvarsAPI(prim).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, interpolation).Set(values)


def material_instance_levels(stage, folder):
    """Whose displayColor wins: the outer of two nested instancers twice two times, those of two native instances, one
    that a prototype inherits as a constant, the mesh's own. Under a sun straight on."""
    outer = parts.instancer(stage, "/World/Outer", ["/World/Outer/Pair"], [0, 0], [(-3, 0, 0), (-1, 0, 0)])
    colored(outer, "vertex", OUTER_COLORS)
    stage.DefinePrim("/World/Outer/Pair", "Xform")
    parts.instancer(
        stage, "/World/Outer/Pair/Inner", ["/World/Outer/Pair/Inner/Square"], [0, 0], [(-0.5, 0, 0), (0.5, 0, 0)]
    )
    parts.quad(stage, "/World/Outer/Pair/Inner/Square", 0.9, None)
    stage.CreateClassPrim("/Source")
    parts.quad(stage, "/Source/Square", 0.9, None)
    for index, color in enumerate(NATIVE_COLORS):
        native = UsdGeom.Xform.Define(stage, f"/World/Native{index}")
        native.AddTranslateOp().Set(Gf.Vec3d(index + 0.5, 0, 0))
        native.GetPrim().GetReferences().AddInternalReference("/Source")
        native.GetPrim().SetInstanceable(True)
        colored(native, "constant", [color])
    constant = parts.instancer(stage, "/World/Constant", ["/World/Constant/Square"], [0], [(2.5, 0, 0)])
    colored(constant, "constant", [CONSTANT_COLOR])
    parts.quad(stage, "/World/Constant/Square", 0.9, None)
    own = parts.instancer(stage, "/World/Own", ["/World/Own/Square"], [0], [(3.5, 0, 0)])
    colored(own, "vertex", [(1, 1, 1)])
    parts.quad(stage, "/World/Own/Square", 0.9, OWN_COLOR)
    parts.distant(stage, "/World/Sun", (0, 0, -1), math.pi)
    parts.orthographic(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), 8.0)


SCENES = [
    material_emission, material_mirror, material_furnace_metal, material_furnace_plastic, material_fresnel,
    material_coat, material_glass, material_cutout, material_cutout_shadow, material_normal_map, material_subsets,
    material_collection, material_primvars, material_instance_primvars, material_display_color,
    material_instance_levels,
]  # fmt: skip
