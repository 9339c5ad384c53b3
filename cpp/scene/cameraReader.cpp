// SPDX-License-Identifier: Apache-2.0
#include "scene/cameraReader.h"

#include "oocpt-bridge/src/ffi_runner.rs.h"
#include "pxr/base/gf/vec4f.h"
#include "pxr/base/vt/array.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <algorithm>
#include <cmath>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

template <typename Array>
bool _TakePlanes(const VtValue& value, std::vector<GfVec4d>* planes)
{
    if (!value.IsHolding<Array>()) {
        return false;
    }
    for (const auto& plane : value.UncheckedGet<Array>()) {
        planes->push_back(GfVec4d(plane));
    }
    return true;
}

} // namespace

HdOocPTLens HdOocPTReadLens(const HdSceneIndexBase& scene, const SdfPath& path)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdContainerDataSourceHandle camera
        = path.IsEmpty() ? nullptr : HdOocPTFindContainer(scene.GetPrim(path).dataSource, { tokens.camera });
    const auto number = [&](const TfToken& name) {
        double value = 0.0;
        HdOocPTConvert(HdOocPTRead(camera, { name }), &value);
        return value;
    };
    TfToken projection;
    HdOocPTConvert(HdOocPTRead(camera, { tokens.projection }), &projection);
    const double stop = number(tokens.fStop);
    const double radius = stop > 0.0 ? number(tokens.focalLength) / (2.0 * stop) : 0.0;
    const double focusDistance = number(tokens.focusDistance);
    const bool hasLens = projection != tokens.orthographic && std::isfinite(radius) && radius > 0.0
        && std::isfinite(focusDistance) && focusDistance > 0.0;
    return hasLens ? HdOocPTLens { radius, focusDistance } : HdOocPTLens {};
}

std::vector<GfVec4d> HdOocPTReadClippingPlanes(
    const HdSceneIndexBase& scene, const SdfPath& path, HdOocPTWarnings* warnings)
{
    const auto& tokens = *HdOocPTSceneTokens;
    std::vector<GfVec4d> planes;
    if (path.IsEmpty()) {
        return planes;
    }
    // Front ends do not agree on the type.
    const VtValue value = HdOocPTRead(scene.GetPrim(path).dataSource, { tokens.camera, tokens.clippingPlanes });
    _TakePlanes<VtArray<GfVec4d>>(value, &planes) || _TakePlanes<VtArray<GfVec4f>>(value, &planes)
        || _TakePlanes<std::vector<GfVec4d>>(value, &planes);
    const auto isUnusable = [](const GfVec4d& plane) {
        return !std::isfinite(plane[0]) || !std::isfinite(plane[1]) || !std::isfinite(plane[2])
            || !std::isfinite(plane[3]);
    };
    const auto end = std::remove_if(planes.begin(), planes.end(), isUnusable);
    if (end != planes.end()) {
        warnings->Add(path, "clipping planes that are not finite are left out");
        planes.erase(end, planes.end());
    }
    const size_t most = oocpt::max_clip_planes();
    if (planes.size() > most) {
        warnings->Add(path,
            "of its " + std::to_string(planes.size()) + " clipping planes only the first " + std::to_string(most)
                + " are used");
        planes.resize(most);
    }
    return planes;
}

PXR_NAMESPACE_CLOSE_SCOPE
