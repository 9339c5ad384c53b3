// SPDX-License-Identifier: Apache-2.0
#include "scene/lightReader.h"

#include "bridge/text.h"
#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/gf/matrix4d.h"
#include "pxr/base/gf/vec3f.h"
#include "pxr/usd/sdf/path.h"
#include "scene/assetPath.h"
#include "scene/dataSource.h"
#include "scene/labelReader.h"
#include "scene/sceneObserver.h"
#include "scene/tokens.h"

#include <array>
#include <set>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

/// The inputs of a light. Both front ends serve them by name in the container "light"; an input that a front end serves
/// only as a parameter of the light's shading node is found there.
class _Inputs
{
public:
    explicit _Inputs(const HdContainerDataSourceHandle& container)
    {
        const auto& tokens = *HdOocPTSceneTokens;
        _light = HdOocPTFindContainer(container, { tokens.light });
        const auto nodes = HdOocPTFindContainer(container, { tokens.material, tokens.universal, tokens.nodes });
        const TfTokenVector names = nodes ? nodes->GetNames() : TfTokenVector();
        if (names.size() == 1) {
            _params = HdOocPTFindContainer(nodes, { names.front(), tokens.parameters });
            HdOocPTConvert(HdOocPTRead(nodes, { names.front(), tokens.nodeIdentifier }), &_shader);
        }
    }

    VtValue Get(const TfToken& name) const
    {
        const VtValue value = HdOocPTRead(_light, { name });
        return value.IsEmpty() ? HdOocPTRead(_params, { name, HdOocPTSceneTokens->value }) : value;
    }

    template <typename Value>
    Value Get(const TfToken& name, Value fallback) const
    {
        HdOocPTConvert(Get(name), &fallback);
        return fallback;
    }

    std::array<float, 3> GetColor(const TfToken& name, const GfVec3f& fallback) const
    {
        const GfVec3f color = Get(name, fallback);
        return { color[0], color[1], color[2] };
    }

    /// The identifier of the light's shading node.
    const TfToken& GetShader() const { return _shader; }

    rust::String GetText(const TfToken& name) const { return HdOocPTText(Get(name, TfToken())); }

private:
    HdContainerDataSourceHandle _light;
    HdContainerDataSourceHandle _params;
    TfToken _shader;
};

oocpt::LightTag _Kind(const TfToken& type)
{
    const auto& tokens = *HdOocPTSceneTokens;
    return type == tokens.mesh         ? oocpt::LightTag::GlowTintedMesh
        : type == tokens.domeLight     ? oocpt::LightTag::Dome
        : type == tokens.rectLight     ? oocpt::LightTag::Rect
        : type == tokens.sphereLight   ? oocpt::LightTag::Sphere
        : type == tokens.diskLight     ? oocpt::LightTag::Disk
        : type == tokens.cylinderLight ? oocpt::LightTag::Cylinder
                                       : oocpt::LightTag::Distant;
}

// The numbers below are the defaults of the UsdLux schemas, for hosts that leave unauthored inputs out.

void _ReadShape(const _Inputs& inputs, oocpt::LightDesc* desc)
{
    const auto& tokens = *HdOocPTSceneTokens;
    desc->angle_degrees = inputs.Get(tokens.angle, 0.53f);
    desc->width = inputs.Get(tokens.width, 1.0f);
    desc->height = inputs.Get(tokens.height, 1.0f);
    desc->radius = inputs.Get(tokens.radius, 0.5f);
    desc->length = inputs.Get(tokens.length, 1.0f);
    desc->treat_as_point = desc->kind == oocpt::LightTag::Sphere && inputs.Get(tokens.treatAsPoint, false);
    desc->treat_as_line = desc->kind == oocpt::LightTag::Cylinder && inputs.Get(tokens.treatAsLine, false);
}

