// SPDX-License-Identifier: Apache-2.0
#include "scene/dataSource.h"

#include "pxr/base/gf/half.h"
#include "pxr/base/gf/matrix4f.h"
#include "pxr/base/gf/vec3d.h"
#include "pxr/base/gf/vec3h.h"
#include "pxr/base/vt/array.h"

#include <cstdint>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

template <typename Held, typename Result>
bool _TakeAs(const VtValue& value, Result* result)
{
    if (!value.IsHolding<Held>()) {
        return false;
    }
    *result = static_cast<Result>(value.UncheckedGet<Held>());
    return true;
}

} // namespace

HdDataSourceBaseHandle HdOocPTFind(const HdContainerDataSourceHandle& container, std::initializer_list<TfToken> names)
{
    HdDataSourceBaseHandle source = container;
    for (const TfToken& name : names) {
        const HdContainerDataSourceHandle parent = HdContainerDataSource::Cast(source);
        if (!parent) {
            return nullptr;
        }
        source = parent->Get(name);
    }
    return source;
}

HdContainerDataSourceHandle HdOocPTFindContainer(
    const HdContainerDataSourceHandle& container, std::initializer_list<TfToken> names)
{
    return HdContainerDataSource::Cast(HdOocPTFind(container, names));
}

VtValue HdOocPTSample(const HdDataSourceBaseHandle& source)
{
    const HdSampledDataSourceHandle sampled = HdSampledDataSource::Cast(source);
    return sampled ? sampled->GetValue(0.0f) : VtValue();
}

VtValue HdOocPTRead(const HdContainerDataSourceHandle& container, std::initializer_list<TfToken> names)
{
    return HdOocPTSample(HdOocPTFind(container, names));
}

bool HdOocPTConvert(const VtValue& value, double* result)
{
    return _TakeAs<float>(value, result) || _TakeAs<double>(value, result) || _TakeAs<int>(value, result)
        || _TakeAs<GfHalf>(value, result) || _TakeAs<unsigned int>(value, result) || _TakeAs<int64_t>(value, result)
        || _TakeAs<uint64_t>(value, result) || _TakeAs<bool>(value, result);
}

bool HdOocPTConvert(const VtValue& value, float* result)
{
    double number = 0.0;
    if (!HdOocPTConvert(value, &number)) {
        return false;
    }
    *result = static_cast<float>(number);
    return true;
}

bool HdOocPTConvert(const VtValue& value, bool* result)
{
    if (_TakeAs<bool>(value, result)) {
        return true;
    }
    double number = 0.0;
    if (!HdOocPTConvert(value, &number)) {
        return false;
    }
    *result = number != 0.0;
    return true;
}

bool HdOocPTConvert(const VtValue& value, GfVec3f* result)
{
    return _TakeAs<GfVec3f>(value, result) || _TakeAs<GfVec3d>(value, result) || _TakeAs<GfVec3h>(value, result);
}

bool HdOocPTConvert(const VtValue& value, GfMatrix4d* result)
{
    return _TakeAs<GfMatrix4d>(value, result) || _TakeAs<GfMatrix4f>(value, result);
}

bool HdOocPTConvert(const VtValue& value, TfToken* result)
{
    if (value.IsHolding<std::string>()) {
        *result = TfToken(value.UncheckedGet<std::string>());
        return true;
    }
    return _TakeAs<TfToken>(value, result);
}

std::string HdOocPTReadText(const VtValue& value)
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

PXR_NAMESPACE_CLOSE_SCOPE
