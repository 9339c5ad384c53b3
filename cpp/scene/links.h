// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_LINKS_H
#define HDOOCPT_SCENE_LINKS_H

#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "pxr/usd/sdf/pathExpression.h"
#include "pxr/usd/sdf/pathExpressionEval.h"
#include "scene/meshReader.h"
#include "scene/primReader.h"

#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

namespace oocpt {
struct LightDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// The collections that a light and its shadows are linked to: expressions over paths where the front end hands out
/// collections, else what it calls them. Collections of everything are none.
struct HdOocPTLightLinks
{
    std::optional<SdfPathExpression> light;
    std::optional<SdfPathExpression> shadow;
    std::pair<TfToken, TfToken> names {};
};

/// The collections that the instances of an instancer are in: a set of `sets` for each, or the first for all where `of`
/// is empty.
struct HdOocPTInstanceLinks
{
    std::vector<TfTokenVector> sets;
    std::vector<uint32_t> of;
};

/// What may be in other collections than before.
enum class HdOocPTLinkChange
{
    Nothing,
    /// Instances: scene delegates say of prims that their collections have changed, but not of instancers.
    Instances,
    Everything,
};

/// Which prims the lights of a scene are linked to.
///
/// Only UsdImaging's scene delegate says itself in which collections a prim is ("categories"); the new front end hands
/// out the collections, and this works out the rest. Hydra has a scene index for it, HdsiLightLinkingSceneIndex, which
/// in OpenUSD 25.08 copies a freed expression when a collection is edited.
///
/// What is instanced is in the collections of its outermost instancer: of a native instance by its path on the stage,
/// of a point instancer by the instancer's, or, where the expressions are here to be asked, by the prototype's own if
/// that is below the instancer.
///
/// Threads: Match() from several at once, between calls of the others.
class HdOocPTLinks
{
public:
    /// Reads the collections of a light. Safe on any thread.
    static HdOocPTLightLinks Read(const HdOocPTPrimSource& light);

    /// Takes what was read of a light. Warns of expressions that cannot be used; that light is linked to everything.
    HdOocPTLinkChange Set(const SdfPath& light, const HdOocPTLightLinks& links, HdOocPTWarnings* warnings);
    void Remove(const SdfPath& light);

    /// The categories of a light and of its shadows; empty means everything.
    std::pair<TfToken, TfToken> GetCategories(const SdfPath& light) const;

    bool IsEmpty() const { return _lights.empty(); }

    /// The categories of a path on the stage: those whose collections hold it. None where the front end says it itself.
    TfTokenVector Match(const SdfPath& path) const;

private:
    struct _Link
    {
        TfToken category;
        SdfPathExpression expression;
        SdfPathExpressionEval<const SdfPath&> eval;
    };
    struct _Light
    {
        std::optional<_Link> light;
        std::optional<_Link> shadow;
        std::pair<TfToken, TfToken> names;
    };

    std::map<SdfPath, _Light> _lights;
};

/// Adds the categories of the collections that a mesh is in, and not by its native instances.
void HdOocPTAddCategories(
    const HdSceneIndexBase& scene, const HdOocPTLinks& links, const HdOocPTPrimSource& source, HdOocPTMeshState* mesh);

/// The collections that the instances of an instancer are in, beside what it shows. `prim`: as last read.
HdOocPTInstanceLinks HdOocPTReadInstanceLinks(const HdSceneIndexBase& scene, const HdOocPTLinks& links,
    const HdOocPTPrimSource& source, const HdOocPTPrimState& prim);

/// Where the front end has named categories itself, those stay.
void HdOocPTSetCategories(const std::pair<TfToken, TfToken>& categories, oocpt::LightDesc* light);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
