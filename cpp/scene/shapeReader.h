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

/// The points of a prim and their meaning, when they were last read.
struct HdOocPTShapeState
{
    enum class Kind
    {
        Mesh,
        Curves,
        Points,
        /// A solid of revolution, without points of its own; Rust generates some.
        Solid
    };
    Kind kind = Kind::Mesh;
    /// The type of curves: linear or cubic, and their basis.
    TfToken type;
    TfToken basis;
    TfToken wrap;
    VtValue counts;
    VtValue indices;
    /// The size of a solid, four numbers each: fraction of the shutter interval, radii at the lower and the upper end,
    /// height. The first entry is for the frame's own time.
    std::vector<double> sizes;
    /// The axis of a solid: 0 x, 1 y, 2 z.
    uint8_t axis = 2;
    /// True if half balls end the solid.
    bool isRound = false;
};

/// Returns true for spheres, capsules, cylinders and cones.
bool HdOocPTIsSolid(const TfToken& primType);

/// The type of the solid from which UsdImaging's scene delegate made a mesh with these faces; empty if it is a mesh in
/// USD, too, or if that is not known.
TfToken HdOocPTFindSolid(const HdOocPTPrimSource& source, const VtValue& faceVertexCounts);

/// Reads the points of curves, points or a solid.
void HdOocPTReadShape(const TfToken& primType, const HdOocPTPrimSource& source, HdOocPTShapeState* state);

/// The index of a token in a list, which is how variants are passed to Rust.
uint8_t HdOocPTPlaceOf(const TfToken& name, std::initializer_list<TfToken> names, uint8_t fallback);

/// Describes the shape for Rust.
oocpt::ShapeDesc HdOocPTDescribeShape(const HdOocPTShapeState& state);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
