// SPDX-License-Identifier: Apache-2.0
#include "bridge/turns.h"

#include <algorithm>
#include <tuple>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

/// A host executes its viewports in one round: one that was passed over so often is not shown any more.
constexpr unsigned int _mostExecutionsOfOthers = 8;

bool _AreSame(const HdOocPTRenderRequest& a, const HdOocPTRenderRequest& b)
{
    const auto values = [](const HdOocPTRenderRequest& one) {
        return std::tie(one.width, one.height, one.cameraPath, one.worldToView, one.projection, one.dataWindow,
            one.displayWindow, one.renderTags);
    };
    const auto isSame = [](const HdOocPTAovRequest& one, const HdOocPTAovRequest& other) {
        return one.name == other.name && one.clearValue == other.clearValue;
    };
    return values(a) == values(b) && a.aovs.size() == b.aovs.size()
        && std::equal(a.aovs.begin(), a.aovs.end(), b.aovs.begin(), isSame);
}

bool _AreSame(const HdOocPTLens& a, const HdOocPTLens& b)
{
    return a.radius == b.radius && a.focusDistance == b.focusDistance;
}

} // namespace

void HdOocPTTurns::AddBuffer(const void* viewport, const void* buffer, Keep keep)
{
    const std::lock_guard<std::mutex> bufferLock(_buffersMutex);
    const std::lock_guard<std::mutex> lock(_mutex);
    for (auto& [other, state] : _viewports) {
        if (other != viewport) {
            state.buffers.erase(buffer);
        }
    }
    _viewports[viewport].buffers.insert_or_assign(buffer, std::move(keep));
}

void HdOocPTTurns::RemoveBuffer(const void* buffer)
{
    const std::lock_guard<std::mutex> bufferLock(_buffersMutex);
    const std::lock_guard<std::mutex> lock(_mutex);
    _viewports.erase(buffer);
    for (auto& [viewport, state] : _viewports) {
        state.buffers.erase(buffer);
    }
    if (_turn == buffer) {
        _turn = nullptr;
        _isTurnLost = !_viewports.empty();
    }
}

void HdOocPTTurns::Restart()
{
    const std::lock_guard<std::mutex> lock(_mutex);
    for (auto& [viewport, state] : _viewports) {
        state.isFinal = false;
        state.isOld = true;
    }
}

bool HdOocPTTurns::_IsTaken(
    _Viewport* viewport, const HdOocPTRenderRequest& request, const HdOocPTLens& lens, bool isConverged)
{
    const bool hasTurn = _turn == request.viewport;
    const bool isChanged = !_AreSame(viewport->request, request) || !_AreSame(viewport->lens, lens);
    _executionsOfOthers = hasTurn ? 0 : _executionsOfOthers + 1;
    const bool isFree = _turn == nullptr || isConverged || _executionsOfOthers > _mostExecutionsOfOthers;
    const bool isTaken = hasTurn || isChanged || (isFree && !viewport->isFinal);
    if (isTaken) {
        viewport->request = request;
        viewport->lens = lens;
        viewport->isFinal = false;
        viewport->isOld = false;
    }
    return isTaken;
}

bool HdOocPTTurns::Take(const HdOocPTRenderRequest& request, const HdOocPTLens& lens, bool isConverged,
    const std::function<Jobs()>& findJobs)
{
    const std::lock_guard<std::mutex> bufferLock(_buffersMutex);
    std::unique_lock<std::mutex> lock(_mutex);
    if (!_IsTaken(&_viewports[request.viewport], request, lens, isConverged)) {
        return false;
    }
    const auto before = _viewports.find(_turn);
    const bool isLeft = before != _viewports.end();
    if (_turn == request.viewport || (!isLeft && !_isTurnLost)) {
        _turn = request.viewport;
        return true;
    }
    // Each buffer locks itself, then _mutex.
    lock.unlock();
    const Jobs jobs = findJobs();
    bool isKept = isConverged;
    if (isLeft) {
        for (const auto& [buffer, keep] : before->second.buffers) {
            isKept = keep() && isKept;
        }
    }
    lock.lock();
    if (isLeft) {
        before->second.isFinal = isKept && !before->second.isOld;
    }
    _isTurnLost = false;
    _turn = request.viewport;
    _executionsOfOthers = 0;
    _isOwnDue = true;
    _firstJob = jobs.newest + (jobs.isCommitPending ? 2 : 1);
    return true;
}

bool HdOocPTTurns::IsFinal(const void* viewport, bool isConverged) const
{
    const std::lock_guard<std::mutex> lock(_mutex);
    const auto state = _viewports.find(viewport);
    return state == _viewports.end() || viewport == _turn ? isConverged : state->second.isFinal;
}

bool HdOocPTTurns::IsWaiting(const void* viewport) const
{
    const std::lock_guard<std::mutex> lock(_mutex);
    return viewport != _turn && _viewports.count(viewport) > 0;
}

uint64_t HdOocPTTurns::Read(
    const void* viewport, const std::function<Jobs()>& findJobs, const std::function<uint64_t()>& read) const
{
    const std::lock_guard<std::mutex> lock(_mutex);
    const bool hasTurn = viewport == _turn || _viewports.count(viewport) == 0;
    return hasTurn && _IsOwn(findJobs) ? read() : 0;
}

bool HdOocPTTurns::_IsOwn(const std::function<Jobs()>& findJobs) const
{
    if (_isOwnDue) {
        const Jobs jobs = findJobs();
        // A request that is the same as the one before makes no job.
        const bool isNewest = !jobs.isCommitPending && jobs.shown >= jobs.newest;
        _isOwnDue = jobs.shown < _firstJob && !isNewest;
    }
    return !_isOwnDue;
}

PXR_NAMESPACE_CLOSE_SCOPE
