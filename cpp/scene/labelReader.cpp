// SPDX-License-Identifier: Apache-2.0
#include "scene/labelReader.h"

#include "pxr/base/vt/array.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <algorithm>
#include <iterator>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

} // namespace

std::string HdOocPTReadLabel(const HdContainerDataSourceHandle& container)
{
    const auto& tokens = *HdOocPTSceneTokens;
    for (const TfToken& name : HdOocPTLabelTokens->allTokens) {
        const std::string text
            = HdOocPTReadText(HdOocPTRead(container, { tokens.primvars, name, tokens.primvarValue }));
        if (!text.empty()) {
            return text;
        }
    }
    return std::string();
}

namespace {

std::vector<std::string> _Texts(const VtValue& value)
{
    std::vector<std::string> texts;
    if (value.IsHolding<VtArray<std::string>>()) {
        const VtArray<std::string>& array = value.UncheckedGet<VtArray<std::string>>();
        texts.assign(array.cbegin(), array.cend());
    } else if (value.IsHolding<VtArray<TfToken>>()) {
        const VtArray<TfToken>& array = value.UncheckedGet<VtArray<TfToken>>();
        std::transform(array.cbegin(), array.cend(), std::back_inserter(texts),
            [](const TfToken& token) { return token.GetString(); });
    }
    return texts;
}

} // namespace

std::vector<std::string> HdOocPTReadTexts(
    const HdContainerDataSourceHandle& container, const TfToken& name, bool isOfInstances)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdContainerDataSourceHandle primvar = HdOocPTFindContainer(container, { tokens.primvars, name });
    if (!primvar) {
        return {};
    }
    TfToken interpolation;
    HdOocPTConvert(HdOocPTRead(primvar, { tokens.interpolation }), &interpolation);
    if (!isOfInstances) {
        const std::string text = HdOocPTReadText(HdOocPTRead(primvar, { tokens.primvarValue }));
        const bool isOfPrim = interpolation.IsEmpty() || interpolation == tokens.constant;
        return isOfPrim && !text.empty() ? std::vector<std::string> { text } : std::vector<std::string>();
    }
    if (interpolation != tokens.instance) {
        return {};
    }
    // The data source applies indices.
    return _Texts(HdOocPTRead(primvar, { tokens.primvarValue }));
}

PXR_NAMESPACE_CLOSE_SCOPE
