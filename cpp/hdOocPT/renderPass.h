// SPDX-License-Identifier: Apache-2.0
/// Hydra render pass: turns the pass state into one request to the session.
#ifndef HDOOCPT_RENDER_PASS_H
#define HDOOCPT_RENDER_PASS_H

#include "bridge/session.h"
#include "hdOocPT/hostPace.h"
#include "pxr/imaging/hd/renderPass.h"
#include "pxr/imaging/hd/renderPassState.h"
#include "pxr/pxr.h"

#include <atomic>
#include <memory>

PXR_NAMESPACE_OPEN_SCOPE

/// Executing is cheap and returns at once; the session restarts the image only when the request or the scene changed.
/// Passes that bind other buffers are other viewports, whose pictures are rendered one after the other.
/// Without bound outputs the pass does nothing and is converged. Threads: IsConverged any, the rest the host's only.
class HdOocPTRenderPass final : public HdRenderPass
{
public:
    HdOocPTRenderPass(
        HdRenderIndex* index, HdRprimCollection const& collection, std::shared_ptr<HdOocPTSession> session);
    ~HdOocPTRenderPass() override;

    /// Returns true once every bound buffer holds its final image, or if rendering has ended for good. A host that asks
    /// without ever sleeping waits here (HdOocPTHostPace).
    bool IsConverged() const override;

protected:
    void _Execute(HdRenderPassStateSharedPtr const& renderPassState, TfTokenVector const& renderTags) override;

private:
    /// Binds the buffers to their outputs and lists them in the request; returns false if there is no buffer to render
    /// into.
    bool _BindAovs(HdRenderPassAovBindingVector const& bindings, HdOocPTRenderRequest* request);
    HdRenderBuffer* _FindBuffer(HdRenderPassAovBinding const& binding) const;

    std::shared_ptr<HdOocPTSession> const _session;
    std::atomic<bool> _hasRequest { false };
    /// That of the last request.
    std::atomic<void const*> _viewport { nullptr };
    GfMatrix4d _worldToView { 1.0 };
    mutable HdOocPTHostPace _pace;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
