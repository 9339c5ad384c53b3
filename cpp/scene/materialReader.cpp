// SPDX-License-Identifier: Apache-2.0
#include "scene/materialReader.h"

#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/gf/vec2d.h"
#include "pxr/base/gf/vec2f.h"
#include "pxr/base/gf/vec2h.h"
#include "pxr/base/gf/vec3d.h"
#include "pxr/base/gf/vec3f.h"
#include "pxr/base/gf/vec3h.h"
#include "pxr/base/gf/vec4d.h"
#include "pxr/base/gf/vec4f.h"
#include "pxr/base/gf/vec4h.h"
#include "pxr/usd/sdf/assetPath.h"
#include "scene/assetPath.h"
#include "scene/dataSource.h"
#include "scene/nodeDefinition.h"
#include "scene/tokens.h"

#include <algorithm>
#include <cstdint>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

rust::String _Text(const TfToken& token)
{
    return rust::String::lossy(token.GetString());
}

TfTokenVector _SortedNames(const HdContainerDataSourceHandle& container)
{
    TfTokenVector names = container ? container->GetNames() : TfTokenVector();
    std::sort(names.begin(), names.end());
    return names;
}

template <typename Vector>
bool _TakeVector(const VtValue& value, oocpt::ParamTag tag, oocpt::ParamDesc* param)
{
    if (!value.IsHolding<Vector>()) {
        return false;
    }
    const Vector& vector = value.UncheckedGet<Vector>();
    for (size_t i = 0; i < Vector::dimension; ++i) {
        param->numbers[i] = static_cast<float>(vector[i]);
    }
    param->tag = tag;
    return true;
}

bool _TakeVectors(const VtValue& value, oocpt::ParamDesc* param)
{
    using oocpt::ParamTag;
    return _TakeVector<GfVec3f>(value, ParamTag::Vec3, param) || _TakeVector<GfVec4f>(value, ParamTag::Vec4, param)
        || _TakeVector<GfVec2f>(value, ParamTag::Vec2, param) || _TakeVector<GfVec3d>(value, ParamTag::Vec3, param)
        || _TakeVector<GfVec4d>(value, ParamTag::Vec4, param) || _TakeVector<GfVec2d>(value, ParamTag::Vec2, param)
        || _TakeVector<GfVec3h>(value, ParamTag::Vec3, param) || _TakeVector<GfVec4h>(value, ParamTag::Vec4, param)
        || _TakeVector<GfVec2h>(value, ParamTag::Vec2, param);
}

bool _TakeScalar(const VtValue& value, oocpt::ParamDesc* param)
{
    TfToken text;
    double number = 0.0;
    if (value.IsHolding<bool>()) {
        param->tag = oocpt::ParamTag::Bool;
        param->flag = value.UncheckedGet<bool>();
    } else if (value.IsHolding<int>() || value.IsHolding<unsigned int>() || value.IsHolding<int64_t>()) {
        param->tag = oocpt::ParamTag::Int;
        param->integer = VtValue::Cast<int64_t>(value).GetWithDefault<int64_t>();
    } else if (HdOocPTConvert(value, &number)) {
        param->tag = oocpt::ParamTag::Float;
        param->numbers[0] = static_cast<float>(number);
    } else if (value.IsHolding<SdfAssetPath>()) {
        param->tag = oocpt::ParamTag::Asset;
        param->asset = HdOocPTDescribeAsset(value);
    } else if (HdOocPTConvert(value, &text)) {
        param->tag = oocpt::ParamTag::Text;
        param->text = _Text(text);
    } else {
        return false;
    }
    return true;
}

void _ReadParams(const HdContainerDataSourceHandle& node, oocpt::NodeDesc* desc)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdContainerDataSourceHandle params = HdOocPTFindContainer(node, { tokens.parameters });
    for (const TfToken& name : _SortedNames(params)) {
        const VtValue value = HdOocPTRead(params, { name, tokens.value });
        oocpt::ParamDesc param {};
        param.name = _Text(name);
        // Matrices, arrays and the like have no meaning in the nodes that the renderer knows, which says so if they are
        // asked for.
        if (_TakeScalar(value, &param) || _TakeVectors(value, &param)) {
            desc->params.push_back(std::move(param));
        }
        // Legacy front ends make this a parameter of its own, with the same name.
        TfToken colorSpace;
        HdOocPTConvert(HdOocPTRead(params, { name, tokens.colorSpace }), &colorSpace);
        const TfToken colorSpaceName("colorSpace:" + name.GetString());
        if (!colorSpace.IsEmpty() && !params->Get(colorSpaceName)) {
            oocpt::ParamDesc space {};
            space.tag = oocpt::ParamTag::Text;
            space.name = _Text(colorSpaceName);
            space.text = _Text(colorSpace);
            desc->params.push_back(std::move(space));
        }
    }
}

