// SPDX-License-Identifier: Apache-2.0
#include "scene/meshReader.h"

#include "bridge/text.h"
#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/vt/array.h"
#include "scene/dataSource.h"
#include "scene/labelReader.h"
#include "scene/sceneObserver.h"
#include "scene/tokens.h"
#include "scene/usdProperties.h"

#include <algorithm>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

void _ReadSubdivision(const HdOocPTPrimSource& source, HdOocPTSubdivisionState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const auto rule = [&](const TfToken& name, const TfToken& fallback) {
        TfToken value = fallback;
        HdOocPTConvert(HdOocPTRead(source.container, { tokens.mesh, tokens.subdivisionTags, name }), &value);
        return value.IsEmpty() ? fallback : value;
    };
    state->interpolateBoundary = rule(tokens.interpolateBoundary, tokens.edgeAndCorner);
    state->faceVaryingLinearInterpolation = rule(tokens.faceVaryingLinearInterpolation, tokens.cornersPlus1);
    state->triangleSubdivisionRule = rule(tokens.triangleSubdivisionRule, tokens.catmullClark);
    const auto array = [&](const TfToken& name, HdOocPTArrayRole role) {
        return HdOocPTReadArray(source, { tokens.mesh, tokens.subdivisionTags, name }, role);
    };
    state->creaseIndices = array(tokens.creaseIndices, HdOocPTArrayRole::Integers);
    state->creaseLengths = array(tokens.creaseLengths, HdOocPTArrayRole::Integers);
    state->creaseSharpnesses = array(tokens.creaseSharpnesses, HdOocPTArrayRole::Scalars);
    state->cornerIndices = array(tokens.cornerIndices, HdOocPTArrayRole::Integers);
    state->cornerSharpnesses = array(tokens.cornerSharpnesses, HdOocPTArrayRole::Scalars);
}

void _ReadTopology(const TfToken& primType, const HdOocPTPrimSource& source, HdOocPTMeshState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    double refineLevel = 0;
    HdOocPTConvert(HdOocPTRead(source.container, { tokens.displayStyle, tokens.refineLevel }), &refineLevel);
    state->refineLevel = refineLevel;
    const auto integers = [&](const TfToken& name) {
        return HdOocPTReadArray(source, { tokens.mesh, tokens.topology, name }, HdOocPTArrayRole::Integers);
    };
    TfToken shape = primType;
    if (primType == tokens.mesh) {
        state->faceVertexCounts = integers(tokens.faceVertexCounts);
        shape = HdOocPTFindSolid(source, state->faceVertexCounts);
    }
    if (!shape.IsEmpty()) {
        state->subdivisionScheme = tokens.none;
        state->faceVertexCounts = VtValue();
        HdOocPTReadShape(shape, source, &state->shape);
        return;
    }
    state->shape = HdOocPTShapeState();
    state->faceVertexIndices = integers(tokens.faceVertexIndices);
    state->holeIndices = integers(tokens.holeIndices);

    TfToken orientation;
    HdOocPTConvert(HdOocPTRead(source.container, { tokens.mesh, tokens.topology, tokens.orientation }), &orientation);
    state->leftHanded = orientation == tokens.leftHanded;

    state->subdivisionScheme = tokens.catmullClark;
    HdOocPTConvert(HdOocPTRead(source.container, { tokens.mesh, tokens.subdivisionScheme }), &state->subdivisionScheme);
    if (HdOocPTFind(source.container, { tokens.tetMesh })) {
        // Hydra's filter leaves tetrahedral meshes the default scheme, but tetrahedra have flat faces.
        state->subdivisionScheme = tokens.none;
    }
    state->doubleSided = false;
    HdOocPTConvert(HdOocPTRead(source.container, { tokens.mesh, tokens.doubleSided }), &state->doubleSided);
    _ReadSubdivision(source, &state->subdivision);
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

oocpt::SubdivisionDesc _DescribeSubdivision(const HdOocPTMeshState& mesh)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdOocPTSubdivisionState& state = mesh.subdivision;
    oocpt::SubdivisionDesc desc;
    desc.scheme
        = HdOocPTPlaceOf(mesh.subdivisionScheme, { tokens.none, tokens.bilinear, tokens.catmullClark, tokens.loop }, 0);
    desc.refine_level = static_cast<uint8_t>(std::clamp(mesh.refineLevel, 0.0, 255.0));
    desc.boundary
        = HdOocPTPlaceOf(state.interpolateBoundary, { tokens.none, tokens.edgeOnly, tokens.edgeAndCorner }, 2);
    desc.face_varying = HdOocPTPlaceOf(state.faceVaryingLinearInterpolation,
        { tokens.none, tokens.cornersOnly, tokens.cornersPlus1, tokens.cornersPlus2, tokens.boundaries, tokens.all },
        2);
    desc.smooth_triangles = state.triangleSubdivisionRule == tokens.smooth;
    desc.crease_indices = HdOocPTHoldArray(state.creaseIndices);
    desc.crease_lengths = HdOocPTHoldArray(state.creaseLengths);
    desc.crease_sharpnesses = HdOocPTHoldArray(state.creaseSharpnesses);
    desc.corner_indices = HdOocPTHoldArray(state.cornerIndices);
    desc.corner_sharpnesses = HdOocPTHoldArray(state.cornerSharpnesses);
    return desc;
}

