// SPDX-License-Identifier: Apache-2.0
#include "scene/passCollections.h"

#include "scene/dataSource.h"
#include "scene/links.h"
#include "scene/tokens.h"

#include <algorithm>
#include <string>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

enum _Place
{
    _Prune,
    _RenderVisibility,
    _CameraVisibility,
    _Matte
};

} // namespace

bool HdOocPTPassCollections::Read(const HdSceneIndexBase& scene, HdOocPTWarnings* warnings)
{
    const auto& tokens = *HdOocPTPassTokens;
    const HdSceneIndexPrim root = scene.GetPrim(SdfPath::AbsoluteRootPath());
    const SdfPath pass = HdOocPTRead(root.dataSource, { HdOocPTSceneTokens->sceneGlobals, tokens.activeRenderPassPrim })
                             .GetWithDefault<SdfPath>();
    const bool isNew = pass != _pass;
    _pass = pass;
    std::array<std::optional<HdOocPTPathCollection>, 4> read;
    if (!pass.IsEmpty()) {
        const HdContainerDataSourceHandle container = scene.GetPrim(pass).dataSource;
        if (isNew && !HdOocPTFind(container, { HdOocPTSceneTokens->collections })) {
            warnings->Add(pass,
                "this render pass is not handed over by the host, at least not its collections: nothing is pruned,"
                " hidden or a matte by it");
        }
        const TfToken names[] = { tokens.prune, tokens.renderVisibility, tokens.cameraVisibility, tokens.matte };
        std::transform(std::begin(names), std::end(names), read.begin(), [&](const TfToken& name) {
            const std::optional<SdfPathExpression> membership = HdOocPTReadMembership(container, name);
            return membership ? HdOocPTPathCollection::Compile(pass, name, *membership, "it is left out", warnings)
                              : std::nullopt;
        });
    }
    const bool isSame = read == _collections;
    if (!isSame) {
        _collections = std::move(read);
    }
    return !isSame;
}

bool HdOocPTPassCollections::IsActive() const
{
    return std::any_of(
        _collections.begin(), _collections.end(), [](const auto& collection) { return collection.has_value(); });
}

HdOocPTPassMarks HdOocPTPassCollections::_Match(const SdfPath& path) const
{
    const auto holds = [&](_Place place, const SdfPath& tested, bool otherwise) {
        const std::optional<HdOocPTPathCollection>& collection = _collections[place];
        return collection ? collection->Holds(tested) : otherwise;
    };
    HdOocPTPassMarks marks;
    // What is below a pruned prim is pruned with it.
    for (SdfPath above = path; !above.IsEmpty() && !above.IsAbsoluteRootPath(); above = above.GetParentPath()) {
        marks.isLeftOut = marks.isLeftOut || holds(_Prune, above, false);
    }
    marks.isLeftOut = marks.isLeftOut || !holds(_RenderVisibility, path, true);
    marks.isHiddenFromCamera = !holds(_CameraVisibility, path, true);
    marks.isMatte = holds(_Matte, path, false);
    return marks;
}

HdOocPTPassMarks HdOocPTPassCollections::Find(
    const HdSceneIndexBase& scene, const SdfPath& path, const HdOocPTPrimState& prim, HdOocPTWarnings* warnings) const
{
    if (!IsActive()) {
        return {};
    }
    const SdfPathVector paths = HdOocPTFindStagePaths(scene, path, prim.instancedBy);
    HdOocPTPassMarks first;
    for (size_t i = 0; i < paths.size(); ++i) {
        const HdOocPTPassMarks marks = _Match(paths[i]);
        if (i == 0) {
            first = marks;
        } else if (!(marks == first)) {
            warnings->Add(_pass,
                "its collections differ for " + paths[0].GetString() + " and " + paths[i].GetString()
                    + ", which are instances of one prototype: those of the first count for both");
            break;
        }
    }
    return first;
}

PXR_NAMESPACE_CLOSE_SCOPE
