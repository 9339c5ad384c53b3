// SPDX-License-Identifier: Apache-2.0
#include "hdOocPT/aov.h"

#include "pxr/base/gf/half.h"
#include "pxr/base/gf/vec2d.h"
#include "pxr/base/gf/vec2f.h"
#include "pxr/base/gf/vec2i.h"
#include "pxr/base/gf/vec3d.h"
#include "pxr/base/gf/vec3f.h"
#include "pxr/base/gf/vec3i.h"
#include "pxr/base/gf/vec4d.h"
#include "pxr/base/gf/vec4f.h"
#include "pxr/base/gf/vec4i.h"
#include "pxr/base/tf/stringUtils.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <mutex>
#include <string>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

enum class _Component
{
    UNorm8,
    SNorm8,
    Float16,
    Float32,
    Int32,
    Unknown
};

// One pixel during conversion. double holds every int32 and every float exactly.
using _Pixel = std::array<double, 4>;

_Component _ComponentOf(HdFormat format)
{
    if (format <= HdFormatInvalid || format >= HdFormatCount) {
        return _Component::Unknown;
    }
    switch (HdGetComponentFormat(format)) {
    case HdFormatUNorm8:
        return _Component::UNorm8;
    case HdFormatSNorm8:
        return _Component::SNorm8;
    case HdFormatFloat16:
        return _Component::Float16;
    case HdFormatFloat32:
        return _Component::Float32;
    case HdFormatInt32:
        return _Component::Int32;
    default:
        return _Component::Unknown;
    }
}

template <typename T>
T _Load(unsigned char const* bytes, size_t index)
{
    T value;
    std::memcpy(&value, bytes + index * sizeof(T), sizeof(T));
    return value;
}

template <typename T>
void _Store(unsigned char* bytes, size_t index, T value)
{
    std::memcpy(bytes + index * sizeof(T), &value, sizeof(T));
}

double _ReadComponent(unsigned char const* pixel, size_t index, _Component component)
{
    switch (component) {
    case _Component::UNorm8:
        return _Load<uint8_t>(pixel, index) / 255.0;
    case _Component::SNorm8:
        return std::max(-1.0, _Load<int8_t>(pixel, index) / 127.0);
    case _Component::Float16:
        return static_cast<float>(_Load<GfHalf>(pixel, index));
    case _Component::Float32:
        return _Load<float>(pixel, index);
    case _Component::Int32:
        return _Load<int32_t>(pixel, index);
    case _Component::Unknown:
        break;
    }
    return 0.0;
}

// NaN becomes the lower bound.
double _Clamp(double value, double lower, double upper)
{
    return value > lower ? std::min(value, upper) : lower;
}

void _WriteComponent(unsigned char* pixel, size_t index, _Component component, double value)
{
    switch (component) {
    case _Component::UNorm8:
        _Store(pixel, index, static_cast<uint8_t>(std::lround(_Clamp(value, 0.0, 1.0) * 255.0)));
        break;
    case _Component::SNorm8:
        _Store(pixel, index, static_cast<int8_t>(std::lround(_Clamp(value, -1.0, 1.0) * 127.0)));
        break;
    case _Component::Float16:
        _Store(pixel, index, GfHalf(static_cast<float>(value)));
        break;
    case _Component::Float32:
        _Store(pixel, index, static_cast<float>(value));
        break;
    case _Component::Int32:
        _Store(pixel, index, static_cast<int32_t>(_Clamp(std::floor(value), INT32_MIN, INT32_MAX)));
        break;
    case _Component::Unknown:
        break;
    }
}

template <typename Scalar>
bool _ReadScalar(VtValue const& value, _Pixel* pixel)
{
    if (!value.IsHolding<Scalar>()) {
        return false;
    }
    pixel->fill(static_cast<double>(value.UncheckedGet<Scalar>()));
    return true;
}

template <typename Vector>
bool _ReadVector(VtValue const& value, _Pixel* pixel)
{
    if (!value.IsHolding<Vector>()) {
        return false;
    }
    Vector const& vector = value.UncheckedGet<Vector>();
    for (size_t i = 0; i < Vector::dimension; ++i) {
        (*pixel)[i] = vector[i];
    }
    return true;
}

