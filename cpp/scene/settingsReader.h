// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_SETTINGS_READER_H
#define HDOOCPT_SCENE_SETTINGS_READER_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
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

/// The namespaced settings of a render settings prim. Empty unless the prim is the one that the scene's globals name as
/// active; where a host has no globals, unless the prim calls itself active.
HdOocPTSettingMap HdOocPTReadRenderSettings(const HdSceneIndexBase& scene, const SdfPath& path);

/// Returns true if a render settings prim, if it is the active one, turns motion blur off: disableMotionBlur, or
/// instantaneousShutter, of itself or of all its products.
bool HdOocPTReadsMotionDisabled(const HdSceneIndexBase& scene, const SdfPath& path);

/// Returns true if it turns the lens off: disableDepthOfField, of itself or of all its products.
bool HdOocPTReadsLensDisabled(const HdSceneIndexBase& scene, const SdfPath& path);

/// What the active render settings prim says of purposes and colours.
struct HdOocPTPurposes
{
    /// The prim; empty if none is active.
    SdfPath settings;
    std::optional<TfTokenVector> included;
    /// Purposes of material bindings, the one that counts most first.
    std::optional<TfTokenVector> bindings;
    /// The front end hands over one binding a prim.
    bool isNamedByDelegate = false;
    TfToken colorSpace;

    bool operator==(const HdOocPTPurposes& other) const
    {
        return settings == other.settings && included == other.included && bindings == other.bindings
            && isNamedByDelegate == other.isNamedByDelegate && colorSpace == other.colorSpace;
    }
};

/// Of the active one of these render settings prims.
HdOocPTPurposes HdOocPTReadPurposes(const HdSceneIndexBase& scene, const std::set<SdfPath>& prims);

/// Says what of them is not used.
void HdOocPTWarnOfPurposes(const HdOocPTPurposes& purposes, HdOocPTWarnings* warnings);

/// The purposes that the settings include and the render tags of the host do not, or the other way round.
std::set<TfToken> HdOocPTFindDisputedPurposes(const HdOocPTPurposes& purposes, const TfTokenVector& renderTags);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
