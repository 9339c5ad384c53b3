// SPDX-License-Identifier: Apache-2.0
#include "scene/sceneObserver.h"

#include "scene/tokens.h"

#include <algorithm>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

using _Row = std::pair<HdDataSourceLocator, uint32_t>;

std::vector<_Row> _MakeTable()
{
    const auto& tokens = *HdOocPTSceneTokens;
    const uint32_t computed = HdOocPTDirtyPoints | HdOocPTDirtyNormals | HdOocPTDirtyColor | HdOocPTDirtyOpacity;
    std::vector<_Row> table {
        { HdDataSourceLocator(tokens.xform), HdOocPTDirtyTransform },
        { HdDataSourceLocator(tokens.visibility), HdOocPTDirtyVisibility },
        { HdDataSourceLocator(tokens.purpose), HdOocPTDirtyPurpose },
        { HdDataSourceLocator(tokens.instancedBy), HdOocPTDirtyInstancedBy },
        { HdDataSourceLocator(tokens.mesh), HdOocPTDirtyTopology },
        { HdDataSourceLocator(tokens.displayStyle, tokens.refineLevel), HdOocPTDirtyTopology },
        { HdDataSourceLocator(tokens.basisCurves), HdOocPTDirtyTopology },
        // Hydra's filters, which make meshes and basis curves of these, pass on the locators of the original prim.
        { HdDataSourceLocator(tokens.nurbsPatch), HdOocPTDirtyTopology },
        { HdDataSourceLocator(tokens.nurbsCurves), HdOocPTDirtyTopology },
        { HdDataSourceLocator(tokens.tetMesh), HdOocPTDirtyTopology },
        { HdDataSourceLocator(tokens.sphere), HdOocPTDirtyTopology },
        { HdDataSourceLocator(tokens.capsule), HdOocPTDirtyTopology },
        { HdDataSourceLocator(tokens.cylinder), HdOocPTDirtyTopology },
        { HdDataSourceLocator(tokens.cone), HdOocPTDirtyTopology },
        { HdDataSourceLocator(tokens.primvars, tokens.widths), HdOocPTDirtyPoints },
        { HdDataSourceLocator(tokens.primvars, tokens.points), HdOocPTDirtyPoints },
        { HdDataSourceLocator(tokens.primvars, tokens.velocities), HdOocPTDirtyPoints },
        { HdDataSourceLocator(tokens.primvars, tokens.accelerations), HdOocPTDirtyPoints },
        { HdDataSourceLocator(tokens.primvars, tokens.normals), HdOocPTDirtyNormals },
        { HdDataSourceLocator(tokens.primvars, tokens.displayColor), HdOocPTDirtyColor },
        { HdDataSourceLocator(tokens.primvars, tokens.displayOpacity), HdOocPTDirtyOpacity },
        { HdDataSourceLocator(tokens.extComputationPrimvars), computed },
        { HdDataSourceLocator(tokens.instancerTopology), HdOocPTDirtyInstances },
        { HdDataSourceLocator(tokens.primvars, tokens.instanceTranslations), HdOocPTDirtyInstancePrimvars },
        { HdDataSourceLocator(tokens.primvars, tokens.instanceRotations), HdOocPTDirtyInstancePrimvars },
        { HdDataSourceLocator(tokens.primvars, tokens.instanceScales), HdOocPTDirtyInstancePrimvars },
        { HdDataSourceLocator(tokens.primvars, tokens.instanceTransforms), HdOocPTDirtyInstancePrimvars },
        { HdDataSourceLocator(tokens.light), HdOocPTDirtyLight },
        { HdDataSourceLocator(tokens.material), HdOocPTDirtyLight | HdOocPTDirtyNetwork },
        { HdDataSourceLocator(tokens.primvars, tokens.cameraVisibility), HdOocPTDirtyLight | HdOocPTDirtyPrimvars },
        { HdDataSourceLocator(tokens.materialBindings), HdOocPTDirtyMaterialBinding },
        { HdDataSourceLocator(tokens.geomSubset), HdOocPTDirtySubsets },
        // The new front end of 25.08 uses this locator when the faces of a subset have changed.
        { HdDataSourceLocator(tokens.indices), HdOocPTDirtySubsets },
        { HdDataSourceLocator(tokens.collections), HdOocPTDirtyLinks },
        { HdDataSourceLocator(tokens.categories), HdOocPTDirtyCategories },
        { HdDataSourceLocator(tokens.instanceCategories), HdOocPTDirtyCategories },
        { HdDataSourceLocator(tokens.renderSettings), HdOocPTDirtySettings },
        // OpenUSD 26.03 names what a filter makes the settings of, and not what it makes.
        { HdDataSourceLocator(tokens.usdRenderSettings), HdOocPTDirtySettings },
        { HdDataSourceLocator(tokens.usdRenderProduct), HdOocPTDirtySettings },
        { HdDataSourceLocator(tokens.usdRenderVar), HdOocPTDirtySettings },
        { HdDataSourceLocator(tokens.sceneGlobals), HdOocPTDirtySettings },
    };
    for (const TfToken& label : HdOocPTLabelTokens->allTokens) {
        table.emplace_back(
            HdDataSourceLocator(tokens.primvars, label), uint32_t(HdOocPTDirtyLight | HdOocPTDirtyPrimvars));
    }
    return table;
}

