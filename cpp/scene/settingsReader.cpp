// SPDX-License-Identifier: Apache-2.0
#include "scene/settingsReader.h"

#include "pxr/base/gf/range2f.h"
#include "pxr/base/gf/vec4f.h"
#include "pxr/base/tf/stringUtils.h"
#include "pxr/base/vt/array.h"
#include "scene/dataSource.h"
#include "scene/primReader.h"
#include "scene/tokens.h"

#include <algorithm>
#include <cmath>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

bool _IsActive(const HdSceneIndexBase& scene, const HdSceneIndexPrim& prim, const SdfPath& path)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdSceneIndexPrim root = scene.GetPrim(SdfPath::AbsoluteRootPath());
    if (const HdContainerDataSourceHandle globals = HdOocPTFindContainer(root.dataSource, { tokens.sceneGlobals })) {
        return HdOocPTRead(globals, { tokens.activeRenderSettingsPrim }).GetWithDefault<SdfPath>() == path;
    }
    // This is asked only if there are no globals: UsdImaging's scene delegate reports an error for this name.
    bool active = false;
    HdOocPTConvert(HdOocPTRead(prim.dataSource, { tokens.renderSettings, tokens.active }), &active);
    return active;
}

} // namespace

HdOocPTSettingMap HdOocPTReadRenderSettings(const HdSceneIndexBase& scene, const SdfPath& path)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTSettingMap settings;
    const HdSceneIndexPrim prim = scene.GetPrim(path);
    if (!_IsActive(scene, prim, path)) {
        return settings;
    }
    const HdContainerDataSourceHandle container
        = HdOocPTFindContainer(prim.dataSource, { tokens.renderSettings, tokens.namespacedSettings });
    if (!container) {
        return settings;
    }
    for (const TfToken& name : container->GetNames()) {
        VtValue value = HdOocPTSample(container->Get(name));
        // Those of other renderers are of no use here.
        if (!value.IsEmpty() && TfStringStartsWith(name.GetString(), "oocpt:")) {
            settings[name] = value;
        }
    }
    return settings;
}

namespace {

// UsdImaging's scene delegate reports an error for names that it does not have.
bool _Has(const HdContainerDataSourceHandle& container, const TfToken& name)
{
    const TfTokenVector names = container ? container->GetNames() : TfTokenVector();
    return std::find(names.begin(), names.end(), name) != names.end();
}

} // namespace

HdContainerDataSourceHandle HdOocPTFindActiveSettings(const HdSceneIndexBase& scene, const SdfPath& path)
{
    const HdSceneIndexPrim prim = scene.GetPrim(path);
    return _IsActive(scene, prim, path) ? HdOocPTFindContainer(prim.dataSource, { HdOocPTSceneTokens->renderSettings })
                                        : nullptr;
}

namespace {

/// Returns true if one of the switches is on, of the settings or of all products.
bool _IsAnySet(const HdContainerDataSourceHandle& settings, const TfTokenVector& switches)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const auto isSet = [&](const HdContainerDataSourceHandle& container) {
        return std::any_of(switches.begin(), switches.end(), [&](const TfToken& name) {
            bool value = false;
            return _Has(container, name) && HdOocPTConvert(HdOocPTRead(container, { name }), &value) && value;
        });
    };
    if (isSet(settings)) {
        return true;
    }
    if (!_Has(settings, tokens.renderProducts)) {
        return false;
    }
    const HdVectorDataSourceHandle products
        = HdVectorDataSource::Cast(HdOocPTFind(settings, { tokens.renderProducts }));
    const size_t count = products ? products->GetNumElements() : 0;
    // There is one picture here: the effect is off if all wanted products turn it off.
    size_t without = 0;
    for (size_t i = 0; i < count; ++i) {
        without += isSet(HdContainerDataSource::Cast(products->GetElement(i))) ? 1 : 0;
    }
    return count > 0 && without == count;
}

std::optional<TfTokenVector> _ReadTokens(const HdContainerDataSourceHandle& settings, const TfToken& name)
{
    const VtValue value = _Has(settings, name) ? HdOocPTRead(settings, { name }) : VtValue();
    if (!value.IsHolding<VtArray<TfToken>>()) {
        return std::nullopt;
    }
    const VtArray<TfToken>& array = value.UncheckedGet<VtArray<TfToken>>();
    return TfTokenVector(array.begin(), array.end());
}

} // namespace

bool HdOocPTReadsMotionDisabled(const HdSceneIndexBase& scene, const SdfPath& path)
{
    const auto& tokens = *HdOocPTSceneTokens;
    return _IsAnySet(HdOocPTFindActiveSettings(scene, path), { tokens.disableMotionBlur, tokens.instantaneousShutter });
}

bool HdOocPTReadsLensDisabled(const HdSceneIndexBase& scene, const SdfPath& path)
{
    return _IsAnySet(HdOocPTFindActiveSettings(scene, path), { HdOocPTSceneTokens->disableDepthOfField });
}

