// SPDX-License-Identifier: Apache-2.0
#include "images/imageFacts.h"
#include "images/imageLibrary.h"
#include "images/imageLimits.h"
#include "images/inputPool.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace {

constexpr std::size_t bandBytes = std::size_t { 4 } << 20;
/// OpenEXR compresses up to 16 or 32 rows together (256 with DWAB): bands do not cut those.
constexpr int blockRows = 32;

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
        InputLease lease(_source);
        const OIIO::ImageSpec spec = lease.Input().spec(0, 0);
        HdOocPTCheckSpec(spec, lease.Input().format_name(), lease.Bytes()->GetSize());
        std::vector<std::string> names = spec.channelnames;
        names.resize(spec.nchannels);
        _channels = HdOocPTChooseChannels(names);
        _facts = HdOocPTFindFacts(lease.Input(), *lease.Bytes(), _channels);
        const auto [first, last] = std::minmax_element(_channels.begin(), _channels.end());
        _first = *first;
        _end = *last + 1;
        // For whole strips OpenImageIO decompresses data that it could not read, beyond the end of its memory; libtiff
        // itself reads rows.
        _readsRowByRow = std::strcmp(lease.Input().format_name(), "tiff") == 0;
        // OpenImageIO's reader of TIFF is broken after a request for a level that does not exist: it forgets how many
        // bits a channel has.
        lease.Discard();
    }

    const HdOocPTImageFacts& GetFacts() const override { return _facts; }

    void Read(std::uint32_t level, std::array<std::uint32_t, 2> at, std::array<std::uint32_t, 2> size, void* out,
        std::size_t byteCount) const override
    {
        const std::size_t texel = _TexelBytes();
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
        std::vector<char> texels;
        try {
            _ReadBox(lease.Input(), static_cast<int>(level), spec, have, &texels);
        } catch (const std::exception&) {
            lease.Discard();
            throw;
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
        // This input is not pooled: it goes through the file once and never back.
        const OpenInput open = HdOocPTOpenInput(*_source);
        const OIIO::ImageSpec spec = _SpecOf(*open.input, level);
        const std::size_t stride = _TexelBytes() * static_cast<std::size_t>(spec.width);
        const int most = static_cast<int>(std::clamp<std::size_t>(bandBytes / stride, 1, spec.height));
        const int rows = _RowsAtOnce(spec, most);
        std::vector<char> texels;
        for (int top = 0; top < spec.height; top += rows) {
            const int end = std::min(top + rows, spec.height);
            _ReadBox(*open.input, static_cast<int>(level), spec,
                { spec.x, spec.x + spec.width, spec.y + top, spec.y + end }, &texels);
            for (int first = top; first < end; first += most) {
                const std::size_t count = static_cast<std::size_t>(std::min(most, end - first));
                if (!sink(static_cast<std::uint32_t>(first), texels.data() + stride * (first - top), stride * count)) {
                    return;
                }
            }
        }
    }

private:
    std::size_t _TexelBytes() const { return _facts.channels * HdOocPTTypeOf(_facts.format).size(); }

    OIIO::ImageSpec _SpecOf(OIIO::ImageInput& input, std::uint32_t level) const
    {
        OIIO::ImageSpec spec = input.spec_dimensions(0, static_cast<int>(level));
        if (spec.width != static_cast<int>(_facts.levels[level][0])
            || spec.height != static_cast<int>(_facts.levels[level][1]) || spec.nchannels < _end) {
            throw std::runtime_error("has changed since it was opened");
        }
        return spec;
    }

    /// The number of rows that are decoded together, so that nothing is decoded twice: a row of tiles, whole blocks.
    int _RowsAtOnce(const OIIO::ImageSpec& spec, int most) const
    {
        if (spec.tile_height > 0) {
            const int rows = std::min(spec.tile_height, spec.height);
            if (_TexelBytes() * static_cast<std::size_t>(spec.width) * rows > HdOocPTMaxHeldBytes) {
                throw std::runtime_error("has tiles of " + std::to_string(rows) + " rows, more than is read");
            }
            return rows;
        }
        return most > blockRows ? most / blockRows * blockRows : most;
    }

    /// The box that OpenImageIO can read at once: whole tiles, or whole rows.
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

    /// Reads the chosen channels of the box, rows from the top down.
    void _ReadBox(OIIO::ImageInput& input, int level, const OIIO::ImageSpec& spec, const FileBox& box,
        std::vector<char>* texels) const
    {
        const OIIO::TypeDesc type = HdOocPTTypeOf(_facts.format);
        const std::size_t count = static_cast<std::size_t>(box.x1 - box.x0) * (box.y1 - box.y0);
        texels->resize(count * (_end - _first) * type.size());
        bool isRead = true;
        if (spec.tile_width > 0 && spec.tile_height > 0) {
            isRead = input.read_tiles(
                0, level, box.x0, box.x1, box.y0, box.y1, spec.z, spec.z + 1, _first, _end, type, texels->data());
        } else {
            const std::size_t stride = (box.x1 - box.x0) * (_end - _first) * type.size();
            const int step = _readsRowByRow ? 1 : box.y1 - box.y0;
            for (int y = box.y0; isRead && y < box.y1; y += step) {
                isRead = input.read_scanlines(
                    0, level, y, y + step, spec.z, _first, _end, type, texels->data() + stride * (y - box.y0));
            }
        }
        // Some readers report success and leave an error message.
        if (!isRead || input.has_error()) {
            const std::string reason = input.geterror();
            throw std::runtime_error("cannot be decoded" + (reason.empty() ? "" : ": " + reason));
        }
        _Pick(texels, count, type.size());
    }

    /// Compacts texels to the chosen channels, in their order.
    void _Pick(std::vector<char>* texels, std::size_t count, std::size_t channelBytes) const
    {
        bool isInOrder = _end - _first == static_cast<int>(_channels.size());
        for (std::size_t i = 0; isInOrder && i < _channels.size(); ++i) {
            isInOrder = _channels[i] == _first + static_cast<int>(i);
        }
        if (isInOrder) {
            return;
        }
        const std::size_t from = (_end - _first) * channelBytes;
        std::vector<char> picked(count * _channels.size() * channelBytes);
        char* next = picked.data();
        for (std::size_t texel = 0; texel < count; ++texel) {
            for (const int channel : _channels) {
                std::memcpy(next, texels->data() + texel * from + (channel - _first) * channelBytes, channelBytes);
                next += channelBytes;
            }
        }
        texels->swap(picked);
    }

    const std::shared_ptr<const InputSource> _source;
    HdOocPTImageFacts _facts;
    /// Numbers in the file of the channels that are read, all of them in [_first, _end).
    std::vector<int> _channels;
    int _first = 0;
    int _end = 0;
    bool _readsRowByRow = false;
};

} // namespace

extern "C" __attribute__((visibility("default"))) std::unique_ptr<HdOocPTImageFile> HdOocPTOpenImage(
    const std::string& name, HdOocPTImageOpener opener)
{
    return std::make_unique<ImageFile>(name, std::move(opener));
}
