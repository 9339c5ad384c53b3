# SPDX-License-Identifier: Apache-2.0
"""What the small scenes are made of: meshes, cameras, lights and instancers in one call each. Needs any pxr."""

from __future__ import annotations

import math

from pxr import Gf, Sdf, UsdGeom, UsdLux, Vt


def mesh(stage, path, points, counts, indices, color=(0.5, 0.5, 0.5)):
    """A polygon mesh without subdivision, constant colour (None = no displayColor)."""
    prim = UsdGeom.Mesh.Define(stage, path)
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreatePointsAttr(Vt.Vec3fArray([Gf.Vec3f(*point) for point in points]))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray(list(counts)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray(list(indices)))
    if color is not None:
        prim.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set(Vt.Vec3fArray([Gf.Vec3f(*color)]))
    return prim


def quad(stage, path, size=1.0, color=(0.5, 0.5, 0.5)):
    """A square in the xy plane, facing +z."""
    half = size / 2
    corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    return mesh(stage, path, corners, [4], [0, 1, 2, 3], color)


def box(stage, path, color=(0.5, 0.5, 0.5), size=1.0):
    """A cube of six quads about the origin."""
    half = size / 2
    points = [(x, y, z) for z in (-half, half) for y in (-half, half) for x in (-half, half)]
    faces = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]
    return mesh(stage, path, points, [4] * 6, faces, color)


def ball(stage, path, radius=1.0, rings=12, color=(0.5, 0.5, 0.5)):
    """A closed sphere of triangles and quads, convex and flat shaded."""
    sides = 2 * rings
    points = [(0.0, radius, 0.0)]
    for ring in range(1, rings):
        polar = math.pi * ring / rings
        for side in range(sides):
            angle = 2 * math.pi * side / sides
            points.append((
                radius * math.sin(polar) * math.sin(angle), radius * math.cos(polar),
                radius * math.sin(polar) * math.cos(angle),
            ))
    points.append((0.0, -radius, 0.0))
    at = lambda ring, side: 1 + (ring - 1) * sides + side % sides
    counts, indices = [], []
    for side in range(sides):
        counts.append(3)
        indices += [0, at(1, side), at(1, side + 1)]
        for ring in range(1, rings - 1):
            # Two triangles: the four corners of a ring's cell are in one plane only up to rounding.
            counts += [3, 3]
            indices += [at(ring, side), at(ring + 1, side), at(ring + 1, side + 1)]
            indices += [at(ring, side), at(ring + 1, side + 1), at(ring, side + 1)]
        counts.append(3)
        indices += [at(rings - 1, side), len(points) - 1, at(rings - 1, side + 1)]
    return mesh(stage, path, points, counts, indices, color)


def camera(stage, path, eye, target, aperture=(24.0, 24.0), focal=30.0, up=(0, 1, 0)):
    """A perspective pinhole camera that looks from `eye` to `target`."""
    prim = UsdGeom.Camera.Define(stage, path)
    look = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*eye), Gf.Vec3d(*target), Gf.Vec3d(*up)).GetInverse()
    prim.AddTransformOp().Set(look)
    prim.CreateHorizontalApertureAttr(aperture[0])
    prim.CreateVerticalApertureAttr(aperture[1])
    prim.CreateFocalLengthAttr(focal)
    prim.CreateClippingRangeAttr(Gf.Vec2f(0.1, 1000.0))
    return prim


def orthographic(stage, path, eye, target, width, up=(0, 1, 0)):
    """An orthographic camera whose image is `width` scene units wide and high."""
    prim = camera(stage, path, eye, target, aperture=(10.0 * width, 10.0 * width), up=up)
    prim.CreateProjectionAttr(UsdGeom.Tokens.orthographic)
    return prim


def dome(stage, radiance=1.0):
    light = UsdLux.DomeLight.Define(stage, "/World/Dome")
    light.CreateIntensityAttr(radiance)
    return light


def distant(stage, path, direction, irradiance, angle=0.0, color=(1, 1, 1)):
    """Light that travels along `direction` and gives a facing surface `irradiance`."""
    light = UsdLux.DistantLight.Define(stage, path)
    light.CreateIntensityAttr(irradiance)
    light.CreateAngleAttr(angle)
    light.CreateColorAttr(Gf.Vec3f(*color))
    light.CreateNormalizeAttr(True)
    turn = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 0, -1), Gf.Vec3d(*direction)))
    light.AddTransformOp().Set(turn)
    return light


def instancer(stage, path, prototypes, kinds, positions, orientations=None, scales=None):
    """A point instancer; prototypes are paths, orientations (w, x, y, z)."""
    prim = UsdGeom.PointInstancer.Define(stage, path)
    prim.CreatePrototypesRel().SetTargets([Sdf.Path(target) for target in prototypes])
    prim.CreateProtoIndicesAttr(Vt.IntArray(list(kinds)))
    prim.CreatePositionsAttr(Vt.Vec3fArray([Gf.Vec3f(*position) for position in positions]))
    if orientations is not None:
        prim.CreateOrientationsfAttr(Vt.QuatfArray([Gf.Quatf(*turn) for turn in orientations]))
    if scales is not None:
        prim.CreateScalesAttr(Vt.Vec3fArray([Gf.Vec3f(*scale) for scale in scales]))
    return prim


def turned(axis, degrees):
    """A quaternion (w, x, y, z)."""
    half = math.radians(degrees) / 2
    return (math.cos(half), *(math.sin(half) * component for component in axis))