/// Number of a name in a sorted list, or -1.
int32_t _NumberOf(const TfToken& name, const TfTokenVector& names)
{
    const auto found = std::lower_bound(names.begin(), names.end(), name);
    return found == names.end() || *found != name ? -1 : static_cast<int32_t>(found - names.begin());
}

void _ReadConnections(const HdContainerDataSourceHandle& node, const TfTokenVector& nodes, oocpt::NodeDesc* desc)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdContainerDataSourceHandle inputs = HdOocPTFindContainer(node, { tokens.inputConnections });
    for (const TfToken& name : _SortedNames(inputs)) {
        const HdVectorDataSourceHandle sources = HdVectorDataSource::Cast(inputs->Get(name));
        // An input with several sources takes the first.
        if (!sources || sources->GetNumElements() == 0) {
            continue;
        }
        const HdContainerDataSourceHandle connection = HdContainerDataSource::Cast(sources->GetElement(0));
        TfToken upstream;
        TfToken output;
        HdOocPTConvert(HdOocPTRead(connection, { tokens.upstreamNodePath }), &upstream);
        HdOocPTConvert(HdOocPTRead(connection, { tokens.upstreamNodeOutputName }), &output);
        const int32_t number = _NumberOf(upstream, nodes);
        if (number >= 0) {
            desc->connections.push_back({ _Text(name), static_cast<uint32_t>(number), _Text(output) });
        }
    }
}

} // namespace

oocpt::MaterialDesc HdOocPTReadMaterial(const HdOocPTPrimSource& source)
{
    const auto& tokens = *HdOocPTSceneTokens;
    oocpt::MaterialDesc desc {};
    desc.path = rust::String::lossy(source.path.GetString());
    HdContainerDataSourceHandle network = HdOocPTFindContainer(source.container, { tokens.material, tokens.mtlx });
    if (!network) {
        network = HdOocPTFindContainer(source.container, { tokens.material, tokens.universal });
    }
    const HdContainerDataSourceHandle nodes = HdOocPTFindContainer(network, { tokens.nodes });
    const TfTokenVector names = _SortedNames(nodes);
    for (const TfToken& name : names) {
        const HdContainerDataSourceHandle node = HdContainerDataSource::Cast(nodes->Get(name));
        oocpt::NodeDesc item {};
        // The new front end names nodes relative to the material.
        const bool isAbsolute = !name.GetString().empty() && name.GetString().front() == '/';
        item.path
            = rust::String::lossy(isAbsolute ? name.GetString() : source.path.GetString() + "/" + name.GetString());
        const HdOocPTNodeDefinition definition = HdOocPTFindNodeDefinition(node);
        item.kind = _Text(definition.name);
        _ReadParams(node, &item);
        if (!definition.file.IsEmpty()) {
            oocpt::ParamDesc param {};
            param.tag = oocpt::ParamTag::Asset;
            param.name = "info:mtlx:sourceAsset";
            param.asset = HdOocPTDescribeAsset(definition.file);
            item.params.push_back(std::move(param));
        }
        _ReadConnections(node, names, &item);
        desc.nodes.push_back(std::move(item));
    }
    const auto terminal = [&](const TfToken& name) {
        TfToken node;
        HdOocPTConvert(HdOocPTRead(network, { tokens.terminals, name, tokens.upstreamNodePath }), &node);
        return _NumberOf(node, names);
    };
    desc.surface = terminal(tokens.surface);
    desc.displacement = terminal(tokens.displacement);
    if (HdOocPTFind(network, { tokens.terminals, tokens.volume })) {
        source.warnings->Add(source.path, "volume shaders are not supported yet; only the surface is shaded");
    }
    return desc;
}

PXR_NAMESPACE_CLOSE_SCOPE