_Pixel _ClearPixel(VtValue const& value)
{
    _Pixel pixel {};
    bool const isKnown = _ReadScalar<float>(value, &pixel) || _ReadScalar<double>(value, &pixel)
        || _ReadScalar<int>(value, &pixel) || _ReadVector<GfVec4f>(value, &pixel) || _ReadVector<GfVec3f>(value, &pixel)
        || _ReadVector<GfVec2f>(value, &pixel) || _ReadVector<GfVec4d>(value, &pixel)
        || _ReadVector<GfVec3d>(value, &pixel) || _ReadVector<GfVec2d>(value, &pixel)
        || _ReadVector<GfVec4i>(value, &pixel) || _ReadVector<GfVec3i>(value, &pixel)
        || _ReadVector<GfVec2i>(value, &pixel);
    return isKnown ? pixel : _Pixel {};
}

std::vector<HdOocPTAov> _MakeAovs()
{
    VtValue const zero3(GfVec3f(0.0f));
    return {
        { TfToken("color"), HdFormatFloat32Vec4, VtValue(GfVec4f(0.0f)) },
        { TfToken("depth"), HdFormatFloat32, VtValue(1.0f) },
        { TfToken("cameraDepth"), HdFormatFloat32, VtValue(0.0f) },
        { TfToken("primId"), HdFormatInt32, VtValue(-1) },
        { TfToken("instanceId"), HdFormatInt32, VtValue(-1) },
        { TfToken("elementId"), HdFormatInt32, VtValue(-1) },
        { TfToken("normal"), HdFormatFloat32Vec3, zero3 },
        { TfToken("Neye"), HdFormatFloat32Vec3, zero3 },
        { TfToken("albedo"), HdFormatFloat32Vec3, zero3 },
        { TfToken("motion"), HdFormatFloat32Vec3, zero3 },
        { TfToken("motionBoth"), HdFormatFloat32Vec4, VtValue(GfVec4f(0.0f)) },
        { TfToken("sampleCount"), HdFormatFloat32, VtValue(0.0f) },
        { TfToken("position"), HdFormatFloat32Vec3, zero3 },
        { TfToken("Peye"), HdFormatFloat32Vec3, zero3 },
        { TfToken("Ng"), HdFormatFloat32Vec3, zero3 },
        { TfToken("denoised"), HdFormatFloat32Vec4, VtValue(GfVec4f(0.0f)) },
        { TfToken("variance"), HdFormatFloat32Vec3, zero3 },
        { TfToken("error"), HdFormatFloat32, VtValue(0.0f) },
        { TfToken("materialId"), HdFormatInt32, VtValue(-1) },
        { TfToken("shadow"), HdFormatFloat32Vec4, VtValue(GfVec4f(0.0f)) },
        { TfToken("shadowCatcher"), HdFormatFloat32, VtValue(0.0f) },
        { TfToken("loadWaits"), HdFormatFloat32, VtValue(0.0f) },
    };
}

// Ids as floats, for hosts that take images of floats alone, and Hydra's names.
std::array<std::array<char const*, 2>, 3> const _floatIds
    = { { { "primIdFloat", "primId" }, { "instanceIdFloat", "instanceId" }, { "elementIdFloat", "elementId" } } };

// Before a light path expression.
constexpr char _expressionPrefix[] = "lpe:";
// Before the name of a primvar.
constexpr char _primvarPrefix[] = "primvars:";

// A part of the light, or a primvar; what is wrong with its name the renderer tells.
HdOocPTAov const* _FindNamed(TfToken const& name, bool isPart)
{
    static std::mutex mutex;
    static std::map<TfToken, HdOocPTAov> found;
    std::lock_guard<std::mutex> const lock(mutex);
    HdOocPTAov const part { name, HdFormatFloat32Vec3, VtValue(GfVec3f(0.0f)) };
    HdOocPTAov const primvar { name, HdFormatFloat32Vec4, VtValue(GfVec4f(0.0f)) };
    return &found.emplace(name, isPart ? part : primvar).first->second;
}

} // namespace

