// SPDX-License-Identifier: Apache-2.0
/// Hydra render delegate: makes prims, passes and buffers, and carries settings and commands to the session.
#ifndef HDOOCPT_RENDER_DELEGATE_H
#define HDOOCPT_RENDER_DELEGATE_H

#include "hdOocPT/compat.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/vt/dictionary.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/renderDelegate.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <cstdint>
#include <memory>
#include <unordered_map>

PXR_NAMESPACE_OPEN_SCOPE

class HdOocPTPlaceholderRprim;
class HdOocPTSession;

/// One renderer for one render index. The scene does not come through the prims made here but through
/// SetTerminalSceneIndex; the prims are placeholders that keep Hydra's own bookkeeping (prim ids, cameras) alive.
///
/// Threads: the host's only, but for GetRenderStats and the pause and stop functions, which any thread may call.
class HdOocPTRenderDelegate final : public HdRenderDelegate
{
public:
    explicit HdOocPTRenderDelegate(HdRenderSettingsMap const& settingsMap);
    ~HdOocPTRenderDelegate() override;
    HdOocPTRenderDelegate(HdOocPTRenderDelegate const&) = delete;
    HdOocPTRenderDelegate& operator=(HdOocPTRenderDelegate const&) = delete;

    // ---- what is supported ----
    TfTokenVector const& GetSupportedRprimTypes() const override;
    TfTokenVector const& GetSupportedSprimTypes() const override;
    TfTokenVector const& GetSupportedBprimTypes() const override;
    HdResourceRegistrySharedPtr GetResourceRegistry() const override;
    TfToken GetMaterialBindingPurpose() const override;
    TfTokenVector GetMaterialRenderContexts() const override;
    TfTokenVector GetShaderSourceTypes() const override;
    TfTokenVector GetRenderSettingsNamespaces() const override;
    bool IsParallelSyncEnabled(TfToken const& primType) const override;

    /// The format is invalid for outputs that OocPT does not render.
    HdAovDescriptor GetDefaultAovDescriptor(TfToken const& name) const override;

    // ---- settings, statistics, commands ----
    void SetRenderSetting(TfToken const& key, VtValue const& value) override;
    HdRenderSettingDescriptorList GetRenderSettingDescriptors() const override;
    VtDictionary GetRenderStats() const override;
    HdCommandDescriptors GetCommandDescriptors() const override;
    bool InvokeCommand(TfToken const& command, HdCommandArgs const& args) override;

    // ---- rendering under the host's control ----
    bool IsPauseSupported() const override;
    bool IsPaused() const override;
    bool Pause() override;
    bool Resume() override;
    bool IsStopSupported() const override;
    bool IsStopped() const override;
    bool Stop(bool blocking = true) override;
    bool Restart() override;

    // ---- scene ----
    void SetTerminalSceneIndex(HdSceneIndexBaseRefPtr const& terminalSceneIndex) override;
    void CommitResources(HdChangeTracker* tracker) override;

    // ---- factory ----
    HdRenderPassSharedPtr CreateRenderPass(HdRenderIndex* index, HdRprimCollection const& collection) override;
    HdInstancer* CreateInstancer(HdSceneDelegate* delegate, SdfPath const& id) override;
    void DestroyInstancer(HdInstancer* instancer) override;
    HdRprim* CreateRprim(TfToken const& typeId, SdfPath const& rprimId) override;
    void DestroyRprim(HdRprim* rprim) override;
    HdSprim* CreateSprim(TfToken const& typeId, SdfPath const& sprimId) override;
    HdSprim* CreateFallbackSprim(TfToken const& typeId) override;
    void DestroySprim(HdSprim* sprim) override;
    HdBprim* CreateBprim(TfToken const& typeId, SdfPath const& bprimId) override;
    HdBprim* CreateFallbackBprim(TfToken const& typeId) override;
    void DestroyBprim(HdBprim* bprim) override;

private:
    int32_t _FindPrimId(SdfPath const& path) const;

    std::shared_ptr<HdOocPTSession> const _session;
    HdResourceRegistrySharedPtr const _resourceRegistry;

    std::unordered_map<SdfPath, HdOocPTPlaceholderRprim const*, SdfPath::Hash> _rprims;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
