// SPDX-License-Identifier: Apache-2.0
#include "subdiv/limitSurface.h"

#include "oocpt-subdiv/src/ffi.rs.h"
#include "subdiv/siteTable.h"

#include <opensubdiv/bfr/refinerSurfaceFactory.h>
#include <opensubdiv/bfr/surface.h>
#include <opensubdiv/bfr/tessellation.h>
#include <opensubdiv/far/error.h>
#include <opensubdiv/far/topologyDescriptor.h>
#include <opensubdiv/far/topologyRefinerFactory.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <string>

namespace oocpt::subdiv {

namespace {

namespace Bfr = OpenSubdiv::Bfr;
namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

/// Levels of refinement around extraordinary vertices and semi-sharp features before a patch replaces the limit:
/// OpenSubdiv's own choice for sharp ones, one more for smooth ones.
constexpr int _smoothLevel = 3;
constexpr int _sharpLevel = 6;
/// Normals with a larger cosine are merged.
constexpr double _sameNormal = 1.0 - 1e-4;
/// Values that differ by less than this share of their size are merged.
constexpr float _sameValue = 1e-4F;
constexpr int32_t _none = SiteTable::none;

/// OpenSubdiv reports errors to one function for the whole process; the calls also fail, so it can ignore them.
void _Ignore(Far::ErrorType, const char*) { }

void _Silence()
{
    static std::once_flag once;
    std::call_once(once, [] {
        Far::SetErrorCallback(_Ignore);
        Far::SetWarningCallback([](const char*) {});
    });
}

/// The surface of one kind of value over a face, with room for its points.
template <typename Real>
struct _Patch
{
    Bfr::Surface<Real> surface;
    std::vector<Real> points;
    int width = 0;

    void Prepare(const Real* values)
    {
        points.resize(static_cast<size_t>(surface.GetNumPatchPoints()) * width);
        surface.PreparePatchPoints(values, width, points.data(), width);
    }

    void Evaluate(const Real* coord, Real* value) const { surface.Evaluate(coord, points.data(), width, value); }
};

bool _AreSame(const float* a, const float* b, size_t count)
{
    for (size_t k = 0; k < count; ++k) {
        // NaN equals nothing, and gets a vertex of its own.
        if (!(std::abs(a[k] - b[k]) <= _sameValue * (1.0F + std::abs(a[k])))) {
            return false;
        }
    }
    return true;
}

/// Number of sites on the outlines of faces, those that faces share counted for each.
size_t _CountSites(const Far::TopologyLevel& level, const FaceCut& cut)
{
    size_t count = 0;
    for (int face = cut.first_face; face < cut.end_face; ++face) {
        const auto edges = level.GetFaceEdges(face);
        for (int k = 0; k < edges.size(); ++k) {
            count += static_cast<size_t>(cut.rates[static_cast<size_t>(edges[k])]);
        }
    }
    return count;
}

/// One tessellation under way.
class _Tessellator
{
public:
    _Tessellator(const Far::TopologyRefiner& refiner, const Bfr::SurfaceFactory& factory, size_t channels,
        const FaceCut& cut, const SurfaceValues& values, Facets* facets)
        : _level(refiner.GetLevel(0))
        , _factory(factory)
        , _scheme(refiner.GetSchemeType())
        , _cut(cut)
        , _facets(facets)
        , _positions(values.positions)
        , _vertex(values.vertex)
        , _varying(values.varying)
        , _channels(channels)
        , _sites(_CountSites(_level, cut))
    {
        _position.width = 3;
        _vertexPatch.width = values.vertex_width;
        _varyingPatch.width = values.varying_width;
        size_t at = 0;
        for (size_t channel = 0; channel < channels; ++channel) {
            const int width = values.face_varying_widths[channel];
            _channels[channel].width = width;
            _channelValues.push_back(values.face_varying.data() + at);
            _channelIds.push_back(static_cast<Bfr::SurfaceFactory::FVarID>(channel));
            _channelWidth += static_cast<size_t>(width);
            at += static_cast<size_t>(refiner.GetNumFVarValuesTotal(static_cast<int>(channel))) * width;
        }
    }

