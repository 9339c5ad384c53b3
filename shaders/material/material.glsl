// SPDX-License-Identifier: Apache-2.0
// Evaluates a material at a hit: from its inputs to the parameters of the BSDF. UsdPreviewSurface and OpenPBR; a
// surface without a material is diffuse in its displayColor. begin_lookups (texture.glsl) must be called before;
// textures without images are black and opaque.
#ifndef OOCPT_MATERIAL_GLSL
#define OOCPT_MATERIAL_GLSL

#include "material/shading.glsl"
#include "geometry/surface.glsl"
#include "texture/texture.glsl"
#define PATTERN_RANDOM
#include "material/pattern.glsl"

// Inputs with another meaning for a fibre: oocpt_materialx::surface::Input documents it.
const uint HAIR_INPUTS = 1u << INPUT_DIFFUSE_COLOR | 1u << INPUT_SPECULAR_COLOR | 1u << INPUT_TRANSMISSION_COLOR |
                         1u << INPUT_IOR | 1u << INPUT_NORMAL | 1u << INPUT_ANISOTROPY | 1u << INPUT_THIN_FILM |
                         1u << INPUT_ABSORPTION;

// Sets of random numbers: the choices of a mixture at bounce 0 use this one, later bounces the following ones.
const uint MIXTURE_SET = (1u << 30) + 2u;

// The coordinates at which a texture input is looked up.
vec2 texture_place(GpuInput i, GpuSurfaceMaterial m) {
    const uint set = (i.kind >> INPUT_SET_SHIFT) & 3u;
    return map_place(i, set == INPUT_NO_SET ? vec2(0.0) : m.uv[set & 1u]);
}

// Width of the filter of a lookup at `place`, in texels, for a ray's cone of width `cone` (world).
float texture_width(GpuInput i, GpuSurfaceMaterial m, vec2 place, float cone) {
    const uint set = (i.kind >> INPUT_SET_SHIFT) & 3u;
    if (set == INPUT_NO_SET) return 0.0;
    return lookup_width(i.texture, place, m.footprints[set & 1u], cone, i.row_s, i.row_t);
}

vec4 pick_channel(GpuInput i, vec4 value) {
    const uint channel = (i.kind >> INPUT_CHANNEL_SHIFT) & 7u;
    return channel == 0u ? value : vec4(value[channel - 1u]);
}

// The value of an input from the texel of its lookup; `found`: the texel is not a fallback.
vec4 finish_texture(GpuInput i, vec4 texel, bool found) {
    return pick_channel(i, found ? texel * i.value + i.bias : texel);
}

// The result of the previous lookup: several inputs often read one texture in one place, metallic and roughness for
// instance.
uint last_texture;
vec2 last_place;
float last_width;
vec4 last_texel;
uint last_unit;

// The value of an input. `missing`: the unit that a lookup waits for, as texture_lookup returns it; not changed if
// nothing is missing.
vec4 input_value(GpuSurfaceMaterial m, uint name, float cone, inout uint missing) {
    Materials materials = Materials(FRAME.materials);
    const uint kind = materials.v[m.material].inputs[name].kind & 3u;
    if (kind == INPUT_CONSTANT) return materials.v[m.material].inputs[name].value;
    const GpuInput i = materials.v[m.material].inputs[name];
    if (kind == INPUT_PRIMVAR) {
        const uint slot = (i.kind >> INPUT_SET_SHIFT) & 1u;
        return (m.flags & (1u << slot)) != 0u ? m.primvars[slot] : i.value;
    }
    if (HAS_PATTERNS && kind == INPUT_REGISTER) return pattern_registers[i.texture & (PROGRAM_REGISTERS - 1u)];
    if (HAS_TEXTURES) {
        const vec2 place = texture_place(i, m);
        const float width = texture_width(i, m, place, cone);
        if (i.texture != last_texture || place != last_place || width != last_width) {
            last_texel = texture_lookup(i.texture, place, width, last_unit);
            last_texture = i.texture;
            last_place = place;
            last_width = width;
        }
        if (last_unit < TEXTURE_FALLBACK) missing = last_unit;
        return finish_texture(i, last_texel, last_unit != TEXTURE_FALLBACK);
    }
    return pick_channel(i, vec4(0.0, 0.0, 0.0, 1.0));
}

