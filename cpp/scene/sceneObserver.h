// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_SCENE_OBSERVER_H
#define HDOOCPT_SCENE_SCENE_OBSERVER_H

#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/dataSourceLocator.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/imaging/hd/sceneIndexObserver.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "pxr/usd/sdf/pathTable.h"

#include <cstdint>
#include <mutex>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// The parts of a prim that have to be read again.
enum HdOocPTDirtyBits : uint32_t
{
    HdOocPTDirtyTransform = 1u << 0,
    HdOocPTDirtyVisibility = 1u << 1,
    HdOocPTDirtyPurpose = 1u << 2,
    HdOocPTDirtyInstancedBy = 1u << 3,
    HdOocPTDirtyTopology = 1u << 4,
    HdOocPTDirtyPoints = 1u << 5,
    HdOocPTDirtyNormals = 1u << 6,
    HdOocPTDirtyColor = 1u << 7,
    HdOocPTDirtyOpacity = 1u << 8,
    HdOocPTDirtyInstances = 1u << 9,
    HdOocPTDirtyInstancePrimvars = 1u << 10,
    HdOocPTDirtyLight = 1u << 11,
    HdOocPTDirtySettings = 1u << 12,
    /// Any primvar that has no bit of its own above.
    HdOocPTDirtyPrimvars = 1u << 13,
    HdOocPTDirtyMaterialBinding = 1u << 14,
    /// The subsets of a mesh: their number, faces and bindings.
    HdOocPTDirtySubsets = 1u << 15,
    HdOocPTDirtyCategories = 1u << 16,
    HdOocPTDirtyNetwork = 1u << 17,
    /// The collections that a light is linked to.
    HdOocPTDirtyLinks = 1u << 18,
    HdOocPTDirtyAll = (1u << 19) - 1,
};

/// The changes of one prim since the last take.
struct HdOocPTPrimChange
{
    uint32_t dirtyBits = 0;
    /// True if the prim was added (or added again, perhaps with another type) and not removed since.
    bool added = false;
    /// Its type, if added.
    TfToken type;
};

/// The changes of the scene since the last take. Removals come first: prims added below a removed path afterwards are
/// among the changes.
struct HdOocPTSceneChanges
{
    std::vector<SdfPath> removed;
    SdfPathTable<HdOocPTPrimChange> changes;
};

/// Listens to the scene index and records what was touched. Reads nothing: notices arrive while the scene is being
/// built.
///
/// Threads: any; one at a time per call, guarded by a mutex.
class HdOocPTSceneObserver final : public HdSceneIndexObserver
{
public:
    void PrimsAdded(const HdSceneIndexBase& sender, const AddedPrimEntries& entries) override;
    void PrimsRemoved(const HdSceneIndexBase& sender, const RemovedPrimEntries& entries) override;
    void PrimsDirtied(const HdSceneIndexBase& sender, const DirtiedPrimEntries& entries) override;
    void PrimsRenamed(const HdSceneIndexBase& sender, const RenamedPrimEntries& entries) override;

    /// Records everything below a path as added.
    void AddSubtree(const HdSceneIndexBase& scene, const SdfPath& root);

    /// Returns the changes recorded since the last call.
    HdOocPTSceneChanges Take();

    bool IsEmpty() const;

private:
    void _Add(const SdfPath& path, const TfToken& type);
    void _Remove(const SdfPath& path);

    mutable std::mutex _mutex;
    HdOocPTSceneChanges _changes;
};

/// The parts that a set of locators touches.
uint32_t HdOocPTDirtyBitsOf(const HdDataSourceLocatorSet& locators);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
