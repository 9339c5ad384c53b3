// SPDX-License-Identifier: Apache-2.0
#include "scene/shapeReader.h"

#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/vt/array.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"
#include "scene/usdProperties.h"

#include <algorithm>
#include <iterator>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

TfToken _Token(const VtValue& value, const TfToken& fallback)
{
    TfToken token;
    HdOocPTConvert(value, &token);
    return token.IsEmpty() ? fallback : token;
}

/// Most faces of the meshes that legacy front ends make of solids: larger meshes are not tested for it.
constexpr size_t _mostFacesOfSolid = 1024;

/// The parameters of a solid: data sources of the scene index, or properties of a USD prim.
class _Parameters
{
public:
    _Parameters(const HdOocPTPrimSource& source, const TfToken& type)
        : _container(HdOocPTFindContainer(source.container, { type }))
        , _properties(source)
    {
    }

    VtValue Get(const TfToken& name, HdSampledDataSource::Time time) const
    {
        if (!_container) {
            return _properties.Get(name);
        }
        const HdSampledDataSourceHandle sampled = Find(name);
        return sampled ? sampled->GetValue(time) : VtValue();
    }

    double GetNumber(const TfToken& name, HdSampledDataSource::Time time, double fallback) const
    {
        HdOocPTConvert(Get(name, time), &fallback);
        return fallback;
    }

    /// The data source of a parameter; null for properties: UsdImaging does not tell how they change while the shutter
    /// is open.
    HdSampledDataSourceHandle Find(const TfToken& name) const
    {
        return _container ? HdSampledDataSource::Cast(_container->Get(name)) : nullptr;
    }

private:
    const HdContainerDataSourceHandle _container;
    const HdOocPTUsdProperties _properties;
};

/// Adds fraction of the shutter interval, radii at the lower and the upper end, height. Missing parameters have the
/// schema's defaults.
void _AddSize(const TfToken& type, const _Parameters& parameters, double part, HdSampledDataSource::Time time,
    std::vector<double>* sizes)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const bool isFlat = type == tokens.cylinder || type == tokens.cone;
    const double radius = parameters.GetNumber(tokens.radius, time, type == tokens.capsule ? 0.5 : 1.0);
    const double lower = parameters.GetNumber(tokens.radiusBottom, time, radius);
    const double upper = type == tokens.cone ? 0.0 : parameters.GetNumber(tokens.radiusTop, time, radius);
    const double height = type == tokens.sphere ? 0.0 : parameters.GetNumber(tokens.height, time, isFlat ? 2.0 : 1.0);
    sizes->insert(sizes->end(), { part, lower, upper, height });
}

void _ReadSolid(const TfToken& type, const HdOocPTPrimSource& source, HdOocPTShapeState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const _Parameters parameters(source, type);
    state->sizes.clear();
    _AddSize(type, parameters, 0.0, 0.0F, &state->sizes);
    const std::vector<HdSampledDataSourceHandle> sources { parameters.Find(tokens.radius),
        parameters.Find(tokens.radiusBottom), parameters.Find(tokens.radiusTop), parameters.Find(tokens.height) };
    for (const HdSampledDataSource::Time time : HdOocPTReadSampleTimes(sources, source.shutter)) {
        _AddSize(type, parameters, source.shutter.Part(time), time, &state->sizes);
    }
    const TfToken axis = _Token(parameters.Get(tokens.axis, 0.0F), tokens.axisZ);
    state->axis = HdOocPTPlaceOf(axis, { tokens.axisX, tokens.axisY, tokens.axisZ }, 2);
    state->isRound = type == tokens.sphere || type == tokens.capsule;
}