// Sets an input of a fibre.
void set_hair(inout Shading r, uint name, vec4 value) {
    if (name == INPUT_DIFFUSE_COLOR) r.hair.tint_r = value.xyz;
    if (name == INPUT_SPECULAR_COLOR) r.hair.tint_tt = value.xyz;
    if (name == INPUT_TRANSMISSION_COLOR) r.hair.tint_trt = value.xyz;
    if (name == INPUT_NORMAL) r.hair.offset = value.x;
    if (name == INPUT_ABSORPTION) r.hair.absorption = value.xyz;
    if (name == INPUT_ANISOTROPY) {
        r.hair.variance.xy = value.xz;
        r.hair.spread.xy = value.yw;
    }
    if (name == INPUT_THIN_FILM) {
        r.hair.variance.z = value.x;
        r.hair.spread.z = value.y;
        r.hair.tilt = value.z;
    }
}

// Random numbers of mixtures (decisions/0046): four numbers in [0, 1) of a hit, stratified over the samples of its
// pixel. A path that comes back to a hit has the same ones. Images through pixel centres make no random choice.
vec4 mixture_numbers(uint path) {
    if ((push.flags & PUSH_AOVS) != 0u) return vec4(0.5);
    const uvec2 pixel = pixel_position(path_pixel(path));
    const uint bounce = ray_bounce(ray_address(path));
    return sample_4d(path_sample(path), MIXTURE_SET + bounce, pixel_seed(pixel.x, pixel.y, path_seed(path)));
}

