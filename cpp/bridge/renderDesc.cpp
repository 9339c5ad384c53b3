// SPDX-License-Identifier: Apache-2.0
#include "bridge/renderDesc.h"

#include "bridge/scalar.h"
#include "bridge/text.h"
#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/gf/vec2d.h"
#include "pxr/base/gf/vec4d.h"
#include "scene/motionReader.h"
#include "scene/primReader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

uint32_t _Size(int pixels)
{
    return static_cast<uint32_t>(std::max(pixels, 0));
}

oocpt::AovDesc _DescribeAov(const HdOocPTAovRequest& aov)
{
    oocpt::AovDesc desc {};
    desc.name = HdOocPTText(aov.name);
    desc.has_clear = HdOocPTToClear(aov.clearValue, &desc.clear);
    return desc;
}

/// The inverse of a matrix that Hydra itself computed by inverting: a matrix that is affine but for rounding becomes
/// exactly affine.
GfMatrix4d _InverseOfView(const GfMatrix4d& worldToView)
{
    GfMatrix4d viewToWorld = worldToView.GetInverse();
    const GfVec4d affine(0.0, 0.0, 0.0, 1.0);
    if (GfIsClose(viewToWorld.GetColumn(3), affine, 1e-9)) {
        viewToWorld.SetColumn(3, affine);
    }
    return viewToWorld;
}

/// A window's edge that fits whatever the host or the scene passes.
int32_t _Edge(double pixels)
{
    constexpr double bound = 1 << 24;
    return static_cast<int32_t>(std::min(std::max(pixels, -bound), bound));
}

void _FillCamera(const HdOocPTRenderRequest& request, const HdOocPTLens& lens, oocpt::RenderDesc* desc)
{
    const GfMatrix4d viewToWorld = _InverseOfView(request.worldToView);
    std::copy_n(viewToWorld.GetArray(), 16, desc->world_from_view.begin());
    std::copy_n(request.projection.GetArray(), 16, desc->projection.begin());
    desc->lens_radius = lens.radius;
    desc->focus_distance = lens.focusDistance;
    // Hydra has applied the framing to the projection: its [-1, 1] square lands on the data window.
    const GfRect2i window
        = request.dataWindow.IsEmpty() ? GfRect2i(GfVec2i(0, 0), request.width, request.height) : request.dataWindow;
    desc->display_window = { static_cast<float>(window.GetMinX()), static_cast<float>(window.GetMinY()),
        static_cast<float>(window.GetMaxX()) + 1.0f, static_cast<float>(window.GetMaxY()) + 1.0f };
    desc->data_window = { _Edge(window.GetMinX()), _Edge(window.GetMinY()), _Edge(window.GetMaxX() + 1.0),
        _Edge(window.GetMaxY() + 1.0) };
}

/// The first pixel whose centre is not before an edge.
int32_t _FirstFrom(double edge)
{
    return _Edge(std::ceil(edge - 0.5));
}

} // namespace

oocpt::RenderDesc HdOocPTDescribeRender(const HdOocPTRenderRequest& request, const HdOocPTLens& lens)
{
    oocpt::RenderDesc desc {};
    desc.width = _Size(request.width);
    desc.height = _Size(request.height);
    _FillCamera(request, lens, &desc);
    desc.aovs.reserve(request.aovs.size());
    for (const HdOocPTAovRequest& aov : request.aovs) {
        desc.aovs.push_back(_DescribeAov(aov));
    }
    static const TfTokenVector all { TfToken("geometry"), TfToken("render"), TfToken("proxy"), TfToken("guide") };
    for (const TfToken& tag : request.renderTags.empty() ? all : request.renderTags) {
        desc.purposes.push_back(HdOocPTText(HdOocPTPurposeOfTag(tag)));
    }
    return desc;
}

void HdOocPTDescribeCamera(const HdOocPTSceneReader& reader, const SdfPath& camera, const GfMatrix4d& viewToWorld,
    oocpt::RenderDesc* desc, HdOocPTWarnings* warnings)
{
    desc->exposure_scale = reader.GetExposureScale(camera, warnings);
    HdOocPTFillMotion(reader.GetCameraMotion(camera, viewToWorld), &desc->camera_motion);
    for (const GfVec4d& plane : reader.GetClippingPlanes(camera, warnings)) {
        std::copy_n(plane.GetArray(), 4, std::back_inserter(desc->clip_planes));
    }
}

void HdOocPTCrop(const HdOocPTRenderRequest& request, const std::optional<GfRange2d>& window, oocpt::RenderDesc* desc)
{
    if (!window) {
        return;
    }
    const GfRange2d picture = request.displayWindow.IsEmpty()
        ? GfRange2d(GfVec2d(0.0), GfVec2d(request.width, request.height))
        : GfRange2d(GfVec2d(request.displayWindow.GetMin()), GfVec2d(request.displayWindow.GetMax()));
    const GfVec2d size = picture.GetSize();
    // Windows of settings are y up, those of requests y down. A pixel counts if its centre is inside.
    const double left = picture.GetMin()[0];
    const double bottom = picture.GetMax()[1];
    const std::array<int32_t, 4> wanted { _FirstFrom(left + window->GetMin()[0] * size[0]),
        _FirstFrom(bottom - window->GetMax()[1] * size[1]), _FirstFrom(left + window->GetMax()[0] * size[0]),
        _FirstFrom(bottom - window->GetMin()[1] * size[1]) };
    for (size_t i = 0; i < 2; ++i) {
        desc->data_window[i] = std::max(desc->data_window[i], wanted[i]);
        desc->data_window[i + 2] = std::min(desc->data_window[i + 2], wanted[i + 2]);
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
