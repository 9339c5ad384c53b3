// SPDX-License-Identifier: Apache-2.0
#include "scene/settingsReader.h"

#include "scene/dataSource.h"
#include "scene/tokens.h"

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
    const auto isSet = [](const HdContainerDataSourceHandle& container) {
        bool disables = false;
        bool instantaneous = false;
        HdOocPTConvert(HdOocPTRead(container, { HdOocPTSceneTokens->disableMotionBlur }), &disables);
        HdOocPTConvert(HdOocPTRead(container, { HdOocPTSceneTokens->instantaneousShutter }), &instantaneous);
        return disables || instantaneous;
    };
    if (settings && isSet(settings)) {
        return true;
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
