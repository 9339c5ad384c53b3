// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_RENDER_DESC_H
#define HDOOCPT_BRIDGE_RENDER_DESC_H

#include "bridge/session.h"
#include "pxr/base/gf/rect2i.h"
#include "pxr/pxr.h"
#include "scene/cameraReader.h"

#include <cstddef>

namespace oocpt {
struct RenderDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// Describes a request for Rust. The image is the whole buffer; HdOocPTClearOutside() clears the pixels outside of the
/// data window when the image is read.
oocpt::RenderDesc HdOocPTDescribeRender(const HdOocPTRenderRequest& request, const HdOocPTLens& lens);

/// Overwrites the pixels of an image (bottom row first) that lie outside of the request's data window with the AOV's
/// clear value. Does nothing if the window covers the buffer, if it is empty, or if the size is not that of the
/// request.
void HdOocPTClearOutside(const HdOocPTRenderRequest& request, const TfToken& aov, void* pixels, size_t byteCount);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
