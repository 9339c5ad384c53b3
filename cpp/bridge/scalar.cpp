// SPDX-License-Identifier: Apache-2.0
#include "bridge/scalar.h"

#include "bridge/text.h"
#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/gf/half.h"
#include "pxr/base/gf/vec2d.h"
#include "pxr/base/gf/vec2f.h"
#include "pxr/base/gf/vec3d.h"
#include "pxr/base/gf/vec3f.h"
#include "pxr/base/gf/vec4d.h"
#include "pxr/base/gf/vec4f.h"
#include "pxr/base/tf/token.h"
#include "pxr/usd/sdf/assetPath.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

using oocpt::ScalarTag;

template <typename Integer>
bool _TakeInteger(const VtValue& value, oocpt::ScalarValue* scalar)
{
    if (!value.IsHolding<Integer>()) {
        return false;
    }
    scalar->tag = ScalarTag::Int;
    const Integer number = value.UncheckedGet<Integer>();
    constexpr auto limit = std::numeric_limits<int64_t>::max();
    scalar->integer = number > Integer(0) && static_cast<uint64_t>(number) > static_cast<uint64_t>(limit)
        ? limit
        : static_cast<int64_t>(number);
    return true;
}

template <typename Real>
bool _TakeReal(const VtValue& value, oocpt::ScalarValue* scalar)
{
    if (!value.IsHolding<Real>()) {
        return false;
    }
    scalar->tag = ScalarTag::Float;
    scalar->real = static_cast<double>(value.UncheckedGet<Real>());
    return true;
}

bool _TakeText(const VtValue& value, oocpt::ScalarValue* scalar)
{
    if (value.IsHolding<std::string>()) {
        scalar->text = HdOocPTText(value.UncheckedGet<std::string>());
    } else if (value.IsHolding<TfToken>()) {
        scalar->text = HdOocPTText(value.UncheckedGet<TfToken>());
    } else if (value.IsHolding<SdfAssetPath>()) {
        scalar->text = HdOocPTText(value.UncheckedGet<SdfAssetPath>().GetAssetPath());
    } else {
        return false;
    }
    scalar->tag = ScalarTag::Text;
    return true;
}

template <typename Vector>
bool _TakeVector(const VtValue& value, std::array<float, 4>* clear)
{
    if (!value.IsHolding<Vector>()) {
        return false;
    }
    const Vector& vector = value.UncheckedGet<Vector>();
    clear->fill(0.0f);
    for (size_t i = 0; i < Vector::dimension; ++i) {
        (*clear)[i] = static_cast<float>(vector[i]);
    }
    return true;
}

} // namespace

bool HdOocPTToScalar(const VtValue& value, oocpt::ScalarValue* scalar)
{
    if (value.IsHolding<bool>()) {
        scalar->tag = ScalarTag::Bool;
        scalar->flag = value.UncheckedGet<bool>();
        return true;
    }
    return _TakeInteger<int>(value, scalar) || _TakeInteger<unsigned int>(value, scalar)
        || _TakeInteger<int64_t>(value, scalar) || _TakeInteger<uint64_t>(value, scalar)
        || _TakeReal<float>(value, scalar) || _TakeReal<double>(value, scalar) || _TakeReal<GfHalf>(value, scalar)
        || _TakeText(value, scalar);
}

VtValue HdOocPTSettingFromScalar(const oocpt::ScalarValue& scalar)
{
    switch (scalar.tag) {
    case ScalarTag::Bool:
        return VtValue(scalar.flag);
    case ScalarTag::Int:
        return VtValue(static_cast<int>(
            std::clamp<int64_t>(scalar.integer, std::numeric_limits<int>::min(), std::numeric_limits<int>::max())));
    case ScalarTag::Float:
        return VtValue(static_cast<float>(scalar.real));
    case ScalarTag::Text:
        return VtValue(std::string(scalar.text));
    }
    return VtValue();
}

VtValue HdOocPTStatisticFromScalar(const oocpt::ScalarValue& scalar)
{
    switch (scalar.tag) {
    case ScalarTag::Int:
        return VtValue(static_cast<size_t>(std::max<int64_t>(scalar.integer, 0)));
    case ScalarTag::Float:
        return VtValue(scalar.real);
    default:
        return HdOocPTSettingFromScalar(scalar);
    }
}

bool HdOocPTToClear(const VtValue& value, std::array<float, 4>* clear)
{
    oocpt::ScalarValue scalar {};
    if (HdOocPTToScalar(value, &scalar) && scalar.tag != ScalarTag::Text) {
        clear->fill(0.0f);
        (*clear)[0] = scalar.tag == ScalarTag::Float ? static_cast<float>(scalar.real)
            : scalar.tag == ScalarTag::Int           ? static_cast<float>(scalar.integer)
                                                     : static_cast<float>(scalar.flag);
        return true;
    }
    return _TakeVector<GfVec4f>(value, clear) || _TakeVector<GfVec3f>(value, clear)
        || _TakeVector<GfVec2f>(value, clear) || _TakeVector<GfVec4d>(value, clear)
        || _TakeVector<GfVec3d>(value, clear) || _TakeVector<GfVec2d>(value, clear);
}

PXR_NAMESPACE_CLOSE_SCOPE
