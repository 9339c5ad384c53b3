// SPDX-License-Identifier: Apache-2.0
#include "scene/instancerReader.h"

#include "bridge/text.h"
#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/vt/array.h"
#include "scene/dataSource.h"
#include "scene/sceneObserver.h"
#include "scene/tokens.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

/// Schemas express "all" or "none" by an empty array as well as by no array.
VtValue _UnlessEmpty(const VtValue& array)
{
    return array.GetArraySize() == 0 ? VtValue() : array;
}

/// The root of a prototype as its prims name it. Blender 5.2 lists the meshes below the roots instead.
SdfPath _FindRoot(const HdSceneIndexBase& scene, const SdfPath& instancer, const SdfPath& listed)
{
    if (listed.GetParentPath() == instancer || !listed.HasPrefix(instancer)) {
        return listed;
    }
    const auto& tokens = *HdOocPTSceneTokens;
    const HdContainerDataSourceHandle prim = scene.GetPrim(listed).dataSource;
    const auto read = [&](const TfToken& name) {
        return HdOocPTRead(prim, { tokens.instancedBy, name }).GetWithDefault<VtArray<SdfPath>>();
    };
    const VtArray<SdfPath> instancers = read(tokens.paths);
    const VtArray<SdfPath> roots = read(tokens.prototypeRoots);
    const size_t at = std::find(instancers.cbegin(), instancers.cend(), instancer) - instancers.cbegin();
    return at < roots.size() && at < instancers.size() && !roots[at].IsEmpty() ? roots[at] : listed;
}

void _ReadTopology(const HdSceneIndexBase& scene, const HdOocPTPrimSource& source, HdOocPTInstancerState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    state->prototypes.clear();
    state->mask
        = _UnlessEmpty(HdOocPTReadArray(source, { tokens.instancerTopology, tokens.mask }, HdOocPTArrayRole::Booleans));
    const VtArray<SdfPath> roots = HdOocPTRead(source.container, { tokens.instancerTopology, tokens.prototypes })
                                       .GetWithDefault<VtArray<SdfPath>>();
    const HdVectorDataSourceHandle indices
        = HdVectorDataSource::Cast(HdOocPTFind(source.container, { tokens.instancerTopology, tokens.instanceIndices }));
    const size_t count = indices ? indices->GetNumElements() : 0;
    const auto isUsed = [&](size_t i) { return HdOocPTSample(indices->GetElement(i)).GetArraySize() > 0; };
    size_t strays = 0;
    for (size_t i = roots.size(); i < count; ++i) {
        strays += isUsed(i) ? 1 : 0;
    }
    if (strays > 0) {
        source.warnings->Add(source.path,
            "has " + std::to_string(roots.size()) + " prototypes but instances of " + std::to_string(strays)
                + " more; they are left out");
    }
    state->prototypes.reserve(roots.size());
    for (size_t i = 0; i < roots.size(); ++i) {
        if (i >= count) {
            // The new front end has indices up to the last prototype that some instance shows.
            state->prototypes.emplace_back(_FindRoot(scene, source.path, roots[i]), VtValue(VtArray<int>()));
            continue;
        }
        std::string reason;
        const VtValue numbers
            = HdOocPTNormalizeArray(HdOocPTSample(indices->GetElement(i)), HdOocPTArrayRole::Integers, &reason);
        if (!reason.empty()) {
            source.warnings->Add(source.path, "instanceIndices of " + roots[i].GetString() + " " + reason);
        }
        state->prototypes.emplace_back(_FindRoot(scene, source.path, roots[i]), numbers);
    }
    // A scene delegate lists its prototypes in the order of a hash map.
    std::sort(state->prototypes.begin(), state->prototypes.end(),
        [](const auto& a, const auto& b) { return a.first < b.first; });
    // Meshes of one root have the same instances.
    const auto isSame = [](const auto& a, const auto& b) { return a.first == b.first; };
    state->prototypes.erase(
        std::unique(state->prototypes.begin(), state->prototypes.end(), isSame), state->prototypes.end());
}