/// Returns true if curves have no authored widths, though Hydra provides a width of 1: such curves are lines.
bool _AreLines(const HdOocPTPrimSource& source, const HdOocPTPrimvarState& widths)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const VtValue& values = widths.values;
    if (!values.IsHolding<VtArray<float>>() || values.GetArraySize() != 1
        || values.UncheckedGet<VtArray<float>>()[0] != 1.0F) {
        return false;
    }
    const HdOocPTUsdProperties properties(source);
    if (!properties) {
        // The stand-in for a model whose draw mode is "bounds" or "origin" is not a prim of USD.
        const TfToken& name = source.path.GetNameToken();
        return (name == tokens.boundsCurves || name == tokens.originCurves)
            && !HdOocPTFind(source.container, { tokens.usdPrimInfo });
    }
    // UsdImaging's scene delegate gives stand-ins the model's own path, and a model is not a curve. Curves without
    // widths get one at the frame's own time alone: at a time beside it the attribute itself is asked.
    constexpr HdSampledDataSource::Time beside = 1e-3F;
    const HdSampledDataSourceHandle sampled = HdSampledDataSource::Cast(
        HdOocPTFind(source.container, { tokens.primvars, tokens.widths, tokens.primvarValue }));
    return properties.Get(tokens.curveVertexCounts).IsEmpty() || (sampled && sampled->GetValue(beside).IsEmpty());
}

/// The interpolation of values for which UsdImaging gives none: the one that fits their number.
TfToken _Interpolation(size_t count, const HdOocPTMeshState& mesh)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const bool isCurves = mesh.shape.kind == HdOocPTShapeState::Kind::Curves;
    const VtValue& faces = isCurves ? mesh.shape.counts : mesh.faceVertexCounts;
    return count == 1                                    ? tokens.constant
        : count == mesh.points.GetArraySize()            ? tokens.vertex
        : count == faces.GetArraySize()                  ? tokens.uniform
        : count == mesh.faceVertexIndices.GetArraySize() ? tokens.faceVarying
                                                         : tokens.constant;
}

/// Reads displayColor or displayOpacity, `property` in USD. UsdImaging's scene delegate drops both if their type is not
/// the schema's own (a single value, doubles, halves), and takes the first value of constant ones, whatever their index
/// is.
HdOocPTPrimvarState _ReadDisplay(const HdOocPTPrimSource& source, const TfToken& name, const TfToken& property,
    HdOocPTArrayRole role, const HdOocPTMeshState& mesh)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTPrimvarState primvar = HdOocPTReadPrimvar(source, name, role);
    const bool isFirst = primvar.interpolation == tokens.constant && primvar.indices.GetArraySize() == 1;
    if (primvar.values.GetArraySize() != 0 && !isFirst) {
        return primvar;
    }
    const HdOocPTUsdProperties properties(source);
    HdOocPTPrimvarState own;
    std::string reason;
    own.values = HdOocPTNormalizeArray(properties.GetIndexed(property, &own.indices), role, &reason);
    if (own.values.GetArraySize() == 0) {
        if (isFirst) {
            return primvar;
        }
        if (!properties && !primvar.values.IsEmpty()) {
            // UsdImaging's scene index reads the schema's type, whatever was authored.
            source.warnings->Add(source.path,
                name.GetString() + " is empty, or has another type than its schema and is not handed over; ignored");
        }
        return HdOocPTPrimvarState();
    }
    const size_t count = own.indices.IsEmpty() ? own.values.GetArraySize() : own.indices.GetArraySize();
    own.interpolation = isFirst ? tokens.constant : _Interpolation(count, mesh);
    return own;
}

