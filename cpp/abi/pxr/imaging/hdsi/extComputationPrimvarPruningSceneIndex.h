// SPDX-License-Identifier: Apache-2.0
/// Scene index that runs ext computations on the CPU and offers their outputs as plain primvars.
#ifndef OOCPT_ABI_HDSI_EXT_COMPUTATION_PRIMVAR_PRUNING_SCENE_INDEX_H
#define OOCPT_ABI_HDSI_EXT_COMPUTATION_PRIMVAR_PRUNING_SCENE_INDEX_H

#include "pxr/imaging/hd/filteringSceneIndex.h"

PXR_NAMESPACE_OPEN_SCOPE

/// The capital I is the runtime's own spelling.
class HD_API HdSiExtComputationPrimvarPruningSceneIndex : public HdSingleInputFilteringSceneIndexBase
{
public:
    static HdSceneIndexBaseRefPtr New(HdSceneIndexBaseRefPtr const& inputSceneIndex);
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
