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

PXR_NAMESPACE_CLOSE_SCOPE
