// SPDX-License-Identifier: Apache-2.0
#include "scene/lightReader.h"

#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/gf/vec3f.h"
#include "pxr/usd/sdf/assetPath.h"
#include "scene/dataSource.h"
#include "scene/sceneObserver.h"
#include "scene/tokens.h"

#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

void _WarnOfTexture(const HdOocPTPrimSource& source)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const VtValue texture = HdOocPTRead(source.container, { tokens.light, tokens.textureFile });
    const std::string file = texture.IsHolding<SdfAssetPath>() ? texture.UncheckedGet<SdfAssetPath>().GetAssetPath()
                                                               : texture.GetWithDefault<std::string>();
    if (!file.empty()) {
        source.warnings->Add(source.path,
            "the texture " + file
                + " is not read yet (this version has no textures); the light has its constant color");
    }
}

} // namespace

oocpt::LightDesc HdOocPTReadLight(const HdOocPTPrimSource& source, const TfToken& type)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdContainerDataSourceHandle light = HdOocPTFindContainer(source.container, { tokens.light });
    const auto number = [&](const TfToken& name, float fallback) {
        HdOocPTConvert(HdOocPTRead(light, { name }), &fallback);
        return fallback;
    };
    const auto flag = [&](const TfToken& name) {
        bool value = false;
        HdOocPTConvert(HdOocPTRead(light, { name }), &value);
        return value;
    };

    HdOocPTPrimState prim;
    HdOocPTReadPrim({ source.path, source.container, HdOocPTDirtyAll, source.warnings }, &prim);
    oocpt::LightDesc desc;
    HdOocPTFillPrim(source.path, prim, &desc.prim);
    const bool isDome = type == tokens.domeLight;
    desc.kind = isDome ? oocpt::LightTag::Dome : oocpt::LightTag::Distant;
    // The schema's own defaults, for hosts that leave unauthored inputs out.
    desc.angle_degrees = number(tokens.angle, 0.53f);
    desc.intensity = number(tokens.intensity, isDome ? 1.0f : 50000.0f);
    desc.exposure = number(tokens.exposure, 0.0f);
    desc.normalize = flag(tokens.normalize);
    desc.enable_color_temperature = flag(tokens.enableColorTemperature);
    desc.color_temperature = number(tokens.colorTemperature, 6500.0f);
    desc.camera_visible = true;
    GfVec3f color(1.0f);
    HdOocPTConvert(HdOocPTRead(light, { tokens.color }), &color);
    desc.color = { color[0], color[1], color[2] };
    if (isDome) {
        _WarnOfTexture(source);
    }
    return desc;
}

PXR_NAMESPACE_CLOSE_SCOPE
