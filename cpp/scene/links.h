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

#include <map>
#include <optional>
#include <utility>

namespace oocpt {
struct LightDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// The collections that a light and its shadows are linked to, where the front end hands out collections: expressions
/// over paths. Collections of everything are none.
struct HdOocPTLightLinks
{
    std::optional<SdfPathExpression> light;
    std::optional<SdfPathExpression> shadow;
};

/// Which prims the lights of a scene are linked to.
///
/// Only UsdImaging's scene delegate says itself in which collections a prim is ("categories"); the new front end hands
/// out the collections, and this works out the rest. Hydra has a scene index for it, HdsiLightLinkingSceneIndex, which
/// in OpenUSD 25.08 copies a freed expression when a collection is edited.
///
/// Threads: Match() from several at once, between calls of the others.
class HdOocPTLinks
{
public:
    /// Reads the collections of a light. Safe on any thread.
    static HdOocPTLightLinks Read(const HdOocPTPrimSource& light);

    /// Takes what was read of a light; whether anything is different now. Warns of expressions that cannot be used, and
    /// links the light to everything then.
    bool Set(const SdfPath& light, const HdOocPTLightLinks& links, HdOocPTWarnings* warnings);
    void Remove(const SdfPath& light);

    /// The categories of a light and of its shadows; empty means everything.
    std::pair<TfToken, TfToken> GetCategories(const SdfPath& light) const;

    bool IsEmpty() const { return _lights.empty(); }

    /// The categories of a prim: those whose collections hold its path or, where it is the prototype of native
    /// instances, the paths of all of them.
    TfTokenVector Match(const SdfPath& path, const SdfPathVector& instances, HdOocPTWarnings* warnings) const;

private:
    struct _Link
    {
        TfToken category;
        SdfPathExpression expression;
        SdfPathExpressionEval<const SdfPath&> eval;
    };
    using _Pair = std::pair<std::optional<_Link>, std::optional<_Link>>;

    std::map<SdfPath, _Pair> _lights;
};

/// Adds the categories of the collections that a mesh, or the native instances of it, are in.
void HdOocPTAddCategories(
    const HdSceneIndexBase& scene, const HdOocPTLinks& links, const HdOocPTPrimSource& source, HdOocPTMeshState* mesh);

/// Where the front end has named categories itself, those stay.
void HdOocPTSetCategories(const std::pair<TfToken, TfToken>& categories, oocpt::LightDesc* light);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
