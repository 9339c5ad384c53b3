// SPDX-License-Identifier: Apache-2.0
#include "images/imageKind.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <stdexcept>

namespace {

struct Mark
{
    const char* format;
    std::size_t offset;
    std::size_t length;
    const char* bytes;
};

constexpr Mark marks[] = {
    { "openexr", 0, 4, "\x76\x2f\x31\x01" },
    { "png", 0, 8, "\x89PNG\r\n\x1a\n" },
    { "jpeg", 0, 3, "\xff\xd8\xff" },
    { "tiff", 0, 4, "II\x2a\x00" },
    { "tiff", 0, 4, "MM\x00\x2a" },
    { "tiff", 0, 4, "II\x2b\x00" },
    { "tiff", 0, 4, "MM\x00\x2b" },
    { "hdr", 0, 10, "#?RADIANCE" },
    { "hdr", 0, 6, "#?RGBE" },
    { "bmp", 0, 2, "BM" },
};

bool EndsWith(const std::string& name, const std::string& end)
{
    const auto same = [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; };
    return name.size() >= end.size()
        && std::equal(end.begin(), end.end(), name.end() - end.size(), [&](char a, char b) { return same(b, a); });
}

std::uint32_t BigEndian(const unsigned char* bytes)
{
    return static_cast<std::uint32_t>(bytes[0]) << 24 | static_cast<std::uint32_t>(bytes[1]) << 16
        | static_cast<std::uint32_t>(bytes[2]) << 8 | static_cast<std::uint32_t>(bytes[3]);
}

} // namespace

std::string HdOocPTFindImageFormat(const std::string& name, const HdOocPTImageBytes& bytes)
{
    std::array<char, 16> head {};
    const std::size_t size = bytes.Read(head.data(), head.size(), 0);
    if (size == 0) {
        throw std::runtime_error("is empty, or cannot be read");
    }
    for (const Mark& mark : marks) {
        if (mark.offset + mark.length <= size && std::memcmp(head.data() + mark.offset, mark.bytes, mark.length) == 0) {
            return mark.format;
        }
    }
    // A path into a package ends with a bracket: scene.usdz[texture.tga].
    if (EndsWith(name, ".tga") || EndsWith(name, ".tga]")) {
        return "targa";
    }
    throw std::runtime_error("is none of the kinds of image that are read: EXR, PNG, JPEG, TIFF, HDR, TGA, BMP");
}

int HdOocPTFindPngColorSpace(const HdOocPTImageBytes& bytes)
{
    // The file has a signature, then chunks of length, type, data, check; the wanted ones come before the first IDAT.
    std::size_t offset = 8;
    for (int chunk = 0; chunk < 64; ++chunk) {
        std::array<unsigned char, 12> head {};
        if (bytes.Read(head.data(), head.size(), offset) != head.size() || std::memcmp(&head[4], "IDAT", 4) == 0) {
            return -1;
        }
        if (std::memcmp(&head[4], "sRGB", 4) == 0) {
            return 1;
        }
        // The name of an embedded profile: "sRGB IEC61966-2.1", "sRGB built-in". PNG says that such a file has no sRGB
        // chunk, so 16-bit files of many programs state it only in this way.
        if (std::memcmp(&head[4], "iCCP", 4) == 0 && std::memcmp(&head[8], "sRGB", 4) == 0) {
            return 1;
        }
        // The chunk has the exponent of the encoding times 100 000.
        if (std::memcmp(&head[4], "gAMA", 4) == 0 && BigEndian(&head[8]) == 100000) {
            return 0;
        }
        offset += std::size_t { 12 } + BigEndian(head.data());
    }
    return -1;
}
