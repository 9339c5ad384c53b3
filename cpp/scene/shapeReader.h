// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_SHAPE_READER_H
#define HDOOCPT_SCENE_SHAPE_READER_H

#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"
#include "scene/primReader.h"

#include <cstdint>
#include <initializer_list>
#include <vector>

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
        Points,
        /// None: a solid of revolution, which Rust gives some.
        Solid
    };
    Kind kind = Kind::Mesh;
    /// Of curves: linear or cubic, and how points make them.
    TfToken type;
    TfToken basis;
    TfToken wrap;
    VtValue counts;
    VtValue indices;
    /// Of a solid, four numbers each: part of the shutter, radii at the lower and the upper end, height. First what it
    /// is at the frame's own time.
    std::vector<double> sizes;
    /// Of a solid: 0 x, 1 y, 2 z.
    uint8_t axis = 2;
    /// Of a solid: half balls end it.
    bool isRound = false;
};

/// True for spheres, capsules, cylinders and cones.
bool HdOocPTIsSolid(const TfToken& primType);

/// The type of the solid that UsdImaging's scene delegate made a mesh with these faces of; empty where it is a mesh in
/// USD, too, or where nobody knows.
TfToken HdOocPTFindSolid(const HdOocPTPrimSource& source, const VtValue& faceVertexCounts);

/// Reads what the points of curves, points or a solid are.
void HdOocPTReadShape(const TfToken& primType, const HdOocPTPrimSource& source, HdOocPTShapeState* state);

/// The place of a token in a list, which is how variants are named to Rust.
uint8_t HdOocPTPlaceOf(const TfToken& name, std::initializer_list<TfToken> names, uint8_t fallback);

/// The shape as it goes to Rust.
oocpt::ShapeDesc HdOocPTDescribeShape(const HdOocPTShapeState& state);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
