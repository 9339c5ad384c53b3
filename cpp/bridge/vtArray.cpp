// SPDX-License-Identifier: Apache-2.0
#include "bridge/vtArray.h"

#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/gf/half.h"
#include "pxr/base/gf/matrix4d.h"
#include "pxr/base/gf/matrix4f.h"
#include "pxr/base/gf/quatd.h"
#include "pxr/base/gf/quatf.h"
#include "pxr/base/gf/quath.h"
#include "pxr/base/gf/vec2d.h"
#include "pxr/base/gf/vec2f.h"
#include "pxr/base/gf/vec2h.h"
#include "pxr/base/gf/vec3d.h"
#include "pxr/base/gf/vec3f.h"
#include "pxr/base/gf/vec3h.h"
#include "pxr/base/gf/vec4d.h"
#include "pxr/base/gf/vec4f.h"
#include "pxr/base/gf/vec4h.h"
#include "pxr/base/vt/array.h"

#include <cstdint>
#include <limits>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

using oocpt::ElementTag;

/// Shares a VtArray with Rust. The array is const and this object holds one reference of it, so its data never moves,
/// even if the scene writes to its own copy (VtArray copies on write).
template <typename Element>
class _HeldVtArray final : public oocpt::HeldArray
{
public:
    _HeldVtArray(ElementTag tag, const VtArray<Element>& array)
        : HeldArray(tag)
        , _array(array)
    {
    }

    rust::Slice<const std::uint8_t> bytes() const noexcept override
    {
        return { reinterpret_cast<const std::uint8_t*>(_array.cdata()), _array.size() * sizeof(Element) };
    }

private:
    const VtArray<Element> _array;
};

template <typename Element>
bool _Hold(const VtValue& value, ElementTag tag, std::unique_ptr<oocpt::HeldArray>* held)
{
    if (!value.IsHolding<VtArray<Element>>()) {
        return false;
    }
    *held = std::make_unique<_HeldVtArray<Element>>(tag, value.UncheckedGet<VtArray<Element>>());
    return true;
}

/// Returns an array of this element type as it is, or one value as an array of one.
template <typename Element>
bool _Keep(const VtValue& value, VtValue* result)
{
    if (value.IsHolding<VtArray<Element>>()) {
        *result = value;
        return true;
    }
    if (value.IsHolding<Element>()) {
        *result = VtValue(VtArray<Element>(1, value.UncheckedGet<Element>()));
        return true;
    }
    return false;
}

template <typename From, typename To, typename Function>
bool _Map(const VtValue& value, VtValue* result, Function&& function)
{
    VtValue kept;
    if (!_Keep<From>(value, &kept)) {
        return false;
    }
    const VtArray<From>& from = kept.UncheckedGet<VtArray<From>>();
    VtArray<To> to(from.size());
    To* out = to.data();
    for (const From& element : from) {
        *out++ = function(element);
    }
    *result = VtValue::Take(to);
    return true;
}

/// Numbers that no int can hold become -1, which is out of range for every index and count.
template <typename From>
int _ToInt(From number)
{
    return number > static_cast<From>(std::numeric_limits<int>::max()) || static_cast<int64_t>(number) < 0
        ? -1
        : static_cast<int>(number);
}

bool _NormalizeIntegers(const VtValue& value, VtValue* result)
{
    return _Keep<int>(value, result) || _Map<unsigned int, int>(value, result, _ToInt<unsigned int>)
        || _Map<int64_t, int>(value, result, _ToInt<int64_t>) || _Map<uint64_t, int>(value, result, _ToInt<uint64_t>);
}

bool _NormalizeBooleans(const VtValue& value, VtValue* result)
{
    return _Keep<bool>(value, result)
        || _Map<unsigned char, bool>(value, result, [](unsigned char byte) { return byte != 0; })
        || _Map<int, bool>(value, result, [](int number) { return number != 0; });
}

bool _NormalizeQuaternions(const VtValue& value, VtValue* result)
{
    return _Keep<GfQuath>(value, result) || _Keep<GfQuatf>(value, result) || _Keep<GfQuatd>(value, result)
        || _Map<GfVec4f, GfQuatf>(
            value, result, [](const GfVec4f& v) { return GfQuatf(v[0], GfVec3f(v[1], v[2], v[3])); })
        || _Map<GfVec4d, GfQuatd>(
            value, result, [](const GfVec4d& v) { return GfQuatd(v[0], GfVec3d(v[1], v[2], v[3])); });
}