namespace {

/// The dataWindowNDC of settings or of a product: left, bottom, right, top.
std::optional<GfVec4d> _ReadWindow(const HdContainerDataSourceHandle& container)
{
    const TfToken& name = HdOocPTSceneTokens->dataWindowNDC;
    const VtValue value = _Has(container, name) ? HdOocPTRead(container, { name }) : VtValue();
    if (value.IsHolding<GfVec4f>()) {
        return GfVec4d(value.UncheckedGet<GfVec4f>());
    }
    if (value.IsHolding<GfRange2f>()) {
        const GfRange2f& range = value.UncheckedGet<GfRange2f>();
        return GfVec4d(range.GetMin()[0], range.GetMin()[1], range.GetMax()[0], range.GetMax()[1]);
    }
    return std::nullopt;
}

/// The windows of the settings themselves or of all their products.
std::vector<GfVec4d> _ReadWindows(const HdContainerDataSourceHandle& settings)
{
    std::vector<GfVec4d> windows;
    if (const std::optional<GfVec4d> window = _ReadWindow(settings)) {
        windows.push_back(*window);
        return windows;
    }
    const TfToken& name = HdOocPTSceneTokens->renderProducts;
    const HdVectorDataSourceHandle products
        = _Has(settings, name) ? HdVectorDataSource::Cast(HdOocPTFind(settings, { name })) : nullptr;
    for (size_t i = 0; i < (products ? products->GetNumElements() : 0); ++i) {
        const std::optional<GfVec4d> window = _ReadWindow(HdContainerDataSource::Cast(products->GetElement(i)));
        // A product without one is of the whole picture.
        windows.push_back(window.value_or(GfVec4d(0.0, 0.0, 1.0, 1.0)));
    }
    return windows;
}

} // namespace

std::optional<GfRange2d> HdOocPTReadDataWindow(
    const HdSceneIndexBase& scene, const SdfPath& path, HdOocPTWarnings* warnings)
{
    const HdContainerDataSourceHandle settings = HdOocPTFindActiveSettings(scene, path);
    const std::vector<GfVec4d> windows = settings ? _ReadWindows(settings) : std::vector<GfVec4d>();
    GfRange2d all;
    for (const GfVec4d& window : windows) {
        if (!std::isfinite(window[0] + window[1] + window[2] + window[3])) {
            warnings->Add(path, "its dataWindowNDC is not finite; the whole picture is rendered");
            return std::nullopt;
        }
        if (window[0] < window[2] && window[1] < window[3]) {
            all.UnionWith(GfRange2d(GfVec2d(window[0], window[1]), GfVec2d(window[2], window[3])));
        }
    }
    const bool isWhole = windows.empty() || all == GfRange2d(GfVec2d(0.0), GfVec2d(1.0));
    return isWhole ? std::nullopt : std::make_optional(all);
}

HdOocPTPurposes HdOocPTReadPurposes(const HdSceneIndexBase& scene, const std::set<SdfPath>& prims)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTPurposes purposes;
    for (const SdfPath& path : prims) {
        const HdContainerDataSourceHandle settings = HdOocPTFindActiveSettings(scene, path);
        if (!settings) {
            continue;
        }
        purposes.settings = path;
        purposes.included = _ReadTokens(settings, tokens.includedPurposes);
        purposes.bindings = _ReadTokens(settings, tokens.materialBindingPurposes);
        purposes.isNamedByDelegate
            = static_cast<bool>(HdOocPTFind(scene.GetPrim(path).dataSource, { tokens.sceneDelegate }));
        if (_Has(settings, tokens.renderingColorSpace)) {
            HdOocPTConvert(HdOocPTRead(settings, { tokens.renderingColorSpace }), &purposes.colorSpace);
        }
        break;
    }
    return purposes;
}

void HdOocPTWarnOfPurposes(const HdOocPTPurposes& purposes, HdOocPTWarnings* warnings)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const bool isUsual = !purposes.bindings || purposes.bindings->empty() || purposes.bindings->front() == tokens.full;
    if (purposes.isNamedByDelegate && !isUsual) {
        warnings->Add(purposes.settings,
            "its materialBindingPurposes are not used: this front end hands over one material a prim, the one that is"
            " bound for the purpose full, else for all");
    }
    const TfToken& space = purposes.colorSpace;
    if (!space.IsEmpty() && space != tokens.lin_rec709 && space != tokens.lin_rec709_scene) {
        warnings->Add(purposes.settings,
            "its renderingColorSpace " + space.GetString()
                + " counts for files of render products alone; light is transported in linear Rec. 709, which images of"
                  " the host are in");
    }
}

std::set<TfToken> HdOocPTFindDisputedPurposes(const HdOocPTPurposes& purposes, const TfTokenVector& renderTags)
{
    const auto& tokens = *HdOocPTSceneTokens;
    std::set<TfToken> disputed;
    if (!purposes.included) {
        return disputed;
    }
    std::set<TfToken> shown;
    for (const TfToken& tag : renderTags) {
        shown.insert(HdOocPTPurposeOfTag(tag));
    }
    const std::set<TfToken> included(purposes.included->begin(), purposes.included->end());
    for (const TfToken& purpose : { tokens.defaultPurpose, tokens.render, tokens.proxy, tokens.guide }) {
        // An empty list of tags means all.
        const bool isShown = shown.empty() || shown.count(purpose) > 0;
        if (isShown != (included.count(purpose) > 0)) {
            disputed.insert(purpose);
        }
    }
    return disputed;
}

PXR_NAMESPACE_CLOSE_SCOPE
