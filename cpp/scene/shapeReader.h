// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_SHAPE_READER_H
#define HDOOCPT_SCENE_SHAPE_READER_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"
#include "scene/primReader.h"
#include "scene/primvarReader.h"

#include <cstdint>
#include <initializer_list>

namespace oocpt {
struct ShapeDesc;
}

PXR_NAMESPACE_OPEN_SCOPE

/// What the points of a prim are, as last read.
struct HdOocPTShapeState
{
    enum class Kind
    {
        Mesh,
        Curves,
        Points
    };
    Kind kind = Kind::Mesh;
    /// Of curves: linear or cubic, and how points make them.
    TfToken type;
    TfToken basis;
    TfToken wrap;
    VtValue counts;
    VtValue indices;
};

/// True for prims whose points, widths and curves HdOocPTReadShape makes: spheres, capsules.
bool HdOocPTIsExactShape(const TfToken& primType);

/// Reads what the points of curves, points, a sphere or a capsule are. Spheres and capsules are a ball and a tube, and
/// are drawn as what they are: `points` and `widths` are set for them.
void HdOocPTReadShape(const TfToken& primType, const HdOocPTPrimSource& source, HdOocPTShapeState* state,
    VtValue* points, HdOocPTPrimvarState* widths);

/// The place of a token in a list, which is how variants are named to Rust.
uint8_t HdOocPTPlaceOf(const TfToken& name, std::initializer_list<TfToken> names, uint8_t fallback);

/// The shape as it goes to Rust.
oocpt::ShapeDesc HdOocPTDescribeShape(const HdOocPTShapeState& state);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
