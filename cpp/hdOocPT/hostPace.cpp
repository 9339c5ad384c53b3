// SPDX-License-Identifier: Apache-2.0
#include "hdOocPT/hostPace.h"

#include <chrono>
#include <thread>

#include <sys/resource.h>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// After this many questions the host is judged by how often it has slept in between. One with a window may ask several
// times a frame, as the tasks of a task controller do, and one without may wait for a lock now and then.
constexpr int _askedToJudge = 64;
constexpr int _sleptOfBusy = _askedToJudge / 8;
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
    if (!_IsBusy()) {
        return;
    }
    long const sleptBefore = _SleptCount();
    for (int step = 0; step < _waitSteps && !isDone(); ++step) {
        std::this_thread::sleep_for(_waitStep);
    }
    std::lock_guard<std::mutex> const lock(_mutex);
    if (_thread == std::this_thread::get_id()) {
        _sleptCount += _SleptCount() - sleptBefore;
    }
}

bool HdOocPTHostPace::_IsBusy()
{
    std::lock_guard<std::mutex> const lock(_mutex);
    if (_thread != std::this_thread::get_id()) {
        _thread = std::this_thread::get_id();
        _askedCount = 0;
    }
    long const sleptCount = _SleptCount();
    if (_askedCount == 0) {
        _sleptCount = sleptCount;
    }
    if (++_askedCount < _askedToJudge) {
        return false;
    }
    if (sleptCount - _sleptCount > _sleptOfBusy) {
        _askedCount = 0;
        return false;
    }
    return true;
}

void HdOocPTHostPace::Restart()
{
    std::lock_guard<std::mutex> const lock(_mutex);
    _askedCount = 0;
}

PXR_NAMESPACE_CLOSE_SCOPE
