// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_TIME_CODES_H
#define HDOOCPT_SCENE_TIME_CODES_H

#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// How many time codes of the stage make a second. Shutters and samples are in time codes, velocities are per second.
struct HdOocPTTimeCodes
{
    double perSecond = 24.0;
    /// Why `perSecond` is a guess; empty where it is known.
    std::string doubt;

    bool operator==(const HdOocPTTimeCodes& other) const
    {
        return perSecond == other.perSecond && doubt == other.doubt;
    }
};

/// The rate of the stage that the scene comes from: what the scene's globals say (scene-index front end); else what a
/// command line of ours has said (HdOocPTSetTimeCodesPerSecond); else that of the layers that are loaded, which is all
/// that the legacy front end leaves, whose scene delegate keeps its stage for itself. Layers that are part of others
/// do not count, nor do those that lack the camera where others have it. The host's thread.
HdOocPTTimeCodes HdOocPTFindTimeCodes(const HdSceneIndexBase& scene, const SdfPath& camera);

/// What a command line of ours knows of the one stage of its process. Any thread.
void HdOocPTSetTimeCodesPerSecond(double rate);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
