// SPDX-License-Identifier: Apache-2.0
/// Loaded into the wheel host by tests/images: reads files exactly as the renderer has them read, through the host's
/// resolver and the library of image readers beside this one, and answers in JSON.
#include "bridge/imageSource.h"
#include "oocpt-bridge/src/ffi_images.rs.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

PXR_NAMESPACE_USING_DIRECTIVE

namespace {

const oocpt::ImageSource& _Source()
{
    static const std::unique_ptr<oocpt::ImageSource> source = HdOocPTMakeImageSource();
    return *source;
}

std::string _Quoted(const char* text)
{
    std::string quoted = "\"";
    for (; *text; ++text) {
        const unsigned char byte = static_cast<unsigned char>(*text);
        if (*text == '"' || *text == '\\') {
            quoted += '\\';
        }
        quoted += byte < 0x20 ? ' ' : *text;
    }
    return quoted + "\"";
}

template <typename Function>
const char* _Answer(Function&& function)
{
    static std::string text;
    try {
        text = function();
    } catch (const std::exception& error) {
        text = "{\"error\": " + _Quoted(error.what()) + "}";
    }
    return text.c_str();
}

std::vector<std::uint8_t> _Read(const oocpt::HeldImage& image, const oocpt::TexelBox& box)
{
    const oocpt::ImageFacts facts = image.facts();
    const std::size_t bytes = facts.format == oocpt::TexelTag::UInt8 ? 1
        : facts.format == oocpt::TexelTag::Half                      ? 2
                                                                     : 4;
    std::vector<std::uint8_t> texels(bytes * facts.channels * box.width * box.height);
    image.read(box, { texels.data(), texels.size() });
    return texels;
}

/// Bytes that this process has read so far, from files and whatever else.
unsigned long _BytesRead()
{
    std::ifstream counters("/proc/self/io");
    std::string name;
    unsigned long count = 0;
    counters >> name >> count;
    return count;
}

} // namespace

#define EXPORT extern "C" __attribute__((visibility("default")))

/// What is known of an image.
EXPORT const char* oocpt_image_facts(const char* path)
{
    return _Answer([&] {
        const oocpt::ImageFacts facts = _Source().open(path)->facts();
        std::ostringstream out;
        out << "{\"levels\": [";
        for (std::size_t i = 0; i + 1 < facts.levels.size(); i += 2) {
            out << (i ? ", " : "") << "[" << facts.levels[i] << ", " << facts.levels[i + 1] << "]";
        }
        out << "], \"channels\": " << facts.channels << ", \"format\": " << static_cast<int>(facts.format)
            << ", \"tiled\": " << (facts.is_tiled ? "true" : "false")
            << ", \"srgb\": " << static_cast<int>(facts.is_srgb) << ", \"wrap\": [" << static_cast<int>(facts.wrap_s)
            << ", " << static_cast<int>(facts.wrap_t) << "]}";
        return out.str();
    });
}

/// The bytes of a box of texels in hexadecimal, as {"texels": ".."}.
EXPORT const char* oocpt_image_read(
    const char* path, unsigned level, unsigned x, unsigned y, unsigned width, unsigned height)
{
    return _Answer([&] {
        const std::vector<std::uint8_t> texels = _Read(*_Source().open(path), { level, x, y, width, height });
        std::string out = "{\"texels\": \"";
        for (const std::uint8_t byte : texels) {
            out += "0123456789abcdef"[byte >> 4];
            out += "0123456789abcdef"[byte & 15];
        }
        return out + "\"}";
    });
}

/// A level decoded at once: the bytes of its texels in hexadecimal, the first row of every band, its bytes, how many
/// bytes the process
/// read meanwhile, as {"texels": "..", "tops": [..], "most": .., "read": ..}. Stops after `bands` bands, if that is
/// not 0.
EXPORT const char* oocpt_image_decode(const char* path, unsigned level, unsigned bands)
{
    return _Answer([&] {
        const std::unique_ptr<HdOocPTImageFile> image = HdOocPTOpenHostImage(path);
        std::string texels;
        std::string tops;
        std::size_t most = 0;
        unsigned count = 0;
        const unsigned long before = _BytesRead();
        image->Decode(level, [&](std::uint32_t top, const void* rows, std::size_t byteCount) {
            const auto* const bytes = static_cast<const std::uint8_t*>(rows);
            for (std::size_t i = 0; i < byteCount; ++i) {
                texels += "0123456789abcdef"[bytes[i] >> 4];
                texels += "0123456789abcdef"[bytes[i] & 15];
            }
            tops += (tops.empty() ? "" : ", ") + std::to_string(top);
            most = std::max(most, byteCount);
            return ++count != bands;
        });
        const unsigned long read = _BytesRead() - before;
        return "{\"texels\": \"" + texels + "\", \"tops\": [" + tops + "], \"most\": " + std::to_string(most)
            + ", \"read\": " + std::to_string(read) + "}";
    });
}

/// Decodes an image without giving its texels: the sum of all bytes, so that nothing is left out, and the rows.
EXPORT const char* oocpt_image_walk(const char* path, unsigned level)
{
    return _Answer([&] {
        const std::unique_ptr<HdOocPTImageFile> image = HdOocPTOpenHostImage(path);
        unsigned long sum = 0;
        image->Decode(level, [&](std::uint32_t, const void* rows, std::size_t byteCount) {
            const auto* const bytes = static_cast<const std::uint8_t*>(rows);
            sum = std::accumulate(bytes, bytes + byteCount, sum);
            return true;
        });
        return "{\"sum\": " + std::to_string(sum) + "}";
    });
}

