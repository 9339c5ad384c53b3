// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_ASSET_PATH_H
#define HDOOCPT_SCENE_ASSET_PATH_H

#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/ar/resolverContext.h"
#include "pxr/usd/ar/resolverContextBinder.h"

namespace oocpt {
struct AssetDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// Describes a file that the scene names for Rust: an SdfAssetPath, or text that means a path. Hydra usually has
/// resolved it; if not, the host's resolver is asked here. Empty for any other value. A path with the separators of
/// Windows, which is one name elsewhere, is looked for in the folders of the resolver's context (the root layer's): the
/// layer that authored it is not known any more.
oocpt::AssetDesc HdOocPTDescribeAsset(const VtValue& value);

/// The context of the host's resolver: the one bound on this thread, or else the scene's. Bind it on every thread that
/// describes assets.
ArResolverContext HdOocPTFindResolverContext(HdSceneIndexBase& scene);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
