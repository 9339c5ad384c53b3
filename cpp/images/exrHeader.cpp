// SPDX-License-Identifier: Apache-2.0
/// Checks headers of OpenEXR files before OpenEXR allocates memory for them. Source: "OpenEXR File Layout" of its
/// documentation.
#include "images/imageLimits.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

constexpr std::size_t maxAttributes = 4096;
constexpr std::size_t maxParts = 1024;
/// Longest name or type of files with long names.
constexpr std::size_t maxName = 255;
constexpr std::uint32_t isDeep = 0x800;
constexpr std::uint32_t hasParts = 0x1000;

[[noreturn]] void Refuse(const std::string& reason)
{
    throw std::runtime_error("cannot be read: " + reason);
}

/// Reads the file from its beginning.
class Cursor
{
public:
    explicit Cursor(const HdOocPTImageBytes& bytes)
        : _bytes(bytes)
    {
    }

    std::size_t Left() const { return _bytes.GetSize() - _at; }

    std::vector<unsigned char> Take(std::size_t count)
    {
        std::vector<unsigned char> taken(count);
        if (count > Left() || _bytes.Read(taken.data(), count, _at) != count) {
            Refuse("its header breaks off");
        }
        _at += count;
        return taken;
    }

    std::uint32_t TakeNumber()
    {
        const std::vector<unsigned char> b = Take(4);
        return b[0] | b[1] << 8 | b[2] << 16 | static_cast<std::uint32_t>(b[3]) << 24;
    }

    /// Reads a name up to a zero.
    std::string TakeName()
    {
        std::array<char, maxName + 1> text {};
        const std::size_t count = _bytes.Read(text.data(), text.size(), _at);
        const auto* const end = static_cast<const char*>(std::memchr(text.data(), 0, count));
        if (!end) {
            Refuse("its header breaks off");
        }
        _at += end - text.data() + 1;
        return text.data();
    }

    void Skip(std::size_t count)
    {
        if (count > Left()) {
            Refuse("its header breaks off");
        }
        _at += count;
    }

private:
    const HdOocPTImageBytes& _bytes;
    std::size_t _at = 0;
};

std::int64_t Number(const std::vector<unsigned char>& data, std::size_t at)
{
    std::uint32_t value = 0;
    for (int i = 3; i >= 0; --i) {
        value = value << 8 | data[at + i];
    }
    return static_cast<std::int32_t>(value);
}

struct Part
{
    std::int64_t width = 0;
    std::int64_t height = 0;
    int compression = 0;
    bool isTiled = false;
    std::int64_t tile[2] = { 0, 0 };
    int levelMode = 0;
    bool roundsUp = false;
    std::int64_t channels = 0;
    std::int64_t texelBytes = 0;
    std::string type;
};

void ReadChannels(const std::vector<unsigned char>& data, Part* part)
{
    std::size_t at = 0;
    while (at < data.size() && data[at] != 0) {
        const auto* const end = static_cast<const unsigned char*>(std::memchr(&data[at], 0, data.size() - at));
        const std::size_t next = end ? end - data.data() + 1 : data.size();
        // The entry has kind of number, linearity, three unused bytes, sampling in x and y.
        if (next + 16 > data.size()) {
            Refuse("its list of channels breaks off");
        }
        part->texelBytes += Number(data, next) == 1 ? 2 : 4;
        ++part->channels;
        at = next + 16;
    }
}

void ReadAttribute(const std::string& name, const std::vector<unsigned char>& data, Part* part)
{
    if (name == "dataWindow" && data.size() == 16) {
        part->width = Number(data, 8) - Number(data, 0) + 1;
        part->height = Number(data, 12) - Number(data, 4) + 1;
    } else if (name == "compression" && data.size() == 1) {
        part->compression = data[0];
    } else if (name == "tiles" && data.size() == 9) {
        part->isTiled = true;
        part->tile[0] = Number(data, 0);
        part->tile[1] = Number(data, 4);
        part->levelMode = data[8] & 15;
        part->roundsUp = (data[8] >> 4) != 0;
    } else if (name == "channels") {
        ReadChannels(data, part);
    } else if (name == "type") {
        part->type.assign(data.begin(), data.end());
    }
}