void _ReadEmission(const _Inputs& inputs, oocpt::LightDesc* desc)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const bool isDistant = desc->kind == oocpt::LightTag::Distant;
    desc->intensity = inputs.Get(tokens.intensity, isDistant ? 50000.0f : 1.0f);
    desc->exposure = inputs.Get(tokens.exposure, 0.0f);
    desc->color = inputs.GetColor(tokens.color, GfVec3f(1.0f));
    desc->normalize = inputs.Get(tokens.normalize, false);
    desc->enable_color_temperature = inputs.Get(tokens.enableColorTemperature, false);
    desc->color_temperature = inputs.Get(tokens.colorTemperature, 6500.0f);
    desc->diffuse = inputs.Get(tokens.diffuse, 1.0f);
    desc->specular = inputs.Get(tokens.specular, 1.0f);
    desc->format = inputs.GetText(tokens.textureFormat);
    if (desc->kind == oocpt::LightTag::Dome || desc->kind == oocpt::LightTag::Rect) {
        desc->texture = HdOocPTDescribeAsset(inputs.Get(tokens.textureFile));
    }
}

void _ReadShaping(const _Inputs& inputs, oocpt::LightDesc* desc)
{
    const auto& tokens = *HdOocPTSceneTokens;
    oocpt::ShapingDesc& shaping = desc->shaping;
    // Only prims with the schema have a cone, of 90 degrees if it is not authored.
    // Blender's scene delegate calls them as USD's attributes are called.
    shaping.cone_angle_degrees = inputs.Get(tokens.coneAngle, inputs.Get(tokens.authoredConeAngle, 180.0f));
    shaping.cone_softness = inputs.Get(tokens.coneSoftness, inputs.Get(tokens.authoredConeSoftness, 0.0f));
    shaping.focus = inputs.Get(tokens.shapingFocus, 0.0f);
    shaping.focus_tint = inputs.GetColor(tokens.focusTint, GfVec3f(0.0f));
    shaping.ies = HdOocPTDescribeAsset(inputs.Get(tokens.iesFile));
    shaping.ies_angle_scale = inputs.Get(tokens.iesAngleScale, 0.0f);
    shaping.ies_normalize = inputs.Get(tokens.iesNormalize, false);
    desc->has_shaping = shaping.cone_angle_degrees < 180.0f || shaping.cone_softness != 0.0f || shaping.focus != 0.0f
        || !shaping.ies.authored.empty();
}

/// The light group, by inputs or primvars.
rust::String _ReadLabel(const HdOocPTPrimSource& source, const _Inputs& inputs)
{
    const auto& labels = *HdOocPTLabelTokens;
    for (const TfToken& name : { labels.lightGroup, labels.riLightGroup, labels.karmaLightTag }) {
        const rust::String text = inputs.GetText(name);
        if (!text.empty()) {
            return text;
        }
    }
    return HdOocPTText(HdOocPTReadLabel(source.container));
}

/// Warns of light shaders of other renderers, which may have any inputs. A schema's own is named as its type; the
/// lights that hosts make at the camera have RenderMan's names for two of them.
void _WarnOfShader(const HdOocPTPrimSource& source, const _Inputs& inputs)
{
    static const std::set<std::string> own { "", "CylinderLight", "DiskLight", "DistantLight", "DomeLight",
        "DomeLight_1", "MeshLight", "PxrDistantLight", "PxrDomeLight", "RectLight", "SphereLight", "simpleLight" };
    const std::string& shader = inputs.GetShader().GetString();
    if (own.count(shader) == 0) {
        source.warnings->Add(
            source.path, "its shader " + shader + " is not supported; the light is what its schema says");
    }
}

/// The combination of a mesh's light and its material.
oocpt::LightTag _MaterialSync(const _Inputs& inputs)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const TfToken mode = inputs.Get(tokens.materialSyncMode, TfToken());
    return mode == tokens.independent       ? oocpt::LightTag::IndependentMesh
        : mode == tokens.noMaterialResponse ? oocpt::LightTag::LightOnlyMesh
                                            : oocpt::LightTag::GlowTintedMesh;
}

