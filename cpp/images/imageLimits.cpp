// SPDX-License-Identifier: Apache-2.0
#include "images/imageLimits.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <stdexcept>

namespace {

/// Most decoded bytes of a byte of deflate: 258 bytes for two bits (zlib's technical notes: 1032), and some for
/// headers.
constexpr double deflateRatio = 1100.0;

std::uint32_t BigEndian(const unsigned char* bytes, int count)
{
    std::uint32_t value = 0;
    for (int i = 0; i < count; ++i) {
        value = value << 8 | bytes[i];
    }
    return value;
}

std::string SizeText(std::uint64_t width, std::uint64_t height)
{
    return std::to_string(width) + " x " + std::to_string(height);
}

void CheckSides(std::uint64_t width, std::uint64_t height)
{
    if (width < 1 || height < 1 || width > HdOocPTMaxSide || height > HdOocPTMaxSide) {
        throw std::runtime_error("is " + SizeText(width, height) + " texels; 65536 x 65536 are the most that are read");
    }
}

/// Most decoded bytes of a byte of a TIFF. LZW: the longest strings of a table of 4096; zstd: RLE in blocks of 128 KiB;
/// the fax codes, where a white row is one bit, and anything else: no limit (strips and tiles bound what is decoded at
/// once).
double TiffRatio(const OIIO::ImageSpec& spec)
{
    const std::string compression = spec.get_string_attribute("compression", "none");
    // Texels of few bits and colours from a palette become bytes.
    const int bits = spec.get_int_attribute("oiio:BitsPerSample", 8);
    const double widened = (bits < 8 ? 8.0 / std::max(bits, 1) : 1.0)
        * (spec.get_string_attribute("tiff:ColorSpace") == "palette"
                    || spec.get_int_attribute("tiff:PhotometricInterpretation") == 3
                ? 3.0
                : 1.0);
    const double ratio = compression == "none" ? 1.01
        : compression == "packbits"            ? 64.0
        : compression == "lzw"                 ? 2800.0
        : compression == "zip"                 ? deflateRatio
        : compression == "jpeg"                ? 2000.0
                                               : 1e9;
    return ratio * widened;
}

/// Checks compressed texts, each of which may expand to 8 MB in libpng.
void CheckPngTexts(const HdOocPTImageBytes& bytes)
{
    constexpr int most = 16;
    std::size_t offset = 8;
    for (int texts = 0; offset < bytes.GetSize();) {
        std::array<unsigned char, 8> head {};
        if (bytes.Read(head.data(), head.size(), offset) != head.size()) {
            return;
        }
        texts += std::memcmp(&head[4], "zTXt", 4) == 0 || std::memcmp(&head[4], "iTXt", 4) == 0;
        if (texts > most) {
            throw std::runtime_error("has more than " + std::to_string(most) + " texts in its header");
        }
        offset += std::size_t { 12 } + BigEndian(head.data(), 4);
    }
}

} // namespace

void HdOocPTCheckRatio(double decoded, double stored, double mostPerByte)
{
    if (decoded > static_cast<double>(HdOocPTAlwaysAllowedBytes) && decoded > stored * mostPerByte) {
        throw std::runtime_error("cannot be read: its header tells of "
            + std::to_string(static_cast<std::uint64_t>(decoded)) + " bytes of texels, and a file of "
            + std::to_string(static_cast<std::uint64_t>(stored)) + " bytes cannot hold that many");
    }
}

void HdOocPTCheckPngHeader(const HdOocPTImageBytes& bytes)
{
    std::array<unsigned char, 13> head {};
    if (bytes.Read(head.data(), head.size(), 16) != head.size()) {
        return;
    }
    const std::uint64_t width = BigEndian(head.data(), 4);
    const std::uint64_t height = BigEndian(head.data() + 4, 4);
    CheckSides(width, height);
    const int type = head[9];
    const int channels = type == 2 ? 3 : type == 4 ? 2 : type == 6 ? 4 : 1;
    CheckPngTexts(bytes);
    const std::uint64_t stored = (width * std::min<unsigned>(head[8], 16) * channels + 7) / 8 * height;
    HdOocPTCheckRatio(static_cast<double>(stored), static_cast<double>(bytes.GetSize()), deflateRatio);
    if (head[12] != 0 && width * height * 4 * (head[8] > 8 ? 2 : 1) > HdOocPTMaxHeldBytes) {
        throw std::runtime_error("is an interlaced PNG of " + SizeText(width, height)
            + " texels, which has to be decoded at once; save it without interlacing");
    }
}

