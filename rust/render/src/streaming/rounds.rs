// SPDX-License-Identifier: Apache-2.0
//! Decides how many rounds a step traces: enough to keep the device busy until the next step, few enough for stop and
//! pause to take effect, and not many more than have rays: a round without rays is still half a dozen passes, on which
//! a software renderer spends as much time as on short work. Pure.

/// Target seconds of a step: short enough for stop and pause to take effect and for demand to be read again.
const STEP_SECS: f64 = 0.03;
/// Most rounds of a step.
const MAX_ROUNDS: u32 = 16;
/// Most rounds of a step on a GPU if more rays are about to join, which they do between steps: a round takes as long as
/// its longest ray, whatever it traces beside it (see the book, design/streaming).
const MAX_ROUNDS_BEFORE_JOIN: u32 = 1;

/// The outcome of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepResult {
    pub(super) rounds: u32,
    /// Rounds that had a ray to trace or a material to resolve.
    pub(super) busy: u32,
    pub(super) secs: f64,
}

/// Rounds of the step after `planned`, the number of those under way: more if steps are short and use all of theirs,
/// fewer if they are long, and gradually fewer if the last ones of a step had nothing to trace.
pub(super) fn next(planned: u32, done: StepResult) -> u32 {
    let StepResult { rounds, busy, secs } = done;
    if secs > STEP_SECS {
        (rounds / 2).max(1)
    } else if busy < rounds {
        planned.min((busy + 1).max(rounds - rounds / 4))
    } else if secs < 0.5 * STEP_SECS && rounds == planned {
        (rounds * 2).min(MAX_ROUNDS)
    } else {
        planned
    }
}

/// Most rounds of the next step, on a processor or not; `more_join`: paths can still begin, or few rays are ready and
/// loads will wake others.
pub(super) fn most(is_cpu: bool, more_join: bool) -> u32 {
    if more_join && !is_cpu { MAX_ROUNDS_BEFORE_JOIN } else { MAX_ROUNDS }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joining_rays_limit_steps_to_one_round_on_a_gpu() {
        assert_eq!(most(false, true), 1);
        assert_eq!(most(false, false), 16, "none join");
        assert_eq!(most(true, true), 16, "a processor is busy with few");
    }

    /// The limit of `planned` after many steps that take `secs` per round, of which at most `busy` rounds have rays.
    fn settled(busy: u32, secs: f64) -> Vec<u32> {
        let mut planned = 1;
        let steps = (0..100).map(|_| {
            let done = StepResult { rounds: planned, busy: busy.min(planned), secs: secs * f64::from(planned) };
            planned = next(planned, done);
            planned
        });
        steps.skip(90).collect()
    }

    #[test]
    fn short_steps_get_more_rounds_while_rays_remain() {
        assert_eq!(settled(u32::MAX, 1e-5), [16; 10], "all there are");
        assert_eq!(settled(u32::MAX, 0.02), [1; 10], "one is long enough");
        assert_eq!(settled(u32::MAX, 1.0), [1; 10], "one is too long");
    }

    #[test]
    fn rounds_without_rays_are_skipped() {
        assert_eq!(settled(4, 1e-5), [5; 10], "one more than have rays: whether that is enough has to be seen");
        assert_eq!(settled(0, 1e-5), [1; 10], "nothing to trace");
        assert!(
            next(16, StepResult { rounds: 16, busy: 0, secs: 1e-4 }) >= 12,
            "not all at once: the next chunk may wake many"
        );
    }

    #[test]
    fn an_earlier_step_does_not_raise_a_lowered_round_count() {
        assert_eq!(next(4, StepResult { rounds: 8, busy: 7, secs: 1e-4 }), 4, "two are under way");
        assert_eq!(next(4, StepResult { rounds: 8, busy: 8, secs: 1e-4 }), 4, "likewise");
    }
}
