// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_PRIM_READER_H
#define HDOOCPT_SCENE_PRIM_READER_H

#include "bridge/vtArray.h"
#include "pxr/base/gf/matrix4d.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/dataSource.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "scene/motionReader.h"
#include "scene/warnings.h"

#include <cstdint>
#include <initializer_list>
#include <utility>
#include <vector>

namespace oocpt {
struct PrimDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// One prim while it is being read: its place in the scene, its data, and the parts to read again.
struct HdOocPTPrimSource
{
    SdfPath path;
    HdContainerDataSourceHandle container;
    uint32_t dirtyBits;
    /// Null if nobody needs the warnings.
    HdOocPTWarnings* warnings;
    HdOocPTShutter shutter {};
    /// Purposes of material bindings, the most important one first; null: those that the delegate requests.
    const TfTokenVector* bindingPurposes = nullptr;
};

/// The state that every prim has, when it was last read. Kept between commits, so that an edit reads only what it
/// dirtied.
struct HdOocPTPrimState
{
    GfMatrix4d transform { 1.0 };
    HdOocPTTransformSamples motion;
    bool visible = true;
    TfToken purpose;
    /// Instancer and prototype root, one pair for each instancer that places this prim.
    std::vector<std::pair<SdfPath, SdfPath>> instancedBy;
};

/// Reads the dirty parts of the common state.
void HdOocPTReadPrim(const HdOocPTPrimSource& source, HdOocPTPrimState* state);

/// Writes the state into a description for Rust.
void HdOocPTFillPrim(const SdfPath& path, const HdOocPTPrimState& state, oocpt::PrimDesc* desc);

/// Reads an array and converts it to a usable form; warns and returns an empty value if its type does not fit the role.
VtValue HdOocPTReadArray(const HdOocPTPrimSource& source, std::initializer_list<TfToken> names, HdOocPTArrayRole role);

/// The collections that the prim is in, of those that lights and shadows are linked to; sorted.
TfTokenVector HdOocPTReadCategories(const HdContainerDataSourceHandle& container);

/// The names of the members of a container of categories, sorted; empty if it is null.
TfTokenVector HdOocPTCategoriesOf(const HdContainerDataSourceHandle& categories);

/// The name under which Rust knows a purpose: "default", "render", "proxy", "guide".
TfToken HdOocPTPurposeOfTag(const TfToken& tag);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
