// SPDX-License-Identifier: Apache-2.0
#include "scene/links.h"

#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/tf/errorMark.h"
#include "pxr/base/vt/array.h"
#include "pxr/usd/sdf/predicateLibrary.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <algorithm>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

using _Eval = SdfPathExpressionEval<const SdfPath&>;

std::optional<SdfPathExpression> _ReadCollection(const HdOocPTPrimSource& light, const TfToken& name)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const VtValue value = HdOocPTRead(light.container, { tokens.collections, name, tokens.membershipExpression });
    if (!value.IsHolding<SdfPathExpression>()) {
        return std::nullopt;
    }
    const SdfPathExpression& expression = value.UncheckedGet<SdfPathExpression>();
    // All paths, and all paths that are no properties: what the defaults of a light come out as.
    const std::string text = expression.GetText();
    return text == "//" || text == "~//*.*" ? std::nullopt : std::make_optional(expression);
}

const SdfPath& _PathOfPath(const SdfPath& path)
{
    return path;
}

bool _Holds(const _Eval& eval, const SdfPath& path)
{
    return static_cast<bool>(eval.Match(path, _PathOfPath));
}

} // namespace

HdOocPTLightLinks HdOocPTLinks::Read(const HdOocPTPrimSource& light)
{
    const auto& tokens = *HdOocPTSceneTokens;
    return { _ReadCollection(light, tokens.lightLink), _ReadCollection(light, tokens.shadowLink) };
}

bool HdOocPTLinks::Set(const SdfPath& light, const HdOocPTLightLinks& links, HdOocPTWarnings* warnings)
{
    const auto link = [&](const std::optional<SdfPathExpression>& expression, const TfToken& name) {
        if (!expression) {
            return std::optional<_Link>();
        }
        // Predicates ask for more than paths; without a library of them they do not compile.
        TfErrorMark mark;
        _Eval eval = SdfMakePathExpressionEval(*expression, SdfPredicateLibrary<const SdfPath&>());
        const bool isUsable = mark.IsClean() && expression->IsComplete() && (eval || expression->IsEmpty());
        mark.Clear();
        if (!isUsable) {
            warnings->Add(light,
                "its collection " + name.GetString() + " uses more than paths (" + expression->GetText()
                    + "), which is not supported yet; it is taken to hold everything");
            return std::optional<_Link>();
        }
        const TfToken category(light.GetString() + ".collection:" + name.GetString());
        return std::make_optional(_Link { category, *expression, std::move(eval) });
    };
    const auto& tokens = *HdOocPTSceneTokens;
    _Pair pair { link(links.light, tokens.lightLink), link(links.shadow, tokens.shadowLink) };
    const auto same = [](const std::optional<_Link>& a, const std::optional<_Link>& b) {
        return a.has_value() == b.has_value() && (!a || a->expression == b->expression);
    };
    const auto known = _lights.find(light);
    if (!pair.first && !pair.second) {
        return known != _lights.end() && (_lights.erase(known), true);
    }
    if (known != _lights.end() && same(known->second.first, pair.first) && same(known->second.second, pair.second)) {
        return false;
    }
    _lights.insert_or_assign(light, std::move(pair));
    return true;
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
                                  : std::make_pair(category(known->second.first), category(known->second.second));
}

TfTokenVector HdOocPTLinks::Match(const SdfPath& path, const SdfPathVector& instances, HdOocPTWarnings* warnings) const
{
    TfTokenVector categories;
    const auto add = [&](const SdfPath& light, const std::optional<_Link>& link) {
        if (!link) {
            return;
        }
        const auto count = std::count_if(
            instances.begin(), instances.end(), [&](const SdfPath& instance) { return _Holds(link->eval, instance); });
        const bool isPart = count > 0 && static_cast<size_t>(count) < instances.size();
        if (isPart) {
            warnings->Add(light,
                "is linked to single instances of " + path.GetString()
                    + ", which is not supported yet; to the light it is in none of its collections");
        }
        if (!isPart && (count > 0 || _Holds(link->eval, path))) {
            categories.push_back(link->category);
        }
    };
    for (const auto& [light, pair] : _lights) {
        add(light, pair.first);
        add(light, pair.second);
    }
    return categories;
}

void HdOocPTAddCategories(
    const HdSceneIndexBase& scene, const HdOocPTLinks& links, const HdOocPTPrimSource& source, HdOocPTMeshState* mesh)
{
    const auto& tokens = *HdOocPTSceneTokens;
    SdfPathVector instances;
    for (const auto& [instancer, root] : mesh->prim.instancedBy) {
        const VtArray<SdfPath> locations
            = HdOocPTRead(scene.GetPrim(instancer).dataSource, { tokens.instancerTopology, tokens.instanceLocations })
                  .GetWithDefault<VtArray<SdfPath>>();
        instances.insert(instances.end(), locations.begin(), locations.end());
    }
    for (const TfToken& category : links.Match(source.path, instances, source.warnings)) {
        mesh->categories.push_back(category);
    }
    std::sort(mesh->categories.begin(), mesh->categories.end());
}

void HdOocPTSetCategories(const std::pair<TfToken, TfToken>& categories, oocpt::LightDesc* light)
{
    if (!categories.first.IsEmpty()) {
        light->light_link = rust::String::lossy(categories.first.GetString());
    }
    if (!categories.second.IsEmpty()) {
        light->shadow_link = rust::String::lossy(categories.second.GetString());
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
