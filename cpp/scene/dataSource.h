// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_DATA_SOURCE_H
#define HDOOCPT_SCENE_DATA_SOURCE_H

#include "pxr/base/gf/matrix4d.h"
#include "pxr/base/gf/vec3f.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/dataSource.h"
#include "pxr/pxr.h"

#include <initializer_list>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// The data source reached from a container by a path of names; null if there is none (or if container is null). Safe
/// on any thread, as the data sources themselves are.
HdDataSourceBaseHandle HdOocPTFind(const HdContainerDataSourceHandle& container, std::initializer_list<TfToken> names);

/// The container reached from a container by a path of names, as HdOocPTFind().
HdContainerDataSourceHandle HdOocPTFindContainer(
    const HdContainerDataSourceHandle& container, std::initializer_list<TfToken> names);

/// The value of a sampled data source at the frame's own time; empty if there is none.
VtValue HdOocPTSample(const HdDataSourceBaseHandle& source);
VtValue HdOocPTRead(const HdContainerDataSourceHandle& container, std::initializer_list<TfToken> names);

// Convert any number, vector or text type that a value holds. They return false, with the result untouched, if it does
// not fit.
bool HdOocPTConvert(const VtValue& value, bool* result);
bool HdOocPTConvert(const VtValue& value, double* result);
bool HdOocPTConvert(const VtValue& value, float* result);
bool HdOocPTConvert(const VtValue& value, GfVec3f* result);
bool HdOocPTConvert(const VtValue& value, GfMatrix4d* result);
bool HdOocPTConvert(const VtValue& value, TfToken* result);

/// The text that a value holds, of an array its first; empty if it holds none.
std::string HdOocPTReadText(const VtValue& value);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
