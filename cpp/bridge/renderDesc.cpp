// SPDX-License-Identifier: Apache-2.0
#include "bridge/renderDesc.h"

#include "bridge/scalar.h"
#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/gf/vec4d.h"
#include "scene/primReader.h"

#include <algorithm>
#include <array>
#include <cstring>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

uint32_t _Size(int pixels)
{
    return static_cast<uint32_t>(std::max(pixels, 0));
}

oocpt::AovDesc _DescribeAov(const HdOocPTAovRequest& aov)
{
    oocpt::AovDesc desc {};
    desc.name = rust::String::lossy(aov.name.GetString());
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

void _FillCamera(const HdOocPTRenderRequest& request, const HdOocPTLens& lens, oocpt::RenderDesc* desc)
{
    const GfMatrix4d viewToWorld = _InverseOfView(request.worldToView);
    std::copy_n(viewToWorld.GetArray(), 16, desc->world_from_view.begin());
    std::copy_n(request.projection.GetArray(), 16, desc->projection.begin());
    desc->lens_radius = lens.radius;
    desc->focus_distance = lens.focusDistance;
    desc->data_window = { 0, 0, request.width, request.height };
    // Hydra has applied the framing to the projection: its [-1, 1] square lands on the data window.
    const GfRect2i window
        = request.dataWindow.IsEmpty() ? GfRect2i(GfVec2i(0, 0), request.width, request.height) : request.dataWindow;
    desc->display_window = { static_cast<float>(window.GetMinX()), static_cast<float>(window.GetMinY()),
        static_cast<float>(window.GetMaxX()) + 1.0f, static_cast<float>(window.GetMaxY()) + 1.0f };
}

/// One pixel's clear value as the bytes of the AOV's format.
std::array<unsigned char, 16> _ClearBytes(const TfToken& aov, std::array<float, 4> clear)
{
    std::array<unsigned char, 16> bytes {};
    const std::string& name = aov.GetString();
    const bool isId = name.size() > 2 && name.compare(name.size() - 2, 2, "Id") == 0;
    if (isId) {
        // Casting a value that does not fit is undefined behaviour, and hosts may pass anything.
        constexpr float bound = 1 << 24;
        const float value = clear[0] == clear[0] ? std::min(std::max(clear[0], -bound), bound) : -1.0f;
        const int32_t number = static_cast<int32_t>(value);
        std::memcpy(bytes.data(), &number, sizeof(number));
    } else {
        std::memcpy(bytes.data(), clear.data(), sizeof(clear));
    }
    return bytes;
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
        desc.purposes.push_back(rust::String::lossy(HdOocPTPurposeOfTag(tag).GetString()));
    }
    return desc;
}

void HdOocPTClearOutside(const HdOocPTRenderRequest& request, const TfToken& aov, void* pixels, size_t byteCount)
{
    const size_t width = _Size(request.width);
    const size_t height = _Size(request.height);
    const GfRect2i buffer(GfVec2i(0, 0), request.width, request.height);
    const GfRect2i window = request.dataWindow.GetIntersection(buffer);
    const auto known = std::find_if(request.aovs.begin(), request.aovs.end(),
        [&](const HdOocPTAovRequest& candidate) { return candidate.name == aov; });
    if (request.dataWindow.IsEmpty() || window == buffer || known == request.aovs.end() || width * height == 0
        || byteCount % (width * height) != 0 || byteCount / (width * height) > 16) {
        return;
    }
    const size_t pixelBytes = byteCount / (width * height);
    std::array<float, 4> clear {};
    HdOocPTToClear(known->clearValue, &clear);
    const std::array<unsigned char, 16> value = _ClearBytes(aov, clear);
    auto* out = static_cast<unsigned char*>(pixels);
    for (size_t row = 0; row < height; ++row) {
        const int y = static_cast<int>(height - 1 - row);
        for (size_t x = 0; x < width; ++x, out += pixelBytes) {
            if (!window.Contains(GfVec2i(static_cast<int>(x), y))) {
                std::memcpy(out, value.data(), pixelBytes);
            }
        }
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
