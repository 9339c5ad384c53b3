// SPDX-License-Identifier: Apache-2.0
// Limit surfaces of subdivision meshes, through OpenSubdiv's Bfr. Called from the crate `oocpt-subdiv` only.
//
// The crate has checked everything that it passes. Any thread; objects are immutable. Errors are exceptions, which cxx
// turns into results.
#pragma once

#include "rust/cxx.h"

#include <opensubdiv/bfr/refinerSurfaceFactory.h>
#include <opensubdiv/far/topologyRefiner.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <vector>

namespace oocpt::subdiv {

struct FaceCut;
struct SchemeRules;
struct MeshTopology;
struct SurfaceValues;

/// Triangles on some faces of a limit surface. A vertex has a position, a normal (zero if the surface has none there)
/// and values; where normals or values differ from face to face, several vertices have the same position.
class Facets
{
public:
    rust::Slice<const float> positions() const { return _Slice(positionData); }
    rust::Slice<const float> normals() const { return _Slice(normalData); }
    rust::Slice<const float> vertex() const { return _Slice(vertexData); }
    rust::Slice<const float> varying() const { return _Slice(varyingData); }
    rust::Slice<const float> face_varying() const { return _Slice(faceVaryingData); }
    rust::Slice<const int32_t> triangles() const { return _Slice(triangleData); }
    rust::Slice<const int32_t> faces() const { return _Slice(faceData); }
    rust::Slice<const int32_t> sites() const { return _Slice(siteData); }

    std::vector<float> positionData;
    std::vector<float> normalData;
    std::vector<float> vertexData;
    std::vector<float> varyingData;
    std::vector<float> faceVaryingData;
    std::vector<int32_t> triangleData;
    /// Control face of each triangle.
    std::vector<int32_t> faceData;
    /// For each vertex the site that faces share: a control vertex or a place of an edge; -1 inside of faces.
    std::vector<int32_t> siteData;

private:
    template <typename T>
    static rust::Slice<const T> _Slice(const std::vector<T>& values)
    {
        return { values.data(), values.size() };
    }
};

/// The surface of a control mesh.
class LimitSurface
{
public:
    LimitSurface(const SchemeRules& rules, const MeshTopology& topology);

    rust::Slice<const int32_t> edges() const { return { _edges.data(), _edges.size() }; }
    /// Estimates the number of triangles that rates give in each face.
    void expected_facets(rust::Slice<const int32_t> rates, rust::Slice<uint64_t> facets) const;
    std::unique_ptr<Facets> tessellate(const FaceCut& cut, const SurfaceValues& values) const;

private:
    /// The cache of irregular neighbourhoods, shared by all threads.
    using _Cache = OpenSubdiv::Bfr::SurfaceFactoryCacheThreaded<std::shared_mutex, std::shared_lock<std::shared_mutex>,
        std::unique_lock<std::shared_mutex>>;

    std::unique_ptr<OpenSubdiv::Far::TopologyRefiner> _refiner;
    std::unique_ptr<OpenSubdiv::Bfr::RefinerSurfaceFactory<_Cache>> _factory;
    std::vector<int32_t> _edges;
    size_t _channelCount;
};

std::unique_ptr<LimitSurface> new_limit_surface(SchemeRules rules, const MeshTopology& topology);

} // namespace oocpt::subdiv
