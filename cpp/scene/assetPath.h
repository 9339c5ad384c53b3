// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_ASSET_PATH_H
#define HDOOCPT_SCENE_ASSET_PATH_H

#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"

namespace oocpt {
struct AssetDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// A file that the scene names, as it goes to Rust: an SdfAssetPath, or text that means a path. Hydra has resolved it
/// already; where it has not, the host's resolver is asked here. Empty for any other value.
oocpt::AssetDesc HdOocPTDescribeAsset(const VtValue& value);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
