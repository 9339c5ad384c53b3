// SPDX-License-Identifier: Apache-2.0
// The emission of a point of a mesh light that a program computes (Features::MESH_LIGHT_PROGRAMS), computed as at a hit
// there: the program for the emission alone, with the coordinates, primvars and position of the point, and the
// direction and the cone that a BSDF ray to it would have. A part of light/mesh.glsl.
#ifndef OOCPT_LIGHT_PROGRAM_GLSL
#define OOCPT_LIGHT_PROGRAM_GLSL

// Interpolates three rows from `row` on, for a point of these weights, as primvar_value does.
vec4 between_corners(uint row, vec3 weights) {
    ConstVec4s rows = ConstVec4s(LIGHTING.light_corners);
    const vec4 a = rows.v[row];
    const vec4 b = rows.v[row + 3u];
    const vec4 c = rows.v[row + 6u];
    if (a == b && b == c) return a;
    return a * weights.x + b * weights.y + c * weights.z;
}

// `pdf`: as for point_emission.
vec3 program_emission(MeshLightPoint point, float pdf) {
    const uint first = LightValues(LIGHTING.light_values).v[point.triangle].corners;
    if (first == NO_INDEX) return vec3(0.0);
    const GpuMeshLight light = load_mesh_light(point.light);
    const GpuLightTriangle t = LightTriangles(LIGHTING.light_triangles).v[point.triangle];
    const vec3 weights = vec3(1.0 - point.place.x - point.place.y, point.place);
    const vec3 q = combine_rows(t.v0, t.v1, t.v2, weights);
    const vec4 uv = between_corners(first, weights);
    GpuSurfaceMaterial m;
    m.material = point.material;
    m.tangent = vec3(0.0);
    m.handedness = 0.0;
    m.flags = 3u;
    m.uv[0] = uv.xy;
    m.uv[1] = uv.zw;
    m.primvars[0] = between_corners(first + 1u, weights);
    m.primvars[1] = between_corners(first + 2u, weights);
    [[unroll]] for (uint i = 0u; i < 2u; ++i) {
        m.footprints[i] = uvec2(0u);
        if (!HAS_TEXTURES) continue;
        ConstVec4s rows = ConstVec4s(LIGHTING.light_corners);
        const vec4 d = rows.v[first + 3u] - rows.v[first];
        const vec4 g = rows.v[first + 6u] - rows.v[first];
        vec3 u, v, n;
        if (edge_gradients(i == 0u ? d.xy : d.zw, i == 0u ? g.xy : g.zw, point.edges[0], point.edges[1], u, v, n)) {
            m.footprints[i] = make_footprint(u, v, point.normal, point.direction);
        }
    }
    const vec3 place = light.position + (combine_rows(light.x, light.y, light.z, q) + light.position_lo);
    const float cone = fma(next_spread(ask_path, pdf), point.distance, ask_width);
    const PatternPoint p = PatternPoint(place, point.normal, point.direction, cone);
    const uint64_t own =
        program_end(material_program(point.material), Materials(FRAME.materials).v[point.material].program_sizes);
    run_program(own + 16ul, ConstUints(own).v[0], m, p, ask_missing);
    return valid_emission(pattern_registers[ConstUints(own).v[1] & (PROGRAM_REGISTERS - 1u)].xyz);
}

#endif
