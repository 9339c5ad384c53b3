// SPDX-License-Identifier: Apache-2.0
#include "scene/warnings.h"

#include "pxr/base/tf/diagnostic.h"

#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

void HdOocPTWarnings::Add(const SdfPath& path, const std::string& text)
{
    std::string line = path.GetString() + ": " + text;
    const std::lock_guard<std::mutex> lock(_mutex);
    if (_posted.count(line) == 0) {
        _pending.insert(std::move(line));
    }
}

void HdOocPTWarnings::Post()
{
    std::set<std::string> lines;
    {
        const std::lock_guard<std::mutex> lock(_mutex);
        lines.swap(_pending);
        _posted.insert(lines.begin(), lines.end());
    }
    for (const std::string& line : lines) {
        TF_WARN("OocPT: %s", line.c_str());
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
