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

/// One prim while it is being read: where it is, what it holds, what has to be read again.
struct HdOocPTPrimSource
{
    SdfPath path;
    HdContainerDataSourceHandle container;
    uint32_t dirtyBits;
    /// Null where nobody needs to know.
    HdOocPTWarnings* warnings;
    HdOocPTShutter shutter {};
    /// Purposes of material bindings, the one that counts most first; null: those that the delegate asks for.
    const TfTokenVector* bindingPurposes = nullptr;
};

/// What every prim has, as last read. Kept between commits, so that an edit reads only what it dirtied.
struct HdOocPTPrimState
{
    GfMatrix4d transform { 1.0 };
    HdOocPTTransformSamples motion;
    bool visible = true;
    TfToken purpose;
    /// Instancer and prototype root, one pair for each instancer that places this prim.
    std::vector<std::pair<SdfPath, SdfPath>> instancedBy;
};

/// Reads the dirty parts.
void HdOocPTReadPrim(const HdOocPTPrimSource& source, HdOocPTPrimState* state);

/// The state as it goes to Rust.
void HdOocPTFillPrim(const SdfPath& path, const HdOocPTPrimState& state, oocpt::PrimDesc* desc);

/// Reads an array and brings it into a usable form; warns and gives an empty value when it has a type of no use for the
/// role.
VtValue HdOocPTReadArray(const HdOocPTPrimSource& source, std::initializer_list<TfToken> names, HdOocPTArrayRole role);

/// The collections that the prim is in, of those that lights and shadows are linked to; sorted.
TfTokenVector HdOocPTReadCategories(const HdContainerDataSourceHandle& container);

/// The names that a container of categories has as members, sorted; none where it is null.
TfTokenVector HdOocPTCategoriesOf(const HdContainerDataSourceHandle& categories);

/// The name under which Rust knows a purpose: "default", "render", "proxy", "guide".
TfToken HdOocPTPurposeOfTag(const TfToken& tag);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
