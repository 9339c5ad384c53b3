// SPDX-License-Identifier: Apache-2.0
#include "bridge/hostFile.h"

#include "pxr/base/tf/errorMark.h"
#include "pxr/usd/ar/asset.h"
#include "pxr/usd/ar/packageUtils.h"
#include "pxr/usd/ar/resolvedPath.h"
#include "pxr/usd/ar/resolver.h"

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <sys/stat.h>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

class _AssetBytes final : public HdOocPTImageBytes
{
public:
    explicit _AssetBytes(std::shared_ptr<ArAsset> asset)
        : _asset(std::move(asset))
        , _size(_asset->GetSize())
    {
    }

    std::size_t GetSize() const override { return _size; }

    std::size_t Read(void* destination, std::size_t count, std::size_t offset) const override
    {
        return offset < _size ? _asset->Read(destination, std::min(count, _size - offset), offset) : 0;
    }

private:
    const std::shared_ptr<ArAsset> _asset;
    /// Size of the file when it was opened. A file that shrinks meanwhile gives fewer bytes than requested.
    const std::size_t _size;
};

/// The reason why a path of the file system must not be opened; null for files, and for paths that do not exist.
const char* _WhyNotOpened(const std::string& path)
{
    struct stat status
    {
    };
    if (stat(path.c_str(), &status) != 0) {
        return errno == ELOOP ? "is a link that leads in a circle" : nullptr;
    }
    return S_ISREG(status.st_mode) ? nullptr
        : S_ISDIR(status.st_mode)  ? "is a folder, not a file"
        : S_ISFIFO(status.st_mode) ? "is a pipe, not a file"
                                   : "is a device or a socket, not a file";
}

} // namespace

std::optional<HdOocPTPlainFile> HdOocPTFindPlainFile(const std::string& resolved)
{
    struct stat status
    {
    };
    if (resolved.empty() || stat(resolved.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) {
        return std::nullopt;
    }
    return HdOocPTPlainFile { static_cast<std::uint64_t>(status.st_size),
        static_cast<std::int64_t>(status.st_mtim.tv_sec) * 1000000000 + status.st_mtim.tv_nsec };
}

std::shared_ptr<const HdOocPTImageBytes> HdOocPTOpenHostFile(const std::string& resolved)
{
    if (resolved.empty()) {
        return nullptr;
    }
    // For scene.usdz[texture.png], the package is the file that is opened.
    const std::string outermost
        = ArIsPackageRelativePath(resolved) ? ArSplitPackageRelativePathOuter(resolved).first : resolved;
    if (const char* const reason = _WhyNotOpened(outermost)) {
        throw std::runtime_error(reason);
    }
    TfErrorMark mark;
    std::shared_ptr<ArAsset> asset = ArGetResolver().OpenAsset(ArResolvedPath(resolved));
    mark.Clear();
    return asset ? std::make_shared<_AssetBytes>(std::move(asset)) : nullptr;
}

PXR_NAMESPACE_CLOSE_SCOPE
