// SPDX-License-Identifier: Apache-2.0
#include "scene/materialReader.h"

#include "bridge/text.h"
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
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

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
        param->text = HdOocPTText(text);
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
        param.name = HdOocPTText(name);
        // Matrices, arrays and the like have no meaning in the nodes that the renderer knows; it warns if they are
        // used.
        if (_TakeScalar(value, &param) || _TakeVectors(value, &param)) {
            desc->params.push_back(std::move(param));
        }
        // Legacy front ends make this a separate parameter with the same name.
        TfToken colorSpace;
        HdOocPTConvert(HdOocPTRead(params, { name, tokens.colorSpace }), &colorSpace);
        const TfToken colorSpaceName("colorSpace:" + name.GetString());
        if (!colorSpace.IsEmpty() && !params->Get(colorSpaceName)) {
            oocpt::ParamDesc space {};
            space.tag = oocpt::ParamTag::Text;
            space.name = HdOocPTText(colorSpaceName);
            space.text = HdOocPTText(colorSpace);
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

/// `first`: the number that the first of `nodes` has in the material.
void _ReadConnections(
    const HdContainerDataSourceHandle& node, const TfTokenVector& nodes, uint32_t first, oocpt::NodeDesc* desc)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdContainerDataSourceHandle inputs = HdOocPTFindContainer(node, { tokens.inputConnections });
    for (const TfToken& name : _SortedNames(inputs)) {
        const HdVectorDataSourceHandle sources = HdVectorDataSource::Cast(inputs->Get(name));
        // Only the first of several sources of an input is used.
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
            desc->connections.push_back(
                { HdOocPTText(name), first + static_cast<uint32_t>(number), HdOocPTText(output) });
        }
    }
}

/// The network of a render context, whose nodes are added to a material once one of its terminals is used.
class _Network
{
public:
    _Network(const HdOocPTPrimSource& source, const TfToken& context)
        : _source(source)
        , _container(HdOocPTFindContainer(source.container, { HdOocPTSceneTokens->material, context }))
        , _nodes(HdOocPTFindContainer(_container, { HdOocPTSceneTokens->nodes }))
        , _names(_SortedNames(_nodes))
    {
    }

    bool HasTerminal(const TfToken& name) const
    {
        return static_cast<bool>(HdOocPTFind(_container, { HdOocPTSceneTokens->terminals, name }));
    }

    /// The number in the material of the node at a terminal, or -1.
    int32_t Use(const TfToken& name, oocpt::MaterialDesc* desc)
    {
        const auto& tokens = *HdOocPTSceneTokens;
        TfToken node;
        HdOocPTConvert(HdOocPTRead(_container, { tokens.terminals, name, tokens.upstreamNodePath }), &node);
        const int32_t number = _NumberOf(node, _names);
        if (number < 0) {
            return -1;
        }
        if (!_isRead) {
            _Read(desc);
        }
        return static_cast<int32_t>(_first) + number;
    }

private:
    void _Read(oocpt::MaterialDesc* desc)
    {
        _isRead = true;
        _first = static_cast<uint32_t>(desc->nodes.size());
        for (const TfToken& name : _names) {
            const HdContainerDataSourceHandle node = HdContainerDataSource::Cast(_nodes->Get(name));
            oocpt::NodeDesc item {};
            // The new front end names nodes relative to the material.
            const std::string& text = name.GetString();
            const bool isAbsolute = !text.empty() && text.front() == '/';
            item.path = HdOocPTText(isAbsolute ? text : _source.path.GetString() + "/" + text);
            const HdOocPTNodeDefinition definition = HdOocPTFindNodeDefinition(node);
            item.kind = HdOocPTText(definition.name);
            _ReadParams(node, &item);
            if (!definition.file.IsEmpty()) {
                oocpt::ParamDesc param {};
                param.tag = oocpt::ParamTag::Asset;
                param.name = "info:mtlx:sourceAsset";
                param.asset = HdOocPTDescribeAsset(definition.file);
                item.params.push_back(std::move(param));
            }
            _ReadConnections(node, _names, _first, &item);
            desc->nodes.push_back(std::move(item));
        }
    }

    const HdOocPTPrimSource& _source;
    const HdContainerDataSourceHandle _container;
    const HdContainerDataSourceHandle _nodes;
    const TfTokenVector _names;
    bool _isRead = false;
    uint32_t _first = 0;
};

} // namespace

oocpt::MaterialDesc HdOocPTReadMaterial(const HdOocPTPrimSource& source)
{
    const auto& tokens = *HdOocPTSceneTokens;
    oocpt::MaterialDesc desc {};
    desc.path = HdOocPTText(source.path);
    // A terminal that a context lacks is taken from the next one, each by itself.
    _Network networks[] { { source, tokens.mtlx }, { source, tokens.universal } };
    const auto terminal = [&](const TfToken& name) {
        const int32_t number = networks[0].Use(name, &desc);
        return number >= 0 ? number : networks[1].Use(name, &desc);
    };
    desc.surface = terminal(tokens.surface);
    desc.displacement = terminal(tokens.displacement);
    if (networks[0].HasTerminal(tokens.volume) || networks[1].HasTerminal(tokens.volume)) {
        source.warnings->Add(source.path, "volume shaders are not supported yet; only the surface is shaded");
    }
    return desc;
}

PXR_NAMESPACE_CLOSE_SCOPE
