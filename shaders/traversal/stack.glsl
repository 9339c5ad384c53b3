// SPDX-License-Identifier: Apache-2.0
// The stack of a walk: references to nodes and leaves still to visit. If the closest hit is wanted, a reference keeps
// its entry distance, so that nodes behind a hit found since are dropped without a visit (3 % on an H200); for any hit
// it does not pay, and is kept only when rays may have to wait, for the order of the items that they wait for.
#ifndef OOCPT_STACK_GLSL
#define OOCPT_STACK_GLSL

// References: an inner node, or LEAF | (count - 1) << 28 | first, or one of ASK, RETURN and DONE.

#ifndef SETTLES
#define SETTLES 0
#endif
// True if candidates that no mask decides are skipped and the nearest is kept (deferral.glsl); otherwise all are looked
// up.
const bool DEFERS_CUTOUTS = HAS_DEFERRED_CUTOUTS && SETTLES == 0;
const bool ASKS_CUTOUTS = HAS_CUTOUTS && !DEFERS_CUTOUTS;
// Words of the kept candidate, above the stack: in registers they would be there all the time.
const uint KEPT_WORDS = DEFERS_CUTOUTS ? 4u + MAX_LEVELS : 0u;

#if ANY_HIT
const uint ENTRIES = HAS_STREAMING ? STACK_SIZE : 1u;
uint stack[STACK_SIZE + KEPT_WORDS];
float stack_entry[ENTRIES];
#else
uvec2 stack[STACK_SIZE + KEPT_WORDS];
#endif
uint stack_top;
// The position of DONE: entries below were given to other threads (sharing.glsl).
uint stack_floor;
bool stack_overflow;

void clear_stack() {
#if ANY_HIT
    if (HAS_STREAMING) stack_entry[0] = 0.0;
    stack[0] = DONE;
#else
    stack[0] = uvec2(DONE, 0u);
#endif
    stack_top = 1u;
    stack_floor = 0u;
    stack_overflow = false;
}

// Pushes an entry. If the stack is full, drops it, and records that.
void push_reference(uint reference, float entry) {
    if (stack_top >= STACK_SIZE) {
        stack_overflow = true;
        return;
    }
#if ANY_HIT
    if (HAS_STREAMING) stack_entry[stack_top] = entry;
    stack[stack_top++] = reference;
#else
    stack[stack_top++] = uvec2(reference, floatBitsToUint(entry));
#endif
}

// The next reference whose box is entered before `limit`, and its entry distance. RETURN and DONE are entered at 0.
uint pop_reference(float limit, out float entry) {
#if ANY_HIT
    --stack_top;
    entry = HAS_STREAMING ? stack_entry[stack_top] : 0.0;
    return stack[stack_top];
#else
    uvec2 top;
    do {
        top = stack[--stack_top];
        entry = uintBitsToFloat(top.y);
    } while (entry > limit);
    return top.x;
#endif
}

void keep_word(uint i, uint word) {
#if ANY_HIT
    stack[STACK_SIZE + i] = word;
#else
    stack[STACK_SIZE + i].x = word;
#endif
}

uint kept_word(uint i) {
#if ANY_HIT
    return stack[STACK_SIZE + i];
#else
    return stack[STACK_SIZE + i].x;
#endif
}

// The entry above the floor, the root of the subtree that is visited last.
uint bottom_reference() {
#if ANY_HIT
    return stack[stack_floor + 1u];
#else
    return stack[stack_floor + 1u].x;
#endif
}

float bottom_entry() {
#if ANY_HIT
    return 0.0;
#else
    return uintBitsToFloat(stack[stack_floor + 1u].y);
#endif
}

// Removes the bottom entry.
void drop_bottom() {
    ++stack_floor;
#if ANY_HIT
    stack[stack_floor] = DONE;
#else
    stack[stack_floor] = uvec2(DONE, 0u);
#endif
}

#endif
