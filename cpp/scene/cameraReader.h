// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_CAMERA_READER_H
#define HDOOCPT_SCENE_CAMERA_READER_H

#include "pxr/base/gf/vec4d.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "scene/warnings.h"

#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// A thin lens in scene units; radius 0 is a pinhole.
struct HdOocPTLens
{
    double radius = 0.0;
    double focusDistance = 0.0;
};

/// The lens of a camera prim: radius = focalLength / (2 fStop). A pinhole if fStop is 0, focusDistance is 0, the camera
/// is orthographic, or there is no such prim. Hydra hands focalLength out in scene units (UsdGeomCamera has tenths of
/// them).
HdOocPTLens HdOocPTReadLens(const HdSceneIndexBase& scene, const SdfPath& path);

/// The factor by which the camera's exposure multiplies the picture: its linear exposure scale or, for a host that has
/// none, the result of UsdGeomCamera::ComputeLinearExposureScale() for its parts; 1 without a prim. Warns of a scale
/// that is not a number, negative or too large, which counts as 1, and of 0.
float HdOocPTReadExposureScale(const HdSceneIndexBase& scene, const SdfPath& path, HdOocPTWarnings* warnings);

/// The clipping planes of a camera prim, in its space: the side below 0 is not seen. Warns of planes that are not
/// finite, and of more than the renderer takes, and leaves them out.
std::vector<GfVec4d> HdOocPTReadClippingPlanes(
    const HdSceneIndexBase& scene, const SdfPath& path, HdOocPTWarnings* warnings);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
