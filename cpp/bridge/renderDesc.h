// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_RENDER_DESC_H
#define HDOOCPT_BRIDGE_RENDER_DESC_H

#include "bridge/session.h"
#include "pxr/base/gf/range2d.h"
#include "pxr/pxr.h"
#include "scene/cameraReader.h"
#include "scene/sceneReader.h"
#include "scene/warnings.h"

#include <optional>

namespace oocpt {
struct RenderDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// Describes a request for Rust. Images are of the whole buffer; the data window is what is rendered of it.
oocpt::RenderDesc HdOocPTDescribeRender(const HdOocPTRenderRequest& request, const HdOocPTLens& lens);

/// Adds what the scene says of a camera beside its lens: exposure, motion, clipping planes.
void HdOocPTDescribeCamera(const HdOocPTSceneReader& reader, const SdfPath& camera, const GfMatrix4d& viewToWorld,
    oocpt::RenderDesc* desc, HdOocPTWarnings* warnings);

/// Leaves of the data window what the scene's render settings ask for (HdOocPTReadDataWindow()): their window is 0 to 1
/// over the request's display window.
void HdOocPTCrop(const HdOocPTRenderRequest& request, const std::optional<GfRange2d>& window, oocpt::RenderDesc* desc);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
