// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_IMAGES_INPUT_POOL_H
#define HDOOCPT_IMAGES_INPUT_POOL_H

#include "images/imageLibrary.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <memory>
#include <string>
#include <vector>

/// The source of an image. Its address names the image in the pool.
struct InputSource
{
    std::string name;
    HdOocPTImageOpener opener;
};

/// A file opened for reading. OpenImageIO's inputs serve one thread at a time.
struct OpenInput
{
    std::shared_ptr<const HdOocPTImageBytes> bytes;
    // The whole file, for OpenImageIO's readers that take nothing else (JPEG).
    std::vector<char> copy;
    // Declared before the input, which uses it until it is destroyed.
    std::unique_ptr<OIIO::Filesystem::IOProxy> proxy;
    std::unique_ptr<OIIO::ImageInput> input;
};

/// Opens an image for a caller who closes it himself. Throws std::runtime_error with the reason.
OpenInput HdOocPTOpenInput(const InputSource& source);

/// The use of an open input by one thread. Inputs are kept when a lease ends, at most 64 of them in the process, since
/// a scene may have more images than a process may have open files.
class InputLease
{
public:
    /// Opens the image if no input of it is idle. Throws std::runtime_error with the reason.
    explicit InputLease(std::shared_ptr<const InputSource> source);
    ~InputLease();
    InputLease(const InputLease&) = delete;
    InputLease& operator=(const InputLease&) = delete;

    OIIO::ImageInput& Input() const { return *_open.input; }
    const std::shared_ptr<const HdOocPTImageBytes>& Bytes() const { return _open.bytes; }

    /// Does not return the input to the pool: after an error its state is unknown.
    void Discard() { _open.input.reset(); }

private:
    const std::shared_ptr<const InputSource> _source;
    OpenInput _open;
};

#endif
