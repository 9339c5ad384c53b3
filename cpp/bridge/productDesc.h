// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_PRODUCT_DESC_H
#define HDOOCPT_BRIDGE_PRODUCT_DESC_H

#include "bridge/session.h"
#include "pxr/pxr.h"
#include "rust/cxx.h"
#include "scene/sceneReader.h"
#include "scene/warnings.h"

namespace oocpt {
struct ProductDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// Describes the products of a scene for Rust. A product with the camera and the size of the host's request is written
/// of the host's picture, all others of pictures of their own. One whose camera is not there says so.
rust::Vec<oocpt::ProductDesc> HdOocPTDescribeProducts(
    const HdOocPTSceneReader& reader, const HdOocPTRenderRequest& request, bool hasLens, HdOocPTWarnings* warnings);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
