// SPDX-License-Identifier: Apache-2.0
#include "bridge/imageSource.h"

#include "bridge/hostFile.h"
#include "oocpt-bridge/src/ffi_images.rs.h"
#include "pxr/base/tf/errorMark.h"

#include <algorithm>
#include <dlfcn.h>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

constexpr std::size_t streamPart = std::size_t { 1 } << 20;

/// The library of image readers, never unloaded once loaded.
struct _Library
{
    HdOocPTOpenImageFunction* open = nullptr;
    HdOocPTMakeColorTransformFunction* makeColorTransform = nullptr;
    /// The reason why it cannot be loaded.
    std::string reason;
};

_Library _Load()
{
    Dl_info own {};
    if (dladdr(reinterpret_cast<const void*>(&HdOocPTMakeImageSource), &own) == 0 || !own.dli_fname) {
        return { nullptr, nullptr, "the plugin does not know where it lies" };
    }
    const std::filesystem::path path = std::filesystem::path(own.dli_fname).parent_path() / "hdOocPTImages.so";
    // RTLD_LOCAL: the libraries that it loads must not be found by the host, nor by what the host loads later.
    void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    void* const symbol = library ? dlsym(library, HDOOCPT_OPEN_IMAGE_NAME) : nullptr;
    void* const colorSymbol = library ? dlsym(library, HDOOCPT_MAKE_COLOR_TRANSFORM_NAME) : nullptr;
    if (!symbol || !colorSymbol) {
        const char* const text = dlerror();
        return { nullptr, nullptr, text ? text : "it lacks its functions" };
    }
    return { reinterpret_cast<HdOocPTOpenImageFunction*>(symbol),
        reinterpret_cast<HdOocPTMakeColorTransformFunction*>(colorSymbol), std::string() };
}

const _Library& _LoadedLibrary()
{
    static const _Library library = _Load();
    if (!library.open) {
        throw std::runtime_error("cannot be read, since the library of image readers does not load: " + library.reason);
    }
    return library;
}

/// The bytes of a file, which must exist.
std::shared_ptr<const HdOocPTImageBytes> _OpenFile(const std::string& resolved)
{
    std::shared_ptr<const HdOocPTImageBytes> bytes = HdOocPTOpenHostFile(resolved);
    if (!bytes) {
        throw std::runtime_error("cannot be found or opened");
    }
    return bytes;
}

static_assert(static_cast<int>(oocpt::TexelTag::Float) == static_cast<int>(HdOocPTTexelFormat::Float));
static_assert(static_cast<int>(oocpt::WrapTag::Mirror) == static_cast<int>(HdOocPTImageWrap::Mirror));

class _Image final : public oocpt::HeldImage
{
public:
    explicit _Image(std::unique_ptr<HdOocPTImageFile> file)
        : _file(std::move(file))
    {
    }

    oocpt::ImageFacts facts() const override
    {
        const HdOocPTImageFacts& found = _file->GetFacts();
        oocpt::ImageFacts facts {};
        for (const auto& [width, height] : found.levels) {
            facts.levels.push_back(width);
            facts.levels.push_back(height);
        }
        facts.channels = found.channels;
        facts.format = static_cast<oocpt::TexelTag>(found.format);
        facts.is_tiled = found.isTiled;
        facts.is_srgb = static_cast<std::int8_t>(found.isSrgb);
        facts.wrap_s = static_cast<oocpt::WrapTag>(found.wrap[0]);
        facts.wrap_t = static_cast<oocpt::WrapTag>(found.wrap[1]);
        return facts;
    }

    void read(const oocpt::TexelBox& box, rust::Slice<std::uint8_t> texels) const override
    {
        TfErrorMark mark;
        _file->Read(box.level, { box.x, box.y }, { box.width, box.height }, texels.data(), texels.size());
        mark.Clear();
    }

    void decode(std::uint32_t level, oocpt::RowSink& sink) const override
    {
        TfErrorMark mark;
        _file->Decode(level, [&](std::uint32_t top, const void* rows, std::size_t byteCount) {
            return sink.take(top, { static_cast<const std::uint8_t*>(rows), byteCount });
        });
        mark.Clear();
    }

private:
    const std::unique_ptr<HdOocPTImageFile> _file;
};

class _File final : public oocpt::HeldFile
{
public:
    explicit _File(std::shared_ptr<const HdOocPTImageBytes> bytes)
        : _bytes(std::move(bytes))
    {
    }

