// SPDX-License-Identifier: Apache-2.0
#include "scene/links.h"

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

/// None for collections of everything.
std::optional<SdfPathExpression> _ReadMembership(const HdOocPTPrimSource& light, const TfToken& name)
{
    const std::optional<SdfPathExpression> membership = HdOocPTReadMembership(light.container, name);
    // All paths, and all paths that are not properties: the defaults of a light resolve to them.
    const std::string text = membership ? membership->GetText() : "//";
    return text == "//" || text == "~//*.*" ? std::nullopt : membership;
}

} // namespace

HdOocPTLightLinks HdOocPTLinks::Read(const HdOocPTPrimSource& light)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTLightLinks links { _ReadMembership(light, tokens.lightLink), _ReadMembership(light, tokens.shadowLink) };
    HdOocPTConvert(HdOocPTRead(light.container, { tokens.light, tokens.lightLink }), &links.names.first);
    HdOocPTConvert(HdOocPTRead(light.container, { tokens.light, tokens.shadowLink }), &links.names.second);
    return links;
}

HdOocPTLinkChange HdOocPTLinks::Set(const SdfPath& light, const HdOocPTLightLinks& links, HdOocPTWarnings* warnings)
{
    const auto link = [&](const std::optional<SdfPathExpression>& expression, const TfToken& name) {
        if (!expression) {
            return std::optional<_Link>();
        }
        std::optional<HdOocPTPathCollection> collection
            = HdOocPTPathCollection::Compile(light, name, *expression, "it is taken to hold everything", warnings);
        if (!collection) {
            return std::optional<_Link>();
        }
        const TfToken category(light.GetString() + ".collection:" + name.GetString());
        return std::make_optional(_Link { category, std::move(*collection) });
    };
    const auto& tokens = *HdOocPTSceneTokens;
    _Light read { link(links.light, tokens.lightLink), link(links.shadow, tokens.shadowLink), links.names };
    const auto same = [](const std::optional<_Link>& a, const std::optional<_Link>& b) {
        return a.has_value() == b.has_value() && (!a || a->collection == b->collection);
    };
    const bool isNamed = !read.names.first.IsEmpty() || !read.names.second.IsEmpty();
    const auto known = _lights.find(light);
    if (!read.light && !read.shadow && !isNamed) {
        return _lights.erase(light) > 0 ? HdOocPTLinkChange::Everything : HdOocPTLinkChange::Nothing;
    }
    const bool isSame = known != _lights.end() && same(known->second.light, read.light)
        && same(known->second.shadow, read.shadow) && known->second.names == read.names;
    if (!isSame) {
        _lights.insert_or_assign(light, std::move(read));
        return HdOocPTLinkChange::Everything;
    }
    return isNamed ? HdOocPTLinkChange::Instances : HdOocPTLinkChange::Nothing;
}

void HdOocPTLinks::Remove(const SdfPath& light)
{
    _lights.erase(light);
}

std::pair<TfToken, TfToken> HdOocPTLinks::GetCategories(const SdfPath& light) const
{
    const auto category = [](const std::optional<_Link>& link) { return link ? link->category : TfToken(); };
    const auto known = _lights.find(light);
    return known == _lights.end() ? std::pair<TfToken, TfToken>()
                                  : std::make_pair(category(known->second.light), category(known->second.shadow));
}

TfTokenVector HdOocPTLinks::Match(const SdfPath& path) const
{
    TfTokenVector categories;
    for (const auto& [light, read] : _lights) {
        for (const std::optional<_Link>* link : { &read.light, &read.shadow }) {
            if (*link && (*link)->collection.Holds(path)) {
                categories.push_back((*link)->category);
            }
        }
    }
    std::sort(categories.begin(), categories.end());
    return categories;
}

namespace {

using _InstancedBy = std::vector<std::pair<SdfPath, SdfPath>>;

bool _HasLocations(const HdContainerDataSourceHandle& instancer)
{
    const auto& tokens = *HdOocPTSceneTokens;
    return !HdOocPTRead(instancer, { tokens.instancerTopology, tokens.instanceLocations })
                .GetWithDefault<VtArray<SdfPath>>()
                .empty();
}

/// The path without the elements that UsdImaging inserts for the prototypes of point instancers.
SdfPath _WithoutInsertions(const SdfPath& path)
{
    SdfPath clean = SdfPath::AbsoluteRootPath();
    for (const SdfPath& prefix : path.GetPrefixes()) {
        if (prefix.GetName().rfind("ForInstancer", 0) != 0) {
            clean = clean.AppendChild(prefix.GetNameToken());
        }
    }
    return clean;
}

/// The path by which collections find a prim, or a native instance, that these instancers place; nullopt if a native
/// instance further out decides.
std::optional<SdfPath> _StagePath(
    const HdSceneIndexBase& scene, const SdfPath& path, const _InstancedBy& instancedBy, int depth = 0)
{
    // This is more than the levels that the renderer supports.
    constexpr int mostLevels = 64;
    if (instancedBy.empty() || depth >= mostLevels) {
        return path;
    }
    const SdfPath& instancer = instancedBy.front().first;
    const HdContainerDataSourceHandle container = scene.GetPrim(instancer).dataSource;
    if (_HasLocations(container)) {
        return std::nullopt;
    }
    HdOocPTPrimState state;
    HdOocPTReadPrim({ instancer, container, HdOocPTDirtyInstancedBy, nullptr }, &state);
    const std::optional<SdfPath> above = _StagePath(scene, instancer, state.instancedBy, depth + 1);
    const SdfPath own = _WithoutInsertions(path);
    return above && own.HasPrefix(*above) ? own : above;
}

} // namespace

