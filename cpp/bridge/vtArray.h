// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_VT_ARRAY_H
#define HDOOCPT_BRIDGE_VT_ARRAY_H

#include "bridge/heldArray.h"
#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"

#include <memory>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// The renderer's use of an array.
enum class HdOocPTArrayRole
{
    Integers,
    Booleans,
    Scalars,
    Vectors3,
    Quaternions,
    Matrices,
    /// Values that a shader may read: numbers and vectors of two to four of them.
    Values,
};

/// Converts any array of a scene into a form that the renderer reads in place for this role.
///
/// Arrays of a fitting type are returned as they are (sharing the data). A single value becomes an array of one.
/// Unsigned and 64-bit integers, byte masks, and quaternions given as (real, i, j, k) four-vectors are converted, which
/// copies them. For any other type the result is empty and reason names the type found; an empty value gives an empty
/// result and no reason.
VtValue HdOocPTNormalizeArray(const VtValue& value, HdOocPTArrayRole role, std::string* reason);

/// Passes an array to Rust, which reads it in place and keeps it alive; the data is shared, not copied. Null if the
/// value holds no array of an element type that the bridge knows.
std::unique_ptr<oocpt::HeldArray> HdOocPTHoldArray(const VtValue& value);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