/// Returns true if a locator touches primvars that no row of the table names.
bool _TouchesOtherPrimvars(const HdDataSourceLocator& locator, const std::vector<_Row>& table)
{
    const TfToken& primvars = HdOocPTSceneTokens->primvars;
    if (locator.IsEmpty() || (locator.GetElementCount() == 1 && locator.GetFirstElement() == primvars)) {
        return true;
    }
    if (locator.GetFirstElement() != primvars) {
        return false;
    }
    const HdDataSourceLocator named(primvars, locator.GetElement(1));
    return std::none_of(table.begin(), table.end(), [&](const _Row& row) { return row.first == named; });
}

} // namespace

uint32_t HdOocPTDirtyBitsOf(const HdDataSourceLocatorSet& locators)
{
    static const std::vector<_Row> table = _MakeTable();
    uint32_t bits = 0;
    for (const _Row& row : table) {
        if ((bits & row.second) != row.second && locators.Intersects(row.first)) {
            bits |= row.second;
        }
    }
    for (const HdDataSourceLocator& locator : locators) {
        if (_TouchesOtherPrimvars(locator, table)) {
            bits |= HdOocPTDirtyPrimvars;
            break;
        }
    }
    return bits;
}

void HdOocPTSceneObserver::_Add(const SdfPath& path, const TfToken& type)
{
    HdOocPTPrimChange& change = _changes.changes[path];
    change.added = true;
    change.type = type;
    change.dirtyBits = HdOocPTDirtyAll;
}

void HdOocPTSceneObserver::_Remove(const SdfPath& path)
{
    _changes.changes.erase(path);
    _changes.removed.push_back(path);
}

void HdOocPTSceneObserver::PrimsAdded(const HdSceneIndexBase&, const AddedPrimEntries& entries)
{
    const std::lock_guard<std::mutex> lock(_mutex);
    for (const AddedPrimEntry& entry : entries) {
        _Add(entry.primPath, entry.primType);
    }
}

void HdOocPTSceneObserver::PrimsRemoved(const HdSceneIndexBase&, const RemovedPrimEntries& entries)
{
    const std::lock_guard<std::mutex> lock(_mutex);
    for (const RemovedPrimEntry& entry : entries) {
        _Remove(entry.primPath);
    }
}

void HdOocPTSceneObserver::PrimsDirtied(const HdSceneIndexBase&, const DirtiedPrimEntries& entries)
{
    const std::lock_guard<std::mutex> lock(_mutex);
    for (const DirtiedPrimEntry& entry : entries) {
        if (const uint32_t bits = HdOocPTDirtyBitsOf(entry.dirtyLocators)) {
            _changes.changes[entry.primPath].dirtyBits |= bits;
        }
    }
}

void HdOocPTSceneObserver::PrimsRenamed(const HdSceneIndexBase& sender, const RenamedPrimEntries& entries)
{
    for (const RenamedPrimEntry& entry : entries) {
        {
            const std::lock_guard<std::mutex> lock(_mutex);
            _Remove(entry.oldPrimPath);
        }
        AddSubtree(sender, entry.newPrimPath);
    }
}

void HdOocPTSceneObserver::AddSubtree(const HdSceneIndexBase& scene, const SdfPath& root)
{
    std::vector<SdfPath> open { root };
    while (!open.empty()) {
        const SdfPath path = open.back();
        open.pop_back();
        const TfToken type = scene.GetPrim(path).primType;
        {
            const std::lock_guard<std::mutex> lock(_mutex);
            _Add(path, type);
        }
        const SdfPathVector children = scene.GetChildPrimPaths(path);
        open.insert(open.end(), children.begin(), children.end());
    }
}

HdOocPTSceneChanges HdOocPTSceneObserver::Take()
{
    const std::lock_guard<std::mutex> lock(_mutex);
    HdOocPTSceneChanges changes;
    std::swap(changes.removed, _changes.removed);
    changes.changes.swap(_changes.changes);
    return changes;
}

bool HdOocPTSceneObserver::IsEmpty() const
{
    const std::lock_guard<std::mutex> lock(_mutex);
    return _changes.removed.empty() && _changes.changes.empty();
}

PXR_NAMESPACE_CLOSE_SCOPE
