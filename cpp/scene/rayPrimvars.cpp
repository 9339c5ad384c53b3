// SPDX-License-Identifier: Apache-2.0
#include "scene/rayPrimvars.h"

#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/vt/array.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <optional>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

/// The first element of an array of this type; the value itself if it is none.
template <class T>
VtValue _First(const VtValue& value)
{
    if (!value.IsHolding<VtArray<T>>() || value.UncheckedGet<VtArray<T>>().empty()) {
        return value;
    }
    return VtValue(T(value.UncheckedGet<VtArray<T>>().cdata()[0]));
}

/// The value as text; none if it is neither text nor a number.
std::optional<std::string> _TextOrNumber(const VtValue& value)
{
    const VtValue first = _First<TfToken>(_First<std::string>(_First<bool>(_First<float>(_First<int>(value)))));
    TfToken text;
    if (HdOocPTConvert(first, &text)) {
        return text.GetString();
    }
    double number = 0;
    if (HdOocPTConvert(first, &number)) {
        return std::to_string(number);
    }
    return std::nullopt;
}

TfTokenVector _MakeNames()
{
    TfTokenVector names;
    for (const rust::String& name : oocpt::ray_primvar_names()) {
        names.emplace_back(std::string(name));
    }
    return names;
}

} // namespace

HdOocPTRayPrimvars HdOocPTReadRayPrimvars(const HdContainerDataSourceHandle& container)
{
    static const TfTokenVector names = _MakeNames();
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTRayPrimvars found;
    const HdContainerDataSourceHandle primvars = HdOocPTFindContainer(container, { tokens.primvars });
    if (!primvars) {
        return found;
    }
    for (const TfToken& name : names) {
        TfToken interpolation = tokens.constant;
        HdOocPTConvert(HdOocPTRead(primvars, { name, tokens.interpolation }), &interpolation);
        if (interpolation != tokens.constant) {
            continue;
        }
        const VtValue value = HdOocPTRead(primvars, { name, tokens.primvarValue });
        if (const std::optional<std::string> text = value.IsEmpty() ? std::nullopt : _TextOrNumber(value)) {
            found.emplace_back(name.GetString(), *text);
        }
    }
    return found;
}

PXR_NAMESPACE_CLOSE_SCOPE
