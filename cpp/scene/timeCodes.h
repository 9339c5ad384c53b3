// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_TIME_CODES_H
#define HDOOCPT_SCENE_TIME_CODES_H

#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// The number of time codes of the stage per second. Shutters and samples are in time codes, velocities are per second.
struct HdOocPTTimeCodes
{
    double perSecond = 24.0;
    /// The reason why `perSecond` is a guess; empty if it is known.
    std::string doubt;

    bool operator==(const HdOocPTTimeCodes& other) const
    {
        return perSecond == other.perSecond && doubt == other.doubt;
    }
};

/// Finds the rate of the scene's stage: from the scene's globals (scene-index front end); otherwise the one that a
/// command line of ours has set (HdOocPTSetTimeCodesPerSecond); otherwise that of the layers that are loaded, the only
/// source with the legacy front end, whose scene delegate does not give access to its stage. Layers that are part of
/// others do not count, nor do those that lack the camera if others have it. The host's thread.
HdOocPTTimeCodes HdOocPTFindTimeCodes(const HdSceneIndexBase& scene, const SdfPath& camera);

/// Sets the rate of the one stage of a command line's process. Any thread.
void HdOocPTSetTimeCodesPerSecond(double rate);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
