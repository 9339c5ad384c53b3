// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_SETTINGS_READER_H
#define HDOOCPT_SCENE_SETTINGS_READER_H

#include "pxr/base/gf/range2d.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/dataSource.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "scene/warnings.h"

#include <map>
#include <optional>
#include <set>

PXR_NAMESPACE_OPEN_SCOPE

/// Settings by key, in a fixed order.
using HdOocPTSettingMap = std::map<TfToken, VtValue>;

/// The render settings at a path, if they are the active ones.
HdContainerDataSourceHandle HdOocPTFindActiveSettings(const HdSceneIndexBase& scene, const SdfPath& path);

/// The namespaced settings of a render settings prim. Empty unless the prim is the one that the scene's globals name as
/// active; for a host without globals, unless the prim itself says that it is active.
HdOocPTSettingMap HdOocPTReadRenderSettings(const HdSceneIndexBase& scene, const SdfPath& path);

/// Returns true if a render settings prim is the active one and turns motion blur off: disableMotionBlur, or
/// instantaneousShutter, of itself or of all its products.
bool HdOocPTReadsMotionDisabled(const HdSceneIndexBase& scene, const SdfPath& path);

/// Returns true if a render settings prim is the active one and turns the lens off: disableDepthOfField, of itself or
/// of all its products.
bool HdOocPTReadsLensDisabled(const HdSceneIndexBase& scene, const SdfPath& path);

/// The part of the picture that a render settings prim asks for if it is the active one, y up, 0 to 1 over the picture:
/// its dataWindowNDC or, as there is one picture here, the range of those of all its products. None: all of it. A range
/// that is not finite is ignored with a warning.
std::optional<GfRange2d> HdOocPTReadDataWindow(
    const HdSceneIndexBase& scene, const SdfPath& path, HdOocPTWarnings* warnings);

/// The purposes and colours of the active render settings prim.
struct HdOocPTPurposes
{
    /// The prim; empty if none is active.
    SdfPath settings;
    std::optional<TfTokenVector> included;
    /// Purposes of material bindings, the most important one first.
    std::optional<TfTokenVector> bindings;
    /// True if the front end provides one binding a prim.
    bool isNamedByDelegate = false;
    TfToken colorSpace;

    bool operator==(const HdOocPTPurposes& other) const
    {
        return settings == other.settings && included == other.included && bindings == other.bindings
            && isNamedByDelegate == other.isNamedByDelegate && colorSpace == other.colorSpace;
    }
};

/// Reads the purposes of the active one of these render settings prims.
HdOocPTPurposes HdOocPTReadPurposes(const HdSceneIndexBase& scene, const std::set<SdfPath>& prims);

/// Warns of those that are not used.
void HdOocPTWarnOfPurposes(const HdOocPTPurposes& purposes, HdOocPTWarnings* warnings);

/// The purposes that the settings include and the render tags of the host do not, or the other way round.
std::set<TfToken> HdOocPTFindDisputedPurposes(const HdOocPTPurposes& purposes, const TfTokenVector& renderTags);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