void HdOocPTCheckJpegHeader(const unsigned char* content, std::size_t size)
{
    constexpr std::size_t mostScans = 100;
    std::size_t at = 2;
    while (at + 4 <= size && content[at] == 0xff) {
        const unsigned marker = content[at + 1];
        if (marker == 0xff) {
            ++at;
            continue;
        }
        const bool isFrame = marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
        if (isFrame && at + 10 <= size) {
            const std::uint64_t height = BigEndian(content + at + 5, 2);
            const std::uint64_t width = BigEndian(content + at + 7, 2);
            const std::uint64_t decoded = width * height * std::min<unsigned>(content[at + 9], 4);
            CheckSides(width, height);
            // A block of 8 x 8 takes at least a bit in each scan that has it, and chroma may have a quarter of the
            // blocks.
            HdOocPTCheckRatio(static_cast<double>(decoded), static_cast<double>(size), 2000.0);
            std::size_t scans = 0;
            const unsigned char* const end = content + size;
            for (const unsigned char* next = content + at; next + 1 < end; ++next) {
                next = static_cast<const unsigned char*>(std::memchr(next, 0xff, end - next - 1));
                if (!next) {
                    break;
                }
                scans += next[1] == 0xda;
            }
            if (scans > mostScans) {
                throw std::runtime_error("is a JPEG of " + std::to_string(scans) + " scans, more than is read");
            }
            // Coefficients of several scans take two bytes each.
            if (scans > 1 && decoded * 2 > HdOocPTMaxHeldBytes) {
                throw std::runtime_error("is a progressive JPEG of " + SizeText(width, height)
                    + " texels, which has to be decoded at once; save it as a baseline JPEG");
            }
            return;
        }
        at += 2 + (marker == 0x01 || (marker >= 0xd0 && marker <= 0xd9) ? 0 : BigEndian(content + at + 2, 2));
    }
    throw std::runtime_error("cannot be read: it is a JPEG without a frame");
}

void HdOocPTCheckSpec(const OIIO::ImageSpec& spec, const std::string& format, std::size_t fileSize)
{
    CheckSides(std::max(spec.width, 0), std::max(spec.height, 0));
    if (spec.depth > 1 || spec.nchannels < 1 || spec.deep) {
        throw std::runtime_error("is a volume or a deep image, not a flat one");
    }
    if (format == "tiff" && spec.format == OIIO::TypeDesc::DOUBLE) {
        // OpenImageIO 2.4 reads zeros from them.
        throw std::runtime_error("has numbers of 64 bits, which are not read from TIFF; save it with 32");
    }
    if (format == "hdr" && spec.get_int_attribute("Orientation", 1) != 1) {
        throw std::runtime_error("has its rows in another order than -Y +X, the only one that is read");
    }
    // libtiff divides by the width of a tile, also by 0 or 2^32 - 1.
    const bool isTiled = spec.tile_width != 0 || spec.tile_height != 0;
    if (isTiled
        && (spec.tile_width < 1 || spec.tile_height < 1 || spec.tile_width > HdOocPTMaxSide
            || spec.tile_height > HdOocPTMaxSide || spec.tile_depth > 1)) {
        throw std::runtime_error(
            "has tiles of " + SizeText(std::max(spec.tile_width, 0), std::max(spec.tile_height, 0)) + " texels");
    }
    const std::size_t texel = spec.pixel_bytes(true);
    const std::size_t level = spec.image_pixels() * texel;
    if (level > HdOocPTMaxLevelBytes) {
        throw std::runtime_error("has " + SizeText(spec.width, spec.height) + " texels of " + std::to_string(texel)
            + " bytes, which is more than is read");
    }
    const std::size_t tile = static_cast<std::size_t>(std::max(spec.tile_width, 0)) * std::max(spec.tile_height, 0);
    const std::size_t rows = std::clamp<std::size_t>(spec.get_int_attribute("tiff:RowsPerStrip", 1), 1, spec.height);
    const bool isHeld = format == "targa" || format == "bmp";
    const std::size_t held = tile != 0 ? tile : isHeld ? spec.image_pixels() : rows * spec.width;
    const std::size_t most = tile != 0 ? HdOocPTMaxHeldBytes / 8 : HdOocPTMaxHeldBytes;
    if (held > most || held * texel > most) {
        throw std::runtime_error(tile == 0 ? "has to be decoded at once, and is too large for that"
                                           : "has tiles of " + SizeText(spec.tile_width, spec.tile_height)
                    + " texels, which is more than is read");
    }
    // Most texels of a run: TGA has 128 texels for two bytes (of a palette of four channels: 256 times), BMP 255 texels
    // for two bytes, and rows may be left out; Radiance has 127 for two bytes, in each of four channels that become
    // three floats.
    const double ratio = format == "tiff" ? TiffRatio(spec)
        : format == "targa"               ? 260.0
        : format == "bmp"                 ? 1100.0
        : format == "hdr"                 ? 400.0
                                          : 1e9;
    HdOocPTCheckRatio(static_cast<double>(level), static_cast<double>(fileSize), ratio);
}
