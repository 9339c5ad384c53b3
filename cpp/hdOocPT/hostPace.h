// SPDX-License-Identifier: Apache-2.0
/// Notices a host that asks for convergence again and again without ever sleeping in between.
#ifndef HDOOCPT_HOST_PACE_H
#define HDOOCPT_HOST_PACE_H

#include "pxr/pxr.h"

#include <functional>
#include <mutex>
#include <thread>

PXR_NAMESPACE_OPEN_SCOPE

/// Blender's final renders execute, ask, and copy all images without pause, which takes a core from the renderer where
/// that is a processor, and is heat elsewhere. Hosts with a window sleep at least once a frame, until the next event or
/// the display's next picture, and ask a few times a frame; these are never held up. Threads: any. Each thread is
/// judged by itself: the count begins anew when another one asks.
class HdOocPTHostPace
{
public:
    /// Called whenever the host was told "not yet". If it has not slept for a while, waits up to a twentieth of a
    /// second, or until `isDone`.
    void Hold(std::function<bool()> const& isDone);

    /// The host looks at something else: it is held up again only if it still does not sleep.
    void Restart();

private:
    /// Counts a question; returns true if the host, which is on this thread, has asked often and hardly slept.
    bool _IsBusy();

    std::mutex _mutex;
    std::thread::id _thread;
    int _askedCount = 0;
    long _sleptCount = -1;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
