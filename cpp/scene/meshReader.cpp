// SPDX-License-Identifier: Apache-2.0
#include "scene/meshReader.h"

#include "oocpt-bridge/src/lib.rs.h"
#include "scene/dataSource.h"
#include "scene/sceneObserver.h"
#include "scene/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

void _ReadTopology(const HdOocPTPrimSource& source, HdOocPTMeshState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const auto integers = [&](const TfToken& name) {
        return HdOocPTReadArray(source, { tokens.mesh, tokens.topology, name }, HdOocPTArrayRole::Integers);
    };
    state->faceVertexCounts = integers(tokens.faceVertexCounts);
    state->faceVertexIndices = integers(tokens.faceVertexIndices);
    state->holeIndices = integers(tokens.holeIndices);

    TfToken orientation;
    HdOocPTConvert(HdOocPTRead(source.container, { tokens.mesh, tokens.topology, tokens.orientation }), &orientation);
    state->leftHanded = orientation == tokens.leftHanded;

    state->subdivisionScheme = tokens.catmullClark;
    HdOocPTConvert(HdOocPTRead(source.container, { tokens.mesh, tokens.subdivisionScheme }), &state->subdivisionScheme);
    state->doubleSided = false;
    HdOocPTConvert(HdOocPTRead(source.container, { tokens.mesh, tokens.doubleSided }), &state->doubleSided);
}

void _ReadPoints(const HdOocPTPrimSource& source, HdOocPTMeshState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    state->points
        = HdOocPTReadArray(source, { tokens.primvars, tokens.points, tokens.primvarValue }, HdOocPTArrayRole::Vectors3);
    if (state->points.IsEmpty() && HdOocPTFind(source.container, { tokens.extComputationPrimvars, tokens.points })) {
        source.warnings->Add(
            source.path, "its points are computed (by UsdSkel, say) and this host does not compute them; left out");
    }
}

HdOocPTPrimvarState _ReadPrimvar(const HdOocPTPrimSource& source, const TfToken& name, HdOocPTArrayRole role)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTPrimvarState primvar;
    if (!HdOocPTFind(source.container, { tokens.primvars, name })) {
        return primvar;
    }
    HdOocPTConvert(
        HdOocPTRead(source.container, { tokens.primvars, name, tokens.interpolation }), &primvar.interpolation);
    primvar.indices = HdOocPTReadArray(source, { tokens.primvars, name, tokens.indices }, HdOocPTArrayRole::Integers);
    if (primvar.indices.GetArraySize() != 0) {
        primvar.values = HdOocPTReadArray(source, { tokens.primvars, name, tokens.indexedPrimvarValue }, role);
        if (!primvar.values.IsEmpty()) {
            return primvar;
        }
    }
    primvar.indices = VtValue();
    primvar.values = HdOocPTReadArray(source, { tokens.primvars, name, tokens.primvarValue }, role);
    if (primvar.values.IsEmpty()) {
        primvar.values = HdOocPTReadArray(source, { tokens.primvars, name, tokens.indexedPrimvarValue }, role);
    }
    return primvar;
}

oocpt::InterpolationTag _InterpolationTag(const TfToken& name)
{
    const auto& tokens = *HdOocPTSceneTokens;
    return name == tokens.uniform    ? oocpt::InterpolationTag::Uniform
        : name == tokens.varying     ? oocpt::InterpolationTag::Varying
        : name == tokens.vertex      ? oocpt::InterpolationTag::Vertex
        : name == tokens.faceVarying ? oocpt::InterpolationTag::FaceVarying
        : name == tokens.instance    ? oocpt::InterpolationTag::Instance
                                     : oocpt::InterpolationTag::Constant;
}

oocpt::SubdivisionTag _SubdivisionTag(const TfToken& scheme)
{
    const auto& tokens = *HdOocPTSceneTokens;
    return scheme == tokens.catmullClark ? oocpt::SubdivisionTag::CatmullClark
        : scheme == tokens.loop          ? oocpt::SubdivisionTag::Loop
        : scheme == tokens.bilinear      ? oocpt::SubdivisionTag::Bilinear
                                         : oocpt::SubdivisionTag::None;
}

oocpt::PrimvarDesc _DescribePrimvar(const HdOocPTPrimvarState& primvar)
{
    return { _InterpolationTag(primvar.interpolation), HdOocPTHoldArray(primvar.values),
        HdOocPTHoldArray(primvar.indices) };
}

} // namespace

void HdOocPTReadMesh(const HdOocPTPrimSource& source, HdOocPTMeshState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTReadPrim(source, &state->prim);
    if (source.dirtyBits & HdOocPTDirtyTopology) {
        _ReadTopology(source, state);
    }
    if (source.dirtyBits & HdOocPTDirtyPoints) {
        _ReadPoints(source, state);
    }
    if (source.dirtyBits & HdOocPTDirtyNormals) {
        state->normals = _ReadPrimvar(source, tokens.normals, HdOocPTArrayRole::Vectors3);
    }
    if (source.dirtyBits & HdOocPTDirtyColor) {
        state->displayColor = _ReadPrimvar(source, tokens.displayColor, HdOocPTArrayRole::Vectors3);
    }
    if (source.dirtyBits & HdOocPTDirtyOpacity) {
        state->displayOpacity = _ReadPrimvar(source, tokens.displayOpacity, HdOocPTArrayRole::Scalars);
    }
}

oocpt::MeshDesc HdOocPTDescribeMesh(const SdfPath& path, const HdOocPTMeshState& state, int32_t primId)
{
    oocpt::MeshDesc desc;
    HdOocPTFillPrim(path, state.prim, &desc.prim);
    desc.prim_id = primId;
    desc.double_sided = state.doubleSided;
    desc.left_handed = state.leftHanded;
    desc.subdivision = _SubdivisionTag(state.subdivisionScheme);
    desc.face_vertex_counts = HdOocPTHoldArray(state.faceVertexCounts);
    desc.face_vertex_indices = HdOocPTHoldArray(state.faceVertexIndices);
    desc.hole_indices = HdOocPTHoldArray(state.holeIndices);
    desc.points = HdOocPTHoldArray(state.points);
    desc.normals = _DescribePrimvar(state.normals);
    desc.display_color = _DescribePrimvar(state.displayColor);
    desc.display_opacity = _DescribePrimvar(state.displayOpacity);
    return desc;
}

PXR_NAMESPACE_CLOSE_SCOPE
