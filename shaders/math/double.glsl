// SPDX-License-Identifier: Apache-2.0
// Points as unevaluated sums of two floats, |lo| <= half an ulp of hi (Dekker 1971; Knuth, TAOCP 2, 4.2.2): 48 bits,
// enough for a millimetre at 10^7 m. Every operation is exact to that unless its comment says else.
#ifndef OOCPT_DOUBLE_GLSL
#define OOCPT_DOUBLE_GLSL

struct Double3 {
    vec3 hi;
    vec3 lo;
};

// a + b = sum + error, exactly.
void two_sum(vec3 a, vec3 b, out vec3 sum, out vec3 error) {
    precise const vec3 s = a + b;
    precise const vec3 bb = s - a;
    precise const vec3 e = (a - (s - bb)) + (b - bb);
    sum = s;
    error = e;
}

Double3 add(Double3 a, vec3 b) {
    vec3 s, e;
    two_sum(a.hi, b, s, e);
    precise const vec3 small = e + a.lo;
    precise const vec3 hi = s + small;
    precise const vec3 lo = small - (hi - s);
    return Double3(hi, lo);
}

// a - b, rounded to one float: relative error 2^-24 of the result, plus 2^-46 of the operands.
vec3 difference(Double3 a, Double3 b) {
    vec3 s, e;
    two_sum(a.hi, -b.hi, s, e);
    precise const vec3 r = s + (e + (a.lo - b.lo));
    return r;
}

#endif