/// Warns of shaping on lights at infinity, which have no position for a cone or a profile, as in hdEmbree.
void _WarnOfShaping(const HdOocPTPrimSource& source, const oocpt::LightDesc& desc)
{
    const bool isInfinite = desc.kind == oocpt::LightTag::Distant || desc.kind == oocpt::LightTag::Dome;
    const oocpt::ShapingDesc& shaping = desc.shaping;
    const bool isShaped = shaping.cone_angle_degrees < 90.0f || shaping.cone_softness > 0.0f || shaping.focus > 0.0f
        || !shaping.ies.authored.empty();
    if (isInfinite && isShaped) {
        source.warnings->Add(source.path, "its shaping is left out: distant lights and domes have none");
    }
}

void _WarnOfFiltersAndPortals(const HdOocPTPrimSource& source, const _Inputs& inputs)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const auto hasAny = [&](const TfToken& name) { return !inputs.Get(name).GetWithDefault<SdfPathVector>().empty(); };
    const bool hasFilters = hasAny(tokens.filters);
    const bool hasPortals = hasAny(tokens.portals);
    if (hasFilters || hasPortals) {
        source.warnings->Add(source.path,
            std::string("has ")
                + (hasFilters && hasPortals ? "filters and portals"
                        : hasFilters        ? "filters"
                                            : "portals")
                + ", which are not supported yet; it shines without them");
    }
}

} // namespace

bool HdOocPTIsMeshLight(const HdContainerDataSourceHandle& container)
{
    const auto& tokens = *HdOocPTSceneTokens;
    bool isLight = false;
    HdOocPTConvert(HdOocPTRead(container, { tokens.light, tokens.isLight }), &isLight);
    return isLight;
}

oocpt::LightDesc HdOocPTReadLight(const HdOocPTPrimSource& source, const TfToken& type)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const _Inputs inputs(source.container);
    HdOocPTPrimState prim;
    HdOocPTReadPrim({ source.path, source.container, HdOocPTDirtyAll, source.warnings, source.shutter }, &prim);
    oocpt::LightDesc desc {};
    desc.kind = _Kind(type);
    if (desc.kind == oocpt::LightTag::Dome) {
        // The pole axis of a DomeLight_1 is a transform in Hydra, between the light and its texture.
        prim.transform = inputs.Get(tokens.domeOffset, GfMatrix4d(1.0)) * prim.transform;
    }
    HdOocPTFillPrim(source.path, prim, &desc.prim);
    if (type == tokens.mesh) {
        desc.kind = _MaterialSync(inputs);
        // MESH_LIGHT of the renderer's core: no prim has such a name.
        desc.prim.path = HdOocPTText(source.path.GetString() + HdOocPTMeshLightSuffix);
    }
    _ReadShape(inputs, &desc);
    _ReadEmission(inputs, &desc);
    _ReadShaping(inputs, &desc);
    _WarnOfShaping(source, desc);
    desc.shadow_enable = inputs.Get(tokens.shadowEnable, true);
    desc.shadow_color = inputs.GetColor(tokens.shadowColor, GfVec3f(0.0f));
    desc.shadow_reach = { inputs.Get(tokens.shadowDistance, -1.0f), inputs.Get(tokens.shadowFalloff, -1.0f),
        inputs.Get(tokens.shadowFalloffGamma, 1.0f) };
    desc.light_link = inputs.GetText(tokens.lightLink);
    desc.shadow_link = inputs.GetText(tokens.shadowLink);
    desc.label = _ReadLabel(source, inputs);
    desc.camera_visible = true;
    HdOocPTConvert(HdOocPTRead(source.container, { tokens.primvars, tokens.cameraVisibility, tokens.primvarValue }),
        &desc.camera_visible);
    _WarnOfFiltersAndPortals(source, inputs);
    _WarnOfShader(source, inputs);
    return desc;
}

PXR_NAMESPACE_CLOSE_SCOPE