void _ReadCurves(const HdOocPTPrimSource& source, HdOocPTShapeState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const auto read = [&](const TfToken& name, const TfToken& fallback) {
        return _Token(HdOocPTRead(source.container, { tokens.basisCurves, tokens.topology, name }), fallback);
    };
    state->type = read(tokens.type, tokens.cubic);
    state->basis = read(tokens.basis, tokens.bezier);
    state->wrap = read(tokens.wrap, tokens.nonperiodic);
    const auto integers = [&](const TfToken& name) {
        return HdOocPTReadArray(source, { tokens.basisCurves, tokens.topology, name }, HdOocPTArrayRole::Integers);
    };
    state->counts = integers(tokens.curveVertexCounts);
    state->indices = integers(tokens.curveIndices);
    const bool isKnown
        = state->basis == tokens.bezier || state->basis == tokens.bspline || state->basis == tokens.catmullRom;
    if (state->type != tokens.linear && !isKnown) {
        source.warnings->Add(
            source.path, "curves of the basis " + state->basis.GetString() + " are not supported; taken as catmullRom");
        state->basis = tokens.catmullRom;
    }
}

} // namespace

uint8_t HdOocPTPlaceOf(const TfToken& name, std::initializer_list<TfToken> names, uint8_t fallback)
{
    const auto found = std::find(names.begin(), names.end(), name);
    return found == names.end() ? fallback : static_cast<uint8_t>(found - names.begin());
}

bool HdOocPTIsSolid(const TfToken& primType)
{
    const auto& tokens = *HdOocPTSceneTokens;
    return primType == tokens.sphere || primType == tokens.capsule || primType == tokens.cylinder
        || primType == tokens.cone;
}

TfToken HdOocPTFindSolid(const HdOocPTPrimSource& source, const VtValue& faceVertexCounts)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const VtArray<int> counts = faceVertexCounts.GetWithDefault<VtArray<int>>();
    if (counts.empty() || counts.size() > _mostFacesOfSolid) {
        return TfToken();
    }
    const HdOocPTUsdProperties properties(source);
    const auto has = [&](const TfToken& name) { return !properties.Get(name).IsEmpty(); };
    if (!properties || !(has(tokens.radius) || has(tokens.radiusTop)) || has(tokens.faceVertexCounts)) {
        return TfToken();
    }
    if (!has(tokens.height)) {
        return tokens.sphere;
    }
    // The faces of a capsule are quads but for its poles, those of a cylinder are triangles at both ends, and a cone
    // has triangles at one end, where it comes to a point perhaps quads.
    const auto triangles = static_cast<size_t>(std::count(counts.begin(), counts.end(), 3));
    const size_t others = counts.size() - triangles;
    return others > triangles ? tokens.capsule : others > 0 && triangles >= 2 * others ? tokens.cylinder : tokens.cone;
}

void HdOocPTReadShape(const TfToken& primType, const HdOocPTPrimSource& source, HdOocPTShapeState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    if (primType == tokens.points) {
        state->kind = HdOocPTShapeState::Kind::Points;
    } else if (HdOocPTIsSolid(primType)) {
        state->kind = HdOocPTShapeState::Kind::Solid;
        _ReadSolid(primType, source, state);
    } else {
        state->kind = HdOocPTShapeState::Kind::Curves;
        _ReadCurves(source, state);
    }
}

oocpt::ShapeDesc HdOocPTDescribeShape(const HdOocPTShapeState& state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    oocpt::ShapeDesc desc;
    desc.kind = static_cast<uint8_t>(state.kind);
    const TfToken& basis = state.type == tokens.linear ? tokens.linear : state.basis;
    desc.basis = HdOocPTPlaceOf(basis, { tokens.linear, tokens.bezier, tokens.bspline, tokens.catmullRom }, 1);
    desc.wrap = HdOocPTPlaceOf(state.wrap, { tokens.nonperiodic, tokens.periodic, tokens.pinned, tokens.segmented }, 0);
    desc.counts = HdOocPTHoldArray(state.counts);
    desc.indices = HdOocPTHoldArray(state.indices);
    desc.solid.reserve(2 + state.sizes.size());
    desc.solid.push_back(state.axis);
    desc.solid.push_back(state.isRound ? 1.0 : 0.0);
    std::copy(state.sizes.begin(), state.sizes.end(), std::back_inserter(desc.solid));
    return desc;
}

PXR_NAMESPACE_CLOSE_SCOPE
