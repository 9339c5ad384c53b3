// SPDX-License-Identifier: Apache-2.0
#include "scene/assetPath.h"

#include "bridge/text.h"
#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/tf/stringUtils.h"
#include "pxr/usd/ar/resolvedPath.h"
#include "pxr/usd/ar/resolver.h"
#include "pxr/usd/sdf/assetPath.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

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
    // Exporters on Windows write `.\textures\wood.png`.
    if (resolved.empty() && authored.find('\\') != std::string::npos) {
        std::string slashes = TfStringReplace(authored, "\\", "/");
        while (TfStringStartsWith(slashes, "./")) {
            slashes.erase(0, 2);
        }
        resolved = ArGetResolver().Resolve(slashes).GetPathString();
    }
    return { HdOocPTText(authored), HdOocPTText(resolved) };
}

ArResolverContext HdOocPTFindResolverContext(HdSceneIndexBase& scene)
{
    const auto& tokens = *HdOocPTSceneTokens;
    ArResolverContext bound = ArGetResolver().GetCurrentContext();
    if (!bound.IsEmpty()) {
        return bound;
    }
    const HdSceneIndexPrim root = scene.GetPrim(SdfPath::AbsoluteRootPath());
    return HdOocPTRead(root.dataSource, { tokens.system, tokens.assetResolution, tokens.resolverContext })
        .GetWithDefault<ArResolverContext>();
}

PXR_NAMESPACE_CLOSE_SCOPE
