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

/// A plain file on a disk.
struct HdOocPTPlainFile
{
    std::uint64_t size = 0;
    /// Nanoseconds since 1970.
    std::int64_t modifiedNanoseconds = 0;
};

/// The facts of the file system about a resolved path, without opening it; nullopt for paths that only the resolver
/// knows (members of packages, resolver plugins, paths that do not exist) and for what is not a file. Any thread.
std::optional<HdOocPTPlainFile> HdOocPTFindPlainFile(const std::string& resolved);

/// The bytes of a file by the host's resolver; null if it has no such file. The resolver's own messages are dropped:
/// this may be any thread, and the caller names the file. Directories, pipes, devices and circular links are refused
/// before anybody opens them, since opening a pipe blocks and a device has no end: std::runtime_error with the reason.
/// Any thread.
std::shared_ptr<const HdOocPTImageBytes> HdOocPTOpenHostFile(const std::string& resolved);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