// The material of a path's hit, or a substitute if it has none. `missing`: TEXTURE_DONE, or the unit that it waits for;
// the result is then meaningless.
Shading make_shading(uint path, Surface s, out uint missing) {
    missing = TEXTURE_DONE;
    if (HAS_TEXTURES) begin_lookups(path);
    last_texture = 0xffffffffu;
    const GpuSurfaceMaterial m = surface_material;
    const float cone = s.cone;
    if (!HAS_MATERIALS || m.material == NO_MATERIAL) {
        return diffuse_shading(s.geometric_normal, s.shading_normal, s.albedo);
    }
    const uint flags = Materials(FRAME.materials).v[m.material].flags;
    Shading r = diffuse_shading(s.geometric_normal, s.shading_normal, vec3(0.0));
    r.ior = 1.5;
    r.flags = 0u;
    uint wanted = 1u << INPUT_DIFFUSE_COLOR | 1u << INPUT_ROUGHNESS | 1u << INPUT_IOR;
    if ((flags & MATERIAL_SPECULAR_WORKFLOW) != 0u) {
        r.flags = SHADING_SPECULAR_WORKFLOW;
        wanted |= 1u << INPUT_SPECULAR_COLOR;
    } else {
        wanted |= 1u << INPUT_METALLIC;
    }
    if (HAS_EMISSION && (flags & MATERIAL_EMISSIVE) != 0u) wanted |= 1u << INPUT_EMISSIVE_COLOR;
    if (HAS_COAT && (flags & MATERIAL_COAT) != 0u) wanted |= 1u << INPUT_CLEARCOAT | 1u << INPUT_CLEARCOAT_ROUGHNESS;
    if ((flags & MATERIAL_PRESENCE) != 0u) {
        r.flags |= SHADING_PRESENCE;
    } else if (HAS_TRANSMISSION && (flags & MATERIAL_OPEN_PBR) == 0u) {
        wanted |= 1u << INPUT_OPACITY;
    }
    if (HAS_OPEN_PBR && (flags & MATERIAL_OPEN_PBR) != 0u) {
        r.flags = (r.flags & ~SHADING_PRESENCE) | SHADING_OPEN_PBR;
        if (HAS_TRANSMISSION) wanted |= 1u << INPUT_TRANSMISSION | 1u << INPUT_TRANSMISSION_COLOR;
        if (HAS_COAT && (flags & MATERIAL_COAT) != 0u) wanted |= 1u << INPUT_COAT_IOR;
        if (HAS_SHEEN && (flags & MATERIAL_SHEEN) != 0u) {
            wanted |= 1u << INPUT_SHEEN_COLOR | 1u << INPUT_SHEEN_ROUGHNESS;
        }
        if (HAS_ANISOTROPY && (flags & MATERIAL_ANISOTROPIC) != 0u) wanted |= 1u << INPUT_ANISOTROPY;
        if (HAS_THIN_FILM && (flags & MATERIAL_THIN_FILM) != 0u) wanted |= 1u << INPUT_THIN_FILM;
        if (HAS_ABSORPTION && (flags & MATERIAL_ABSORBING) != 0u) wanted |= 1u << INPUT_ABSORPTION;
        if (HAS_DISPERSION && (flags & MATERIAL_DISPERSIVE) != 0u) wanted |= 1u << INPUT_ABSORPTION;
        if (HAS_ROUGH_DIFFUSE && (flags & MATERIAL_ROUGH_DIFFUSE) != 0u) wanted |= 1u << INPUT_DIFFUSE_ROUGHNESS;
        if (HAS_THIN_WALLS && (flags & MATERIAL_THIN_WALLED) != 0u) r.flags |= SHADING_THIN_WALLED;
    }
    const bool is_hair = HAS_HAIR && (flags & MATERIAL_HAIR) != 0u;
    if (is_hair) {
        r.flags = SHADING_HAIR;
        wanted = HAIR_INPUTS | (wanted & 1u << INPUT_EMISSIVE_COLOR);
    }
    if (HAS_PATTERNS && (flags & MATERIAL_PATTERNS) != 0u) {
        const vec3 view = load_ray(ray_address(path)).d;
        const PatternPoint point = PatternPoint(s.position.hi + s.position.lo, s.shading_normal, view, s.cone);
        if (HAS_MIXTURES && (flags & MATERIAL_MIXTURE) != 0u) pattern_random = mixture_numbers(path);
        const uint sizes = Materials(FRAME.materials).v[m.material].program_sizes;
        run_program(material_program(m.material), sizes, m, point, missing);
    }
    const bool is_framed = HAS_PATTERNS && (flags & MATERIAL_FRAMED_NORMAL) != 0u;
    if (!is_hair && (flags & MATERIAL_NORMAL_MAP) != 0u && (is_framed || m.handedness != 0.0)) {
        wanted |= 1u << INPUT_NORMAL;
    }
    vec3 local = vec3(0.0, 0.0, 1.0);
    // All inputs share one copy of the code: unrolled, lookups would be most of the code of a pass that shades.
    [[dont_unroll]] for (uint rest = wanted; rest != 0u; rest &= rest - 1u) {
        const uint name = uint(findLSB(rest));
        const vec4 whole = input_value(m, name, cone, missing);
        const vec3 value = whole.xyz;
        if (name == INPUT_DIFFUSE_COLOR) r.diffuse_color = value;
        if (name == INPUT_SPECULAR_COLOR) r.specular_color = value;
        if (name == INPUT_METALLIC) r.metallic = value.x;
        if (name == INPUT_ROUGHNESS) r.roughness = value.x;
        if (name == INPUT_IOR) r.ior = value.x;
        if (HAS_EMISSION && name == INPUT_EMISSIVE_COLOR) r.emission = value;
        if (HAS_COAT && name == INPUT_CLEARCOAT) r.clearcoat = value.x;
        if (HAS_COAT && name == INPUT_CLEARCOAT_ROUGHNESS) r.clearcoat_roughness = value.x;
        if (HAS_TRANSMISSION && name == INPUT_OPACITY) r.opacity = value.x;
        if (name == INPUT_NORMAL) local = value;
        if (HAS_OPEN_PBR && HAS_TRANSMISSION && name == INPUT_TRANSMISSION) r.opacity = 1.0 - value.x;
        if (HAS_OPEN_PBR && name == INPUT_TRANSMISSION_COLOR) r.transmission_color = value;
        if (HAS_OPEN_PBR && HAS_COAT && name == INPUT_COAT_IOR) r.coat_ior = value.x;
        if (HAS_SHEEN && name == INPUT_SHEEN_COLOR) r.sheen_color = value;
        if (HAS_SHEEN && name == INPUT_SHEEN_ROUGHNESS) r.sheen_roughness = value.x;
        if (HAS_ANISOTROPY && name == INPUT_ANISOTROPY) r.anisotropy = whole;
        if (HAS_THIN_FILM && name == INPUT_THIN_FILM) r.film = value;
        if (HAS_ABSORPTION && name == INPUT_ABSORPTION) r.absorption = value;
        if (HAS_DISPERSION && name == INPUT_ABSORPTION && (flags & MATERIAL_DISPERSIVE) != 0u) r.dispersion = whole.w;
        if (HAS_ROUGH_DIFFUSE && name == INPUT_DIFFUSE_ROUGHNESS) r.diffuse_roughness = value.x;
        if (is_hair) set_hair(r, name, whole);
    }
    if (is_hair) {
        r.tangent = m.tangent;
        r.absorption = vec3(0.0);
        r.diffuse_color = r.hair.tint_tt * exp(-r.hair.absorption); // of images: a way through half of it
        return valid_shading(r);
    }
    if (HAS_ANISOTROPY) {
        r.tangent = m.tangent;
        // Turns are from the tangent to the bitangent.
        if (m.handedness < 0.0) r.anisotropy.yw = -r.anisotropy.yw;
    }
    if ((wanted & (1u << INPUT_NORMAL)) != 0u) {
        const vec3 n = r.normal;
        vec3 t, b;
        normal_frame(m, n, is_framed, t, b);
        r.normal = normal_or(t * local.x + b * local.y + n * local.z, n);
    }
    return valid_shading(r);
}

#endif
