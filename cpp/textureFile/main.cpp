// SPDX-License-Identifier: Apache-2.0
/// oocpt-texture-file: the part of `oocpt bench texture-files` that needs OpenImageIO. It writes a texture file of
/// noise row by row, and reads whole files as a baseline. It is a program of its own so that its peak of memory is its
/// own.
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
#include <system_error>
#include <thread>
#include <vector>

namespace {

constexpr int maxSize = 65536;
/// Rows that are written in one call, so that OpenImageIO may compress on several threads.
constexpr int rowsPerWrite = 64;
/// Limit of one decoded image.
constexpr std::size_t maxBytes = std::size_t { 16 } << 30;

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start)
{
    return std::chrono::duration<double>(Clock::now() - start).count();
}

bool EndsWith(const std::string& name, const std::string& suffix)
{
    return name.size() >= suffix.size() && name.compare(name.size() - suffix.size(), suffix.size(), suffix) == 0;
}

/// The format that artists' programs save: JPEG at quality 92, TIFF with deflate, half-float EXR with zip. PNG uses
/// zlib's fastest level, which hardly changes the time to decode.
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
    for (int top = 0; top < size; top += rowsPerWrite) {
        const int end = std::min(top + rowsPerWrite, size);
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

/// Reads a whole file in its own pixel format.
void ReadFile(const std::string& file)
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
    // Not zeroed: the time of that is not the decoder's.
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
    std::string message;
    const auto work = [&] {
        try {
            for (std::size_t i = next++; i < files.size(); i = next++) {
                ReadFile(files[i]);
            }
        } catch (const std::exception& error) {
            const std::lock_guard<std::mutex> lock(mutex);
            message = error.what();
        }
    };
    const std::size_t threadCount = threads > 0 ? threads : std::max(std::thread::hardware_concurrency(), 1U);
    // This thread is one of them.
    const std::size_t workerCount = std::min(threadCount, files.size()) - 1;
    std::vector<std::thread> workers;
    workers.reserve(workerCount);
    try {
        while (workers.size() < workerCount) {
            workers.emplace_back(work);
        }
    } catch (const std::system_error& error) {
        // Those that did start read all files, and have to be joined.
        std::fprintf(stderr, "%zu of %zu threads: %s\n", workers.size() + 1, workerCount + 1, error.what());
    }
    work();
    for (std::thread& worker : workers) {
        worker.join();
    }
    if (!message.empty()) {
        throw std::runtime_error(message);
    }
    std::printf("{\"seconds\": %.6f}\n", SecondsSince(start));
}

/// Parses a whole number from 0 to `max`; -1 if it is none.
long ParseNumber(const char* text, long max)
{
    char* end = nullptr;
    const long number = std::strtol(text, &end, 10);
    return *text && !*end && number >= 0 && number <= max ? number : -1;
}

int Run(const std::vector<const char*>& arguments)
{
    const std::string command = arguments.empty() ? "" : arguments[0];
    if (command == "write" && arguments.size() == 4) {
        const long size = ParseNumber(arguments[1], maxSize);
        const long seed = ParseNumber(arguments[2], 1L << 30);
        if (size >= 4 && seed >= 0) {
            Write(static_cast<int>(size), static_cast<std::uint32_t>(seed), arguments[3]);
            return 0;
        }
    } else if (command == "read" && arguments.size() >= 3) {
        const long threads = ParseNumber(arguments[1], 1024);
        if (threads >= 0) {
            Read(static_cast<unsigned>(threads), { arguments.begin() + 2, arguments.end() });
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
