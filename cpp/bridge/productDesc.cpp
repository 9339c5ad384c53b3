// SPDX-License-Identifier: Apache-2.0
#include "bridge/productDesc.h"

#include "bridge/renderDesc.h"
#include "bridge/scalar.h"
#include "bridge/text.h"
#include "oocpt-bridge/src/lib.rs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

rust::Vec<oocpt::NamedValue> _DescribeSettings(const HdOocPTSettingMap& settings)
{
    rust::Vec<oocpt::NamedValue> values;
    for (const auto& [key, value] : settings) {
        oocpt::NamedValue named {};
        named.key = HdOocPTText(key);
        if (HdOocPTToScalar(value, &named.value)) {
            values.push_back(std::move(named));
        }
    }
    return values;
}

/// The pixels of a window of the picture: x0, y0, x1, y1, y down, ends exclusive. A pixel counts if its centre is
/// inside. Empty for windows that are not finite.
std::array<int32_t, 4> _Pixels(const HdOocPTProduct& product)
{
    const GfVec2d size(product.resolution);
    const GfRange2d& window = product.dataWindow;
    const double edges[4] = { window.GetMin()[0] * size[0], size[1] - window.GetMax()[1] * size[1],
        window.GetMax()[0] * size[0], size[1] - window.GetMin()[1] * size[1] };
    std::array<int32_t, 4> pixels {};
    for (size_t i = 0; i < 4; ++i) {
        if (!std::isfinite(edges[i])) {
            return {};
        }
        constexpr double bound = 1 << 24;
        pixels[i] = static_cast<int32_t>(std::clamp(std::ceil(edges[i] - 0.5), -bound, bound));
    }
    return pixels;
}

bool _IsOfHost(const HdOocPTProduct& product, const HdOocPTProductView& view, const HdOocPTRenderRequest& request)
{
    const GfRect2i whole(GfVec2i(0, 0), request.width, request.height);
    const bool isWhole = product.dataWindow == GfRange2d(GfVec2d(0.0), GfVec2d(1.0))
        && (request.dataWindow.IsEmpty() || request.dataWindow == whole);
    return isWhole && product.camera == request.cameraPath && product.resolution[0] == request.width
        && product.resolution[1] == request.height && GfIsClose(view.projection, request.projection, 1e-5)
        && !product.isLensDisabled;
}

oocpt::RenderDesc _DescribePicture(const HdOocPTSceneReader& reader, const HdOocPTProduct& product,
    const HdOocPTProductView& view, const std::array<int32_t, 4>& pixels, bool hasLens, HdOocPTWarnings* warnings)
{
    // Inside of the picture the pixels are a window of it, with its bits; overscan is a picture of another size.
    const GfVec2i& size = product.resolution;
    const bool isInside = pixels[0] >= 0 && pixels[1] >= 0 && pixels[2] <= size[0] && pixels[3] <= size[1]
        && pixels[0] < pixels[2] && pixels[1] < pixels[3];
    const GfVec2i corner = isInside ? GfVec2i(0) : GfVec2i(pixels[0], pixels[1]);
    HdOocPTRenderRequest request;
    request.width = isInside ? size[0] : std::max(pixels[2] - pixels[0], 0);
    request.height = isInside ? size[1] : std::max(pixels[3] - pixels[1], 0);
    request.cameraPath = product.camera;
    request.projection = view.projection;
    const HdOocPTLens lens = hasLens && !product.isLensDisabled ? reader.GetLens(product.camera) : HdOocPTLens {};
    oocpt::RenderDesc desc = HdOocPTDescribeRender(request, lens);
    std::copy_n(view.viewToWorld.GetArray(), 16, desc.world_from_view.begin());
    if (isInside) {
        desc.data_window = pixels;
    }
    // The projection is that of the whole picture.
    desc.display_window = { static_cast<float>(-corner[0]), static_cast<float>(-corner[1]),
        static_cast<float>(size[0] - corner[0]), static_cast<float>(size[1] - corner[1]) };
    HdOocPTDescribeCamera(reader, product.camera, view.viewToWorld, &desc, warnings);
    return desc;
}

} // namespace

rust::Vec<oocpt::ProductDesc> HdOocPTDescribeProducts(
    const HdOocPTSceneReader& reader, const HdOocPTRenderRequest& request, bool hasLens, HdOocPTWarnings* warnings)
{
    rust::Vec<oocpt::ProductDesc> descs;
    const std::optional<double> frame = reader.GetCurrentFrame();
    const double rate = reader.GetProducts().empty() ? 0.0 : reader.GetTimeCodesPerSecond();
    for (const HdOocPTProduct& product : reader.GetProducts()) {
        const std::optional<HdOocPTProductView> view = reader.GetProductView(product);
        oocpt::ProductDesc desc {};
        desc.path = HdOocPTText(product.path);
        desc.name = HdOocPTText(product.name);
        if (!view) {
            desc.missing = HdOocPTText(
                "its camera <" + product.camera.GetString() + "> or its resolution is not there, or is empty");
            descs.push_back(std::move(desc));
            continue;
        }
        if (!reader.IsShutterOf(product.camera)) {
            warnings->Add(product.path,
                "the shutter of its camera <" + product.camera.GetString()
                    + "> opens and closes at other times than that of the host's camera, which counts");
        }
        const std::array<int32_t, 4> pixels = _Pixels(product);
        desc.kind = HdOocPTText(product.type);
        for (const HdOocPTProductVar& var : product.vars) {
            desc.vars.push_back({ HdOocPTText(var.path), HdOocPTText(var.dataType), HdOocPTText(var.sourceName),
                HdOocPTText(var.sourceType), _DescribeSettings(var.settings) });
        }
        desc.settings = _DescribeSettings(product.settings);
        desc.color_space = HdOocPTText(product.colorSpace);
        desc.pixel_aspect = static_cast<float>(view->pixelAspectRatio);
        desc.display_size
            = { static_cast<uint32_t>(product.resolution[0]), static_cast<uint32_t>(product.resolution[1]) };
        desc.data_corner = { pixels[0], pixels[1] };
        desc.has_frame = frame.has_value();
        desc.frame = frame.value_or(0.0);
        desc.time_codes_per_second = rate;
        desc.shutter = { reader.GetShutter().open, reader.GetShutter().close };
        desc.is_of_host = _IsOfHost(product, *view, request);
        desc.picture = _DescribePicture(reader, product, *view, pixels, hasLens, warnings);
        descs.push_back(std::move(desc));
    }
    return descs;
}

PXR_NAMESPACE_CLOSE_SCOPE
