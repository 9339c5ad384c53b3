// SPDX-License-Identifier: Apache-2.0
#include "scene/cameraReader.h"

#include "oocpt-bridge/src/ffi_runner.rs.h"
#include "pxr/base/gf/vec4f.h"
#include "pxr/base/vt/array.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <algorithm>
#include <cmath>
#include <limits>
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

float HdOocPTReadExposureScale(const HdSceneIndexBase& scene, const SdfPath& path, HdOocPTWarnings* warnings)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdContainerDataSourceHandle camera
        = path.IsEmpty() ? nullptr : HdOocPTFindContainer(scene.GetPrim(path).dataSource, { tokens.camera });
    if (!camera) {
        return 1.0f;
    }
    const auto number = [&](const TfToken& name, double fallback) {
        HdOocPTConvert(HdOocPTRead(camera, { name }), &fallback);
        return fallback;
    };
    const double stop = number(tokens.exposureFStop, 1.0);
    const double parts = number(tokens.exposureTime, 1.0) * number(tokens.exposureIso, 100.0)
        * std::exp2(number(tokens.exposure, 0.0)) * number(tokens.exposureResponsivity, 1.0) / (100.0 * stop * stop);
    const double scale = number(tokens.linearExposureScale, parts);
    if (!(scale >= 0.0 && scale <= std::numeric_limits<float>::max())) {
        warnings->Add(path, "the exposure is not a number, negative or too large, and is left out");
        return 1.0f;
    }
    if (scale == 0.0) {
        warnings->Add(path, "the exposure makes the picture black");
    }
    return static_cast<float>(scale);
}

std::vector<GfVec4d> HdOocPTReadClippingPlanes(
    const HdSceneIndexBase& scene, const SdfPath& path, HdOocPTWarnings* warnings)
{
    const auto& tokens = *HdOocPTSceneTokens;
    std::vector<GfVec4d> planes;
    if (path.IsEmpty()) {
        return planes;
    }
    // Front ends use different types for it.
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
