// SPDX-License-Identifier: Apache-2.0
#include "scene/nodeDefinition.h"

#include "pxr/usd/sdf/assetPath.h"
#include "pxr/usd/sdr/registry.h"
#include "pxr/usd/sdr/shaderNode.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

/// The suffix of the registry's identifiers that were made for a MaterialX document.
const std::string _end = "><mtlx>";
/// The text before the file in the registry's description of a node.
const std::string _before = "implementation URI: '";

/// The definition's name in `number<name><mtlx>`; empty for other identifiers.
std::string _NameIn(const std::string& identifier)
{
    const size_t begin = identifier.find('<');
    const bool ends = identifier.size() > _end.size()
        && identifier.compare(identifier.size() - _end.size(), _end.size(), _end) == 0;
    if (!ends || begin == std::string::npos || begin + 1 + _end.size() > identifier.size()) {
        return {};
    }
    return identifier.substr(begin + 1, identifier.size() - _end.size() - begin - 1);
}

/// The file that the registry read a node from; empty if it is not known.
std::string _FileOf(const TfToken& identifier)
{
    const SdrShaderNode* const found
        = SdrRegistry::GetInstance().GetShaderNodeByIdentifier(identifier, { HdOocPTSceneTokens->mtlx });
    if (!found) {
        return {};
    }
    // The accessors are inline, and the offsets of their members differ from version to version.
    const std::string words = found->SdrShaderNode::GetInfoString();
    const size_t at = words.rfind(_before);
    if (at == std::string::npos || words.empty() || words.back() != '\'') {
        return {};
    }
    const size_t begin = at + _before.size();
    return begin < words.size() ? words.substr(begin, words.size() - 1 - begin) : std::string();
}

} // namespace

HdOocPTNodeDefinition HdOocPTFindNodeDefinition(const HdContainerDataSourceHandle& node)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTNodeDefinition definition;
    HdOocPTConvert(HdOocPTRead(node, { tokens.nodeIdentifier }), &definition.name);
    if (definition.name.IsEmpty()) {
        TfToken name;
        HdOocPTConvert(HdOocPTRead(node, { tokens.nodeTypeInfo, tokens.mtlxSubIdentifier }), &name);
        const VtValue file = HdOocPTRead(node, { tokens.nodeTypeInfo, tokens.mtlxSourceAsset });
        if (!name.IsEmpty() && file.IsHolding<SdfAssetPath>()) {
            definition.name = name;
            definition.file = file;
        }
        return definition;
    }
    const std::string name = _NameIn(definition.name.GetString());
    if (!name.empty()) {
        const std::string file = _FileOf(definition.name);
        definition.name = TfToken(name);
        if (!file.empty()) {
            definition.file = VtValue(SdfAssetPath(file, file));
        }
    }
    return definition;
}

PXR_NAMESPACE_CLOSE_SCOPE
