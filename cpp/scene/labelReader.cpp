// SPDX-License-Identifier: Apache-2.0
#include "scene/labelReader.h"

#include "scene/dataSource.h"
#include "scene/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

/// The text of a constant primvar; of an array the first element.
std::string _Text(const VtValue& value)
{
    TfToken text;
    if (HdOocPTConvert(value, &text)) {
        return text.GetString();
    }
    if (value.IsHolding<VtArray<std::string>>() && !value.UncheckedGet<VtArray<std::string>>().empty()) {
        return value.UncheckedGet<VtArray<std::string>>().cdata()[0];
    }
    if (value.IsHolding<VtArray<TfToken>>() && !value.UncheckedGet<VtArray<TfToken>>().empty()) {
        return value.UncheckedGet<VtArray<TfToken>>().cdata()[0].GetString();
    }
    return std::string();
}

} // namespace

std::string HdOocPTReadLabel(const HdContainerDataSourceHandle& container)
{
    const auto& tokens = *HdOocPTSceneTokens;
    for (const TfToken& name : HdOocPTLabelTokens->allTokens) {
        const std::string text = _Text(HdOocPTRead(container, { tokens.primvars, name, tokens.primvarValue }));
        if (!text.empty()) {
            return text;
        }
    }
    return std::string();
}

PXR_NAMESPACE_CLOSE_SCOPE