/// The material bound for the requested purposes, by default "full", which the delegate requests; otherwise that for
/// all purposes.
SdfPath _ReadMaterial(const HdContainerDataSourceHandle& container, const TfTokenVector* purposes)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const auto bound = [&](const TfToken& purpose) {
        return HdOocPTRead(container, { tokens.materialBindings, purpose, tokens.path }).GetWithDefault<SdfPath>();
    };
    const TfTokenVector usual { tokens.full };
    for (const TfToken& purpose : purposes ? *purposes : usual) {
        const SdfPath path = bound(purpose);
        if (!path.IsEmpty()) {
            return path;
        }
    }
    return bound(tokens.allPurpose);
}

void _ReadSubsets(const HdSceneIndexBase& scene, const HdOocPTPrimSource& mesh, HdOocPTMeshState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    state->subsets.clear();
    for (const SdfPath& path : scene.GetChildPrimPaths(mesh.path)) {
        const HdSceneIndexPrim prim = scene.GetPrim(path);
        if (prim.primType != tokens.geomSubset || !prim.dataSource) {
            continue;
        }
        TfToken type;
        HdOocPTConvert(HdOocPTRead(prim.dataSource, { tokens.geomSubset, tokens.type }), &type);
        const SdfPath material = _ReadMaterial(prim.dataSource, mesh.bindingPurposes);
        // Subsets of points or edges, and those that only group faces, do not affect shading.
        if (type != tokens.typeFaceSet || material.IsEmpty()) {
            continue;
        }
        const HdOocPTPrimSource source { path, prim.dataSource, mesh.dirtyBits, mesh.warnings };
        state->subsets.push_back({ path, material,
            HdOocPTReadArray(source, { tokens.geomSubset, tokens.indices }, HdOocPTArrayRole::Integers) });
    }
    // Front ends list children in different orders, and a face in several subsets belongs to the first.
    std::sort(state->subsets.begin(), state->subsets.end(),
        [](const HdOocPTSubsetState& a, const HdOocPTSubsetState& b) { return a.path < b.path; });
}

} // namespace

