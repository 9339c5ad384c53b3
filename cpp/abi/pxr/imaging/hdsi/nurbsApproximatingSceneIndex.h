// SPDX-License-Identifier: Apache-2.0
/// Scene index that turns NURBS patches into meshes of their control points' grid and NURBS curves into basis curves.
#ifndef OOCPT_ABI_HDSI_NURBS_APPROXIMATING_SCENE_INDEX_H
#define OOCPT_ABI_HDSI_NURBS_APPROXIMATING_SCENE_INDEX_H

#include "pxr/imaging/hd/filteringSceneIndex.h"

PXR_NAMESPACE_OPEN_SCOPE

TF_DECLARE_REF_PTRS(HdsiNurbsApproximatingSceneIndex);

class HD_API HdsiNurbsApproximatingSceneIndex : public HdSingleInputFilteringSceneIndexBase
{
public:
    static HdsiNurbsApproximatingSceneIndexRefPtr New(HdSceneIndexBaseRefPtr const& inputSceneIndex);
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
