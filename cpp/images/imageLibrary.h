// SPDX-License-Identifier: Apache-2.0
/// The interface of the library of image readers (hdOocPTImages.so), through which the plugin reads files by
/// OpenImageIO.
///
/// It is a library of its own, opened by the plugin when the first image is needed, so that its OpenImageIO and the 200
/// libraries behind that never meet the host's own copies (rust/decisions/0007-images.md), and scenes without images do
/// not load them. No type of USD or OpenImageIO appears here. Both sides are built together, by one compiler.
#ifndef HDOOCPT_IMAGES_IMAGE_LIBRARY_H
#define HDOOCPT_IMAGES_IMAGE_LIBRARY_H

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

/// The bytes of a file, wherever it is stored. Any thread, several at once.
class HdOocPTImageBytes
{
public:
    virtual ~HdOocPTImageBytes() = default;
    virtual std::size_t GetSize() const = 0;
    /// Reads at most `count` bytes; returns their number, 0 at the end and on errors.
    virtual std::size_t Read(void* destination, std::size_t count, std::size_t offset) const = 0;
};

/// Opens a file's bytes, anew each time; null if they cannot be opened.
using HdOocPTImageOpener = std::function<std::shared_ptr<const HdOocPTImageBytes>()>;

/// Takes rows: the number of the first counted from the top of the image, the rows from there on downwards. Returns
/// false to stop.
using HdOocPTRowSink = std::function<bool(std::uint32_t top, const void* rows, std::size_t byteCount)>;

enum class HdOocPTTexelFormat : std::uint8_t
{
    UInt8,
    Half,
    Float,
};

enum class HdOocPTImageWrap : std::uint8_t
{
    Unknown,
    Black,
    Clamp,
    Repeat,
    Mirror,
};

struct HdOocPTImageFacts
{
    /// Width and height of the levels in the file, finest first.
    std::vector<std::array<std::uint32_t, 2>> levels;
    /// Number of channels that are read, 1 to 4.
    std::uint32_t channels = 0;
    HdOocPTTexelFormat format = HdOocPTTexelFormat::UInt8;
    /// True if the file has tiles of ordinary size, so that parts of it can be read alone.
    bool isTiled = false;
    /// 1 if the file itself says that it is sRGB, 0 if it says that it is not, -1 if it says nothing.
    int isSrgb = -1;
    std::array<HdOocPTImageWrap, 2> wrap { HdOocPTImageWrap::Unknown, HdOocPTImageWrap::Unknown };
};

/// An image. Several threads may read at once.
class HdOocPTImageFile
{
public:
    virtual ~HdOocPTImageFile() = default;
    virtual const HdOocPTImageFacts& GetFacts() const = 0;

    /// Reads a rectangle of a level, its rows from the bottom up (row 0 is the lowest of the image), tightly packed.
    /// Throws std::runtime_error with the reason.
    virtual void Read(std::uint32_t level, std::array<std::uint32_t, 2> at, std::array<std::uint32_t, 2> size,
        void* out, std::size_t byteCount) const = 0;

    /// Decodes a level once, from the top of the image down, in bands of whole rows of at most 4 MiB (or one row).
    /// Throws as Read does; exceptions of the sink pass through.
    virtual void Decode(std::uint32_t level, const HdOocPTRowSink& sink) const = 0;
};

/// A conversion of colors to linear Rec. 709. Any thread, several at once.
class HdOocPTColorTransform
{
public:
    virtual ~HdOocPTColorTransform() = default;

    /// Converts `count` texels of 1 to 4 channels in place. Alpha stays; grey is converted as r = g = b, and the red of
    /// the result is taken.
    virtual void Apply(float* texels, std::size_t count, std::uint32_t channels) const = 0;
};

/// The functions of the library, whose names are below. Both throw std::runtime_error with the reason.
using HdOocPTOpenImageFunction = std::unique_ptr<HdOocPTImageFile>(const std::string& name, HdOocPTImageOpener opener);
/// Makes the conversion from a color space that OpenColorIO knows: by the configuration that $OCIO names, then by one
/// of ours with the names that OpenUSD and ACES use (colorConfig.h).
using HdOocPTMakeColorTransformFunction = std::unique_ptr<HdOocPTColorTransform>(const std::string& name);

#define HDOOCPT_OPEN_IMAGE_NAME "HdOocPTOpenImage"
#define HDOOCPT_MAKE_COLOR_TRANSFORM_NAME "HdOocPTMakeColorTransform"

#endif
