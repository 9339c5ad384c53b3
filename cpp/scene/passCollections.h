// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_PASS_COLLECTIONS_H
#define HDOOCPT_SCENE_PASS_COLLECTIONS_H

#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "scene/pathCollection.h"
#include "scene/primReader.h"

#include <array>
#include <optional>

PXR_NAMESPACE_OPEN_SCOPE

/// What the active render pass makes of a prim.
struct HdOocPTPassMarks
{
    /// It is pruned, or not in the collection that is rendered.
    bool isLeftOut = false;
    /// It is not in the collection that the camera sees.
    bool isHiddenFromCamera = false;
    bool isMatte = false;

    bool operator==(const HdOocPTPassMarks& other) const
    {
        return isLeftOut == other.isLeftOut && isHiddenFromCamera == other.isHiddenFromCamera
            && isMatte == other.isMatte;
    }
};

/// The collections of the active render pass (UsdRenderPass): `prune`, `renderVisibility`, `cameraVisibility`, `matte`.
/// Hosts name the pass and hand its collections over; who renders applies them.
///
/// Threads: Find() from several at once, between calls of Read().
class HdOocPTPassCollections
{
public:
    /// Reads the active pass; returns true if prims may be in other collections than before. Warns of expressions that
    /// cannot be used, which are left out, and of a pass that the front end does not hand over.
    bool Read(const HdSceneIndexBase& scene, HdOocPTWarnings* warnings);

    /// Returns true if the pass has any collection.
    bool IsActive() const;

    /// What the pass makes of a prim or a light as it was last read. What instancers place is in the collections of its
    /// outermost native instance, or of its own path below a point instancer. Where instances of one prototype differ
    /// in that the first counts, with a warning.
    HdOocPTPassMarks Find(const HdSceneIndexBase& scene, const SdfPath& path, const HdOocPTPrimState& prim,
        HdOocPTWarnings* warnings) const;

private:
    HdOocPTPassMarks _Match(const SdfPath& path) const;

    SdfPath _pass;
    /// In the order of the names above.
    std::array<std::optional<HdOocPTPathCollection>, 4> _collections;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
