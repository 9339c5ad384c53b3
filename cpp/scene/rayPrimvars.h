// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_RAY_PRIMVARS_H
#define HDOOCPT_SCENE_RAY_PRIMVARS_H

#include "pxr/imaging/hd/dataSource.h"
#include "pxr/pxr.h"

#include <string>
#include <utility>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// Names and values, as text.
using HdOocPTRayPrimvars = std::vector<std::pair<std::string, std::string>>;

/// The primvars by which renderers say which kinds of rays see a prim, and whether it is a matte; of arrays the first
/// element. Those that are not constant for the prim do not count. The renderer names them and says what they mean. Any
/// thread.
HdOocPTRayPrimvars HdOocPTReadRayPrimvars(const HdContainerDataSourceHandle& container);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
