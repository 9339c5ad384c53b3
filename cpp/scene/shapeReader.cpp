// SPDX-License-Identifier: Apache-2.0
#include "scene/shapeReader.h"

#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/gf/vec3f.h"
#include "pxr/base/vt/array.h"
#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <algorithm>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

double _Number(const HdOocPTPrimSource& source, const TfToken& shape, const TfToken& name, double fallback)
{
    double value = fallback;
    HdOocPTConvert(HdOocPTRead(source.container, { shape, name }), &value);
    return value;
}

TfToken _Token(const HdOocPTPrimSource& source, std::initializer_list<TfToken> path, const TfToken& fallback)
{
    TfToken value;
    HdOocPTConvert(HdOocPTRead(source.container, path), &value);
    return value.IsEmpty() ? fallback : value;
}

/// Balls around `centers`: one is a point, two are a tube.
void _SetBalls(const VtArray<GfVec3f>& centers, const VtArray<float>& diameters, HdOocPTShapeState* state,
    VtValue* points, HdOocPTPrimvarState* widths)
{
    const auto& tokens = *HdOocPTSceneTokens;
    *points = VtValue(centers);
    *widths = HdOocPTPrimvarState { tokens.vertex, VtValue(diameters), VtValue() };
    if (centers.size() > 1) {
        state->kind = HdOocPTShapeState::Kind::Curves;
        state->type = tokens.linear;
        state->counts = VtValue(VtArray<int>(1, static_cast<int>(centers.size())));
    }
}

void _ReadSphere(
    const HdOocPTPrimSource& source, HdOocPTShapeState* state, VtValue* points, HdOocPTPrimvarState* widths)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const auto diameter = static_cast<float>(2.0 * _Number(source, tokens.sphere, tokens.radius, 1.0));
    _SetBalls({ GfVec3f(0.0F) }, { diameter }, state, points, widths);
}

void _ReadCapsule(
    const HdOocPTPrimSource& source, HdOocPTShapeState* state, VtValue* points, HdOocPTPrimvarState* widths)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const double height = _Number(source, tokens.capsule, tokens.height, 1.0);
    const double radius = _Number(source, tokens.capsule, tokens.radius, 0.5);
    const double bottom = _Number(source, tokens.capsule, tokens.radiusBottom, radius);
    const double top = _Number(source, tokens.capsule, tokens.radiusTop, radius);
    const TfToken axis = _Token(source, { tokens.capsule, tokens.axis }, tokens.axisZ);
    const int along = axis == tokens.axisX ? 0 : axis == tokens.axisY ? 1 : 2;
    GfVec3f half(0.0F);
    half[along] = static_cast<float>(0.5 * height);
    _SetBalls(
        { -half, half }, { static_cast<float>(2.0 * bottom), static_cast<float>(2.0 * top) }, state, points, widths);
}

void _ReadCurves(const HdOocPTPrimSource& source, HdOocPTShapeState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const auto read = [&](const TfToken& name, const TfToken& fallback) {
        return _Token(source, { tokens.basisCurves, tokens.topology, name }, fallback);
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

bool HdOocPTIsExactShape(const TfToken& primType)
{
    const auto& tokens = *HdOocPTSceneTokens;
    return primType == tokens.sphere || primType == tokens.capsule;
}

void HdOocPTReadShape(const TfToken& primType, const HdOocPTPrimSource& source, HdOocPTShapeState* state,
    VtValue* points, HdOocPTPrimvarState* widths)
{
    const auto& tokens = *HdOocPTSceneTokens;
    if (primType == tokens.points) {
        state->kind = HdOocPTShapeState::Kind::Points;
    } else if (primType == tokens.sphere) {
        state->kind = HdOocPTShapeState::Kind::Points;
        _ReadSphere(source, state, points, widths);
    } else if (primType == tokens.capsule) {
        _ReadCapsule(source, state, points, widths);
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
    return desc;
}

PXR_NAMESPACE_CLOSE_SCOPE
