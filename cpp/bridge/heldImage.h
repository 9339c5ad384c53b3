// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_HELD_IMAGE_H
#define HDOOCPT_BRIDGE_HELD_IMAGE_H

#include "rust/cxx.h"

#include <cstdint>
#include <memory>

namespace oocpt {

// Listed in the bridge (rust/bridge/src/ffi_images.rs).
struct ImageFacts;
struct TexelBox;
struct FileFacts;
struct RowSink;
struct ByteSink;

/// An image that Rust reads when it needs texels, and keeps open by owning this object.
///
/// Contract for every subclass: all functions and the destructor may run on any thread, several at once; facts() is
/// always the same; failures are std::exceptions whose text follows on the name of the file. No USD type appears here,
/// so that the Rust side compiles without USD.
class HeldImage
{
public:
    virtual ~HeldImage() = default;
    HeldImage(const HeldImage&) = delete;
    HeldImage& operator=(const HeldImage&) = delete;

    virtual ImageFacts facts() const = 0;

    /// Reads a box of texels, its rows from the bottom up, tightly packed.
    virtual void read(const TexelBox& box, rust::Slice<std::uint8_t> texels) const = 0;

    /// Decodes a level once, from the top of the image down, in bands of whole rows.
    virtual void decode(std::uint32_t level, RowSink& sink) const = 0;

protected:
    HeldImage() = default;
};

/// The bytes of a file, which stays open. The contract of HeldImage holds.
class HeldFile
{
public:
    virtual ~HeldFile() = default;
    HeldFile(const HeldFile&) = delete;
    HeldFile& operator=(const HeldFile&) = delete;

    virtual std::uint64_t size() const = 0;

    /// Reads from `offset` on as many bytes as `destination` has; fails where the file has fewer.
    virtual void read(std::uint64_t offset, rust::Slice<std::uint8_t> destination) const = 0;

protected:
    HeldFile() = default;
};

/// A conversion of colours to linear Rec. 709. The contract of HeldImage holds.
class HeldTransform
{
public:
    virtual ~HeldTransform() = default;
    HeldTransform(const HeldTransform&) = delete;
    HeldTransform& operator=(const HeldTransform&) = delete;

    /// Converts texels of 1 to 4 channels in place; alpha stays.
    virtual void apply(rust::Slice<float> texels, std::uint32_t channels) const = 0;

protected:
    HeldTransform() = default;
};

/// The host's files, by resolved path. The contract of HeldImage holds.
class ImageSource
{
public:
    virtual ~ImageSource() = default;
    ImageSource(const ImageSource&) = delete;
    ImageSource& operator=(const ImageSource&) = delete;

    virtual std::unique_ptr<HeldImage> open(rust::Str resolved) const = 0;

    virtual bool exists(rust::Str resolved) const = 0;

    /// The facts of a file that are known without opening it.
    virtual FileFacts file_facts(rust::Str resolved) const = 0;

    /// The bytes of a file, to be read in parts.
    virtual std::unique_ptr<HeldFile> open_file(rust::Str resolved) const = 0;

    /// Passes all bytes of a file to `sink`, part by part; returns their number.
    virtual std::uint64_t stream_file(rust::Str resolved, ByteSink& sink) const = 0;

    /// The conversion from a named colour space.
    virtual std::unique_ptr<HeldTransform> color_transform(rust::Str name) const = 0;

    /// All bytes of a file of at most `limit` bytes.
    virtual rust::Vec<std::uint8_t> read_file(rust::Str resolved, std::uint64_t limit) const = 0;

protected:
    ImageSource() = default;
};

} // namespace oocpt

#endif
