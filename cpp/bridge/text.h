// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_TEXT_H
#define HDOOCPT_BRIDGE_TEXT_H

#include "pxr/base/tf/token.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "rust/cxx.h"

#include <string>

PXR_NAMESPACE_OPEN_SCOPE

// Text for Rust. Bytes that are not UTF-8 become replacement characters.
inline rust::String HdOocPTText(const std::string& text)
{
    return rust::String::lossy(text);
}
inline rust::String HdOocPTText(const TfToken& token)
{
    return rust::String::lossy(token.GetString());
}
inline rust::String HdOocPTText(const SdfPath& path)
{
    return rust::String::lossy(path.GetString());
}

PXR_NAMESPACE_CLOSE_SCOPE

#endif
