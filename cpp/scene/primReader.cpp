// SPDX-License-Identifier: Apache-2.0
#include "scene/primReader.h"

#include "bridge/text.h"
#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/vt/array.h"
#include "scene/dataSource.h"
#include "scene/sceneObserver.h"
#include "scene/tokens.h"

#include <algorithm>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

void _ReadInstancedBy(const HdOocPTPrimSource& source, HdOocPTPrimState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    state->instancedBy.clear();
    const VtValue paths = HdOocPTRead(source.container, { tokens.instancedBy, tokens.paths });
    if (!paths.IsHolding<VtArray<SdfPath>>()) {
        return;
    }
    const VtArray<SdfPath>& instancers = paths.UncheckedGet<VtArray<SdfPath>>();
    const VtArray<SdfPath> roots = HdOocPTRead(source.container, { tokens.instancedBy, tokens.prototypeRoots })
                                       .GetWithDefault<VtArray<SdfPath>>();
    for (size_t i = 0; i < instancers.size(); ++i) {
        // A scene delegate lists each prim as a prototype of its own and names no roots.
        const SdfPath& root = i < roots.size() && !roots[i].IsEmpty() ? roots[i] : source.path;
        if (!instancers[i].IsEmpty()) {
            state->instancedBy.emplace_back(instancers[i], root);
        }
    }
}

} // namespace

TfToken HdOocPTPurposeOfTag(const TfToken& tag)
{
    const auto& tokens = *HdOocPTSceneTokens;
    return tag.IsEmpty() || tag == tokens.geometry ? tokens.defaultPurpose : tag;
}

void HdOocPTReadPrim(const HdOocPTPrimSource& source, HdOocPTPrimState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    if (source.dirtyBits & HdOocPTDirtyTransform) {
        state->transform.SetIdentity();
        HdOocPTConvert(HdOocPTRead(source.container, { tokens.xform, tokens.matrix }), &state->transform);
        state->motion = HdOocPTReadTransformSamples(source.container, source.shutter);
    }
    if (source.dirtyBits & HdOocPTDirtyVisibility) {
        state->visible = true;
        HdOocPTConvert(HdOocPTRead(source.container, { tokens.visibility, tokens.visibility }), &state->visible);
    }
    if (source.dirtyBits & HdOocPTDirtyPurpose) {
        TfToken purpose;
        HdOocPTConvert(HdOocPTRead(source.container, { tokens.purpose, tokens.purpose }), &purpose);
        state->purpose = HdOocPTPurposeOfTag(purpose);
    }
    if (source.dirtyBits & HdOocPTDirtyInstancedBy) {
        _ReadInstancedBy(source, state);
    }
}

void HdOocPTFillPrim(const SdfPath& path, const HdOocPTPrimState& state, oocpt::PrimDesc* desc)
{
    desc->path = HdOocPTText(path);
    std::copy_n(state.transform.GetArray(), 16, desc->transform.begin());
    HdOocPTFillMotion(state.motion, &desc->motion);
    desc->visible = state.visible;
    desc->purpose = HdOocPTText(state.purpose);
    desc->instanced_by.reserve(state.instancedBy.size());
    for (const auto& [instancer, root] : state.instancedBy) {
        desc->instanced_by.push_back({ HdOocPTText(instancer), HdOocPTText(root) });
    }
}

TfTokenVector HdOocPTReadCategories(const HdContainerDataSourceHandle& container)
{
    return HdOocPTCategoriesOf(HdOocPTFindContainer(container, { HdOocPTSceneTokens->categories }));
}

TfTokenVector HdOocPTCategoriesOf(const HdContainerDataSourceHandle& categories)
{
    TfTokenVector members;
    for (const TfToken& name : categories ? categories->GetNames() : TfTokenVector()) {
        bool isMember = false;
        if (HdOocPTConvert(HdOocPTSample(categories->Get(name)), &isMember) && isMember) {
            members.push_back(name);
        }
    }
    std::sort(members.begin(), members.end());
    return members;
}

VtValue HdOocPTReadArray(const HdOocPTPrimSource& source, std::initializer_list<TfToken> names, HdOocPTArrayRole role)
{
    std::string reason;
    const VtValue array = HdOocPTNormalizeArray(HdOocPTRead(source.container, names), role, &reason);
    if (!reason.empty()) {
        std::string where;
        for (const TfToken& name : names) {
            where += (where.empty() ? "" : "/") + name.GetString();
        }
        source.warnings->Add(source.path, where + " " + reason);
    }
    return array;
}

PXR_NAMESPACE_CLOSE_SCOPE
