// SPDX-License-Identifier: Apache-2.0
#include "scene/primvarReader.h"

#include "bridge/text.h"
#include "oocpt-bridge/src/lib.rs.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <algorithm>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

/// Reads an array of the primvar; `warnings` is null if unusable values are to be dropped silently.
VtValue _ReadValues(const HdOocPTPrimSource& source, const TfToken& name, const TfToken& part, HdOocPTArrayRole role)
{
    const auto& tokens = *HdOocPTSceneTokens;
    if (source.warnings) {
        return HdOocPTReadArray(source, { tokens.primvars, name, part }, role);
    }
    std::string reason;
    return HdOocPTNormalizeArray(HdOocPTRead(source.container, { tokens.primvars, name, part }), role, &reason);
}

oocpt::InterpolationTag _InterpolationTag(const TfToken& name)
{
    const auto& tokens = *HdOocPTSceneTokens;
    return name == tokens.uniform    ? oocpt::InterpolationTag::Uniform
        : name == tokens.varying     ? oocpt::InterpolationTag::Varying
        : name == tokens.vertex      ? oocpt::InterpolationTag::Vertex
        : name == tokens.faceVarying ? oocpt::InterpolationTag::FaceVarying
        : name == tokens.instance    ? oocpt::InterpolationTag::Instance
                                     : oocpt::InterpolationTag::Constant;
}

} // namespace

HdOocPTPrimvarState HdOocPTReadPrimvar(const HdOocPTPrimSource& source, const TfToken& name, HdOocPTArrayRole role)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTPrimvarState primvar;
    if (!HdOocPTFind(source.container, { tokens.primvars, name })) {
        return primvar;
    }
    HdOocPTConvert(
        HdOocPTRead(source.container, { tokens.primvars, name, tokens.interpolation }), &primvar.interpolation);
    primvar.indices = _ReadValues(source, name, tokens.indices, HdOocPTArrayRole::Integers);
    if (primvar.indices.GetArraySize() != 0) {
        primvar.values = _ReadValues(source, name, tokens.indexedPrimvarValue, role);
        if (!primvar.values.IsEmpty()) {
            return primvar;
        }
    }
    primvar.indices = VtValue();
    primvar.values = _ReadValues(source, name, tokens.primvarValue, role);
    if (primvar.values.IsEmpty()) {
        primvar.values = _ReadValues(source, name, tokens.indexedPrimvarValue, role);
    }
    return primvar;
}

HdOocPTNamedPrimvars HdOocPTReadOtherPrimvars(const HdOocPTPrimSource& source, std::initializer_list<TfToken> except)
{
    HdOocPTNamedPrimvars primvars;
    const HdContainerDataSourceHandle container
        = HdOocPTFindContainer(source.container, { HdOocPTSceneTokens->primvars });
    if (!container) {
        return primvars;
    }
    HdOocPTPrimSource quiet = source;
    quiet.warnings = nullptr;
    for (const TfToken& name : container->GetNames()) {
        if (std::find(except.begin(), except.end(), name) != except.end()) {
            continue;
        }
        HdOocPTPrimvarState primvar = HdOocPTReadPrimvar(quiet, name, HdOocPTArrayRole::Values);
        if (!primvar.values.IsEmpty()) {
            primvars.emplace_back(name, std::move(primvar));
        }
    }
    std::sort(primvars.begin(), primvars.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    return primvars;
}

oocpt::PrimvarDesc HdOocPTDescribePrimvar(const HdOocPTPrimvarState& primvar)
{
    return { _InterpolationTag(primvar.interpolation), HdOocPTHoldArray(primvar.values),
        HdOocPTHoldArray(primvar.indices) };
}

rust::Vec<oocpt::NamedPrimvarDesc> HdOocPTDescribePrimvars(const HdOocPTNamedPrimvars& primvars)
{
    rust::Vec<oocpt::NamedPrimvarDesc> descs;
    descs.reserve(primvars.size());
    for (const auto& [name, primvar] : primvars) {
        descs.push_back({ HdOocPTText(name), HdOocPTDescribePrimvar(primvar) });
    }
    return descs;
}

PXR_NAMESPACE_CLOSE_SCOPE
