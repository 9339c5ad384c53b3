// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_MESH_READER_H
#define HDOOCPT_SCENE_MESH_READER_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "scene/motionReader.h"
#include "scene/passCollections.h"
#include "scene/primReader.h"
#include "scene/primvarReader.h"
#include "scene/rayPrimvars.h"
#include "scene/shapeReader.h"

#include <cstdint>
#include <string>
#include <vector>

namespace oocpt {
struct MeshDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// Faces with a material of their own, when they were last read.
struct HdOocPTSubsetState
{
    SdfPath path;
    SdfPath material;
    VtValue faces;
};

/// Rules, creases and corners of a subdivision surface, when they were last read.
struct HdOocPTSubdivisionState
{
    TfToken interpolateBoundary;
    TfToken faceVaryingLinearInterpolation;
    TfToken triangleSubdivisionRule;
    VtValue creaseIndices;
    VtValue creaseLengths;
    VtValue creaseSharpnesses;
    VtValue cornerIndices;
    VtValue cornerSharpnesses;
};

/// The state of a mesh or another prim with a surface when it was last read. The arrays share their data with the
/// scene.
struct HdOocPTMeshState
{
    HdOocPTPrimState prim;
    VtValue faceVertexCounts;
    VtValue faceVertexIndices;
    VtValue holeIndices;
    TfToken subdivisionScheme;
    HdOocPTSubdivisionState subdivision;
    double refineLevel = 0;
    bool leftHanded = false;
    bool doubleSided = false;
    VtValue points;
    HdOocPTPointsMotionState pointMotion;
    HdOocPTShapeState shape;
    HdOocPTPrimvarState widths;
    HdOocPTPrimvarState normals;
    HdOocPTPrimvarState displayColor;
    HdOocPTPrimvarState displayOpacity;
    HdOocPTNamedPrimvars primvars;
    SdfPath material;
    std::vector<HdOocPTSubsetState> subsets;
    TfTokenVector categories;
    std::string label;
    HdOocPTRayPrimvars rayPrimvars;
    HdOocPTPassMarks pass;
};

/// Reads the dirty parts of a mesh, curves, points or a solid of revolution. Its subsets are children of it in `scene`.
void HdOocPTReadMesh(
    const HdSceneIndexBase& scene, const TfToken& primType, const HdOocPTPrimSource& source, HdOocPTMeshState* state);

/// Describes the mesh for Rust.
oocpt::MeshDesc HdOocPTDescribeMesh(const SdfPath& path, const HdOocPTMeshState& state, int32_t primId);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
