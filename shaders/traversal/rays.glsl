// SPDX-License-Identifier: Apache-2.0
// Walks all rays of a queue so that few threads of a subgroup are idle (see the book, design/traversal): the subgroup
// leaves the nodes when few of its threads are still among them, so that the others need not wait; and threads that
// have ended their walk take new rays, once enough of them have (after Aila and Laine 2009, "Understanding the
// Efficiency of Ray Traversal on GPUs"). Cutouts are looked up when many threads wait for one (decisions/0058). Which
// thread walks a ray, and when, does not change the result.
//
// Before including, define NEXT as the member of WavefrontCounters that holds the first ray of the queue that nobody
// has begun, and after it begin_ray(at): begin_walk() or no_walk() for entry `at` of the queue; end_ray(ended): stores
// the result of the ray if `ended`; called by all threads of a subgroup.
#ifndef OOCPT_RAYS_GLSL
#define OOCPT_RAYS_GLSL

#include "wavefront/queue.glsl"
#include "traversal/traverse.glsl"
#include "traversal/sharing.glsl"

// Fewer threads than these of a subgroup of 32 do not keep it among the nodes.
const uint KEEP_DESCENDING = 12u;
// Fewer than these do not keep it from taking new rays; but for a number of visits of leaves and instances it goes on
// with those that it has: short walks end together.
const uint KEEP_WALKING = 26u;
const uint PATIENCE = 16u;
// So many threads that wait at a cutout look it up; fewer do when fewer than MIN_OTHERS have other work.
const uint ASK_TOGETHER = 16u;
const uint MIN_OTHERS = 2u;

void begin_ray(uint at);
void end_ray(bool ended);

uint threads_that(bool are) {
    return subgroupBallotBitCount(subgroupBallot(are));
}

// Returns true if the threads that wait at a cutout look it up now.
bool is_asking_time() {
    const uint asking = threads_that(reference == ASK);
    if (asking >= max(ASK_TOGETHER * gl_SubgroupSize / 32u, 1u)) return true;
    const uint others = threads_that(reference != ASK && reference != DONE);
    return asking > 0u && others < max(MIN_OTHERS * gl_SubgroupSize / 32u, 1u);
}

// `count`: rays in the queue. Call with all threads of the pass.
void trace_rays(uint count) {
    const uint keep_descending = KEEP_DESCENDING * gl_SubgroupSize / 32u;
    const uint keep_walking = KEEP_WALKING * gl_SubgroupSize / 32u;
    // The last rays are shared every few visits.
    const uint last_walking = shares_walks() ? gl_SubgroupSize + 1u : 1u;
    const uint threads = gl_NumWorkGroups.x * gl_NumWorkGroups.y * WORKGROUP_SIZE;
    const uint spread = shares_walks() ? clamp(threads / max(count, 1u), 1u, gl_SubgroupSize) : 1u;
    uint at = thread_index() % spread == 0u ? thread_index() / spread : count;
    bool has_ray = false;
    bool more = count > threads;
    reference = DONE;
    own_walk();
    do {
        if (at < count) {
            begin_ray(at);
            own_walk();
            has_ray = true;
        }
        uint visits = 0u;
        do {
            ++visits;
            while (reference < LEAF) {
                reference = descend(reference);
                if (threads_that(reference < LEAF) < keep_descending) break;
            }
            const bool asks = ASKS_CUTOUTS && reference == ASK;
            if (reference >= LEAF && reference != DONE && !asks) reference = visit(reference);
            if (ASKS_CUTOUTS && is_asking_time() && reference == ASK) reference = answer_candidate();
        } while (threads_that(reference != DONE) >= (visits < PATIENCE ? 1u : more ? keep_walking : last_walking));
        const bool shares = !more && shares_walks();
        bool helped = false;
        if (shares) {
            hand_in();
            helped = is_helped();
        }
        const bool ended = has_ray && reference == DONE && !helped;
        if (ended) end_walk();
        end_ray(ended);
        has_ray = has_ray && !ended;
        at = count;
        if (more) {
            uint to;
            QUEUE_SLOT(to, NEXT, !has_ray);
            if (!has_ray) at = to;
            more = threads_that(!has_ray && at >= count) == 0u;
        }
        if (shares) share_walks(!has_ray && !is_helper());
    } while (threads_that(has_ray || at < count) > 0u);
}

#endif
