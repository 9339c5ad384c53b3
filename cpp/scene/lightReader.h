// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_LIGHT_READER_H
#define HDOOCPT_SCENE_LIGHT_READER_H

#include "pxr/base/tf/token.h"
#include "pxr/pxr.h"
#include "scene/primReader.h"

namespace oocpt {
struct LightDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// The suffix of a mesh's path in the path of its light: MESH_LIGHT of the renderer's core. No prim has such a name.
inline constexpr const char* HdOocPTMeshLightSuffix = "/{light}";

/// Returns true if a mesh is a light too (MeshLightAPI). Both front ends say so in the container "light" of the mesh
/// itself.
bool HdOocPTIsMeshLight(const HdContainerDataSourceHandle& container);

/// Reads a light whole; simple lights (a host's camera light) are distant lights. Unsupported inputs are named in a
/// warning and left out. For the type "mesh" it is the light of the mesh.
oocpt::LightDesc HdOocPTReadLight(const HdOocPTPrimSource& source, const TfToken& type);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