/// Reads a part; returns false at the end of the list of parts.
bool ReadPart(Cursor* file, Part* part)
{
    for (std::size_t count = 0; count < maxAttributes; ++count) {
        const std::string name = file->TakeName();
        if (name.empty()) {
            return count > 0;
        }
        static_cast<void>(file->TakeName());
        const std::uint32_t size = file->TakeNumber();
        const bool isWanted
            = name == "dataWindow" || name == "compression" || name == "tiles" || name == "channels" || name == "type";
        if (!isWanted) {
            file->Skip(size);
        } else if (size > (1U << 20)) {
            Refuse("its header has an attribute `" + name + "` of " + std::to_string(size) + " bytes");
        } else {
            ReadAttribute(name, file->Take(size), part);
        }
    }
    Refuse("its header has no end");
}

/// Number of tiles along one axis, of the level alone or of all levels that halve it.
double TileCount(std::int64_t size, std::int64_t tile, bool allLevels, bool roundsUp)
{
    double count = 0.0;
    for (;; size = roundsUp ? (size + 1) / 2 : size / 2) {
        count += static_cast<double>((size + tile - 1) / tile);
        if (!allLevels || size <= 1) {
            return count;
        }
    }
}

void CheckPart(const Part& part, std::size_t fileSize, double* tableBytes)
{
    // Bytes of a table entry and of an empty chunk's header.
    constexpr double bytesPerChunk = 16.0;
    // Rows of a block by OpenEXR's number of the compression.
    constexpr int rows[] = { 1, 1, 1, 16, 32, 16, 32, 32, 32, 256 };
    if (part.width < 1 || part.height < 1 || part.width > HdOocPTMaxSide || part.height > HdOocPTMaxSide) {
        throw std::runtime_error("is " + std::to_string(part.width) + " x " + std::to_string(part.height)
            + " texels; 65536 x 65536 are the most that are read");
    }
    if (part.channels == 0) {
        Refuse("it has no channels");
    }
    if (part.isTiled
        && (part.tile[0] < 1 || part.tile[1] < 1 || part.tile[0] > HdOocPTMaxSide || part.tile[1] > HdOocPTMaxSide)) {
        Refuse("it has tiles of " + std::to_string(part.tile[0]) + " x " + std::to_string(part.tile[1]) + " texels");
    }
    const int inChunk = part.compression < 10 ? rows[part.compression] : 256;
    const std::int64_t chunk = part.isTiled ? part.tile[0] * part.tile[1] : part.width * inChunk;
    if (static_cast<double>(chunk) * static_cast<double>(part.texelBytes)
        > static_cast<double>(HdOocPTMaxHeldBytes) / 8) {
        Refuse("what it compresses together has " + std::to_string(chunk) + " texels of "
            + std::to_string(part.texelBytes) + " bytes");
    }
    double chunks = static_cast<double>((part.height + inChunk - 1) / inChunk);
    if (part.isTiled) {
        // Rip maps have every combination of levels. Those of mip maps after the finest add at most as much again.
        const bool all = part.levelMode == 2;
        chunks = TileCount(part.width, part.tile[0], all, part.roundsUp)
            * TileCount(part.height, part.tile[1], all, part.roundsUp);
    }
    *tableBytes += chunks * bytesPerChunk;
    if (*tableBytes > static_cast<double>(fileSize)) {
        Refuse("its header tells of more parts than a file of " + std::to_string(fileSize) + " bytes can have");
    }
}

} // namespace

void HdOocPTCheckExrHeader(const HdOocPTImageBytes& bytes)
{
    Cursor file(bytes);
    file.Skip(4);
    const std::uint32_t version = file.TakeNumber();
    double tableBytes = 0.0;
    for (std::size_t count = 0;; ++count) {
        Part part;
        if (!ReadPart(&file, &part)) {
            if (count == 0) {
                Refuse("its header is empty");
            }
            return;
        }
        if ((version & isDeep) != 0 || part.type.rfind("deep", 0) == 0) {
            throw std::runtime_error("is a volume or a deep image, not a flat one");
        }
        CheckPart(part, bytes.GetSize(), &tableBytes);
        if ((version & hasParts) == 0) {
            return;
        }
        if (count >= maxParts) {
            Refuse("it has more than " + std::to_string(maxParts) + " parts");
        }
    }
}