/// Opens an image, cuts its file to `size` bytes, then decodes it and reads its lowest row.
EXPORT const char* oocpt_image_shrink(const char* path, unsigned long size)
{
    return _Answer([&] {
        const std::unique_ptr<oocpt::HeldImage> held = _Source().open(path);
        const std::unique_ptr<HdOocPTImageFile> image = HdOocPTOpenHostImage(path);
        std::filesystem::resize_file(path, size);
        unsigned long sum = 0;
        const oocpt::ImageFacts facts = held->facts();
        sum += _Read(*held, { 0, 0, 0, facts.levels[0], 1 }).size();
        image->Decode(0, [&](std::uint32_t, const void*, std::size_t byteCount) {
            sum += byteCount;
            return true;
        });
        return "{\"sum\": " + std::to_string(sum) + "}";
    });
}

/// What is known of a file without opening it, as {"plain": .., "canonical": "..", "size": .., "modified": ..,
/// "loaded": ..}; `loaded`
/// says whether the library of image readers is in the process.
EXPORT const char* oocpt_image_file_facts(const char* path)
{
    return _Answer([&] {
        const oocpt::FileFacts facts = _Source().file_facts(path);
        std::ifstream maps("/proc/self/maps");
        const std::string all((std::istreambuf_iterator<char>(maps)), std::istreambuf_iterator<char>());
        std::ostringstream out;
        out << "{\"plain\": " << (facts.is_plain ? "true" : "false")
            << ", \"canonical\": " << _Quoted(std::string(facts.canonical).c_str()) << ", \"size\": " << facts.size
            << ", \"modified\": " << facts.modified_ns
            << ", \"loaded\": " << (all.find("hdOocPTImages.so") != std::string::npos ? "true" : "false") << "}";
        return out.str();
    });
}

/// Reads an image in boxes from several threads at once, all of them again and again; how many boxes differ from the
/// image read whole by one thread.
EXPORT const char* oocpt_image_race(const char* path, unsigned threads, unsigned size)
{
    return _Answer([&] {
        const std::unique_ptr<oocpt::HeldImage> image = _Source().open(path);
        const oocpt::ImageFacts facts = image->facts();
        const unsigned width = facts.levels[0];
        const unsigned height = facts.levels[1];
        const std::vector<std::uint8_t> whole = _Read(*image, { 0, 0, 0, width, height });
        const std::size_t texel = whole.size() / width / height;
        std::atomic<int> different { 0 };
        const auto work = [&](unsigned first) {
            const unsigned columns = (width + size - 1) / size;
            const unsigned count = columns * ((height + size - 1) / size);
            for (unsigned i = 0; i < count; ++i) {
                const unsigned box = (i * 7 + first) % count;
                const unsigned x = box % columns * size;
                const unsigned y = box / columns * size;
                const unsigned w = std::min(size, width - x);
                const unsigned h = std::min(size, height - y);
                try {
                    const std::vector<std::uint8_t> part = _Read(*image, { 0, x, y, w, h });
                    for (unsigned row = 0; row < h; ++row) {
                        const std::size_t at = ((static_cast<std::size_t>(y) + row) * width + x) * texel;
                        different += std::memcmp(&part[row * w * texel], &whole[at], w * texel) != 0;
                    }
                } catch (const std::exception&) {
                    ++different;
                }
            }
        };
        std::vector<std::thread> running;
        for (unsigned i = 0; i < threads; ++i) {
            running.emplace_back(work, i);
        }
        for (std::thread& thread : running) {
            thread.join();
        }
        return "{\"different\": " + std::to_string(different.load()) + "}";
    });
}

/// Size of a file of at most `limit` bytes, and the sum of its bytes.
EXPORT const char* oocpt_image_file(const char* path, unsigned long limit)
{
    return _Answer([&] {
        unsigned long sum = 0;
        const rust::Vec<std::uint8_t> bytes = _Source().read_file(path, limit);
        for (const std::uint8_t byte : bytes) {
            sum += byte;
        }
        return "{\"size\": " + std::to_string(bytes.size()) + ", \"sum\": " + std::to_string(sum) + "}";
    });
}

/// Texels (as JSON has numbers, `text`) after the conversion from a color space, as {"texels": [..]}.
EXPORT const char* oocpt_image_convert(const char* name, unsigned channels, const char* text)
{
    return _Answer([&] {
        std::istringstream in(text);
        std::vector<float> texels { std::istream_iterator<float>(in), std::istream_iterator<float>() };
        _Source().color_transform(name)->apply({ texels.data(), texels.size() }, channels);
        std::ostringstream out;
        out.precision(9);
        for (const float value : texels) {
            out << (out.tellp() > 0 ? ", " : "") << value;
        }
        return "{\"texels\": [" + out.str() + "]}";
    });
}

EXPORT const char* oocpt_image_exists(const char* path)
{
    return _Answer([&] { return std::string(_Source().exists(path) ? "{\"exists\": true}" : "{\"exists\": false}"); });
}
