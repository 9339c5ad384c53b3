// SPDX-License-Identifier: Apache-2.0
#include "hdOocPT/hostPace.h"

#include <chrono>
#include <thread>

#include <sys/resource.h>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// So often a host asks before it is judged by how often it has slept.
constexpr int _askedToJudge = 64;
constexpr int _waitSteps = 25;
constexpr std::chrono::milliseconds _waitStep(2);

// How often this thread has given up the processor of its own accord: for an event, a timer, a lock. Where the system
// does not tell, a number that grows, as that of a host that sleeps.
long _SleptCount()
{
#ifdef RUSAGE_THREAD
    rusage usage {};
    if (getrusage(RUSAGE_THREAD, &usage) == 0) {
        return usage.ru_nvcsw;
    }
#endif
    static long count = 0;
    return ++count;
}

} // namespace

void HdOocPTHostPace::Hold(std::function<bool()> const& isDone)
{
    if (_askedCount == 0) {
        _sleptCount = _SleptCount();
    }
    if (++_askedCount < _askedToJudge) {
        return;
    }
    // A host may wait for a lock now and then.
    if (_SleptCount() - _sleptCount > _askedToJudge / 2) {
        Restart();
        return;
    }
    long const sleptBefore = _SleptCount();
    for (int step = 0; step < _waitSteps && !isDone(); ++step) {
        std::this_thread::sleep_for(_waitStep);
    }
    _sleptCount += _SleptCount() - sleptBefore;
}

void HdOocPTHostPace::Restart()
{
    _askedCount = 0;
}

PXR_NAMESPACE_CLOSE_SCOPE
