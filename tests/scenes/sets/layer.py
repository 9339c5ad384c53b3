# SPDX-License-Identifier: Apache-2.0
"""Writes what `shapes` makes into USD files of any up axis and unit.

Generators count in metres with z up. A `Layer` turns that into its own: so files differ as those of different programs
do, and their generators do not.
"""

from __future__ import annotations

import argparse
import pathlib

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdRender, UsdShade, UsdUtils, Vt

import images
import shading
from .shapes import Shape

CAMERA = UsdUtils.GetPrimaryCameraName()
"""Pixar's usdrecord finds a camera of this name without being told."""


class Layer:
    """One USD file under way; everything is below its default prim."""

    def __init__(self, path: pathlib.Path, name: str, up: str, unit: float, kind: str = "component") -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path, self.up, self.unit, self.root = path, up, unit, f"/{name}"
        self.stage = Usd.Stage.CreateNew(str(path))
        UsdGeom.SetStageUpAxis(self.stage, up)
        UsdGeom.SetStageMetersPerUnit(self.stage, unit)
        prim = UsdGeom.Xform.Define(self.stage, self.root).GetPrim()
        Usd.ModelAPI(prim).SetKind(kind)
        self.stage.SetDefaultPrim(prim)

    def save(self) -> None:
        """Groups that were made by naming what is in them get a type: importers lose what is below a prim without."""
        layer = self.stage.GetRootLayer()

        def give_type(path):
            spec = layer.GetPrimAtPath(path) if path.IsPrimPath() else None
            if spec and spec.specifier == Sdf.SpecifierDef and not spec.typeName:
                spec.typeName = "Scope" if spec.name == "Looks" else "Xform"

        layer.Traverse(Sdf.Path.absoluteRootPath, give_type)
        layer.Save()

    def at(self, name: str) -> str:
        return f"{self.root}/{name}"

    def turned(self, values) -> np.ndarray:
        """Directions from z up to this file's axis."""
        values = np.asarray(values, float)
        return values if self.up == "Z" else np.stack([values[..., 0], values[..., 2], -values[..., 1]], -1)

    def lengths(self, values) -> np.ndarray:
        return self.turned(values) / self.unit

    def vectors(self, values) -> Vt.Vec3fArray:
        return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(self.lengths(values), np.float32))

    def mesh(self, path: str, shape: Shape, material=None, scheme="none", double=False, st_scale=1.0):
        """A mesh; `points` may be given samples afterwards by `samples`."""
        mesh = UsdGeom.Mesh.Define(self.stage, path)
        points = self.vectors(shape.points)
        mesh.CreatePointsAttr(points)
        mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(shape.faces.ravel(), np.int32)))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(shape.faces), shape.faces.shape[1]))
        mesh.CreateSubdivisionSchemeAttr(scheme)
        if double:
            mesh.CreateDoubleSidedAttr(True)
        st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
        st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(shape.st * st_scale, np.float32)))
        if material:
            shading.bind(mesh, material)
        return mesh

    def smooth(self, mesh, shape: Shape) -> None:
        """Normals of the points, from the areas of the faces about them."""
        corners = shape.points[shape.faces]
        facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        if shape.faces.shape[1] == 4:
            facing += np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 0])
        normals = np.zeros_like(shape.points)
        for corner in range(shape.faces.shape[1]):
            np.add.at(normals, shape.faces[:, corner], facing)
        # The two ends of a closed seam are points of their own at one place.
        _, same = np.unique(np.round(shape.points, 6), axis=0, return_inverse=True)
        summed = np.zeros((same.max() + 1, 3))
        np.add.at(summed, same.ravel(), normals)
        normals = summed[same.ravel()]
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(self.turned(normals), np.float32)))
        mesh.SetNormalsInterpolation("vertex")

    def samples(self, prim, frames: dict) -> None:
        """Points at times, beside those of no time; the extent holds all of them."""
        box = []
        for time, points in frames.items():
            prim.GetPointsAttr().Set(self.vectors(points), time)
            box.append(self.lengths(points))
        box = np.concatenate(box)
        width = np.max(prim.GetWidthsAttr().Get()) / 2 if hasattr(prim, "GetWidthsAttr") else 0.0
        ends = [Gf.Vec3f(*map(float, box.min(axis=0) - width)), Gf.Vec3f(*map(float, box.max(axis=0) + width))]
        prim.CreateExtentAttr(Vt.Vec3fArray(ends))

    def curves(self, path: str, strands: np.ndarray, widths: np.ndarray, material=None, basis="bspline"):
        """Cubic curves: strands (count, points, 3), widths (count, points)."""
        curves = UsdGeom.BasisCurves.Define(self.stage, path)
        curves.CreateTypeAttr("cubic")
        curves.CreateBasisAttr(basis)
        curves.CreateWrapAttr("pinned")
        curves.CreateCurveVertexCountsAttr(Vt.IntArray(len(strands), strands.shape[1]))
        points = self.vectors(strands.reshape(-1, 3))
        wide = Vt.FloatArray.FromNumpy(np.ascontiguousarray(widths.ravel() / self.unit, np.float32))
        curves.CreatePointsAttr(points)
        curves.CreateWidthsAttr(wide)
        curves.SetWidthsInterpolation("vertex")
        curves.CreateExtentAttr(UsdGeom.Curves.ComputeExtent(points, wide))
        if material:
            shading.bind(curves, material)
        return curves

    def dots(self, path: str, places: np.ndarray, widths: np.ndarray, material=None):
        made = UsdGeom.Points.Define(self.stage, path)
        points = self.vectors(places)
        wide = Vt.FloatArray.FromNumpy(np.ascontiguousarray(widths / self.unit, np.float32))
        made.CreatePointsAttr(points)
        made.CreateWidthsAttr(wide)
        made.SetWidthsInterpolation("vertex")
        made.CreateExtentAttr(UsdGeom.Points.ComputeExtent(points, wide))
        if material:
            shading.bind(made, material)
        return made

    def instancer(self, path: str, prototypes: list[str], kinds, places, turns=None, scales=None):
        """A point instancer; prototypes are paths, turns (w, x, y, z)."""
        made = UsdGeom.PointInstancer.Define(self.stage, path)
        made.CreatePrototypesRel().SetTargets([Sdf.Path(target) for target in prototypes])
        made.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(kinds, np.int32)))
        made.CreatePositionsAttr(self.vectors(places))
        if turns is not None:
            axis = self.turned(turns[:, 1:])
            packed = np.ascontiguousarray(np.concatenate([axis, turns[:, :1]], 1), np.float16)
            made.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(packed))
        if scales is not None:
            scales = np.asarray(scales, np.float32)
            scales = np.repeat(scales[:, None], 3, 1) if scales.ndim == 1 else np.abs(self.turned(scales))
            made.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(scales, np.float32)))
        return made

    def xform(self, path: str, place=(0, 0, 0), degrees=0.0, scale=1.0, kind=""):
        """An Xform that stands at a place, turned about the up axis."""
        made = UsdGeom.Xform.Define(self.stage, path)
        made.AddTranslateOp().Set(Gf.Vec3d(*map(float, self.lengths(place))))
        (made.AddRotateZOp() if self.up == "Z" else made.AddRotateYOp()).Set(float(degrees))
        if scale != 1.0:
            made.AddScaleOp().Set(Gf.Vec3f(float(scale)))
        if kind:
            Usd.ModelAPI(made.GetPrim()).SetKind(kind)
        return made

    def use(self, path: str, file: str, payload=False, instance=False, **placed):
        """Another file's default prim, placed; `file` is as the layer writes it."""
        made = self.xform(path, **placed)
        (made.GetPrim().GetPayloads().AddPayload if payload else made.GetPrim().GetReferences().AddReference)(file)
        if instance:
            made.GetPrim().SetInstanceable(True)
        return made

    def look(self, name: str, **inputs) -> UsdShade.Material:
        """A UsdPreviewSurface below Looks."""
        return shading.material(self.stage, self.at(f"Looks/{name}"), **inputs)

    def texture(self, look: str, name: str, file: str, **options):
        """A file's colour as an output to connect; below the look's name, which may come later."""
        return shading.sample(self.stage, self.at(f"Looks/{look}/{name}"), file, **options)

    def towards(self, prim, eye, target) -> None:
        """Places a camera or a light so that it looks (shines) from `eye` to `target`."""
        eye, target = (Gf.Vec3d(*map(float, self.lengths(place))) for place in (eye, target))
        up = Gf.Vec3d(*map(float, self.turned((0, 0, 1))))
        prim.AddTransformOp().Set(Gf.Matrix4d().SetLookAt(eye, target, up).GetInverse())

    def sun(self, name: str, irradiance: float, angle: float, color, eye) -> None:
        """A distant light that shines from `eye` to the origin, `irradiance` on what faces it."""
        light = UsdLux.DistantLight.Define(self.stage, self.at(f"Lights/{name}"))
        light.CreateNormalizeAttr(True)
        light.CreateIntensityAttr(irradiance)
        light.CreateAngleAttr(angle)
        light.CreateColorAttr(Gf.Vec3f(*color))
        self.towards(light, eye, (0, 0, 0))

    def camera(self, eye, target, focal=28.0, near=0.1, far=5000.0) -> UsdGeom.Camera:
        """The camera `main_cam` of 16:9, and render settings that name it."""
        camera = UsdGeom.Camera.Define(self.stage, self.at(CAMERA))
        self.towards(camera, eye, target)
        camera.CreateHorizontalApertureAttr(36.0)
        camera.CreateVerticalApertureAttr(20.25)
        camera.CreateFocalLengthAttr(focal)
        camera.CreateClippingRangeAttr(Gf.Vec2f(near / self.unit, far / self.unit))
        self._settings(camera)
        return camera

    def _settings(self, camera) -> None:
        """Render settings with a product, for `usdrecord --renderSettingsPrimPath /Render/Settings`. The stage does not
        name them as its own: then a command line could not say how large and where to."""
        UsdGeom.Scope.Define(self.stage, "/Render")
        settings = UsdRender.Settings.Define(self.stage, "/Render/Settings")
        settings.CreateCameraRel().SetTargets([camera.GetPath()])
        settings.CreateResolutionAttr(Gf.Vec2i(640, 360))
        settings.CreateIncludedPurposesAttr(["default", "render"])
        color = UsdRender.Var.Define(self.stage, "/Render/Color")
        color.CreateDataTypeAttr("color4f")
        color.CreateSourceNameAttr("color")
        product = UsdRender.Product.Define(self.stage, "/Render/Picture")
        product.CreateProductNameAttr(f"{self.root[1:].lower()}.exr")
        product.CreateOrderedVarsRel().SetTargets([color.GetPath()])
        settings.CreateProductsRel().SetTargets([product.GetPath()])


def picture(path: pathlib.Path, values: np.ndarray, bits: int = 8) -> None:
    """A PNG of values from 0 to 1, row 0 at the top."""
    path.parent.mkdir(parents=True, exist_ok=True)
    top = (1 << bits) - 1
    array = np.rint(np.clip(values, 0, 1) * top).astype(np.uint8 if bits == 8 else np.uint16)
    images.png(path, array, packed=True)


def run(name: str, build, texture: int) -> None:
    """The command line of a generator: `build(folder, seed, size, texture)` writes the set."""
    parser = argparse.ArgumentParser(prog=f"sets.{name}")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=0, help="even: for tuning; odd: held out, for figures")
    parser.add_argument("--size", type=float, default=1.0, help="how much there is, against a set for a GPU")
    parser.add_argument("--texture", type=int, default=texture, help="texels along a side of the larger files")
    given = parser.parse_args()
    if given.size <= 0 or given.texture < 4:
        parser.error("--size above 0 and --texture of at least 4")
    print(build(given.folder, given.seed, given.size, given.texture))


def many(base: float, size: float, least: int = 1) -> int:
    """A number that grows with the size of the set."""
    return max(int(round(base * size)), least)
