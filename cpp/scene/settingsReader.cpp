// SPDX-License-Identifier: Apache-2.0
#include "scene/settingsReader.h"

#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <algorithm>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

bool _IsActive(const HdSceneIndexBase& scene, const HdSceneIndexPrim& prim, const SdfPath& path)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdSceneIndexPrim root = scene.GetPrim(SdfPath::AbsoluteRootPath());
    if (const HdContainerDataSourceHandle globals = HdOocPTFindContainer(root.dataSource, { tokens.sceneGlobals })) {
        return HdOocPTRead(globals, { tokens.activeRenderSettingsPrim }).GetWithDefault<SdfPath>() == path;
    }
    // Asked only where there are no globals: UsdImaging's scene delegate answers this name with an error.
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
        if (!value.IsEmpty()) {
            settings[name] = value;
        }
    }
    return settings;
}

bool HdOocPTReadsMotionDisabled(const HdSceneIndexBase& scene, const SdfPath& path)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdSceneIndexPrim prim = scene.GetPrim(path);
    if (!_IsActive(scene, prim, path)) {
        return false;
    }
    const HdContainerDataSourceHandle settings = HdOocPTFindContainer(prim.dataSource, { tokens.renderSettings });
    // UsdImaging's scene delegate answers names that it does not have with an error.
    const auto has = [](const HdContainerDataSourceHandle& container, const TfToken& name) {
        const TfTokenVector names = container ? container->GetNames() : TfTokenVector();
        return std::find(names.begin(), names.end(), name) != names.end();
    };
    const auto isSet = [&](const HdContainerDataSourceHandle& container) {
        bool set = false;
        for (const TfToken& name :
            { HdOocPTSceneTokens->disableMotionBlur, HdOocPTSceneTokens->instantaneousShutter }) {
            bool value = false;
            set = set || (has(container, name) && HdOocPTConvert(HdOocPTRead(container, { name }), &value) && value);
        }
        return set;
    };
    if (isSet(settings)) {
        return true;
    }
    if (!has(settings, tokens.renderProducts)) {
        return false;
    }
    const HdVectorDataSourceHandle products
        = HdVectorDataSource::Cast(HdOocPTFind(settings, { tokens.renderProducts }));
    const size_t count = products ? products->GetNumElements() : 0;
    // There is one picture here: it is at rest if all that are wanted are.
    size_t still = 0;
    for (size_t i = 0; i < count; ++i) {
        still += isSet(HdContainerDataSource::Cast(products->GetElement(i))) ? 1 : 0;
    }
    return count > 0 && still == count;
}

PXR_NAMESPACE_CLOSE_SCOPE