void _ReadPlacement(const HdOocPTPrimSource& source, HdOocPTInstancerState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const auto primvar = [&](const TfToken& name, HdOocPTArrayRole role) {
        return _UnlessEmpty(HdOocPTReadArray(source, { tokens.primvars, name, tokens.primvarValue }, role));
    };
    state->translations = primvar(tokens.instanceTranslations, HdOocPTArrayRole::Vectors3);
    state->rotations = primvar(tokens.instanceRotations, HdOocPTArrayRole::Quaternions);
    state->scales = primvar(tokens.instanceScales, HdOocPTArrayRole::Vectors3);
    state->transforms = primvar(tokens.instanceTransforms, HdOocPTArrayRole::Matrices);
}

} // namespace

void HdOocPTReadInstancer(const HdSceneIndexBase& scene, const HdOocPTPrimSource& source, HdOocPTInstancerState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTPrimSource prim = source;
    if (HdOocPTFind(source.container, { tokens.sceneDelegate })) {
        // Legacy scene delegates are not asked for the visibility of an instancer: Blender's dereferences a null
        // pointer there. Prototypes know themselves what their instancer hides.
        prim.dirtyBits &= ~HdOocPTDirtyVisibility;
    }
    HdOocPTReadPrim(prim, &state->prim);
    if (source.dirtyBits & HdOocPTDirtyInstances) {
        _ReadTopology(scene, source, state);
    }
    if (source.dirtyBits & HdOocPTDirtyInstancePrimvars) {
        _ReadPlacement(source, state);
    }
    if (source.dirtyBits & (HdOocPTDirtyInstancePrimvars | HdOocPTDirtyPrimvars | HdOocPTDirtyPoints)) {
        state->motion = HdOocPTReadInstancerMotion(source);
    }
    // An instancer has no rows of its own for the primvars that meshes read apart.
    if (source.dirtyBits
        & (HdOocPTDirtyPrimvars | HdOocPTDirtyPoints | HdOocPTDirtyNormals | HdOocPTDirtyColor | HdOocPTDirtyOpacity)) {
        state->primvars = HdOocPTReadOtherPrimvars(source,
            { tokens.instanceTranslations, tokens.instanceRotations, tokens.instanceScales, tokens.instanceTransforms,
                tokens.velocities, tokens.accelerations, tokens.angularVelocities });
    }
}

oocpt::InstancerDesc HdOocPTDescribeInstancer(const SdfPath& path, const HdOocPTInstancerState& state)
{
    oocpt::InstancerDesc desc;
    HdOocPTFillPrim(path, state.prim, &desc.prim);
    desc.prototypes.reserve(state.prototypes.size());
    for (const auto& [root, indices] : state.prototypes) {
        desc.prototypes.push_back({ HdOocPTText(root), HdOocPTHoldArray(indices) });
    }
    desc.mask = HdOocPTHoldArray(state.mask);
    desc.translations = HdOocPTHoldArray(state.translations);
    desc.rotations = HdOocPTHoldArray(state.rotations);
    desc.scales = HdOocPTHoldArray(state.scales);
    desc.transforms = HdOocPTHoldArray(state.transforms);
    desc.motion = HdOocPTDescribeInstancerMotion(state.motion);
    desc.primvars = HdOocPTDescribePrimvars(state.primvars);
    for (const TfTokenVector& set : state.links.sets) {
        for (const TfToken& category : set) {
            desc.link_names.push_back(HdOocPTText(category));
        }
        desc.link_sizes.push_back(static_cast<uint32_t>(set.size()));
    }
    desc.links.reserve(state.links.of.size());
    std::copy(state.links.of.begin(), state.links.of.end(), std::back_inserter(desc.links));
    return desc;
}

PXR_NAMESPACE_CLOSE_SCOPE
