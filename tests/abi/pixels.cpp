// SPDX-License-Identifier: Apache-2.0
/// Checks of the pixel conversion in cpp/hdOocPT/aov.cpp, compiled together with it and run in the wheel host by
/// test_pixels.py. Expected values are written out by hand.
#include "hdOocPT/aov.h"
#include "pxr/base/gf/half.h"
#include "pxr/base/gf/vec3d.h"
#include "pxr/base/gf/vec4f.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

PXR_NAMESPACE_USING_DIRECTIVE

namespace {

std::ostringstream _failures;

void _Expect(bool isTrue, char const* what)
{
    if (!isTrue) {
        _failures << what << "\n";
    }
}

constexpr float _nan = std::numeric_limits<float>::quiet_NaN();

void _CheckColor()
{
    std::array<float, 8> const color { 0.5f, 2.0f, -1.0f, 1.0f, _nan, 0.25f, 0.75f, 0.0f };
    std::array<uint8_t, 8> bytes {};
    _Expect(HdOocPTConvertPixels(color.data(), HdFormatFloat32Vec4, bytes.data(), HdFormatUNorm8Vec4, 2), "to UNorm8");
    _Expect(bytes == std::array<uint8_t, 8> { 128, 255, 0, 255, 0, 64, 191, 0 }, "UNorm8 values");

    std::array<GfHalf, 8> halves {};
    _Expect(HdOocPTConvertPixels(color.data(), HdFormatFloat32Vec4, halves.data(), HdFormatFloat16Vec4, 2), "to half");
    _Expect(halves[0] == 0.5f && halves[1] == 2.0f && halves[2] == -1.0f && std::isnan(static_cast<float>(halves[4])),
        "half values");

    std::array<float, 6> rgb {};
    _Expect(HdOocPTConvertPixels(color.data(), HdFormatFloat32Vec4, rgb.data(), HdFormatFloat32Vec3, 2), "to Vec3");
    _Expect(rgb[0] == 0.5f && rgb[2] == -1.0f && std::isnan(rgb[3]) && rgb[5] == 0.75f, "Vec3 values");
}

void _CheckNumbers()
{
    std::array<int32_t, 3> const ids { -1, 7, std::numeric_limits<int32_t>::max() };
    std::array<int32_t, 3> same {};
    _Expect(
        HdOocPTConvertPixels(ids.data(), HdFormatInt32, same.data(), HdFormatInt32, 3) && same == ids, "same format");
    std::array<float, 3> floats {};
    _Expect(HdOocPTConvertPixels(ids.data(), HdFormatInt32, floats.data(), HdFormatFloat32, 3), "ids to float");
    _Expect(floats[0] == -1.0f && floats[1] == 7.0f, "ids as float");
    std::array<float, 3> const depths { 0.25f, _nan, 1e30f };
    std::array<int32_t, 3> numbers {};
    _Expect(HdOocPTConvertPixels(depths.data(), HdFormatFloat32, numbers.data(), HdFormatInt32, 3), "depth to int");
    _Expect(numbers[0] == 0 && numbers[1] == INT32_MIN && numbers[2] == INT32_MAX, "depth as int is bounded");
    std::array<float, 8> widened {};
    _Expect(HdOocPTConvertPixels(depths.data(), HdFormatFloat32, widened.data(), HdFormatFloat32Vec4, 2), "widening");
    _Expect(
        widened[0] == 0.25f && widened[1] == 0.0f && widened[3] == 0.0f && std::isnan(widened[4]), "widened values");
}

void _CheckFill()
{
    std::array<float, 8> color {};
    HdOocPTFillPixels(VtValue(GfVec4f(1, 2, 3, 4)), color.data(), HdFormatFloat32Vec4, 2);
    _Expect(color == std::array<float, 8> { 1, 2, 3, 4, 1, 2, 3, 4 }, "fill by a vector");
    HdOocPTFillPixels(VtValue(GfVec3d(5, 6, 7)), color.data(), HdFormatFloat32Vec4, 1);
    _Expect(color == std::array<float, 8> { 5, 6, 7, 0, 1, 2, 3, 4 }, "fill by a shorter vector of doubles");
    std::array<int32_t, 3> ids { 9, 9, 9 };
    HdOocPTFillPixels(VtValue(-1), ids.data(), HdFormatInt32, 2);
    _Expect(ids == std::array<int32_t, 3> { -1, -1, 9 }, "fill ids");
    // More pixels than are copied at a time, by any number, and not one too many.
    for (size_t const count : { size_t(1), size_t(3), size_t(4096), size_t(4097), size_t(8191), size_t(10007) }) {
        std::vector<std::array<float, 3>> many(count + 1, std::array<float, 3> { 9, 9, 9 });
        HdOocPTFillPixels(VtValue(GfVec3f(1, 2, 3)), many.data(), HdFormatFloat32Vec3, count);
        bool const isFilled = std::all_of(many.begin(), many.end() - 1,
            [](std::array<float, 3> const& pixel) { return pixel == std::array<float, 3> { 1, 2, 3 }; });
        _Expect(isFilled && many.back() == std::array<float, 3> { 9, 9, 9 }, "fill many");
    }
    HdOocPTFillPixels(VtValue(std::string("red")), ids.data(), HdFormatInt32, 3);
    _Expect(ids == std::array<int32_t, 3> { 0, 0, 0 }, "an unknown clear value means zero");
}

void _CheckRefusals()
{
    std::array<float, 4> pixel { 1, 2, 3, 4 };
    std::array<float, 4> target { 9, 9, 9, 9 };
    for (HdFormat format : { HdFormatInvalid, HdFormatInt16, HdFormatFloat32UInt8, HdFormatCount }) {
        _Expect(!HdOocPTIsStorable(format), "formats that are not storable");
        _Expect(!HdOocPTConvertPixels(pixel.data(), HdFormatFloat32Vec4, target.data(), format, 1), "refused target");
        _Expect(!HdOocPTConvertPixels(pixel.data(), format, target.data(), HdFormatFloat32, 1), "refused source");
    }
    _Expect(target == std::array<float, 4> { 9, 9, 9, 9 }, "nothing is written on refusal");
    _Expect(HdOocPTFindAov(TfToken("depth"))->clearValue == VtValue(1.0f), "depth clears to 1");
    _Expect(HdOocPTFindAov(TfToken("primId"))->clearValue == VtValue(-1), "ids clear to -1");
    _Expect(!HdOocPTFindAov(TfToken("sparkle")), "an unknown output");
    _Expect(HdOocPTFindAov(TfToken("primvars:st"))->format == HdFormatFloat32Vec4, "a primvar has four numbers");
    _Expect(HdOocPTDescribeAov(TfToken("primIdFloat")).format == HdFormatFloat32, "ids as floats");
}

} // namespace

/// One line per check that failed; empty when all hold.
extern "C" __attribute__((visibility("default"))) char const* oocpt_pixels_run()
{
    static std::string const lines = [] {
        _CheckColor();
        _CheckNumbers();
        _CheckFill();
        _CheckRefusals();
        return _failures.str();
    }();
    return lines.c_str();
}
