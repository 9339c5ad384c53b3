// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_SCALAR_H
#define HDOOCPT_BRIDGE_SCALAR_H

#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"

#include <array>

namespace oocpt {
struct ScalarValue;
}

PXR_NAMESPACE_OPEN_SCOPE

/// Converts a setting's value for Rust: bool, int, float or text. Returns false for any other type.
bool HdOocPTToScalar(const VtValue& value, oocpt::ScalarValue* scalar);

/// Converts a value from Rust to a setting's value: bool, int, float or std::string, the types for which usdview has a
/// widget.
VtValue HdOocPTSettingFromScalar(const oocpt::ScalarValue& scalar);

/// Converts a value from Rust to a statistic: whole numbers as size_t and real ones as double, so that nothing is cut.
VtValue HdOocPTStatisticFromScalar(const oocpt::ScalarValue& scalar);

/// Converts a clear value: the components of a number or vector, zero for missing ones. Returns false if value holds
/// neither.
bool HdOocPTToClear(const VtValue& value, std::array<float, 4>* clear);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
