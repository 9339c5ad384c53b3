// SPDX-License-Identifier: Apache-2.0
/// Keeps exceptions of this library (out of memory, above all) from reaching a host that does not expect any.
#ifndef HDOOCPT_GUARD_H
#define HDOOCPT_GUARD_H

#include "pxr/base/tf/diagnostic.h"
#include "pxr/pxr.h"

#include <exception>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

/// Runs `body`. An exception becomes a TF_RUNTIME_ERROR that names `entry`, and `fallback` is returned.
template <typename Result, typename Body>
Result HdOocPTGuard(char const* entry, Result fallback, Body&& body) noexcept
{
    try {
        return std::forward<Body>(body)();
    } catch (std::exception const& error) {
        TF_RUNTIME_ERROR("OocPT: %s failed: %s", entry, error.what());
    } catch (...) {
        TF_RUNTIME_ERROR("OocPT: %s failed for an unknown reason", entry);
    }
    return fallback;
}

/// Runs a body without a result in the same way.
template <typename Body>
void HdOocPTGuard(char const* entry, Body&& body) noexcept
{
    HdOocPTGuard(entry, true, [&body] {
        body();
        return true;
    });
}

PXR_NAMESPACE_CLOSE_SCOPE

#endif
