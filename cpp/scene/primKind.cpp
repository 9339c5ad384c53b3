// SPDX-License-Identifier: Apache-2.0
#include "scene/primKind.h"

#include "pxr/base/tf/staticTokens.h"
#include "scene/tokens.h"

#include <unordered_map>

PXR_NAMESPACE_OPEN_SCOPE

TF_DEFINE_PRIVATE_TOKENS(_unsupported,
    /* geometry */
    (nurbsCurves)(nurbsPatch)(tetMesh)(volume)(particleField)
    /* lights */
    (geometryLight)(meshLight)(pluginLight)(portalLight)(lightFilter)
    /* implicit shapes that no filter has turned into meshes */
    (cube)(plane));

namespace {

using _KindMap = std::unordered_map<TfToken, HdOocPTPrimKind, TfToken::HashFunctor>;

_KindMap _MakeKinds()
{
    const auto& tokens = *HdOocPTSceneTokens;
    _KindMap kinds {
        { tokens.mesh, HdOocPTPrimKind::Mesh },
        { tokens.basisCurves, HdOocPTPrimKind::Mesh },
        { tokens.points, HdOocPTPrimKind::Mesh },
        { tokens.sphere, HdOocPTPrimKind::Mesh },
        { tokens.capsule, HdOocPTPrimKind::Mesh },
        { tokens.cylinder, HdOocPTPrimKind::Mesh },
        { tokens.cone, HdOocPTPrimKind::Mesh },
        { tokens.instancer, HdOocPTPrimKind::Instancer },
        { tokens.domeLight, HdOocPTPrimKind::Light },
        { tokens.distantLight, HdOocPTPrimKind::Light },
        { tokens.simpleLight, HdOocPTPrimKind::Light },
        { tokens.rectLight, HdOocPTPrimKind::Light },
        { tokens.sphereLight, HdOocPTPrimKind::Light },
        { tokens.diskLight, HdOocPTPrimKind::Light },
        { tokens.cylinderLight, HdOocPTPrimKind::Light },
        { tokens.geomSubset, HdOocPTPrimKind::GeomSubset },
        { tokens.material, HdOocPTPrimKind::Material },
        { tokens.renderSettings, HdOocPTPrimKind::RenderSettings },
    };
    for (const TfToken& type : _unsupported->allTokens) {
        kinds.emplace(type, HdOocPTPrimKind::Unsupported);
    }
    return kinds;
}

} // namespace

HdOocPTPrimKind HdOocPTKindOfPrim(const TfToken& type)
{
    static const _KindMap kinds = _MakeKinds();
    const auto found = kinds.find(type);
    return found == kinds.end() ? HdOocPTPrimKind::Other : found->second;
}

PXR_NAMESPACE_CLOSE_SCOPE
