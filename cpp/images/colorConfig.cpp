// SPDX-License-Identifier: Apache-2.0
#include "images/colorConfig.h"

#include <array>
#include <string>
#include <vector>

namespace OCIO = OCIO_NAMESPACE;

namespace {

using Vector = std::array<double, 3>;
using Matrix = std::array<Vector, 3>;

constexpr Matrix identity { { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } } };
/// Bradford's cone responses from XYZ (Lam 1985, as ICC.1:2022, annex E has them).
constexpr Matrix bradford { { { 0.8951, 0.2664, -0.1614 }, { -0.7502, 1.7135, 0.0367 }, { 0.0389, -0.0685, 1.0296 } } };

/// x and y of red, green, blue and white.
struct Primaries
{
    std::array<double, 2> red, green, blue, white;
};

constexpr std::array<double, 2> d65 { 0.3127, 0.3290 };
constexpr std::array<double, 2> acesWhite { 0.32168, 0.33767 };
constexpr Primaries rec709 { { 0.64, 0.33 }, { 0.30, 0.60 }, { 0.15, 0.06 }, d65 };
constexpr Primaries rec2020 { { 0.708, 0.292 }, { 0.170, 0.797 }, { 0.131, 0.046 }, d65 };
constexpr Primaries p3 { { 0.680, 0.320 }, { 0.265, 0.690 }, { 0.150, 0.060 }, d65 };
constexpr Primaries adobe { { 0.64, 0.33 }, { 0.21, 0.71 }, { 0.15, 0.06 }, d65 };
constexpr Primaries ap0 { { 0.7347, 0.2653 }, { 0.0, 1.0 }, { 0.0001, -0.0770 }, acesWhite };
constexpr Primaries ap1 { { 0.713, 0.293 }, { 0.165, 0.830 }, { 0.128, 0.044 }, acesWhite };

Matrix Multiply(const Matrix& a, const Matrix& b)
{
    Matrix product {};
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            product[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
        }
    }
    return product;
}

Vector Multiply(const Matrix& a, const Vector& v)
{
    Vector product {};
    for (int i = 0; i < 3; ++i) {
        product[i] = a[i][0] * v[0] + a[i][1] * v[1] + a[i][2] * v[2];
    }
    return product;
}

Matrix Invert(const Matrix& m)
{
    const auto minor = [&](int i, int j) {
        const int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
        return m[a][c] * m[b][d] - m[a][d] * m[b][c];
    };
    const double determinant = m[0][0] * minor(0, 0) + m[0][1] * minor(0, 1) + m[0][2] * minor(0, 2);
    Matrix inverse {};
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            inverse[j][i] = minor(i, j) / determinant;
        }
    }
    return inverse;
}

Vector XyzOf(const std::array<double, 2>& xy)
{
    return { xy[0] / xy[1], 1.0, (1.0 - xy[0] - xy[1]) / xy[1] };
}

/// The matrix from linear colors of these primaries to XYZ (SMPTE RP 177).
Matrix XyzFrom(const Primaries& primaries)
{
    const Vector r = XyzOf(primaries.red), g = XyzOf(primaries.green), b = XyzOf(primaries.blue);
    const Matrix columns { { { r[0], g[0], b[0] }, { r[1], g[1], b[1] }, { r[2], g[2], b[2] } } };
    const Vector scale = Multiply(Invert(columns), XyzOf(primaries.white));
    Matrix scaled = columns;
    for (Vector& row : scaled) {
        for (int j = 0; j < 3; ++j) {
            row[j] *= scale[j];
        }
    }
    return scaled;
}

Matrix Adapt(const std::array<double, 2>& from, const std::array<double, 2>& to)
{
    const Vector source = Multiply(bradford, XyzOf(from)), target = Multiply(bradford, XyzOf(to));
    Matrix gain {};
    for (int i = 0; i < 3; ++i) {
        gain[i][i] = target[i] / source[i];
    }
    return Multiply(Invert(bradford), Multiply(gain, bradford));
}

Matrix Rec709FromXyz(const std::array<double, 2>& white)
{
    return Multiply(Invert(XyzFrom(rec709)), Adapt(white, d65));
}

OCIO::TransformRcPtr MatrixTransform(const Matrix& m)
{
    const double values[16]
        = { m[0][0], m[0][1], m[0][2], 0, m[1][0], m[1][1], m[1][2], 0, m[2][0], m[2][1], m[2][2], 0, 0, 0, 0, 1 };
    const OCIO::MatrixTransformRcPtr transform = OCIO::MatrixTransform::Create();
    transform->setMatrix(values);
    return transform;
}

/// The transform of a pure power. Numbers below zero are mirrored.
OCIO::TransformRcPtr PowerTransform(double gamma)
{
    const double values[4] = { gamma, gamma, gamma, 1.0 };
    const OCIO::ExponentTransformRcPtr transform = OCIO::ExponentTransform::Create();
    transform->setValue(values);
    transform->setNegativeStyle(OCIO::NEGATIVE_MIRROR);
    return transform;
}