void HdOocPTReadMesh(
    const HdSceneIndexBase& scene, const TfToken& primType, const HdOocPTPrimSource& source, HdOocPTMeshState* state)
{
    const auto& tokens = *HdOocPTSceneTokens;
    HdOocPTReadPrim(source, &state->prim);
    // If UsdImaging made a mesh of a solid, changed points mean that the solid has another size.
    const bool wasSolid = state->shape.kind == HdOocPTShapeState::Kind::Solid;
    if (source.dirtyBits & (HdOocPTDirtyTopology | (wasSolid ? HdOocPTDirtyPoints : 0u))) {
        _ReadTopology(primType, source, state);
    }
    const bool isSolid = state->shape.kind == HdOocPTShapeState::Kind::Solid;
    if ((source.dirtyBits & HdOocPTDirtyPoints) && !isSolid) {
        _ReadPoints(source, state);
        state->widths = primType == tokens.mesh ? HdOocPTPrimvarState()
                                                : HdOocPTReadPrimvar(source, tokens.widths, HdOocPTArrayRole::Scalars);
        if (primType == tokens.basisCurves && _AreLines(source, state->widths)) {
            state->widths = HdOocPTPrimvarState();
        }
    }
    if ((source.dirtyBits & (HdOocPTDirtyPoints | HdOocPTDirtyNormals)) && !isSolid) {
        state->pointMotion = HdOocPTReadPointsMotion(source, primType != tokens.mesh);
    }
    if ((source.dirtyBits & HdOocPTDirtyNormals) && !isSolid) {
        state->normals = HdOocPTReadPrimvar(source, tokens.normals, HdOocPTArrayRole::Vectors3);
    }
    if (source.dirtyBits & HdOocPTDirtyColor) {
        state->displayColor = _ReadDisplay(
            source, tokens.displayColor, tokens.displayColorProperty, HdOocPTArrayRole::Vectors3, *state);
    }
    if (source.dirtyBits & HdOocPTDirtyOpacity) {
        state->displayOpacity = _ReadDisplay(
            source, tokens.displayOpacity, tokens.displayOpacityProperty, HdOocPTArrayRole::Scalars, *state);
    }
    if (source.dirtyBits & HdOocPTDirtyPrimvars) {
        state->primvars = HdOocPTReadOtherPrimvars(
            source, { tokens.points, tokens.widths, tokens.normals, tokens.displayColor, tokens.displayOpacity });
        state->label = HdOocPTReadLabel(source.container);
        state->rayPrimvars = HdOocPTReadRayPrimvars(source.container);
    }
    if (source.dirtyBits & HdOocPTDirtyMaterialBinding) {
        state->material = _ReadMaterial(source.container, source.bindingPurposes);
    }
    if (source.dirtyBits & HdOocPTDirtySubsets) {
        _ReadSubsets(scene, source, state);
    }
    if (source.dirtyBits & HdOocPTDirtyCategories) {
        state->categories = HdOocPTReadCategories(source.container);
    }
}

oocpt::MeshDesc HdOocPTDescribeMesh(const SdfPath& path, const HdOocPTMeshState& state, int32_t primId)
{
    oocpt::MeshDesc desc;
    HdOocPTFillPrim(path, state.prim, &desc.prim);
    desc.prim_id = primId;
    desc.double_sided = state.doubleSided;
    desc.left_handed = state.leftHanded;
    desc.subdivision = _DescribeSubdivision(state);
    desc.face_vertex_counts = HdOocPTHoldArray(state.faceVertexCounts);
    desc.face_vertex_indices = HdOocPTHoldArray(state.faceVertexIndices);
    desc.hole_indices = HdOocPTHoldArray(state.holeIndices);
    desc.points = HdOocPTHoldArray(state.points);
    desc.point_motion = HdOocPTDescribePointsMotion(state.pointMotion);
    desc.shape = HdOocPTDescribeShape(state.shape);
    desc.widths = HdOocPTDescribePrimvar(state.widths);
    desc.normals = HdOocPTDescribePrimvar(state.normals);
    desc.display_color = HdOocPTDescribePrimvar(state.displayColor);
    desc.display_opacity = HdOocPTDescribePrimvar(state.displayOpacity);
    desc.primvars = HdOocPTDescribePrimvars(state.primvars);
    desc.material = HdOocPTText(state.material);
    desc.label = HdOocPTText(state.label);
    for (const auto& [name, value] : state.rayPrimvars) {
        desc.ray_primvars.push_back({ HdOocPTText(name), HdOocPTText(value) });
    }
    desc.prim.visible = desc.prim.visible && !state.pass.isLeftOut;
    desc.pass_hides = state.pass.isHiddenFromCamera;
    desc.pass_is_matte = state.pass.isMatte;
    for (const HdOocPTSubsetState& subset : state.subsets) {
        // The new front end copies the mesh's binding to subsets that have none, such as those that only group faces.
        if (subset.material != state.material) {
            desc.subsets.push_back(
                { HdOocPTText(subset.path), HdOocPTText(subset.material), HdOocPTHoldArray(subset.faces) });
        }
    }
    desc.categories.reserve(state.categories.size());
    for (const TfToken& category : state.categories) {
        desc.categories.push_back(HdOocPTText(category));
    }
    return desc;
}

PXR_NAMESPACE_CLOSE_SCOPE
