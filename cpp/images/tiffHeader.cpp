// SPDX-License-Identifier: Apache-2.0
/// The first directory of TIFF files. Source: TIFF 6.0, and libtiff's description of BigTIFF.
#include "images/imageLimits.h"

#include <array>
#include <cstdint>
#include <stdexcept>

namespace {

/// A number of `count` bytes at an offset; 0 beyond the end.
std::uint64_t Number(const HdOocPTImageBytes& bytes, std::uint64_t at, int count, bool isBig)
{
    std::array<unsigned char, 8> read {};
    if (at > bytes.GetSize() || bytes.Read(read.data(), count, at) != static_cast<std::size_t>(count)) {
        return 0;
    }
    std::uint64_t value = 0;
    for (int i = 0; i < count; ++i) {
        value = value << 8 | read[isBig ? i : count - 1 - i];
    }
    return value;
}

} // namespace

void HdOocPTCheckTiffHeader(const HdOocPTImageBytes& bytes)
{
    constexpr std::uint64_t maxEntries = 4096;
    constexpr std::uint64_t bitsPerSample = 258;
    const bool isBig = Number(bytes, 0, 1, true) == 'M';
    const bool isLong = Number(bytes, 2, 2, isBig) == 43;
    const std::uint64_t directory = isLong ? Number(bytes, 8, 8, isBig) : Number(bytes, 4, 4, isBig);
    const std::uint64_t count = Number(bytes, directory, isLong ? 8 : 2, isBig);
    if (count == 0 || count > maxEntries) {
        throw std::runtime_error("cannot be read: its directory is not there, or damaged");
    }
    const std::uint64_t entryBytes = isLong ? 20 : 12;
    for (std::uint64_t i = 0; i < count; ++i) {
        if (Number(bytes, directory + (isLong ? 8 : 2) + i * entryBytes, 2, isBig) == bitsPerSample) {
            return;
        }
    }
    // The default is one bit. OpenImageIO 2.4 takes it for eight.
    throw std::runtime_error("does not say how many bits a channel has; save it with 8");
}