    void AddAll()
    {
        for (int face = _cut.first_face; face < _cut.end_face; ++face) {
            _AddFace(face);
        }
    }

private:
    bool _Init(int face)
    {
        if (!_factory.FaceHasLimitSurface(face) || !_factory.InitVertexSurface(face, &_position.surface)) {
            return false;
        }
        _position.Prepare(_positions.data());
        if (_vertexPatch.width > 0) {
            if (!_factory.InitVertexSurface(face, &_vertexPatch.surface)) {
                return false;
            }
            _vertexPatch.Prepare(_vertex.data());
        }
        if (_varyingPatch.width > 0) {
            if (!_factory.InitVaryingSurface(face, &_varyingPatch.surface)) {
                return false;
            }
            _varyingPatch.Prepare(_varying.data());
        }
        for (size_t k = 0; k < _channels.size(); ++k) {
            if (!_factory.InitFaceVaryingSurface(face, &_channels[k].surface, _channelIds[k])) {
                return false;
            }
            _channels[k].Prepare(_channelValues[k]);
        }
        return true;
    }

    void _AddFace(int face)
    {
        const auto edges = _level.GetFaceEdges(face);
        const auto corners = _level.GetFaceVertices(face);
        if (!_Init(face)) {
            return;
        }
        _faceRates.clear();
        for (int k = 0; k < edges.size(); ++k) {
            _faceRates.push_back(_cut.rates[static_cast<size_t>(edges[k])]);
        }
        const Bfr::Parameterization parameters(_scheme, corners.size());
        Bfr::Tessellation::Options options;
        const Bfr::Tessellation pattern(parameters, static_cast<int>(_faceRates.size()), _faceRates.data(), options);
        if (!pattern.IsValid()) {
            throw std::runtime_error("a face cannot be tessellated");
        }
        _coords.resize(static_cast<size_t>(pattern.GetNumCoords()) * 2);
        pattern.GetCoords(_coords.data());
        _vertices.clear();
        for (int k = 0; k < corners.size(); ++k) {
            _AddAt(corners[k]);
            const int rate = _faceRates[k];
            const bool isForward = _level.GetEdgeVertices(edges[k])[0] == corners[k];
            for (int step = 1; step < rate; ++step) {
                _AddAt(_cut.edge_sites[static_cast<size_t>(edges[k])] + (isForward ? step : rate - step) - 1);
            }
        }
        const size_t boundary = _vertices.size();
        for (int k = static_cast<int>(boundary); k < pattern.GetNumCoords(); ++k) {
            _EvaluateNext();
            _vertices.push_back(_Push(_at.position, _none));
        }
        _facetData.resize(static_cast<size_t>(pattern.GetNumFacets()) * 3);
        pattern.GetFacets(_facetData.data());
        for (size_t k = 0; k + 2 < _facetData.size(); k += 3) {
            for (size_t corner = 0; corner < 3; ++corner) {
                _facets->triangleData.push_back(_vertices[static_cast<size_t>(_facetData[k + corner])]);
            }
            _facets->faceData.push_back(face);
        }
    }

    /// Evaluates everything at the coordinate after those of `_vertices`.
    void _EvaluateNext()
    {
        const double* coord = _coords.data() + _vertices.size() * 2;
        double du[3];
        double dv[3];
        double position[3];
        _position.surface.Evaluate(coord, _position.points.data(), 3, position, du, dv);
        const double cross[3]
            = { du[1] * dv[2] - du[2] * dv[1], du[2] * dv[0] - du[0] * dv[2], du[0] * dv[1] - du[1] * dv[0] };
        const double length = std::sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]);
        const double lengths = std::sqrt(du[0] * du[0] + du[1] * du[1] + du[2] * du[2])
            * std::sqrt(dv[0] * dv[0] + dv[1] * dv[1] + dv[2] * dv[2]);
        // Where derivatives vanish or are parallel there is no normal: 1e-9 of their product is rounding.
        const bool hasNormal = length > 1e-9 * lengths && length > std::numeric_limits<double>::min();
        for (int k = 0; k < 3; ++k) {
            _at.position[k] = static_cast<float>(position[k]);
            _at.normal[k] = hasNormal ? static_cast<float>(cross[k] / length) : 0.0F;
        }
        const float single[2] = { static_cast<float>(coord[0]), static_cast<float>(coord[1]) };
        _at.vertex.resize(static_cast<size_t>(_vertexPatch.width));
        if (_vertexPatch.width > 0) {
            _vertexPatch.Evaluate(single, _at.vertex.data());
        }
        _at.varying.resize(static_cast<size_t>(_varyingPatch.width));
        if (_varyingPatch.width > 0) {
            _varyingPatch.Evaluate(single, _at.varying.data());
        }
        _at.faceVarying.resize(_channelWidth);
        size_t at = 0;
        for (const _Patch<float>& channel : _channels) {
            channel.Evaluate(single, _at.faceVarying.data() + at);
            at += static_cast<size_t>(channel.width);
        }
    }

