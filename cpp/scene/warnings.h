// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_WARNINGS_H
#define HDOOCPT_SCENE_WARNINGS_H

#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <mutex>
#include <set>
#include <string>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

/// The warnings of the scene reader. Each line is posted once in the life of the object.
///
/// Threads: Add() from any thread; Post() on the host's thread, never while another one adds.
class HdOocPTWarnings
{
public:
    /// Adds the line "path: text".
    void Add(const SdfPath& path, const std::string& text);

    /// Posts the new lines as TF_WARN, sorted, so that their order does not depend on threads. If many prims have the
    /// same text, one line stands for all.
    void Post();

private:
    /// Path and text.
    using _Line = std::pair<std::string, std::string>;

    std::mutex _mutex;
    std::set<_Line> _pending;
    std::set<_Line> _posted;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
