// SPDX-License-Identifier: Apache-2.0
#include "scene/settingsReader.h"

#include "scene/dataSource.h"
#include "scene/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

SdfPath HdOocPTActiveRenderSettings(const HdSceneIndexBase& scene)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdSceneIndexPrim root = scene.GetPrim(SdfPath::AbsoluteRootPath());
    return HdOocPTRead(root.dataSource, { tokens.sceneGlobals, tokens.activeRenderSettingsPrim })
        .GetWithDefault<SdfPath>();
}

HdOocPTSettingMap HdOocPTReadRenderSettings(const HdSceneIndexBase& scene, const SdfPath& path)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTSettingMap settings;
    const HdSceneIndexPrim prim = scene.GetPrim(path);
    bool active = false;
    HdOocPTConvert(HdOocPTRead(prim.dataSource, { tokens.renderSettings, tokens.active }), &active);
    if (!active && HdOocPTActiveRenderSettings(scene) != path) {
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
