// SPDX-License-Identifier: Apache-2.0
#include "scene/timeCodes.h"

#include "pxr/usd/sdf/layer.h"
#include "pxr/usd/sdf/schema.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <set>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

/// The value of UsdStage if none is authored.
constexpr double _fallbackRate = 24.0;

/// The least rate, so that seconds of shutters stay finite.
constexpr double _leastRate = 1e-30;

/// The rate that a command line has set; 0 if none has.
std::atomic<double> _toldRate { 0.0 };

/// A layer that may be the root of the stage.
struct _Candidate
{
    SdfLayerHandle layer;
    double rate = _fallbackRate;
    /// True if the layer itself authors a rate.
    bool isAuthored = false;
};
using _Candidates = std::vector<_Candidate>;

_Candidate _MakeCandidate(const SdfLayerHandle& layer)
{
    // As in UsdStage, the rate of frames stands in for that of time codes.
    if (layer->HasTimeCodesPerSecond()) {
        return { layer, layer->GetTimeCodesPerSecond(), true };
    }
    if (layer->HasFramesPerSecond()) {
        return { layer, layer->GetFramesPerSecond(), true };
    }
    return { layer, _fallbackRate, false };
}

bool _Agree(const _Candidates& all)
{
    return std::all_of(all.begin(), all.end(), [&](const _Candidate& one) { return one.rate == all.front().rate; });
}

/// The layer and all its sublayers, of any depth.
std::set<SdfLayerHandle> _LayerStack(const SdfLayerHandle& root)
{
    std::set<SdfLayerHandle> stack { root };
    std::vector<SdfLayerHandle> open { root };
    while (!open.empty()) {
        const SdfLayerHandle layer = open.back();
        open.pop_back();
        const VtValue paths = layer->GetField(SdfPath::AbsoluteRootPath(), SdfFieldKeys->SubLayers);
        if (!paths.IsHolding<std::vector<std::string>>()) {
            continue;
        }
        for (const std::string& path : paths.UncheckedGet<std::vector<std::string>>()) {
            const SdfLayerHandle below = path.empty() ? SdfLayerHandle() : SdfLayer::FindRelativeToLayer(layer, path);
            if (below && stack.insert(below).second) {
                open.push_back(below);
            }
        }
    }
    return stack;
}

/// Keeps the layers that a test accepts, unless it accepts none.
template <typename Test>
void _Prefer(_Candidates* all, const Test& test)
{
    _Candidates kept;
    std::copy_if(all->begin(), all->end(), std::back_inserter(kept), test);
    if (!kept.empty()) {
        all->swap(kept);
    }
}

void _PreferThoseWithPrim(_Candidates* all, const SdfPath& path)
{
    if (!path.IsEmpty()) {
        _Prefer(all, [&](const _Candidate& one) {
            const std::set<SdfLayerHandle> stack = _LayerStack(one.layer);
            return std::any_of(
                stack.begin(), stack.end(), [&](const SdfLayerHandle& layer) { return layer->HasSpec(path); });
        });
    }
}

/// Drops the layers that others of them refer to: first by sublayers, which costs nothing, then by all kinds of arcs,
/// which reads through every layer.
void _PreferRoots(_Candidates* all, bool withArcs)
{
    std::set<SdfLayerHandle> parts;
    for (const _Candidate& one : *all) {
        for (const SdfLayerHandle& layer : _LayerStack(one.layer)) {
            if (layer != one.layer) {
                parts.insert(layer);
            }
            if (!withArcs) {
                continue;
            }
            for (const std::string& path : layer->GetCompositionAssetDependencies()) {
                const SdfLayerHandle part
                    = path.empty() ? SdfLayerHandle() : SdfLayer::FindRelativeToLayer(layer, path);
                if (part && part != one.layer) {
                    parts.insert(part);
                }
            }
        }
    }
    _Prefer(all, [&](const _Candidate& one) { return parts.count(one.layer) == 0; });
}

/// Describes in one line how the layers disagree.
std::string _Disagreement(const _Candidates& all)
{
    std::set<std::string> said;
    for (const _Candidate& one : all) {
        said.insert(one.layer->GetDisplayName() + " has " + TfStringify(one.rate));
    }
    std::string text;
    for (auto line = said.begin(); line != said.end() && std::distance(said.begin(), line) < 4; ++line) {
        text += (text.empty() ? "" : ", ") + *line;
    }
    return text;
}

/// Finds the rate from the loaded layers.
HdOocPTTimeCodes _FindByLayers(const SdfPath& camera)
{
    _Candidates all;
    bool isAnyAuthored = false;
    for (const SdfLayerHandle& layer : SdfLayer::GetLoadedLayers()) {
        if (layer) {
            all.push_back(_MakeCandidate(layer));
            isAnyAuthored = isAnyAuthored || all.back().isAuthored;
        }
    }
    if (!isAnyAuthored) {
        return {};
    }
    // These are session layers and an application's own layers.
    _Prefer(&all, [](const _Candidate& one) { return one.isAuthored || !one.layer->IsAnonymous(); });
    if (!_Agree(all)) {
        _PreferRoots(&all, false);
    }
    if (!_Agree(all)) {
        _PreferThoseWithPrim(&all, camera);
    }
    if (!_Agree(all)) {
        _PreferThoseWithPrim(&all, camera.GetPrefixes().empty() ? SdfPath() : camera.GetPrefixes().front());
    }
    if (!_Agree(all)) {
        _PreferRoots(&all, true);
    }
    if (!_Agree(all)) {
        return { _fallbackRate,
            "this host does not say how many time codes make a second, and its layers disagree (" + _Disagreement(all)
                + ")" };
    }
    return { all.front().rate, {} };
}

} // namespace

void HdOocPTSetTimeCodesPerSecond(double rate)
{
    _toldRate = rate;
}

HdOocPTTimeCodes HdOocPTFindTimeCodes(const HdSceneIndexBase& scene, const SdfPath& camera)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdSceneIndexPrim root = scene.GetPrim(SdfPath::AbsoluteRootPath());
    const HdContainerDataSourceHandle globals = HdOocPTFindContainer(root.dataSource, { tokens.sceneGlobals });
    HdOocPTTimeCodes found;
    const bool isSaid = HdOocPTConvert(HdOocPTRead(globals, { tokens.timeCodesPerSecond }), &found.perSecond);
    // Hydra's own scene index of globals returns the fallback if no rate was set. Ranges of time come from stages
    // alone.
    const bool isKnown = isSaid && (found.perSecond != _fallbackRate || globals->Get(tokens.startTimeCode));
    if (!isKnown) {
        found.perSecond = _toldRate;
        if (found.perSecond == 0.0) {
            found = _FindByLayers(camera);
        }
    }
    if (!std::isfinite(found.perSecond) || found.perSecond < _leastRate) {
        found = { _fallbackRate, "the stage's timeCodesPerSecond is " + TfStringify(found.perSecond) };
    }
    return found;
}

PXR_NAMESPACE_CLOSE_SCOPE
