// SPDX-License-Identifier: Apache-2.0
#include "scene/assetPath.h"

#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/usd/ar/resolvedPath.h"
#include "pxr/usd/ar/resolver.h"
#include "pxr/usd/sdf/assetPath.h"

#include <string>

PXR_NAMESPACE_OPEN_SCOPE

oocpt::AssetDesc HdOocPTDescribeAsset(const VtValue& value)
{
    std::string authored;
    std::string resolved;
    if (value.IsHolding<SdfAssetPath>()) {
        const SdfAssetPath& path = value.UncheckedGet<SdfAssetPath>();
        authored = path.GetAssetPath();
        resolved = path.GetResolvedPath();
    } else {
        authored = value.GetWithDefault<std::string>();
    }
    if (resolved.empty() && !authored.empty()) {
        resolved = ArGetResolver().Resolve(authored).GetPathString();
    }
    return { rust::String::lossy(authored), rust::String::lossy(resolved) };
}

PXR_NAMESPACE_CLOSE_SCOPE