SdfPathVector HdOocPTFindStagePaths(
    const HdSceneIndexBase& scene, const SdfPath& path, const std::vector<std::pair<SdfPath, SdfPath>>& instancedBy)
{
    // This is more than the levels that the renderer supports.
    constexpr int mostLevels = 64;
    SdfPathVector locations;
    _InstancedBy above = instancedBy;
    for (int level = 0; level < mostLevels && !above.empty(); ++level) {
        const SdfPath instancer = above.front().first;
        const HdContainerDataSourceHandle container = scene.GetPrim(instancer).dataSource;
        if (_HasLocations(container)) {
            const auto& tokens = *HdOocPTSceneTokens;
            const auto found = HdOocPTRead(container, { tokens.instancerTopology, tokens.instanceLocations })
                                   .GetWithDefault<VtArray<SdfPath>>();
            locations.assign(found.cbegin(), found.cend());
        }
        HdOocPTPrimState state;
        HdOocPTReadPrim({ instancer, container, HdOocPTDirtyInstancedBy, nullptr }, &state);
        above = state.instancedBy;
    }
    if (!locations.empty()) {
        return locations;
    }
    return { _StagePath(scene, path, instancedBy).value_or(path) };
}

namespace {

/// Collects distinct sets of collections and numbers them.
class _Sets
{
public:
    explicit _Sets(HdOocPTInstanceLinks* links)
        : _links(links)
    {
    }

    void Add(const TfTokenVector& categories)
    {
        const auto [known, isNew] = _numbers.emplace(categories, static_cast<uint32_t>(_links->sets.size()));
        if (isNew) {
            _links->sets.push_back(categories);
        }
        _links->of.push_back(known->second);
    }

private:
    HdOocPTInstanceLinks* _links;
    std::map<TfTokenVector, uint32_t> _numbers;
};

/// Reads the links of instances from a scene delegate, which resolves them itself for all levels of native instances.
HdOocPTInstanceLinks _ReadNamedLinks(const HdOocPTPrimSource& source)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTInstanceLinks links;
    const HdVectorDataSourceHandle values = HdVectorDataSource::Cast(
        HdOocPTFind(source.container, { tokens.instanceCategories, tokens.categoriesValues }));
    const size_t count = values ? values->GetNumElements() : 0;
    if (count == 0) {
        links.sets.push_back(HdOocPTReadCategories(source.container));
        return links;
    }
    _Sets sets(&links);
    for (size_t i = 0; i < count; ++i) {
        sets.Add(HdOocPTCategoriesOf(HdContainerDataSource::Cast(values->GetElement(i))));
    }
    return links;
}

} // namespace

void HdOocPTAddCategories(
    const HdSceneIndexBase& scene, const HdOocPTLinks& links, const HdOocPTPrimSource& source, HdOocPTMeshState* mesh)
{
    if (HdOocPTFind(source.container, { HdOocPTSceneTokens->sceneDelegate })) {
        // The delegate has provided the links itself.
        return;
    }
    if (const std::optional<SdfPath> path = _StagePath(scene, source.path, mesh->prim.instancedBy)) {
        const TfTokenVector found = links.Match(*path);
        mesh->categories.insert(mesh->categories.end(), found.begin(), found.end());
        std::sort(mesh->categories.begin(), mesh->categories.end());
    }
}

HdOocPTInstanceLinks HdOocPTReadInstanceLinks(const HdSceneIndexBase& scene, const HdOocPTLinks& links,
    const HdOocPTPrimSource& source, const HdOocPTPrimState& prim)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTInstanceLinks read;
    if (HdOocPTFind(source.container, { tokens.sceneDelegate })) {
        return prim.instancedBy.empty() ? _ReadNamedLinks(source) : read;
    }
    const VtArray<SdfPath> locations
        = HdOocPTRead(source.container, { tokens.instancerTopology, tokens.instanceLocations })
              .GetWithDefault<VtArray<SdfPath>>();
    _Sets sets(&read);
    for (const SdfPath& location : locations) {
        const std::optional<SdfPath> path = _StagePath(scene, location, prim.instancedBy);
        if (!path) {
            return {};
        }
        sets.Add(links.Match(*path));
    }
    return read;
}

void HdOocPTSetCategories(const std::pair<TfToken, TfToken>& categories, oocpt::LightDesc* light)
{
    if (!categories.first.IsEmpty()) {
        light->light_link = HdOocPTText(categories.first);
    }
    if (!categories.second.IsEmpty()) {
        light->shadow_link = HdOocPTText(categories.second);
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