    std::uint64_t size() const override { return _bytes->GetSize(); }

    void read(std::uint64_t offset, rust::Slice<std::uint8_t> destination) const override
    {
        const std::size_t size = _bytes->GetSize();
        if (offset > size || destination.size() > size - offset
            || _bytes->Read(destination.data(), destination.size(), offset) != destination.size()) {
            throw std::runtime_error("cannot be read to its end");
        }
    }

private:
    const std::shared_ptr<const HdOocPTImageBytes> _bytes;
};

class _Transform final : public oocpt::HeldTransform
{
public:
    explicit _Transform(std::unique_ptr<HdOocPTColorTransform> transform)
        : _transform(std::move(transform))
    {
    }

    void apply(rust::Slice<float> texels, std::uint32_t channels) const override
    {
        if (channels < 1 || channels > 4 || texels.size() % channels != 0) {
            throw std::runtime_error("was given texels that are not whole");
        }
        _transform->Apply(texels.data(), texels.size() / channels, channels);
    }

private:
    const std::unique_ptr<HdOocPTColorTransform> _transform;
};

class _Source final : public oocpt::ImageSource
{
public:
    std::unique_ptr<oocpt::HeldImage> open(rust::Str resolved) const override
    {
        return std::make_unique<_Image>(HdOocPTOpenHostImage(std::string(resolved)));
    }

    bool exists(rust::Str resolved) const override
    {
        const std::string path(resolved);
        try {
            return HdOocPTFindPlainFile(path) || HdOocPTOpenHostFile(path);
        } catch (const std::runtime_error&) {
            return false;
        }
    }

    oocpt::FileFacts file_facts(rust::Str resolved) const override
    {
        const std::string path(resolved);
        oocpt::FileFacts facts {};
        if (const std::optional<HdOocPTPlainFile> file = HdOocPTFindPlainFile(path)) {
            std::error_code problem;
            facts.canonical = rust::String::lossy(std::filesystem::canonical(path, problem).string());
            facts.is_plain = !problem;
            facts.size = file->size;
            facts.modified_ns = file->modifiedNanoseconds;
        }
        return facts;
    }

    std::unique_ptr<oocpt::HeldFile> open_file(rust::Str resolved) const override
    {
        return std::make_unique<_File>(_OpenFile(std::string(resolved)));
    }

    std::uint64_t stream_file(rust::Str resolved, oocpt::ByteSink& sink) const override
    {
        const auto bytes = _OpenFile(std::string(resolved));
        std::vector<std::uint8_t> part(std::min(streamPart, std::max<std::size_t>(bytes->GetSize(), 1)));
        std::size_t offset = 0;
        while (const std::size_t count = bytes->Read(part.data(), part.size(), offset)) {
            sink.take({ part.data(), count });
            offset += count;
        }
        if (offset != bytes->GetSize()) {
            throw std::runtime_error("cannot be read to its end");
        }
        return offset;
    }

    std::unique_ptr<oocpt::HeldTransform> color_transform(rust::Str name) const override
    {
        return std::make_unique<_Transform>(_LoadedLibrary().makeColorTransform(std::string(name)));
    }

    rust::Vec<std::uint8_t> read_file(rust::Str resolved, std::uint64_t limit) const override
    {
        const auto bytes = _OpenFile(std::string(resolved));
        const std::size_t size = bytes->GetSize();
        if (size > limit) {
            throw std::runtime_error("has " + std::to_string(size) + " bytes, more than is read");
        }
        rust::Vec<std::uint8_t> content;
        content.reserve(size);
        for (std::size_t i = 0; i < size; ++i) {
            content.push_back(0);
        }
        if (bytes->Read(content.data(), size, 0) != size) {
            throw std::runtime_error("cannot be read");
        }
        return content;
    }
};

} // namespace

std::unique_ptr<HdOocPTImageFile> HdOocPTOpenHostImage(const std::string& resolved)
{
    // Fails for paths that are not files before the library is loaded.
    static_cast<void>(_OpenFile(resolved));
    return _LoadedLibrary().open(resolved, [resolved] { return HdOocPTOpenHostFile(resolved); });
}

std::unique_ptr<oocpt::ImageSource> HdOocPTMakeImageSource()
{
    return std::make_unique<_Source>();
}

PXR_NAMESPACE_CLOSE_SCOPE
