// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_WARNINGS_H
#define HDOOCPT_SCENE_WARNINGS_H

#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <mutex>
#include <set>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// What the scene reader has to complain about. Each line is posted once in the life of the object.
///
/// Threads: Add() from any thread; Post() on the host's thread, never while another one adds.
class HdOocPTWarnings
{
public:
    /// Notes "path: text".
    void Add(const SdfPath& path, const std::string& text);

    /// Posts the new lines as TF_WARN, sorted, so that their order does not depend on threads.
    void Post();

private:
    std::mutex _mutex;
    std::set<std::string> _pending;
    std::set<std::string> _posted;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
