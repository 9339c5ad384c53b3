// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_LABEL_READER_H
#define HDOOCPT_SCENE_LABEL_READER_H

#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/dataSource.h"
#include "pxr/pxr.h"

#include <string>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// The label of a light or a surface in light path expressions, which is its light group, by the first of the primvars
/// that OocPT, RenderMan, Karma and Arnold have for it; empty if there is none. Lights have inputs for it, too
/// (lightReader.cpp). Any thread.
std::string HdOocPTReadLabel(const HdContainerDataSourceHandle& container);

/// The texts of a primvar, by the number of an instance if it is one of an instancer, else a single one; empty if there
/// are none, or none that are for the whole prim or for its instances. Any thread.
std::vector<std::string> HdOocPTReadTexts(
    const HdContainerDataSourceHandle& container, const TfToken& name, bool isOfInstances);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
