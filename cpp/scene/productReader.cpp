// SPDX-License-Identifier: Apache-2.0
#include "scene/productReader.h"

#include "pxr/base/gf/range2f.h"
#include "pxr/base/gf/vec2d.h"
#include "pxr/base/gf/vec2f.h"
#include "pxr/base/gf/vec4f.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <algorithm>
#include <cmath>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// UsdImaging's scene delegate reports an error for names that it does not have.
VtValue _Read(const HdContainerDataSourceHandle& container, const TfToken& name)
{
    const TfTokenVector names = container ? container->GetNames() : TfTokenVector();
    const bool has = std::find(names.begin(), names.end(), name) != names.end();
    return has ? HdOocPTRead(container, { name }) : VtValue();
}

HdOocPTSettingMap _ReadNamespaced(const HdContainerDataSourceHandle& container)
{
    const TfToken& name = HdOocPTProductTokens->namespacedSettings;
    HdOocPTSettingMap settings;
    const TfTokenVector names = container->GetNames();
    if (std::find(names.begin(), names.end(), name) == names.end()) {
        return settings;
    }
    if (const HdContainerDataSourceHandle all = HdOocPTFindContainer(container, { name })) {
        for (const TfToken& key : all->GetNames()) {
            settings[key] = HdOocPTSample(all->Get(key));
        }
    }
    return settings;
}

/// The elements of a vector of containers.
std::vector<HdContainerDataSourceHandle> _Elements(const HdContainerDataSourceHandle& container, const TfToken& name)
{
    std::vector<HdContainerDataSourceHandle> elements;
    const TfTokenVector names = container->GetNames();
    if (std::find(names.begin(), names.end(), name) == names.end()) {
        return elements;
    }
    const HdVectorDataSourceHandle all = HdVectorDataSource::Cast(HdOocPTFind(container, { name }));
    for (size_t i = 0; i < (all ? all->GetNumElements() : 0); ++i) {
        if (const HdContainerDataSourceHandle element = HdContainerDataSource::Cast(all->GetElement(i))) {
            elements.push_back(element);
        }
    }
    return elements;
}

HdOocPTProductVar _ReadVar(const HdContainerDataSourceHandle& container)
{
    const auto& tokens = *HdOocPTProductTokens;
    HdOocPTProductVar var;
    var.path = _Read(container, tokens.path).GetWithDefault<SdfPath>();
    HdOocPTConvert(_Read(container, tokens.dataType), &var.dataType);
    var.sourceName = HdOocPTReadText(_Read(container, tokens.sourceName));
    HdOocPTConvert(_Read(container, tokens.sourceType), &var.sourceType);
    var.settings = _ReadNamespaced(container);
    return var;
}

HdOocPTProduct _ReadProduct(const HdContainerDataSourceHandle& container)
{
    const auto& tokens = *HdOocPTProductTokens;
    HdOocPTProduct product;
    product.path = _Read(container, tokens.path).GetWithDefault<SdfPath>();
    HdOocPTConvert(_Read(container, tokens.type), &product.type);
    product.name = HdOocPTReadText(_Read(container, tokens.name));
    product.camera = _Read(container, tokens.cameraPrim).GetWithDefault<SdfPath>();
    product.resolution = _Read(container, tokens.resolution).GetWithDefault<GfVec2i>(GfVec2i(0));
    HdOocPTConvert(_Read(container, tokens.pixelAspectRatio), &product.pixelAspectRatio);
    HdOocPTConvert(_Read(container, tokens.aspectRatioConformPolicy), &product.conformPolicy);
    const VtValue window = _Read(container, tokens.dataWindowNDC);
    if (window.IsHolding<GfVec4f>()) {
        const GfVec4d corners(window.UncheckedGet<GfVec4f>());
        product.dataWindow = GfRange2d(GfVec2d(corners[0], corners[1]), GfVec2d(corners[2], corners[3]));
    } else if (window.IsHolding<GfRange2f>()) {
        const GfRange2f& range = window.UncheckedGet<GfRange2f>();
        product.dataWindow = GfRange2d(GfVec2d(range.GetMin()), GfVec2d(range.GetMax()));
    }
    HdOocPTConvert(_Read(container, tokens.disableDepthOfField), &product.isLensDisabled);
    for (const HdContainerDataSourceHandle& var : _Elements(container, tokens.renderVars)) {
        product.vars.push_back(_ReadVar(var));
    }
    product.settings = _ReadNamespaced(container);
    return product;
}

/// The window of a camera in a plane at distance 1, or of parallel rays, widened or cut to an aspect ratio.
GfRange2d _Conform(const GfRange2d& window, const TfToken& policy, double aspect)
{
    const auto& tokens = *HdOocPTProductTokens;
    GfVec2d size = window.GetSize();
    const bool isWider = aspect > size[0] / size[1];
    const bool keepsHeight = policy == tokens.adjustApertureWidth
        || (policy == tokens.cropAperture ? !isWider : policy != tokens.adjustApertureHeight && isWider);
    if (keepsHeight) {
        size[0] = size[1] * aspect;
    } else {
        size[1] = size[0] / aspect;
    }
    const GfVec2d middle = window.GetMidpoint();
    return GfRange2d(middle - 0.5 * size, middle + 0.5 * size);
}

