// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_INSTANCER_READER_H
#define HDOOCPT_SCENE_INSTANCER_READER_H

#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"
#include "scene/links.h"
#include "scene/primReader.h"
#include "scene/primvarReader.h"

#include <utility>
#include <vector>

namespace oocpt {
struct InstancerDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// The state of an instancer when it was last read. The arrays share their data with the scene.
struct HdOocPTInstancerState
{
    HdOocPTPrimState prim;
    /// Prototype root and the numbers of its instances.
    std::vector<std::pair<SdfPath, VtValue>> prototypes;
    VtValue mask;
    VtValue translations;
    VtValue rotations;
    VtValue scales;
    VtValue transforms;
    HdOocPTInstancerMotionState motion;
    /// All other primvars with a value per instance.
    HdOocPTNamedPrimvars primvars;
    /// Set by the caller, who knows the lights.
    HdOocPTInstanceLinks links;
};

/// Reads the dirty parts of an instancer.
void HdOocPTReadInstancer(const HdSceneIndexBase& scene, const HdOocPTPrimSource& source, HdOocPTInstancerState* state);

/// Describes the instancer for Rust.
oocpt::InstancerDesc HdOocPTDescribeInstancer(const SdfPath& path, const HdOocPTInstancerState& state);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
