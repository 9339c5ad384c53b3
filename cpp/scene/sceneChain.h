// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_SCENE_CHAIN_H
#define HDOOCPT_SCENE_SCENE_CHAIN_H

#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// Chains Hydra's own filters behind the host's scene, for what OocPT does not take directly: cubes, planes, NURBS
/// patches and tetrahedral meshes become meshes, NURBS curves become basis curves; primvars that ext computations
/// produce (UsdSkel) become plain primvars.
HdSceneIndexBaseRefPtr HdOocPTChainSceneIndices(const HdSceneIndexBaseRefPtr& terminal);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
