# SPDX-License-Identifier: Apache-2.0
"""displayColor, displayOpacity and normals in every interpolation, indexed too: the picture against numpy, value by
value."""

import itertools

import numpy as np
import pytest
from pxr import UsdGeom

import compare
import reference
import small

SIZE = (112, 112)
SAMPLES = 64


def corner_values(prim, name) -> np.ndarray:
    """The primvar at the four corners of both faces: (2, 4, components)."""
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
    values = np.array(primvar.ComputeFlattened(), dtype=np.float64).reshape(len(primvar.ComputeFlattened()), -1)
    indices = np.array(UsdGeom.Mesh(prim).GetFaceVertexIndicesAttr().Get()).reshape(2, 4)
    interpolation = primvar.GetInterpolation()
    if interpolation == "constant":
        return np.broadcast_to(values[0], (2, 4, values.shape[1]))
    if interpolation == "uniform":
        return np.broadcast_to(values[:, None], (2, 4, values.shape[1]))
    return values.reshape(2, 4, -1) if interpolation == "faceVarying" else values[indices]


def interpolations(corners: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Value at (u, v) of a square with corner values (4, k), split along either diagonal: (2, n, k)."""
    a, b, c, d = (corner[None] for corner in corners)
    u, v = u[:, None], v[:, None]
    by_ac = np.where(u >= v, a + (b - a) * u + (c - b) * v, a + (c - d) * u + (d - a) * v)
    by_bd = np.where(u + v <= 1, a + (b - a) * u + (d - a) * v, c + (d - c) * (1 - u) + (b - c) * (1 - v))
    return np.stack([by_ac, by_bd])


@pytest.fixture(scope="module")
def stage():
    return small.build(small.primvars)


@pytest.fixture(scope="module")
def patches(stage):
    """Per patch and face: mask of its pixels, and (u, v) of their centres."""
    hits = reference.first_hits(stage, "/World/Camera", *SIZE)
    rays = reference.pixel_rays(stage, "/World/Camera", *SIZE)
    x, y = rays.origins[:, 0].reshape(SIZE), rays.origins[:, 1].reshape(SIZE)
    found = {}
    for number, item in enumerate(hits.items):
        for face in range(2):
            mask = (hits.item == number) & (hits.face == face)
            inner = mask & np.roll(mask, 1, 0) & np.roll(mask, -1, 0) & np.roll(mask, 1, 1) & np.roll(mask, -1, 1)
            low = item.points[item.faces[face][1]].min(axis=0)
            found[item.path, face] = (inner, (x[inner] - low[0]) / 0.45, (y[inner] - low[1]) / 0.45)
            assert inner.sum() >= 25, f"{item.path} fills only {inner.sum()} pixels"
    return found


@pytest.fixture(scope="module")
def pictures(pool):
    made = {}

    def get(mode):
        if mode not in made:
            settings = {"oocpt:samplesPerPixel": SAMPLES, "oocpt:maxBounces": 0}
            made[mode] = pool.get(mode).picture(
                small.FOLDER / "primvars.usda", SIZE, aovs=["color", "albedo", "normal"], settings=settings
            )
        return made[mode]

    return get


def residual(values: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Largest error of each pixel, under the diagonal that explains the patch better."""
    errors = np.abs(values[None] - expected).max(axis=-1)
    return errors[np.argmin(errors.mean(axis=-1))]


@pytest.mark.parametrize("mode", ["legacy", "scene_index"])
@pytest.mark.parametrize("kind, interpolation", list(itertools.product(["color", "indexed"], small.INTERPOLATIONS)))
def test_display_color(pictures, stage, patches, mode, kind, interpolation):
    """A sun of irradiance pi straight on: the picture is the albedo. Filtering over a pixel of a linear function
    changes nothing but at the diagonal."""
    picture, path = pictures(mode), f"/World/{kind}_{interpolation}"
    corners = corner_values(stage.GetPrimAtPath(path), "displayColor")
    for face in range(2):
        mask, u, v = patches[path, face]
        expected = interpolations(corners[face], u, v)
        error = residual(picture["albedo"][mask], expected)
        assert error.max() <= 2e-4, f"albedo of {path} face {face} is off by {error.max():g}"
        error = residual(picture["color"][mask][:, :3], expected)
        assert (
            np.median(error) <= 4e-3 and error.max() <= 0.06
        ), f"colour of {path} face {face} is off by {np.median(error):g}, {error.max():g}"


@pytest.mark.parametrize("mode", ["legacy", "scene_index"])
@pytest.mark.parametrize("interpolation", small.INTERPOLATIONS)
def test_display_opacity(pictures, stage, patches, mode, interpolation):
    """Alpha is the opacity, colour is premultiplied by it, within the noise of stochastic transparency."""
    picture, path = pictures(mode), f"/World/opacity_{interpolation}"
    corners = corner_values(stage.GetPrimAtPath(path), "displayOpacity")
    for face in range(2):
        mask, u, v = patches[path, face]
        expected = interpolations(corners[face], u, v)
        alpha = picture["color"][mask][:, 3:4]
        # Binomial deviation of the patch's mean and of a pixel, at most.
        mean_error = np.abs((alpha[None] - expected).mean(axis=1)).min()
        assert mean_error <= 4.5 * 0.5 / np.sqrt(
            SAMPLES * mask.sum()
        ), f"mean alpha of {path} face {face} is off by {mean_error:g}"
        assert residual(alpha, expected).max() <= 5.0 * 0.5 / np.sqrt(SAMPLES), f"alpha of {path} face {face}"
        compare.near(picture["color"][mask][:, :3], 0.6 * alpha, 1e-5, f"{path}: colour is premultiplied")


@pytest.mark.parametrize("mode", ["legacy", "scene_index"])
@pytest.mark.parametrize("interpolation", small.INTERPOLATIONS)
def test_normals(pictures, stage, patches, mode, interpolation):
    """Interpolated and normalised; they shade by their cosine with the sun, which stands at +z."""
    picture, path = pictures(mode), f"/World/normals_{interpolation}"
    corners = corner_values(stage.GetPrimAtPath(path), "normals")
    for face in range(2):
        mask, u, v = patches[path, face]
        expected = interpolations(corners[face], u, v)
        expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
        error = residual(picture["normal"][mask], expected)
        assert error.max() <= 2e-4, f"normal of {path} face {face} is off by {error.max():g}"
        error = residual(picture["color"][mask][:, :1], 0.6 * expected[..., 2:])
        assert (
            np.median(error) <= 4e-3 and error.max() <= 0.06
        ), f"shading of {path} face {face} is off by {np.median(error):g}"


def test_planted_faults_are_seen():
    """A swapped corner, or one face's value on the other, must not pass for the expected picture."""
    corners = np.array([[0.1], [0.3], [0.9], [0.4]])
    u, v = (plane.ravel() for plane in np.meshgrid(np.linspace(0.1, 0.9, 9), np.linspace(0.1, 0.9, 9)))
    honest = interpolations(corners, u, v)
    assert residual(honest[1], honest).max() == 0.0
    swapped = interpolations(corners[[1, 0, 2, 3]], u, v)[0]
    assert residual(swapped, honest).max() > 0.06 and np.median(residual(swapped, honest)) > 4e-3
