// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_NODE_DEFINITION_H
#define HDOOCPT_SCENE_NODE_DEFINITION_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/dataSource.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// The definition of a node of a material network.
struct HdOocPTNodeDefinition
{
    /// Its identifier, or that of a MaterialX definition in `file`; empty if the host knows none.
    TfToken name;
    /// An SdfAssetPath to the MaterialX document that has the definition, or empty: then the host's libraries have it.
    VtValue file;
};

/// Reads the definition of a node. Documents of MaterialX with definitions of their own come as
/// `info:mtlx:sourceAsset`: front ends that pass on what is authored have it in the node's `nodeTypeInfo`; others ask
/// OpenUSD's registry of shaders, and name the node by its result, `number<definition><mtlx>`. Any thread.
HdOocPTNodeDefinition HdOocPTFindNodeDefinition(const HdContainerDataSourceHandle& node);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
