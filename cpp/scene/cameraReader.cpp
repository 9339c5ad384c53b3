// SPDX-License-Identifier: Apache-2.0
#include "scene/cameraReader.h"

#include "scene/dataSource.h"
#include "scene/tokens.h"

#include <cmath>

PXR_NAMESPACE_OPEN_SCOPE

HdOocPTLens HdOocPTReadLens(const HdSceneIndexBase& scene, const SdfPath& path)
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdContainerDataSourceHandle camera
        = path.IsEmpty() ? nullptr : HdOocPTFindContainer(scene.GetPrim(path).dataSource, { tokens.camera });
    const auto number = [&](const TfToken& name) {
        double value = 0.0;
        HdOocPTConvert(HdOocPTRead(camera, { name }), &value);
        return value;
    };
    TfToken projection;
    HdOocPTConvert(HdOocPTRead(camera, { tokens.projection }), &projection);
    const double stop = number(tokens.fStop);
    const double radius = stop > 0.0 ? number(tokens.focalLength) / (2.0 * stop) : 0.0;
    const double focusDistance = number(tokens.focusDistance);
    const bool hasLens = projection != tokens.orthographic && std::isfinite(radius) && radius > 0.0
        && std::isfinite(focusDistance) && focusDistance > 0.0;
    return hasLens ? HdOocPTLens { radius, focusDistance } : HdOocPTLens {};
}

PXR_NAMESPACE_CLOSE_SCOPE
