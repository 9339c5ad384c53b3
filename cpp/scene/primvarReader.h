// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_PRIMVAR_READER_H
#define HDOOCPT_SCENE_PRIMVAR_READER_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"
#include "rust/cxx.h"
#include "scene/primReader.h"

#include <initializer_list>
#include <utility>
#include <vector>

namespace oocpt {
struct NamedPrimvarDesc;
struct PrimvarDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// The state of a primvar when it was last read; empty values mean absent. The arrays share their data with the scene.
struct HdOocPTPrimvarState
{
    TfToken interpolation;
    VtValue values;
    VtValue indices;
};

/// Primvars by name, sorted by it.
using HdOocPTNamedPrimvars = std::vector<std::pair<TfToken, HdOocPTPrimvarState>>;

/// Reads one primvar; warns if its values do not fit the role.
HdOocPTPrimvarState HdOocPTReadPrimvar(const HdOocPTPrimSource& source, const TfToken& name, HdOocPTArrayRole role);

/// Reads all primvars but `except`, for shaders to read by name. Values that no shader can read (text, matrices) are
/// dropped without a warning: scenes are full of them.
HdOocPTNamedPrimvars HdOocPTReadOtherPrimvars(const HdOocPTPrimSource& source, std::initializer_list<TfToken> except);

/// Describes a primvar for Rust.
oocpt::PrimvarDesc HdOocPTDescribePrimvar(const HdOocPTPrimvarState& primvar);
rust::Vec<oocpt::NamedPrimvarDesc> HdOocPTDescribePrimvars(const HdOocPTNamedPrimvars& primvars);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
