// SPDX-License-Identifier: Apache-2.0
#include "bridge/imageSource.h"

#include "images/imageLibrary.h"
#include "oocpt-bridge/src/ffi_images.rs.h"
#include "pxr/base/tf/errorMark.h"
#include "pxr/usd/ar/asset.h"
#include "pxr/usd/ar/resolvedPath.h"
#include "pxr/usd/ar/resolver.h"

#include <algorithm>
#include <dlfcn.h>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <sys/stat.h>
#include <utility>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

/// The library of image readers, once loaded never unloaded.
struct _Library
{
    HdOocPTOpenImageFunction* open = nullptr;
    /// Why it is not there.
    std::string reason;
};

_Library _Load()
{
    Dl_info own {};
    if (dladdr(reinterpret_cast<const void*>(&HdOocPTMakeImageSource), &own) == 0 || !own.dli_fname) {
        return { nullptr, "the plugin does not know where it lies" };
    }
    const std::filesystem::path path = std::filesystem::path(own.dli_fname).parent_path() / "hdOocPTImages.so";
    // Local: what it brings along must not be found by the host, nor by what the host loads later.
    void* const library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    void* const symbol = library ? dlsym(library, HDOOCPT_OPEN_IMAGE_NAME) : nullptr;
    if (!symbol) {
        const char* const text = dlerror();
        return { nullptr, text ? text : "it lacks its function" };
    }
    return { reinterpret_cast<HdOocPTOpenImageFunction*>(symbol), std::string() };
}

HdOocPTOpenImageFunction& _OpenImageFunction()
{
    static const _Library library = _Load();
    if (!library.open) {
        throw std::runtime_error("cannot be read, since the library of image readers does not load: " + library.reason);
    }
    return *library.open;
}

class _AssetBytes final : public HdOocPTImageBytes
{
public:
    explicit _AssetBytes(std::shared_ptr<ArAsset> asset)
        : _asset(std::move(asset))
    {
    }

    std::size_t GetSize() const override { return _asset->GetSize(); }

    std::size_t Read(void* destination, std::size_t count, std::size_t offset) const override
    {
        const std::size_t end = _asset->GetSize();
        return offset < end ? _asset->Read(destination, std::min(count, end - offset), offset) : 0;
    }

private:
    const std::shared_ptr<ArAsset> _asset;
};

/// The status of a file that lies on a disk under its resolved path; none for anything else that resolvers serve.
std::optional<struct stat> _FindPlainFile(const std::string& resolved)
{
    struct stat status
    {
    };
    const bool isPlain = !resolved.empty() && stat(resolved.c_str(), &status) == 0 && S_ISREG(status.st_mode);
    return isPlain ? std::optional(status) : std::nullopt;
}

/// Null when the resolver has no such asset. What it has to say about that goes no further: this may be any thread, and the
/// caller names the file.
std::shared_ptr<const HdOocPTImageBytes> _OpenAsset(const std::string& resolved)
{
    std::error_code ignored;
    if (resolved.empty() || std::filesystem::is_directory(resolved, ignored)) {
        return nullptr;
    }
    TfErrorMark mark;
    std::shared_ptr<ArAsset> asset = ArGetResolver().OpenAsset(ArResolvedPath(resolved));
    mark.Clear();
    return asset ? std::make_shared<_AssetBytes>(std::move(asset)) : nullptr;
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

class _Source final : public oocpt::ImageSource
{
public:
    std::unique_ptr<oocpt::HeldImage> open(rust::Str resolved) const override
    {
        const std::string path(resolved);
        if (!exists(resolved)) {
            throw std::runtime_error("cannot be found or opened");
        }
        return std::make_unique<_Image>(_OpenImageFunction()(path, [path] { return _OpenAsset(path); }));
    }

    bool exists(rust::Str resolved) const override
    {
        const std::string path(resolved);
        return _FindPlainFile(path) || _OpenAsset(path);
    }

    oocpt::FileFacts file_facts(rust::Str resolved) const override
    {
        const std::string path(resolved);
        oocpt::FileFacts facts {};
        if (const std::optional<struct stat> status = _FindPlainFile(path)) {
            std::error_code problem;
            const std::filesystem::path canonical = std::filesystem::canonical(path, problem);
            facts.is_plain = !problem;
            facts.canonical = rust::String::lossy(canonical.string());
            facts.size = static_cast<std::uint64_t>(status->st_size);
            facts.modified_ns
                = static_cast<std::int64_t>(status->st_mtim.tv_sec) * 1000000000 + status->st_mtim.tv_nsec;
        }
        return facts;
    }

    std::uint64_t stream_file(rust::Str resolved, oocpt::ByteSink& sink) const override
    {
        const auto bytes = _OpenAsset(std::string(resolved));
        if (!bytes) {
            throw std::runtime_error("cannot be found or opened");
        }
        std::vector<std::uint8_t> part(std::size_t { 1 } << 20);
        std::size_t offset = 0;
        for (;;) {
            const std::size_t count = bytes->Read(part.data(), part.size(), offset);
            if (count == 0) {
                break;
            }
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
        throw std::runtime_error("the color space `" + std::string(name) + "` is not known");
    }

    rust::Vec<std::uint8_t> read_file(rust::Str resolved, std::uint64_t limit) const override
    {
        const auto bytes = _OpenAsset(std::string(resolved));
        if (!bytes) {
            throw std::runtime_error("cannot be found or opened");
        }
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

std::unique_ptr<oocpt::ImageSource> HdOocPTMakeImageSource()
{
    return std::make_unique<_Source>();
}

PXR_NAMESPACE_CLOSE_SCOPE
