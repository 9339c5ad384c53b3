// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_MESH_READER_H
#define HDOOCPT_SCENE_MESH_READER_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"
#include "scene/primReader.h"

#include <cstdint>

namespace oocpt {
struct MeshDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// A primvar as last read; empty values mean absent.
struct HdOocPTPrimvarState
{
    TfToken interpolation;
    VtValue values;
    VtValue indices;
};

/// A mesh as last read. The arrays share their data with the scene.
struct HdOocPTMeshState
{
    HdOocPTPrimState prim;
    VtValue faceVertexCounts;
    VtValue faceVertexIndices;
    VtValue holeIndices;
    TfToken subdivisionScheme;
    bool leftHanded = false;
    bool doubleSided = false;
    VtValue points;
    HdOocPTPrimvarState normals;
    HdOocPTPrimvarState displayColor;
    HdOocPTPrimvarState displayOpacity;
};

/// Reads the dirty parts of a mesh.
void HdOocPTReadMesh(const HdOocPTPrimSource& source, HdOocPTMeshState* state);

/// The mesh as it goes to Rust.
oocpt::MeshDesc HdOocPTDescribeMesh(const SdfPath& path, const HdOocPTMeshState& state, int32_t primId);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
