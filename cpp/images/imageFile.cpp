// SPDX-License-Identifier: Apache-2.0
#include "images/imageKind.h"
#include "images/imageLibrary.h"
#include "images/inputPool.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace {

constexpr int maxSize = 16384;
constexpr int maxLevels = 16;
/// Of one tile in a file, decoded. Ordinary ones are a thousandth of it.
constexpr std::size_t bandBytes = std::size_t { 4 } << 20;
/// OpenEXR compresses up to 16 or 32 rows together (256 with DWAB): bands do not cut those.
constexpr int blockRows = 32;
constexpr std::size_t maxTileBytes = std::size_t { 256 } << 20;

OIIO::TypeDesc TypeOf(HdOocPTTexelFormat format)
{
    return format == HdOocPTTexelFormat::UInt8 ? OIIO::TypeDesc::UINT8
        : format == HdOocPTTexelFormat::Half   ? OIIO::TypeDesc::HALF
                                               : OIIO::TypeDesc::FLOAT;
}

/// 16-bit integers become floats: half precision would lose five of their bits.
HdOocPTTexelFormat FormatOf(OIIO::TypeDesc type)
{
    return type == OIIO::TypeDesc::UINT8 ? HdOocPTTexelFormat::UInt8
        : type == OIIO::TypeDesc::HALF   ? HdOocPTTexelFormat::Half
                                         : HdOocPTTexelFormat::Float;
}

HdOocPTImageWrap WrapOf(const std::string& word)
{
    return word == "black"   ? HdOocPTImageWrap::Black
        : word == "clamp"    ? HdOocPTImageWrap::Clamp
        : word == "periodic" ? HdOocPTImageWrap::Repeat
        : word == "mirror"   ? HdOocPTImageWrap::Mirror
                             : HdOocPTImageWrap::Unknown;
}

std::string SizeText(const OIIO::ImageSpec& spec)
{
    return std::to_string(spec.width) + " x " + std::to_string(spec.height);
}

void CheckSize(const OIIO::ImageSpec& spec)
{
    if (spec.width < 1 || spec.height < 1 || spec.width > maxSize || spec.height > maxSize) {
        throw std::runtime_error("is " + SizeText(spec) + " texels; 16384 x 16384 are the most that are read");
    }
    if (spec.depth > 1 || spec.nchannels < 1 || spec.deep) {
        throw std::runtime_error("is a volume or a deep image, not a flat one");
    }
    const std::size_t tile = static_cast<std::size_t>(std::max(spec.tile_width, 0)) * std::max(spec.tile_height, 0);
    if (tile > maxTileBytes || tile * spec.pixel_bytes(true) > maxTileBytes) {
        throw std::runtime_error("has tiles of " + std::to_string(spec.tile_width) + " x "
            + std::to_string(spec.tile_height) + " texels, which is more than is read");
    }
}

HdOocPTImageFacts FactsOf(OIIO::ImageInput& input, const HdOocPTImageBytes& bytes)
{
    HdOocPTImageFacts facts;
    const OIIO::ImageSpec spec = input.spec(0, 0);
    CheckSize(spec);
    facts.channels = static_cast<std::uint32_t>(std::min(spec.nchannels, 4));
    facts.format = FormatOf(spec.format);
    facts.isTiled = spec.tile_width > 0;
    const std::string name = input.format_name();
    facts.isSrgb = name == "openexr" || name == "hdr" ? 0 : name == "png" ? HdOocPTFindPngColorSpace(bytes) : -1;
    const std::string wrap = spec.get_string_attribute("wrapmodes");
    const std::size_t comma = wrap.find(',');
    if (!wrap.empty()) {
        facts.wrap
            = { WrapOf(wrap.substr(0, comma)), WrapOf(comma == std::string::npos ? wrap : wrap.substr(comma + 1)) };
    }
    for (int level = 0; level < maxLevels; ++level) {
        const OIIO::ImageSpec found = level == 0 ? spec : input.spec_dimensions(0, level);
        if (found.undefined() || found.width < 1 || found.height < 1 || found.nchannels != spec.nchannels) {
            break;
        }
        CheckSize(found);
        facts.levels.push_back({ static_cast<std::uint32_t>(found.width), static_cast<std::uint32_t>(found.height) });
        // Formats without levels give the same one for every number.
        if (!input.supports("mipmap")) {
            break;
        }
    }
    // Asking for a level that is not there leaves a message behind.
    static_cast<void>(input.geterror());
    return facts;
}

/// A rectangle of a file's level, in the file's own coordinates: rows from the top, origin of the data window added.
struct FileBox
{
    int x0, x1, y0, y1;
};

class ImageFile final : public HdOocPTImageFile
{
public:
    ImageFile(std::string name, HdOocPTImageOpener opener)
        : _source(std::make_shared<InputSource>(InputSource { std::move(name), std::move(opener) }))
    {
        const InputLease lease(_source);
        _facts = FactsOf(lease.Input(), *lease.Bytes());
    }

    const HdOocPTImageFacts& GetFacts() const override { return _facts; }