/// The curve of IEC 61966-2-1.
OCIO::TransformRcPtr SrgbTransform()
{
    const double gamma[4] = { 2.4, 2.4, 2.4, 1.0 };
    const double offset[4] = { 0.055, 0.055, 0.055, 0.0 };
    const OCIO::ExponentWithLinearTransformRcPtr transform = OCIO::ExponentWithLinearTransform::Create();
    transform->setGamma(gamma);
    transform->setOffset(offset);
    transform->setNegativeStyle(OCIO::NEGATIVE_MIRROR);
    return transform;
}

/// Adds a color space with all its names; `curve` may be null.
void Add(const OCIO::ConfigRcPtr& config, const std::vector<const char*>& names, const OCIO::TransformRcPtr& curve,
    const Matrix& toRec709)
{
    const OCIO::ColorSpaceRcPtr space = OCIO::ColorSpace::Create();
    space->setName(names.front());
    for (std::size_t i = 1; i < names.size(); ++i) {
        space->addAlias(names[i]);
    }
    const OCIO::GroupTransformRcPtr group = OCIO::GroupTransform::Create();
    if (curve) {
        group->appendTransform(curve);
    }
    group->appendTransform(MatrixTransform(toRec709));
    space->setTransform(group, OCIO::COLORSPACE_DIR_TO_REFERENCE);
    config->addColorSpace(space);
}

} // namespace

OCIO::ConstConfigRcPtr HdOocPTMakeColorConfig()
{
    const auto to709 = [](const Primaries& from) { return Multiply(Rec709FromXyz(from.white), XyzFrom(from)); };
    const OCIO::ConfigRcPtr config = OCIO::Config::Create();
    config->setVersion(2, 0);
    Add(config,
        { "lin_rec709", "lin_rec709_scene", "lin_srgb", "Linear Rec.709 (sRGB)", "Utility - Linear - sRGB",
            "Utility - Linear - Rec.709" },
        nullptr, identity);
    Add(config, { "lin_ap1", "lin_ap1_scene", "ACEScg", "ACES - ACEScg" }, nullptr, to709(ap1));
    Add(config, { "lin_ap0", "lin_ap0_scene", "ACES2065-1", "aces", "ACES - ACES2065-1" }, nullptr, to709(ap0));
    Add(config, { "lin_rec2020", "lin_rec2020_scene", "Linear Rec.2020", "Utility - Linear - Rec.2020" }, nullptr,
        to709(rec2020));
    Add(config, { "lin_p3d65", "lin_p3d65_scene", "lin_displayp3", "Linear P3-D65", "Utility - Linear - P3-D65" },
        nullptr, to709(p3));
    Add(config, { "lin_adobergb", "lin_adobergb_scene", "Linear AdobeRGB", "Utility - Linear - Adobe RGB" }, nullptr,
        to709(adobe));
    Add(config, { "lin_ciexyzd65", "lin_ciexyzd65_scene", "CIEXYZ", "CIE XYZ-D65", "cie_xyz_d65" }, nullptr,
        Rec709FromXyz(d65));
    Add(config, { "srgb_texture", "srgb_rec709_scene", "sRGB - Texture", "Utility - sRGB - Texture" }, SrgbTransform(),
        identity);
    Add(config, { "srgb_ap1", "srgb_ap1_scene", "sRGB Encoded AP1", "srgb_encoded_ap1_tx" }, SrgbTransform(),
        to709(ap1));
    Add(config,
        { "srgb_p3d65", "srgb_p3d65_scene", "srgb_displayp3", "sRGB Encoded P3-D65", "srgb_encoded_p3d65_tx",
            "Display P3" },
        SrgbTransform(), to709(p3));
    Add(config,
        { "g18_rec709", "g18_rec709_scene", "Gamma 1.8 Rec.709 - Texture", "g18_rec709_tx",
            "Utility - Gamma 1.8 - Rec.709 - Texture" },
        PowerTransform(1.8), identity);
    Add(config,
        { "g22_rec709", "g22_rec709_scene", "Gamma 2.2 Rec.709 - Texture", "g22_rec709_tx",
            "Utility - Gamma 2.2 - Rec.709 - Texture" },
        PowerTransform(2.2), identity);
    Add(config, { "g24_rec709", "g24_rec709_scene", "Gamma 2.4 Rec.709 - Texture", "g24_rec709_tx", "rec709_display" },
        PowerTransform(2.4), identity);
    Add(config, { "g18_ap1", "g18_ap1_scene" }, PowerTransform(1.8), to709(ap1));
    Add(config,
        { "g22_ap1", "g22_ap1_scene", "Gamma 2.2 AP1 - Texture", "g22_ap1_tx", "Utility - Gamma 2.2 - AP1 - Texture" },
        PowerTransform(2.2), to709(ap1));
    // The power of Adobe RGB (1998) is 563 / 256.
    Add(config, { "adobergb", "g22_adobergb", "g22_adobergb_scene", "AdobeRGB", "Utility - AdobeRGB - Texture" },
        PowerTransform(563.0 / 256.0), to709(adobe));
    config->setRole(OCIO::ROLE_SCENE_LINEAR, "lin_rec709");
    // OpenColorIO converts between configurations by these roles.
    config->setRole("aces_interchange", "lin_ap0");
    config->setRole("cie_xyz_d65_interchange", "lin_ciexyzd65");
    return config;
}
