// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_PRIM_KIND_H
#define HDOOCPT_SCENE_PRIM_KIND_H

#include "pxr/base/tf/token.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// What OocPT does with a prim type.
enum class HdOocPTPrimKind
{
    /// Nothing: a group, a camera…
    Other,
    /// A mesh, curves, points, a solid of revolution.
    Mesh,
    /// Faces of the mesh above it.
    GeomSubset,
    Instancer,
    Light,
    Material,
    RenderSettings,
    /// It would be seen in the picture, but there is no code for it yet.
    Unsupported,
};

HdOocPTPrimKind HdOocPTKindOfPrim(const TfToken& type);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
