// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_MATERIAL_READER_H
#define HDOOCPT_SCENE_MATERIAL_READER_H

#include "pxr/pxr.h"
#include "scene/primReader.h"

namespace oocpt {
struct MaterialDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// Reads the networks of a material's terminals, whole: nodes, authored inputs, connections. Each terminal is that of
/// the MaterialX context or, if that has none, of the universal one. Which nodes and inputs are supported is not
/// decided here.
oocpt::MaterialDesc HdOocPTReadMaterial(const HdOocPTPrimSource& source);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
