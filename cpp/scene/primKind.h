// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_PRIM_KIND_H
#define HDOOCPT_SCENE_PRIM_KIND_H

#include "pxr/base/tf/token.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// The treatment of a prim type by OocPT.
enum class HdOocPTPrimKind
{
    /// Not rendered: a group, a camera…
    Other,
    /// A mesh, curves, points, a solid of revolution.
    Mesh,
    /// Faces of the mesh above it.
    GeomSubset,
    Instancer,
    Light,
    Material,
    RenderSettings,
    /// A visible prim that is not supported yet.
    Unsupported,
};

HdOocPTPrimKind HdOocPTKindOfPrim(const TfToken& type);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