TfToken HdOocPTAovName(HdRenderPassAovBinding const& binding)
{
    static TfToken const sourceName("sourceName");
    static TfToken const sourceType("sourceType");
    static TfToken const lpe("lpe");
    auto const text = [&binding](TfToken const& key) {
        auto const found = binding.aovSettings.find(key);
        if (found == binding.aovSettings.end()) {
            return std::string();
        }
        VtValue const& value = found->second;
        return value.IsHolding<TfToken>() ? value.UncheckedGet<TfToken>().GetString()
                                          : value.GetWithDefault<std::string>();
    };
    std::string const expression = text(sourceName);
    if (text(sourceType) != lpe.GetString() || expression.empty()) {
        return binding.aovName;
    }
    return TfToken(TfStringStartsWith(expression, _expressionPrefix) ? expression : _expressionPrefix + expression);
}

HdOocPTAov const* HdOocPTFindAov(TfToken const& name)
{
    static std::vector<HdOocPTAov> const aovs = _MakeAovs();
    bool const isPart = TfStringStartsWith(name.GetString(), _expressionPrefix);
    if (isPart || TfStringStartsWith(name.GetString(), _primvarPrefix)) {
        return _FindNamed(name, isPart);
    }
    auto const isFloat = [&name](std::array<char const*, 2> const& id) { return name == id[0]; };
    auto const id = std::find_if(_floatIds.begin(), _floatIds.end(), isFloat);
    TfToken const rendered = id == _floatIds.end() ? name : TfToken((*id)[1]);
    auto const isNamed = [&rendered](HdOocPTAov const& a) { return a.name == rendered; };
    auto const found = std::find_if(aovs.begin(), aovs.end(), isNamed);
    return found == aovs.end() ? nullptr : &*found;
}

HdAovDescriptor HdOocPTDescribeAov(TfToken const& name)
{
    HdOocPTAov const* const aov = HdOocPTFindAov(name);
    if (!aov) {
        return HdAovDescriptor();
    }
    bool const isFloat = aov->format == HdFormatInt32 && name != aov->name;
    return isFloat ? HdAovDescriptor(HdFormatFloat32, false, VtValue(-1.0f))
                   : HdAovDescriptor(aov->format, false, aov->clearValue);
}

bool HdOocPTIsStorable(HdFormat format)
{
    return _ComponentOf(format) != _Component::Unknown;
}

bool HdOocPTConvertPixels(
    void const* source, HdFormat sourceFormat, void* target, HdFormat targetFormat, size_t pixelCount)
{
    _Component const sourceComponent = _ComponentOf(sourceFormat);
    _Component const targetComponent = _ComponentOf(targetFormat);
    if (sourceComponent == _Component::Unknown || targetComponent == _Component::Unknown) {
        return false;
    }
    size_t const sourceStride = HdDataSizeOfFormat(sourceFormat);
    size_t const targetStride = HdDataSizeOfFormat(targetFormat);
    if (sourceFormat == targetFormat) {
        std::memcpy(target, source, sourceStride * pixelCount);
        return true;
    }
    size_t const sourceCount = HdGetComponentCount(sourceFormat);
    size_t const targetCount = HdGetComponentCount(targetFormat);
    auto const* from = static_cast<unsigned char const*>(source);
    auto* to = static_cast<unsigned char*>(target);
    for (size_t i = 0; i < pixelCount; ++i, from += sourceStride, to += targetStride) {
        for (size_t c = 0; c < targetCount; ++c) {
            double const value = c < sourceCount ? _ReadComponent(from, c, sourceComponent) : 0.0;
            _WriteComponent(to, c, targetComponent, value);
        }
    }
    return true;
}

void HdOocPTFillPixels(VtValue const& clearValue, void* target, HdFormat targetFormat, size_t pixelCount)
{
    _Component const component = _ComponentOf(targetFormat);
    if (component == _Component::Unknown || pixelCount == 0) {
        return;
    }
    _Pixel const pixel = _ClearPixel(clearValue);
    size_t const stride = HdDataSizeOfFormat(targetFormat);
    size_t const count = HdGetComponentCount(targetFormat);
    auto* const bytes = static_cast<unsigned char*>(target);
    for (size_t c = 0; c < count; ++c) {
        _WriteComponent(bytes, c, component, pixel[c]);
    }
    // Pixels are filled in runs that fit the processor's cache: pixel by pixel is several times slower.
    constexpr size_t longestRun = 4096;
    for (size_t filled = 1; filled < pixelCount;) {
        size_t const run = std::min({ filled, longestRun, pixelCount - filled });
        std::memcpy(bytes + filled * stride, bytes, run * stride);
        filled += run;
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
