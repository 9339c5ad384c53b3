// SPDX-License-Identifier: Apache-2.0
#include "scene/warnings.h"

#include "oocpt-bridge/src/ffi_runner.rs.h"
#include "pxr/base/tf/diagnostic.h"

#include <exception>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

void HdOocPTWarnings::Add(const SdfPath& path, const std::string& text)
{
    _Line line(path.GetString(), text);
    const std::lock_guard<std::mutex> lock(_mutex);
    if (_posted.count(line) == 0) {
        _pending.insert(std::move(line));
    }
}

void HdOocPTWarnings::Post()
{
    std::set<_Line> lines;
    {
        const std::lock_guard<std::mutex> lock(_mutex);
        lines.swap(_pending);
        _posted.insert(lines.begin(), lines.end());
    }
    if (lines.empty()) {
        return;
    }
    try {
        rust::Vec<oocpt::PrimWarning> warnings;
        for (const auto& [path, text] : lines) {
            warnings.push_back({ path, text });
        }
        for (const rust::String& line : oocpt::summed_warnings(std::move(warnings))) {
            TF_WARN("OocPT: %s", std::string(line).c_str());
        }
    } catch (const std::exception& error) {
        TF_WARN("OocPT: %zu warnings of the scene reader cannot be told: %s", lines.size(), error.what());
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
