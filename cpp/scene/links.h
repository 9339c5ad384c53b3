// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_LINKS_H
#define HDOOCPT_SCENE_LINKS_H

#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "pxr/usd/sdf/pathExpression.h"
#include "scene/meshReader.h"
#include "scene/pathCollection.h"
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

/// The collections that a light and its shadows are linked to: expressions over paths if the front end provides
/// collections, otherwise the names that it gives them. Collections of everything are left out.
struct HdOocPTLightLinks
{
    std::optional<SdfPathExpression> light;
    std::optional<SdfPathExpression> shadow;
    std::pair<TfToken, TfToken> names {};
};

/// The collections that the instances of an instancer are in: a set of `sets` for each, or the first for all if `of` is
/// empty.
struct HdOocPTInstanceLinks
{
    std::vector<TfTokenVector> sets;
    std::vector<uint32_t> of;
};

/// The prims that may be in other collections than before.
enum class HdOocPTLinkChange
{
    Nothing,
    /// Instances: scene delegates report changed collections of prims, but not of instancers.
    Instances,
    Everything,
};

/// The light links of a scene: which prims are in the collections of lights and shadows.
///
/// Only UsdImaging's scene delegate itself tells in which collections a prim is ("categories"); the new front end
/// provides the collections, and this class evaluates them. Hydra has a scene index for it, HdsiLightLinkingSceneIndex,
/// which in OpenUSD 25.08 copies a freed expression when a collection is edited.
///
/// Instanced prims are in the collections of their outermost instancer: for a native instance by its path on the stage,
/// for a point instancer by the instancer's, or, if the expressions are available, by the prototype's own path if that
/// is below the instancer.
///
/// Threads: Match() from several at once, between calls of the others.
class HdOocPTLinks
{
public:
    /// Reads the collections of a light. Safe on any thread.
    static HdOocPTLightLinks Read(const HdOocPTPrimSource& light);

    /// Sets the collections of a light. Warns of expressions that cannot be used; such a light is linked to everything.
    HdOocPTLinkChange Set(const SdfPath& light, const HdOocPTLightLinks& links, HdOocPTWarnings* warnings);
    void Remove(const SdfPath& light);

    /// The categories of a light and of its shadows; empty means everything.
    std::pair<TfToken, TfToken> GetCategories(const SdfPath& light) const;

    bool IsEmpty() const { return _lights.empty(); }

    /// The categories of a path on the stage: those whose collections contain it. None if the front end resolves them
    /// itself.
    TfTokenVector Match(const SdfPath& path) const;

private:
    struct _Link
    {
        TfToken category;
        HdOocPTPathCollection collection;
    };
    struct _Light
    {
        std::optional<_Link> light;
        std::optional<_Link> shadow;
        std::pair<TfToken, TfToken> names;
    };

    std::map<SdfPath, _Light> _lights;
};

/// Adds the categories of the collections that a mesh is in, other than through its native instances.
void HdOocPTAddCategories(
    const HdSceneIndexBase& scene, const HdOocPTLinks& links, const HdOocPTPrimSource& source, HdOocPTMeshState* mesh);

/// The collections that the instances of an instancer are in, apart from those of its prototypes. `prim`: as last read.
HdOocPTInstanceLinks HdOocPTReadInstanceLinks(const HdSceneIndexBase& scene, const HdOocPTLinks& links,
    const HdOocPTPrimSource& source, const HdOocPTPrimState& prim);

/// The paths on the stage by which collections find a prim that these instancers place: those of its outermost native
/// instances, else one.
SdfPathVector HdOocPTFindStagePaths(
    const HdSceneIndexBase& scene, const SdfPath& path, const std::vector<std::pair<SdfPath, SdfPath>>& instancedBy);

/// Sets the categories, except those that the front end has named itself.
void HdOocPTSetCategories(const std::pair<TfToken, TfToken>& categories, oocpt::LightDesc* light);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
