// SPDX-License-Identifier: Apache-2.0
/// oocpt-texture-file: the part of `oocpt bench texture-files` that needs OpenImageIO, which the `oocpt` program does
/// not link: it writes a texture file of noise, row by row, and reads files whole, for comparison. It is a program of
/// its own so that its peak memory is its own.
///
///     oocpt-texture-file write SIZE SEED FILE      the extension selects the format: .jpg .png .tif .exr
///     oocpt-texture-file read THREADS FILE...      each file once, a file per thread; 0 = as many threads as cores
///
/// It prints one JSON object. Exit status: 0 done, 1 failed (the message is on stderr), 2 bad arguments.
#include "textureFile/noise.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

constexpr int maxSize = 65536;
/// Rows that are written at once, so that writers may compress on several threads.
constexpr int band = 64;
/// Most bytes of one decoded image.
constexpr std::size_t maxBytes = std::size_t { 16 } << 30;

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start)
{
    return std::chrono::duration<double>(Clock::now() - start).count();
}

bool EndsWith(const std::string& name, const std::string& end)
{
    return name.size() >= end.size() && name.compare(name.size() - end.size(), end.size(), end) == 0;
}

/// The options with which artists' programs save: JPEG at quality 92, TIFF with deflate, half EXR with zip. PNG is
/// compressed as fast as zlib can, which hardly changes how long it takes to unpack.
OIIO::ImageSpec SpecOf(const std::string& file, int size)
{
    OIIO::ImageSpec spec(size, size, 3, OIIO::TypeDesc::UINT8);
    if (EndsWith(file, ".jpg")) {
        spec.attribute("Compression", "jpeg:92");
    } else if (EndsWith(file, ".png")) {
        spec.attribute("png:compressionLevel", 1);
        // PNG_FAST_FILTERS
        spec.attribute("png:filter", 0x38);
    } else if (EndsWith(file, ".tif")) {
        spec.attribute("Compression", "zip");
    } else if (EndsWith(file, ".exr")) {
        spec = OIIO::ImageSpec(size, size, 3, OIIO::TypeDesc::HALF);
        spec.attribute("Compression", "zip");
    } else {
        throw std::runtime_error(file + ": the name must end in .jpg, .png, .tif or .exr");
    }
    return spec;
}

void Write(int size, std::uint32_t seed, const std::string& file)
{
    const Clock::time_point start = Clock::now();
    const OIIO::ImageSpec spec = SpecOf(file, size);
    const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(file);
    if (!output || !output->open(file, spec)) {
        throw std::runtime_error(file + ": " + (output ? output->geterror() : OIIO::geterror()));
    }
    const bool isLinear = spec.format == OIIO::TypeDesc::HALF;
    Noise noise(size, seed);
    std::vector<float> row;
    std::vector<float> rows;
    for (int top = 0; top < size; top += band) {
        const int end = std::min(top + band, size);
        rows.clear();
        for (int y = top; y < end; ++y) {
            noise.GetRow(y, &row);
            if (isLinear) {
                std::transform(row.begin(), row.end(), row.begin(), [](float x) { return x * x; });
            }
            rows.insert(rows.end(), row.begin(), row.end());
        }
        if (!output->write_scanlines(top, end, 0, OIIO::TypeDesc::FLOAT, rows.data())) {
            throw std::runtime_error(file + ": " + output->geterror());
        }
    }
    if (!output->close()) {
        throw std::runtime_error(file + ": " + output->geterror());
    }
    std::printf("{\"seconds\": %.6f}\n", SecondsSince(start));
}

/// Reads a file whole, in its own format, with OpenImageIO's defaults.
void ReadOne(const std::string& file)
{
    const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::open(file);
    if (!input) {
        throw std::runtime_error(file + ": " + OIIO::geterror());
    }
    const OIIO::ImageSpec& spec = input->spec();
    const std::size_t bytes = spec.image_bytes(true);
    if (bytes == 0 || bytes > maxBytes) {
        throw std::runtime_error(file + ": it is too large");
    }
    // The memory is not zeroed: that pass over it would not be part of decoding.
    const std::unique_ptr<char[]> pixels(new char[bytes]);
    if (!input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UNKNOWN, pixels.get())) {
        throw std::runtime_error(file + ": " + input->geterror());
    }
}

void Read(unsigned threads, const std::vector<std::string>& files)
{
    const Clock::time_point start = Clock::now();
    std::atomic<std::size_t> next { 0 };
    std::mutex mutex;
    std::string reason;
    const auto work = [&] {
        try {
            for (std::size_t i = next++; i < files.size(); i = next++) {
                ReadOne(files[i]);
            }
        } catch (const std::exception& error) {
            const std::lock_guard<std::mutex> lock(mutex);
            reason = error.what();
        }
    };
    const std::size_t cores = threads > 0 ? threads : std::max(std::thread::hardware_concurrency(), 1U);
    std::vector<std::thread> others;
    for (std::size_t i = 1; i < std::min(cores, files.size()); ++i) {
        others.emplace_back(work);
    }
    work();
    for (std::thread& other : others) {
        other.join();
    }
    if (!reason.empty()) {
        throw std::runtime_error(reason);
    }
    std::printf("{\"seconds\": %.6f}\n", SecondsSince(start));
}

/// A whole number of at most `most`, or -1.
long Number(const char* text, long most)
{
    char* end = nullptr;
    const long number = std::strtol(text, &end, 10);
    return *text && !*end && number >= 0 && number <= most ? number : -1;
}

int Run(const std::vector<const char*>& words)
{
    const std::string command = words.empty() ? "" : words[0];
    if (command == "write" && words.size() == 4) {
        const long size = Number(words[1], maxSize);
        const long seed = Number(words[2], 1L << 30);
        if (size >= 4 && seed >= 0) {
            Write(static_cast<int>(size), static_cast<std::uint32_t>(seed), words[3]);
            return 0;
        }
    } else if (command == "read" && words.size() >= 3) {
        const long threads = Number(words[1], 1024);
        if (threads >= 0) {
            Read(static_cast<unsigned>(threads), { words.begin() + 2, words.end() });
            return 0;
        }
    }
    std::fputs("usage: oocpt-texture-file write SIZE SEED FILE | read THREADS FILE...\n", stderr);
    return 2;
}

} // namespace

int main(int argc, char** argv)
{
    try {
        return Run({ argv + 1, argv + argc });
    } catch (const std::exception& error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}
