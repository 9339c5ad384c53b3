// SPDX-License-Identifier: Apache-2.0
/// Scene index that turns spheres, cubes, cones, cylinders, capsules and planes into meshes.
#ifndef OOCPT_ABI_HDSI_IMPLICIT_SURFACE_SCENE_INDEX_H
#define OOCPT_ABI_HDSI_IMPLICIT_SURFACE_SCENE_INDEX_H

#include "pxr/imaging/hd/filteringSceneIndex.h"

PXR_NAMESPACE_OPEN_SCOPE

TF_DECLARE_REF_PTRS(HdsiImplicitSurfaceSceneIndex);

class HD_API HdsiImplicitSurfaceSceneIndex : public HdSingleInputFilteringSceneIndexBase
{
public:
    /// `inputArgs` maps a prim type ("sphere", ...) to the token "toMesh".
    static HdsiImplicitSurfaceSceneIndexRefPtr New(
        HdSceneIndexBaseRefPtr const& inputSceneIndex, HdContainerDataSourceHandle const& inputArgs);
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
