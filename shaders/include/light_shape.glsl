// SPDX-License-Identifier: Apache-2.0
// Shapes of local lights under any affine map M: hits, points for shadow rays, and their densities per solid angle at
// the receiver.
//
// All in the light's unit frame: o is the receiver and d a direction there, d = M^-1 w for a unit world direction w, so
// that distances t are the world's. A shape's area element is |det M| |n . M^-1 w| / |w . N| times the unit shape's,
// hence a density p over the unit shape's area is p t^2 / (|det M| |n . d|) per world solid angle. Spheres are sampled
// in the cone that they fill in the unit frame; dw/dw' = |det M| |d|^3. Exact for ellipsoids and elliptic cylinders
// too.
// All shapes shine to one side: planes to -z, the others outwards.
#ifndef OOCPT_LIGHT_SHAPE_GLSL
#define OOCPT_LIGHT_SHAPE_GLSL

GpuLocalLight load_local_light(uint index) {
    GpuLocalLight light = LocalLights(LIGHTING.local_lights).v[index];
    if (HAS_MOVING_LIGHTS) move_local_light(index, light);
    return light;
}

uint light_kind(uint flags) {
    return flags & LIGHT_KIND_MASK;
}

bool is_thin(uint kind) {
    return kind == LIGHT_POINT || kind == LIGHT_LINE;
}

// 1 - cos of the half angle of the cone that the unit sphere fills from o outside of it.
float sphere_cone(vec3 o) {
    const float sin_squared = 1.0 / dot3(o, o);
    return sin_squared / (1.0 + sqrt(max(1.0 - sin_squared, 0.0)));
}

// Density at the receiver, per world solid angle, of choosing the point q at distance t.
float shape_density(uint kind, float determinant, vec3 o, vec3 d, vec3 q, float t) {
    const float volume = abs(determinant);
    if (kind == LIGHT_SPHERE) {
        const float size = sqrt(dot3(d, d));
        return 1.0 / (2.0 * PI * sphere_cone(o) * volume * size * size * size);
    }
    float density = kind == LIGHT_RECT ? 0.25 : 1.0 / PI;
    float cosine = abs(d.z);
    if (kind == LIGHT_CYLINDER) {
        density = 0.25 / acos(min(inversesqrt(dot(o.yz, o.yz)), 1.0));
        cosine = abs(dot(q.yz, d.yz));
    }
    return density * t * t / (volume * cosine);
}

// Whether the receiver is on the side that shines.
bool shape_faces(uint kind, vec3 o) {
    if (kind == LIGHT_RECT || kind == LIGHT_DISK) return o.z < 0.0;
    if (kind == LIGHT_SPHERE) return dot3(o, o) > 1.0;
    if (kind == LIGHT_CYLINDER) return dot(o.yz, o.yz) > 1.0;
    return true;
}

// The point q of the shape, and its distance, that a ray from outside meets.
bool shape_hit(uint kind, vec3 o, vec3 d, out vec3 q, out float t) {
    t = 0.0;
    q = vec3(0.0);
    if (is_thin(kind) || !shape_faces(kind, o)) return false;
    if (kind == LIGHT_RECT || kind == LIGHT_DISK) {
        if (!(d.z > 0.0)) return false;
        t = -o.z / d.z;
        q = vec3(o.xy + t * d.xy, 0.0);
        return kind == LIGHT_RECT ? max(abs(q.x), abs(q.y)) <= 1.0 : dot(q.xy, q.xy) <= 1.0;
    }
    // Nearer root of |o + t d| = 1 (a cylinder: without x), from outside (Haines et al. 2019, Ray Tracing Gems ch. 7).
    const vec3 across = kind == LIGHT_SPHERE ? vec3(1.0) : vec3(0.0, 1.0, 1.0);
    const vec3 oo = o * across;
    const vec3 dd = d * across;
    const float a = dot3(dd, dd);
    const float b = -dot3(oo, dd);
    if (!(b > 0.0 && a > 0.0)) return false;
    const vec3 nearest = oo + dd * (b / a);
    const float discriminant = 1.0 - dot3(nearest, nearest);
    if (!(discriminant > 0.0)) return false;
    t = (dot3(oo, oo) - 1.0) / (b + sqrt(a * discriminant));
    q = o + t * d;
    return kind == LIGHT_SPHERE || abs(q.x) <= 1.0;
}

// A point of the shape for the receiver o, from two random numbers; false when none shines there.
bool shape_point(uint kind, vec3 o, vec2 u, out vec3 q) {
    q = vec3(0.0);
    if (!shape_faces(kind, o)) return false;
    if (kind == LIGHT_RECT) {
        q = vec3(2.0 * u - 1.0, 0.0);
    } else if (kind == LIGHT_DISK) {
        q = vec3(disk(u), 0.0);
    } else if (kind == LIGHT_CYLINDER) {
        // The side that is seen: a point is when its normal looks at the receiver.
        const float seen = acos(min(inversesqrt(dot(o.yz, o.yz)), 1.0));
        const float phi = atan(o.z, o.y) + (2.0 * u.y - 1.0) * seen;
        q = vec3(2.0 * u.x - 1.0, cos(phi), sin(phi));
    } else if (kind == LIGHT_LINE) {
        q = vec3(2.0 * u.x - 1.0, 0.0, 0.0);
    } else if (kind == LIGHT_SPHERE) {
        // Uniform in the cone; the angle at the centre from that at the receiver (Pharr et al. 2023, 6.2.4).
        const float distance = sqrt(dot3(o, o));
        const float h = u.x * sphere_cone(o);
        const float sin_squared = h * (2.0 - h);
        const float cos_center = sin_squared * distance
            + (1.0 - h) * sqrt(max(1.0 - sin_squared * distance * distance, 0.0));
        const float sin_center = sqrt(max(1.0 - cos_center * cos_center, 0.0));
        const vec3 axis = o / distance;
        vec3 x, y;
        tangents(axis, x, y);
        const float phi = 2.0 * PI * u.y;
        q = axis * cos_center + (x * cos(phi) + y * sin(phi)) * sin_center;
    }
    return true;
}

#endif