bool _NormalizeValues(const VtValue& value, VtValue* result)
{
    return _Keep<GfVec2f>(value, result) || _Keep<GfVec3f>(value, result) || _Keep<float>(value, result)
        || _Keep<GfVec4f>(value, result) || _Keep<GfVec2d>(value, result) || _Keep<GfVec3d>(value, result)
        || _Keep<GfVec4d>(value, result) || _Keep<double>(value, result) || _Keep<GfVec2h>(value, result)
        || _Keep<GfVec3h>(value, result) || _Keep<GfVec4h>(value, result) || _Keep<GfHalf>(value, result)
        || _NormalizeIntegers(value, result) || _Keep<bool>(value, result);
}

bool _Normalize(const VtValue& value, HdOocPTArrayRole role, VtValue* result)
{
    switch (role) {
    case HdOocPTArrayRole::Integers:
        return _NormalizeIntegers(value, result);
    case HdOocPTArrayRole::Booleans:
        return _NormalizeBooleans(value, result);
    case HdOocPTArrayRole::Scalars:
        return _Keep<float>(value, result) || _Keep<double>(value, result) || _Keep<GfHalf>(value, result);
    case HdOocPTArrayRole::Vectors3:
        return _Keep<GfVec3f>(value, result) || _Keep<GfVec3d>(value, result) || _Keep<GfVec3h>(value, result);
    case HdOocPTArrayRole::Quaternions:
        return _NormalizeQuaternions(value, result);
    case HdOocPTArrayRole::Matrices:
        return _Keep<GfMatrix4d>(value, result) || _Keep<GfMatrix4f>(value, result);
    case HdOocPTArrayRole::Values:
        return _NormalizeValues(value, result);
    }
    return false;
}

const char* _Describe(HdOocPTArrayRole role)
{
    switch (role) {
    case HdOocPTArrayRole::Integers:
        return "integers";
    case HdOocPTArrayRole::Booleans:
        return "booleans";
    case HdOocPTArrayRole::Scalars:
        return "numbers";
    case HdOocPTArrayRole::Vectors3:
        return "3-vectors";
    case HdOocPTArrayRole::Quaternions:
        return "quaternions";
    case HdOocPTArrayRole::Matrices:
        return "4x4 matrices";
    case HdOocPTArrayRole::Values:
        return "numbers or vectors";
    }
    return "an array";
}

} // namespace

VtValue HdOocPTNormalizeArray(const VtValue& value, HdOocPTArrayRole role, std::string* reason)
{
    VtValue result;
    if (!value.IsEmpty() && !_Normalize(value, role, &result)) {
        *reason = "holds " + value.GetTypeName() + " where " + _Describe(role) + " are expected; ignored";
    }
    return result;
}

std::unique_ptr<oocpt::HeldArray> HdOocPTHoldArray(const VtValue& value)
{
    std::unique_ptr<oocpt::HeldArray> held;
    static_cast<void>(_Hold<GfVec3f>(value, ElementTag::Vec3f, &held) || _Hold<int>(value, ElementTag::I32, &held)
        || _Hold<float>(value, ElementTag::F32, &held) || _Hold<bool>(value, ElementTag::Bool, &held)
        || _Hold<GfQuath>(value, ElementTag::Quath, &held) || _Hold<GfQuatf>(value, ElementTag::Quatf, &held)
        || _Hold<GfQuatd>(value, ElementTag::Quatd, &held) || _Hold<GfMatrix4d>(value, ElementTag::Matrix4d, &held)
        || _Hold<GfMatrix4f>(value, ElementTag::Matrix4f, &held) || _Hold<GfVec3d>(value, ElementTag::Vec3d, &held)
        || _Hold<GfVec3h>(value, ElementTag::Vec3h, &held) || _Hold<double>(value, ElementTag::F64, &held)
        || _Hold<GfHalf>(value, ElementTag::F16, &held) || _Hold<GfVec2f>(value, ElementTag::Vec2f, &held)
        || _Hold<GfVec2d>(value, ElementTag::Vec2d, &held) || _Hold<GfVec2h>(value, ElementTag::Vec2h, &held)
        || _Hold<GfVec4f>(value, ElementTag::Vec4f, &held) || _Hold<GfVec4d>(value, ElementTag::Vec4d, &held)
        || _Hold<GfVec4h>(value, ElementTag::Vec4h, &held));
    return held;
}

PXR_NAMESPACE_CLOSE_SCOPE
