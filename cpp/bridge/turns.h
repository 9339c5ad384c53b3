// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_TURNS_H
#define HDOOCPT_BRIDGE_TURNS_H

#include "bridge/session.h"
#include "pxr/pxr.h"
#include "scene/cameraReader.h"

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>

PXR_NAMESPACE_OPEN_SCOPE

/// Whose picture a session renders, where render passes of several viewports share one delegate.
///
/// A viewport is known by the first buffer that its pass binds. One whose request is another one than before has its
/// turn at once; one that waits for the scene's edits has it when the picture of the turn is final, or when the host
/// does not execute that viewport any more. At the end of a turn its buffers take the newest picture, and keep it.
/// Sessions with one viewport take no notice of any of this.
///
/// Threads: any, but for Take, which is the host's.
class HdOocPTTurns
{
public:
    /// Has a buffer take the newest picture; false if it cannot, because it is mapped.
    using Keep = std::function<bool()>;

    /// Where the session is: the newest job, the one whose picture it shows, and whether a newer one is to come.
    struct Jobs
    {
        uint64_t newest = 0;
        uint64_t shown = 0;
        bool isCommitPending = false;
    };

    void AddBuffer(const void* viewport, const void* buffer, Keep keep);
    void RemoveBuffer(const void* buffer);

    /// No picture is final any more.
    void Restart();

    /// Returns true if the viewport of the request is to be rendered now. `isConverged`: the session is.
    bool Take(const HdOocPTRenderRequest& request, const HdOocPTLens& lens, bool isConverged,
        const std::function<Jobs()>& findJobs);

    /// Returns true if the viewport has its final picture. `isConverged`: the session is.
    bool IsFinal(const void* viewport, bool isConverged) const;

    /// Returns true if a viewport has to wait for its turn.
    bool IsWaiting(const void* viewport) const;

    /// Reads a picture for the viewport if it has the turn, and if the picture is its own; returns what `read` does, or
    /// 0.
    uint64_t Read(
        const void* viewport, const std::function<Jobs()>& findJobs, const std::function<uint64_t()>& read) const;

private:
    struct _Viewport
    {
        std::map<const void*, Keep> buffers;
        HdOocPTRenderRequest request;
        HdOocPTLens lens;
        bool isFinal = false;
        /// The scene has changed since it was asked for.
        bool isOld = false;
    };

    bool _IsTaken(_Viewport* viewport, const HdOocPTRenderRequest& request, const HdOocPTLens& lens, bool isConverged);
    bool _IsOwn(const std::function<Jobs()>& findJobs) const;

    /// Taken before _mutex. Buffers stay as long as it is held.
    std::mutex _buffersMutex;
    mutable std::mutex _mutex;
    std::map<const void*, _Viewport> _viewports;
    const void* _turn = nullptr;
    /// The viewport that had the turn is gone, and others are not.
    bool _isTurnLost = false;
    /// Executions of others since the one of the turn was executed.
    unsigned int _executionsOfOthers = 0;
    /// The picture that is shown may be of the turn before; the first job that is surely of this one.
    mutable bool _isOwnDue = false;
    uint64_t _firstJob = 0;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
