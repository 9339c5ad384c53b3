// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_SETTINGS_READER_H
#define HDOOCPT_SCENE_SETTINGS_READER_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <map>

PXR_NAMESPACE_OPEN_SCOPE

/// Settings by key, in a fixed order.
using HdOocPTSettingMap = std::map<TfToken, VtValue>;

/// The namespaced settings of a render settings prim. Empty unless the prim is the one that the scene's globals name as
/// active; where a host has no globals, unless the prim calls itself active.
HdOocPTSettingMap HdOocPTReadRenderSettings(const HdSceneIndexBase& scene, const SdfPath& path);

/// Whether a render settings prim, if it is the active one, turns motion blur off: disableMotionBlur, or
/// instantaneousShutter, of itself or of all its products.
bool HdOocPTReadsMotionDisabled(const HdSceneIndexBase& scene, const SdfPath& path);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
