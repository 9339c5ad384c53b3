// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_HOST_FILE_H
#define HDOOCPT_BRIDGE_HOST_FILE_H

#include "images/imageLibrary.h"
#include "pxr/pxr.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// A file that lies on a disk.
struct HdOocPTPlainFile
{
    std::uint64_t size = 0;
    /// Since 1970.
    std::int64_t modifiedNanoseconds = 0;
};

/// What the file system says of a resolved path, without opening it; none for what only the resolver knows (members of
/// packages, resolver plugins, nothing at all) and for what is no file. Any thread.
std::optional<HdOocPTPlainFile> HdOocPTFindPlainFile(const std::string& resolved);

/// The bytes of a file by the host's resolver; null when it has no such file. What the resolver has to say about that
/// goes no further: this may be any thread, and the caller names the file. Directories, pipes, devices and links in
/// circles are refused before anybody opens them, since opening a pipe waits and a device has no end:
/// std::runtime_error with the reason. Any thread.
std::shared_ptr<const HdOocPTImageBytes> HdOocPTOpenHostFile(const std::string& resolved);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
