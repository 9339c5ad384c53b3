// SPDX-License-Identifier: Apache-2.0
/// Scene index that turns tetrahedral meshes into the triangles of their surface.
#ifndef OOCPT_ABI_HDSI_TET_MESH_CONVERSION_SCENE_INDEX_H
#define OOCPT_ABI_HDSI_TET_MESH_CONVERSION_SCENE_INDEX_H

#include "pxr/imaging/hd/filteringSceneIndex.h"

PXR_NAMESPACE_OPEN_SCOPE

TF_DECLARE_REF_PTRS(HdsiTetMeshConversionSceneIndex);

class HD_API HdsiTetMeshConversionSceneIndex : public HdSingleInputFilteringSceneIndexBase
{
public:
    static HdsiTetMeshConversionSceneIndexRefPtr New(HdSceneIndexBaseRefPtr const& inputSceneIndex);
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