    /// Adds the vertex of the next coordinate, at a site that faces share: an existing one if its normal and values are
    /// the same, otherwise a new one with the position of the first.
    void _AddAt(int32_t site)
    {
        _EvaluateNext();
        int32_t& head = _sites[site];
        const int32_t first = head;
        int32_t vertex = first;
        while (vertex != _none && !_IsLike(static_cast<size_t>(vertex))) {
            vertex = _next[vertex];
        }
        if (vertex == _none) {
            vertex = _Push(
                first == _none ? _at.position : _facets->positionData.data() + 3 * static_cast<size_t>(first), site);
            // The first vertex stays at the head: all others have its position.
            if (first == _none) {
                head = vertex;
            } else {
                _next[vertex] = _next[first];
                _next[first] = vertex;
            }
        }
        _vertices.push_back(vertex);
    }

    bool _IsLike(size_t vertex) const
    {
        const float* normal = _facets->normalData.data() + 3 * vertex;
        double cosine = 0.0;
        double square = 0.0;
        for (int k = 0; k < 3; ++k) {
            cosine += static_cast<double>(normal[k]) * _at.normal[k];
            square += static_cast<double>(normal[k]) * normal[k];
        }
        const bool hasNormal = _at.normal[0] != 0.0F || _at.normal[1] != 0.0F || _at.normal[2] != 0.0F;
        if (hasNormal != (square > 0.0) || (hasNormal && cosine < _sameNormal)) {
            return false;
        }
        // Vertex and varying values belong to the site; only face-varying ones can differ.
        return _AreSame(
            _facets->faceVaryingData.data() + vertex * _channelWidth, _at.faceVarying.data(), _channelWidth);
    }

    /// Adds a vertex at `position`, at a site that faces share or `_none`, with the normal and values of `_at`.
    int32_t _Push(const float* position, int32_t site)
    {
        const float copy[3] = { position[0], position[1], position[2] };
        const size_t count = _next.size();
        if (count >= static_cast<size_t>(std::numeric_limits<int32_t>::max())) {
            throw std::length_error("more vertices than can be numbered");
        }
        const auto append
            = [](std::vector<float>* to, const float* from, size_t size) { to->insert(to->end(), from, from + size); };
        append(&_facets->positionData, copy, 3);
        append(&_facets->normalData, _at.normal, 3);
        append(&_facets->vertexData, _at.vertex.data(), _at.vertex.size());
        append(&_facets->varyingData, _at.varying.data(), _at.varying.size());
        append(&_facets->faceVaryingData, _at.faceVarying.data(), _at.faceVarying.size());
        _facets->siteData.push_back(site);
        _next.push_back(_none);
        return static_cast<int32_t>(count);
    }

    const Far::TopologyLevel& _level;
    const Bfr::SurfaceFactory& _factory;
    Sdc::SchemeType _scheme;
    const FaceCut& _cut;
    Facets* _facets;
    rust::Slice<const double> _positions;
    rust::Slice<const float> _vertex;
    rust::Slice<const float> _varying;
    std::vector<const float*> _channelValues;
    std::vector<Bfr::SurfaceFactory::FVarID> _channelIds;
    size_t _channelWidth = 0;

    _Patch<double> _position;
    _Patch<float> _vertexPatch;
    _Patch<float> _varyingPatch;
    std::vector<_Patch<float>> _channels;

    SiteTable _sites;
    /// The next vertex of the same site.
    std::vector<int32_t> _next;

    // Rates of the current face.
    std::vector<int> _faceRates;
    std::vector<double> _coords;
    std::vector<int32_t> _vertices;
    std::vector<int> _facetData;
    struct
    {
        float position[3];
        float normal[3];
        std::vector<float> vertex;
        std::vector<float> varying;
        std::vector<float> faceVarying;
    } _at {};
};

} // namespace

