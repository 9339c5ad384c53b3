// SPDX-License-Identifier: Apache-2.0
#include "hdOocPT/hostPace.h"

#include <chrono>
#include <thread>

#include <sys/resource.h>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// After this many questions the host is judged by how often it has slept in between.
constexpr int _askedToJudge = 64;
constexpr int _waitSteps = 25;
constexpr std::chrono::milliseconds _waitStep(2);

// Counts the voluntary context switches of this thread: waits for an event, a timer or a lock. Where the system does
// not count them, each call returns a larger number, so that the host passes for one that sleeps.
long _SleptCount()
{
#ifdef RUSAGE_THREAD
    rusage usage {};
    if (getrusage(RUSAGE_THREAD, &usage) == 0) {
        return usage.ru_nvcsw;
    }
#endif
    static thread_local long count = 0;
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
