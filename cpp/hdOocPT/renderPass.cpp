// SPDX-License-Identifier: Apache-2.0
#include "hdOocPT/renderPass.h"

#include "hdOocPT/aov.h"
#include "hdOocPT/guard.h"
#include "hdOocPT/renderBuffer.h"
#include "pxr/base/tf/token.h"
#include "pxr/imaging/hd/camera.h"
#include "pxr/imaging/hd/renderIndex.h"

#include <algorithm>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

TF_DEFINE_PRIVATE_TOKENS(_primTypeTokens, (renderBuffer));

HdOocPTRenderPass::HdOocPTRenderPass(
    HdRenderIndex* index, HdRprimCollection const& collection, std::shared_ptr<HdOocPTSession> session)
    : HdRenderPass(index, collection)
    , _session(std::move(session))
{
}

HdOocPTRenderPass::~HdOocPTRenderPass() = default;

bool HdOocPTRenderPass::IsConverged() const
{
    return HdOocPTGuard("asking the render pass for convergence", true, [this] {
        // This comes first: a fatal message is queued before the session says converged, so draining after it loses
        // none.
        bool const isConverged = !_hasRequest || _session->IsConverged(_viewport);
        _session->DrainMessages();
        if (!isConverged) {
            _pace.Hold([this] { return _session->IsConverged(_viewport); });
        }
        return isConverged;
    });
}

void HdOocPTRenderPass::_Execute(HdRenderPassStateSharedPtr const& renderPassState, TfTokenVector const& renderTags)
{
    HdOocPTGuard("executing the render pass", [&] {
        HdCamera const* const camera = renderPassState->GetCamera();
        HdOocPTRenderRequest request;
        request.cameraPath = camera ? camera->GetId() : SdfPath();
        _hasRequest = _BindAovs(renderPassState->GetAovBindings(), &request);
        _viewport = request.viewport;
        if (_hasRequest) {
            CameraUtilFraming const& framing = renderPassState->GetFraming();
            if (framing.IsValid()) {
                request.dataWindow = framing.dataWindow;
                request.displayWindow = framing.displayWindow;
            }
            request.worldToView = renderPassState->GetWorldToViewMatrix();
            request.projection = renderPassState->GetProjectionMatrix();
            request.renderTags = renderTags;
            if (request.worldToView != _worldToView) {
                _worldToView = request.worldToView;
                _pace.Restart();
            }
        }
        if (!_hasRequest || _session->TakeTurn(request)) {
            _session->CommitScene(request.cameraPath);
        }
        if (_hasRequest && !_session->IsWaiting(_viewport)) {
            _session->Render(request);
        }
        _session->DrainMessages();
    });
}

bool HdOocPTRenderPass::_BindAovs(HdRenderPassAovBindingVector const& bindings, HdOocPTRenderRequest* request)
{
    for (HdRenderPassAovBinding const& binding : bindings) {
        auto* const buffer = dynamic_cast<HdOocPTRenderBuffer*>(_FindBuffer(binding));
        if (!buffer) {
            continue;
        }
        if (!request->viewport) {
            request->viewport = buffer;
        }
        TfToken const name = HdOocPTAovName(binding);
        HdOocPTAov const* const aov = HdOocPTFindAov(name);
        buffer->Bind(request->viewport, aov, binding.clearValue);
        int const width = static_cast<int>(buffer->GetWidth());
        int const height = static_cast<int>(buffer->GetHeight());
        if (!aov || width == 0 || height == 0) {
            continue;
        }
        if (request->aovs.empty()) {
            request->width = width;
            request->height = height;
        }
        auto const isSame = [aov](HdOocPTAovRequest const& other) { return other.name == aov->name; };
        if (std::none_of(request->aovs.begin(), request->aovs.end(), isSame)) {
            request->aovs.push_back({ aov->name, name == aov->name ? binding.clearValue : aov->clearValue });
        }
    }
    return !request->aovs.empty();
}

HdRenderBuffer* HdOocPTRenderPass::_FindBuffer(HdRenderPassAovBinding const& binding) const
{
    if (binding.renderBuffer || !GetRenderIndex()) {
        return binding.renderBuffer;
    }
    HdBprim* const bprim = GetRenderIndex()->GetBprim(_primTypeTokens->renderBuffer, binding.renderBufferId);
    return static_cast<HdRenderBuffer*>(bprim);
}

PXR_NAMESPACE_CLOSE_SCOPE