LimitSurface::LimitSurface(const SchemeRules& rules, const MeshTopology& topology)
    : _channelCount(topology.channel_counts.size())
{
    _Silence();
    Sdc::Options options;
    options.SetVtxBoundaryInterpolation(static_cast<Sdc::Options::VtxBoundaryInterpolation>(rules.boundary));
    options.SetFVarLinearInterpolation(static_cast<Sdc::Options::FVarLinearInterpolation>(rules.face_varying));
    options.SetCreasingMethod(static_cast<Sdc::Options::CreasingMethod>(rules.creasing));
    options.SetTriangleSubdivision(static_cast<Sdc::Options::TriangleSubdivision>(rules.triangles));

    std::vector<Far::TopologyDescriptor::FVarChannel> channels(_channelCount);
    for (size_t k = 0; k < _channelCount; ++k) {
        channels[k].numValues = topology.channel_counts[k];
        channels[k].valueIndices = topology.channel_values.data() + k * topology.face_points.size();
    }
    Far::TopologyDescriptor descriptor;
    descriptor.numVertices = topology.point_count;
    descriptor.numFaces = static_cast<int>(topology.face_counts.size());
    descriptor.numVertsPerFace = topology.face_counts.data();
    descriptor.vertIndicesPerFace = topology.face_points.data();
    descriptor.numCreases = static_cast<int>(topology.crease_weights.size());
    descriptor.creaseVertexIndexPairs = topology.crease_pairs.data();
    descriptor.creaseWeights = topology.crease_weights.data();
    descriptor.numCorners = static_cast<int>(topology.corner_weights.size());
    descriptor.cornerVertexIndices = topology.corner_points.data();
    descriptor.cornerWeights = topology.corner_weights.data();
    descriptor.numHoles = static_cast<int>(topology.holes.size());
    descriptor.holeIndices = topology.holes.data();
    descriptor.numFVarChannels = static_cast<int>(_channelCount);
    descriptor.fvarChannels = channels.data();

    using Factory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
    _refiner.reset(Factory::Create(descriptor, Factory::Options(static_cast<Sdc::SchemeType>(rules.scheme), options)));
    if (!_refiner) {
        throw std::invalid_argument("OpenSubdiv refuses the topology");
    }
    Bfr::SurfaceFactory::Options approximation;
    approximation.SetApproxLevelSmooth(_smoothLevel);
    approximation.SetApproxLevelSharp(_sharpLevel);
    _factory = std::make_unique<Bfr::RefinerSurfaceFactory<_Cache>>(*_refiner, approximation);
    const Far::TopologyLevel& level = _refiner->GetLevel(0);
    _edges.reserve(static_cast<size_t>(level.GetNumEdges()) * 2);
    for (int edge = 0; edge < level.GetNumEdges(); ++edge) {
        const auto ends = level.GetEdgeVertices(edge);
        _edges.push_back(ends[0]);
        _edges.push_back(ends[1]);
    }
}

void LimitSurface::expected_facets(rust::Slice<const int32_t> rates, rust::Slice<uint64_t> facets) const
{
    const Far::TopologyLevel& level = _refiner->GetLevel(0);
    if (rates.size() != static_cast<size_t>(level.GetNumEdges())
        || facets.size() != static_cast<size_t>(level.GetNumFaces())) {
        throw std::invalid_argument("one rate for each edge, one number for each face");
    }
    for (int face = 0; face < level.GetNumFaces(); ++face) {
        const auto edges = level.GetFaceEdges(face);
        const auto rate = [&](int k) { return static_cast<uint64_t>(rates[static_cast<size_t>(edges[k])]); };
        uint64_t& total = facets[static_cast<size_t>(face)];
        if (edges.size() == 4) {
            total = 2 * std::max(rate(0), rate(2)) * std::max(rate(1), rate(3));
            continue;
        }
        // A face gives a triangle of Loop's scheme, or as many quads as there are corners, of half the rate.
        uint64_t largest = 0;
        for (int k = 0; k < edges.size(); ++k) {
            largest = std::max(largest, rate(k));
        }
        total = std::max<uint64_t>(largest * largest * static_cast<uint64_t>(edges.size()) / 2, edges.size() - 2);
    }
}

std::unique_ptr<Facets> LimitSurface::tessellate(const FaceCut& cut, const SurfaceValues& values) const
{
    const size_t edges = _edges.size() / 2;
    const bool hasFaces = 0 <= cut.first_face && cut.end_face <= _refiner->GetLevel(0).GetNumFaces();
    if (cut.rates.size() != edges || cut.edge_sites.size() != edges || !hasFaces
        || values.face_varying_widths.size() != _channelCount) {
        throw std::invalid_argument("one rate and place for each edge, one width for each channel, and faces");
    }
    auto facets = std::make_unique<Facets>();
    _Tessellator(*_refiner, *_factory, _channelCount, cut, values, facets.get()).AddAll();
    return facets;
}

std::unique_ptr<LimitSurface> new_limit_surface(SchemeRules rules, const MeshTopology& topology)
{
    return std::make_unique<LimitSurface>(rules, topology);
}

} // namespace oocpt::subdiv