GfMatrix4d _Project(const GfRange2d& window, GfVec2d range, bool isOrthographic)
{
    if (!(range[0] < range[1]) || (!isOrthographic && !(range[0] > 0.0))) {
        range = GfVec2d(1.0, 1e6);
    }
    const GfVec2d size = window.GetSize();
    const GfVec2d sum = window.GetMin() + window.GetMax();
    const double depth = range[1] - range[0];
    GfMatrix4d projection(0.0);
    projection[0][0] = 2.0 / size[0];
    projection[1][1] = 2.0 / size[1];
    if (isOrthographic) {
        projection[2][2] = -2.0 / depth;
        projection[3][0] = -sum[0] / size[0];
        projection[3][1] = -sum[1] / size[1];
        projection[3][2] = -(range[0] + range[1]) / depth;
        projection[3][3] = 1.0;
    } else {
        projection[2][0] = sum[0] / size[0];
        projection[2][1] = sum[1] / size[1];
        projection[2][2] = -(range[0] + range[1]) / depth;
        projection[2][3] = -1.0;
        projection[3][2] = -2.0 * range[0] * range[1] / depth;
    }
    return projection;
}

} // namespace

std::vector<HdOocPTProduct> HdOocPTReadProducts(const HdSceneIndexBase& scene, const std::set<SdfPath>& prims)
{
    std::vector<HdOocPTProduct> products;
    for (const SdfPath& path : prims) {
        const HdContainerDataSourceHandle settings = HdOocPTFindActiveSettings(scene, path);
        if (!settings) {
            continue;
        }
        for (const HdContainerDataSourceHandle& product : _Elements(settings, HdOocPTSceneTokens->renderProducts)) {
            products.push_back(_ReadProduct(product));
            HdOocPTConvert(_Read(settings, HdOocPTSceneTokens->renderingColorSpace), &products.back().colorSpace);
        }
    }
    return products;
}

std::optional<double> HdOocPTReadCurrentFrame(const HdSceneIndexBase& scene)
{
    const auto& tokens = *HdOocPTProductTokens;
    const HdSceneIndexPrim root = scene.GetPrim(SdfPath::AbsoluteRootPath());
    double frame = 0.0;
    const bool has = HdOocPTConvert(
        HdOocPTRead(root.dataSource, { HdOocPTSceneTokens->sceneGlobals, tokens.currentFrame }), &frame);
    return has && std::isfinite(frame) ? std::make_optional(frame) : std::nullopt;
}

std::optional<HdOocPTProductView> HdOocPTReadProductView(const HdSceneIndexBase& scene, const HdOocPTProduct& product)
{
    const auto& tokens = *HdOocPTProductTokens;
    const HdContainerDataSourceHandle prim
        = product.camera.IsEmpty() ? nullptr : scene.GetPrim(product.camera).dataSource;
    const HdContainerDataSourceHandle camera = HdOocPTFindContainer(prim, { HdOocPTSceneTokens->camera });
    if (!camera) {
        return std::nullopt;
    }
    const auto number = [&](const TfToken& name) {
        double value = 0.0;
        HdOocPTConvert(HdOocPTRead(camera, { name }), &value);
        return value;
    };
    TfToken projection;
    HdOocPTConvert(HdOocPTRead(camera, { tokens.projection }), &projection);
    const bool isOrthographic = projection == HdOocPTSceneTokens->orthographic;
    const double distance = isOrthographic ? 1.0 : number(tokens.focalLength);
    const GfVec2d size(number(tokens.horizontalAperture), number(tokens.verticalAperture));
    const GfVec2d middle(number(tokens.horizontalApertureOffset), number(tokens.verticalApertureOffset));
    const GfVec2d resolution(product.resolution);
    if (!(distance > 0.0 && size[0] > 0.0 && size[1] > 0.0 && resolution[0] > 0.0 && resolution[1] > 0.0)) {
        return std::nullopt;
    }
    GfRange2d window((middle - 0.5 * size) / distance, (middle + 0.5 * size) / distance);
    HdOocPTProductView view;
    view.pixelAspectRatio = product.pixelAspectRatio;
    if (product.conformPolicy == tokens.adjustPixelAspectRatio) {
        view.pixelAspectRatio = size[0] / size[1] * resolution[1] / resolution[0];
    } else {
        window = _Conform(window, product.conformPolicy, resolution[0] / resolution[1] * product.pixelAspectRatio);
    }
    const GfVec2f range = HdOocPTRead(camera, { tokens.clippingRange }).GetWithDefault<GfVec2f>(GfVec2f(1.0f, 1e6f));
    view.projection = _Project(window, GfVec2d(range), isOrthographic);
    HdOocPTConvert(HdOocPTRead(prim, { HdOocPTSceneTokens->xform, HdOocPTSceneTokens->matrix }), &view.viewToWorld);
    return view;
}

PXR_NAMESPACE_CLOSE_SCOPE
