// SPDX-License-Identifier: Apache-2.0
// Test shader, not a pass of a render: compares the probabilities and densities of lights as choosing gives them and as
// rays that meet them give them. One thread per receiver: rays[i] holds its position (o) and its normal (d). arg0 = 0:
// radiance[i].xy = sum over all lights of the probability of choosing it; probability of ending at a node whose lights
// contribute nothing. arg0 = 1: radiance[i] = (probability by choosing, the same by a ray to a point of the light, 1 +
// the light's index, density by choosing over the one by the ray); zero if no light is chosen or its point is on the
// other side. arg0 = 2, mesh lights: radiance[i] = (density by choosing a point, by a hit there, 1 + the light's index,
// end of the shadow ray over the distance); zero if none is chosen. Each thread has a time of its own.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "math/sampler.glsl"
#include "wavefront/path_surface.glsl"
#include "material/bsdf_lambert.glsl"

uint wanted;
float found;
#define ON_LIGHT(index, probability) \
    if (index == wanted) found = probability

#include "light/sample.glsl"

// Walks the whole tree.
vec2 all_probabilities(Receiver r) {
    vec2 sum = vec2(0.0);
    uint top = 0u;
    light_stack[0] = 0u;
    probability_stack[0] = 1.0;
    while (true) {
        const uint reference = light_stack[top];
        const float probability = probability_stack[top];
        if ((reference & LIGHT_LEAF) == 0u) {
            const GpuLightNode node = load_light_node(reference);
            const float share = first_share(node, r);
            if (share >= 0.0) {
                light_stack[top] = node.child[0];
                probability_stack[top] = probability * share;
                ++top;
                light_stack[top] = node.child[1];
                probability_stack[top] = probability * (1.0 - share);
                continue;
            }
            sum.y += probability;
        } else {
            sum.x += probability;
        }
        if (top == 0u) return sum;
        --top;
    }
}

vec4 sampled(Ray ray, Receiver r, vec4 u) {
    uint index;
    float probability;
    if (!choose_local_light(r, u.x, u.w, index, probability)) return vec4(0.0);
    const GpuLocalLight light = load_local_light(index);
    const uint kind = light_kind(light.flags);
    const Double3 origin = Double3(ray.o, ray.o_lo);
    const vec3 place = difference(origin, Double3(light.position, light.position_lo));
    const vec3 o = apply_rows(light.row_x, light.row_y, light.row_z, place);
    vec3 q;
    if (is_thin(kind) || !shape_point(kind, o, u.yz, q)) return vec4(0.0);
    const vec3 towards = light.x * q.x + light.y * q.y + light.z * q.z - place;
    const float distance = sqrt(dot3(towards, towards));
    const vec3 w = towards / distance;
    const vec3 d = apply_rows(light.row_x, light.row_y, light.row_z, w);
    const float density = shape_density(kind, light.determinant, o, d, q, distance);
    wanted = index;
    found = 0.0;
    bool met;
    lights_along(origin, w, MAX_FLOAT, false, PreviousVertex(r, 0u, vec3(0.0), 1.0), met);
    float t;
    vec3 hit;
    float other = 0.0;
    if (shape_hit(kind, o, d, hit, t)) other = shape_density(kind, light.determinant, o, d, hit, t);
    return vec4(probability * LIGHTING.local_share, found, float(index + 1u), other > 0.0 ? density / other : 0.0);
}

vec4 sampled_mesh(Ray ray, Receiver r, vec4 u, vec4 u_mesh) {
    const Double3 origin = Double3(ray.o, ray.o_lo);
    const float first = mesh_light_first(r);
    MeshLightPoint point;
    if (first < 0.0 || !sample_mesh_light(r, origin, u, u_mesh, LIGHTING.local_share * (1.0 - first), point)) {
        return vec4(0.0);
    }
    const GpuMeshLight light = load_mesh_light(point.light);
    const float density = mesh_light_density(r, origin, LIGHTING.local_share, light.prim_id, light.instance_id,
                                             light.mesh, point.face, point.material, point.normal,
                                             point.distance, dot3(point.normal, point.direction));
    return vec4(point.density, density, float(point.light + 1u), point.reach / point.distance);
}

void main() {
    const uint at = thread_index();
    if (at >= push.path_count) return;
    const Ray ray = load_ray(ray_address(at));
    const Receiver r = Receiver(ray.o, ray.d);
    vec4 result = vec4(0.0);
    if (HAS_MOVING_MESH_LIGHTS) light_time = sample_4d(at, 3u, FRAME.seed).x;
    if (push.arg0 == 0u) {
        result.xy = all_probabilities(r);
    } else if (push.arg0 == 1u) {
        result = sampled(ray, r, sample_4d(at, 1u, FRAME.seed));
    } else {
        result = sampled_mesh(ray, r, sample_4d(at, 1u, FRAME.seed), sample_4d(at, 2u, FRAME.seed));
    }
    Vec4s(FRAME.radiance).v[at] = result;
}