    void Read(std::uint32_t level, std::array<std::uint32_t, 2> at, std::array<std::uint32_t, 2> size, void* out,
        std::size_t byteCount) const override
    {
        const std::size_t texel = _facts.channels * TypeOf(_facts.format).size();
        if (level >= _facts.levels.size() || size[0] == 0 || size[1] == 0 || size[0] > _facts.levels[level][0]
            || size[1] > _facts.levels[level][1] || at[0] > _facts.levels[level][0] - size[0]
            || at[1] > _facts.levels[level][1] - size[1] || byteCount != texel * size[0] * size[1]) {
            throw std::runtime_error("was asked for texels that it does not have");
        }
        InputLease lease(_source);
        const OIIO::ImageSpec spec = _SpecOf(lease.Input(), level);
        const int top = spec.y + spec.height - static_cast<int>(at[1] + size[1]);
        const int left = spec.x + static_cast<int>(at[0]);
        const FileBox want { left, left + static_cast<int>(size[0]), top, top + static_cast<int>(size[1]) };
        const FileBox have = _Widened(spec, want);
        std::vector<char> texels(texel * (have.x1 - have.x0) * (have.y1 - have.y0));
        if (!_ReadBox(lease.Input(), static_cast<int>(level), spec, have, texels.data())) {
            const std::string reason = lease.Input().geterror();
            lease.Discard();
            throw std::runtime_error("cannot be decoded" + (reason.empty() ? "" : ": " + reason));
        }
        const std::size_t stride = texel * (have.x1 - have.x0);
        for (std::size_t row = 0; row < size[1]; ++row) {
            const std::size_t from = static_cast<std::size_t>(want.y1 - 1 - have.y0) - row;
            std::memcpy(static_cast<char*>(out) + row * texel * size[0],
                texels.data() + from * stride + texel * (want.x0 - have.x0), texel * size[0]);
        }
    }

    void Decode(std::uint32_t level, const HdOocPTRowSink& sink) const override
    {
        if (level >= _facts.levels.size()) {
            throw std::runtime_error("has no level " + std::to_string(level));
        }
        // Not pooled: one input, which goes through the file once and never back.
        const OpenInput open = HdOocPTOpenInput(*_source);
        const OIIO::ImageSpec spec = _SpecOf(*open.input, level);
        const std::size_t stride
            = _facts.channels * TypeOf(_facts.format).size() * static_cast<std::size_t>(spec.width);
        const int most = static_cast<int>(std::clamp<std::size_t>(bandBytes / stride, 1, spec.height));
        const int rows = spec.tile_height > 0 ? std::min(spec.tile_height, spec.height)
            : most > blockRows                ? most / blockRows * blockRows
                                              : most;
        if (stride * rows > maxTileBytes) {
            throw std::runtime_error("has tiles of " + std::to_string(spec.tile_height) + " rows, more than is read");
        }
        std::vector<char> texels(stride * rows);
        for (int top = 0; top < spec.height; top += rows) {
            const int end = std::min(top + rows, spec.height);
            const FileBox box { spec.x, spec.x + spec.width, spec.y + top, spec.y + end };
            if (!_ReadBox(*open.input, static_cast<int>(level), spec, box, texels.data())) {
                const std::string reason = open.input->geterror();
                throw std::runtime_error("cannot be decoded" + (reason.empty() ? "" : ": " + reason));
            }
            for (int first = top; first < end; first += most) {
                const std::size_t count = static_cast<std::size_t>(std::min(most, end - first));
                if (!sink(static_cast<std::uint32_t>(first), texels.data() + stride * (first - top), stride * count)) {
                    return;
                }
            }
        }
    }

private:
    OIIO::ImageSpec _SpecOf(OIIO::ImageInput& input, std::uint32_t level) const
    {
        OIIO::ImageSpec spec = input.spec_dimensions(0, static_cast<int>(level));
        if (spec.width != static_cast<int>(_facts.levels[level][0])
            || spec.height != static_cast<int>(_facts.levels[level][1])
            || std::min(spec.nchannels, 4) != static_cast<int>(_facts.channels)) {
            throw std::runtime_error("has changed since it was opened");
        }
        return spec;
    }

    /// What OpenImageIO can read at once: whole tiles, or whole rows.
    static FileBox _Widened(const OIIO::ImageSpec& spec, const FileBox& box)
    {
        if (spec.tile_width <= 0 || spec.tile_height <= 0) {
            return { spec.x, spec.x + spec.width, box.y0, box.y1 };
        }
        const auto down = [](int value, int origin, int step) { return value - (value - origin) % step; };
        const auto up = [&](int value, int origin, int step, int end) {
            return std::min(down(value + step - 1, origin, step), end);
        };
        return { down(box.x0, spec.x, spec.tile_width), up(box.x1, spec.x, spec.tile_width, spec.x + spec.width),
            down(box.y0, spec.y, spec.tile_height), up(box.y1, spec.y, spec.tile_height, spec.y + spec.height) };
    }

    bool _ReadBox(
        OIIO::ImageInput& input, int level, const OIIO::ImageSpec& spec, const FileBox& box, char* texels) const
    {
        const int channels = static_cast<int>(_facts.channels);
        const OIIO::TypeDesc type = TypeOf(_facts.format);
        return spec.tile_width > 0 && spec.tile_height > 0
            ? input.read_tiles(0, level, box.x0, box.x1, box.y0, box.y1, spec.z, spec.z + 1, 0, channels, type, texels)
            : input.read_scanlines(0, level, box.y0, box.y1, spec.z, 0, channels, type, texels);
    }

    const std::shared_ptr<const InputSource> _source;
    HdOocPTImageFacts _facts;
};

} // namespace

extern "C" __attribute__((visibility("default"))) std::unique_ptr<HdOocPTImageFile> HdOocPTOpenImage(
    const std::string& name, HdOocPTImageOpener opener)
{
    return std::make_unique<ImageFile>(name, std::move(opener));
}
