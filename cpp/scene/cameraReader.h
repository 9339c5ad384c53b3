// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_CAMERA_READER_H
#define HDOOCPT_SCENE_CAMERA_READER_H

#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

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

PXR_NAMESPACE_CLOSE_SCOPE

#endif
