// SPDX-License-Identifier: Apache-2.0
#include "hdOocPT/renderDelegate.h"

#include "bridge/session.h"
#include "hdOocPT/aov.h"
#include "hdOocPT/guard.h"
#include "hdOocPT/placeholderPrims.h"
#include "hdOocPT/renderBuffer.h"
#include "hdOocPT/renderPass.h"
#include "pxr/base/tf/diagnostic.h"
#include "pxr/imaging/hd/camera.h"
#include "pxr/imaging/hd/instancer.h"

#include <map>

PXR_NAMESPACE_OPEN_SCOPE

// clang-format off
TF_DEFINE_PRIVATE_TOKENS(_tokens,
    // prim types
    (mesh)(basisCurves)(points)(sphere)(cube)(cone)(cylinder)(capsule)(plane)(nurbsCurves)(nurbsPatch)
    (tetMesh)(camera)(distantLight)(domeLight)(rectLight)
    (sphereLight)(diskLight)(cylinderLight)(material)(extComputation)(renderBuffer)(renderSettings)
    // names of settings, purposes and commands
    (oocpt)(driver)(karma)(arnold)(ri)(full)(restart)(stop)(mtlx)(glslfx));
// clang-format on

HdOocPTRenderDelegate::HdOocPTRenderDelegate(HdRenderSettingsMap const& settingsMap)
    : _session(std::make_shared<HdOocPTSession>())
    , _resourceRegistry(std::make_shared<HdResourceRegistry>())
{
    _session->SetPrimIdLookup([this](SdfPath const& path) { return _FindPrimId(path); });
    _settingsMap = settingsMap;
    _PopulateDefaultSettings(GetRenderSettingDescriptors());
    // A hash map has no order; settings are forwarded in the order of their names.
    std::map<TfToken, VtValue> const ordered(settingsMap.begin(), settingsMap.end());
    for (auto const& entry : ordered) {
        _session->SetSetting(entry.first, entry.second);
    }
}

HdOocPTRenderDelegate::~HdOocPTRenderDelegate()
{
    HdOocPTGuard("closing the session", [this] {
        _session->Stop(true);
        _session->SetTerminalSceneIndex(HdSceneIndexBaseRefPtr());
        _session->SetPrimIdLookup([](SdfPath const&) { return -1; });
        _session->DrainMessages();
    });
}

// ---- what is supported ----

TfTokenVector const& HdOocPTRenderDelegate::GetSupportedRprimTypes() const
{
    // Implicit shapes, NURBS and tetrahedral meshes are listed so that they get prim ids; scene indices in front of the
    // reader convert most of them to meshes and basis curves.
    static TfTokenVector const types { _tokens->mesh, _tokens->basisCurves, _tokens->points, _tokens->sphere,
        _tokens->cube, _tokens->cone, _tokens->cylinder, _tokens->capsule, _tokens->plane, _tokens->nurbsCurves,
        _tokens->nurbsPatch, _tokens->tetMesh };
    return types;
}

TfTokenVector const& HdOocPTRenderDelegate::GetSupportedSprimTypes() const
{
    // Lights that are not rendered yet are listed so that they reach the scene index, where the reader warns of them.
    // simpleLight is not: without it hosts send their camera light as a distantLight.
    static TfTokenVector const types { _tokens->camera, _tokens->distantLight, _tokens->domeLight, _tokens->rectLight,
        _tokens->sphereLight, _tokens->diskLight, _tokens->cylinderLight, _tokens->material, _tokens->extComputation };
    return types;
}

TfTokenVector const& HdOocPTRenderDelegate::GetSupportedBprimTypes() const
{
    static TfTokenVector const types { _tokens->renderBuffer, _tokens->renderSettings };
    return types;
}

HdResourceRegistrySharedPtr HdOocPTRenderDelegate::GetResourceRegistry() const
{
    return _resourceRegistry;
}

TfToken HdOocPTRenderDelegate::GetMaterialBindingPurpose() const
{
    return _tokens->full;
}

TfTokenVector HdOocPTRenderDelegate::GetMaterialRenderContexts() const
{
    return { _tokens->mtlx, TfToken() };
}

TfTokenVector HdOocPTRenderDelegate::GetShaderSourceTypes() const
{
    // Front ends that ask OpenUSD's registry find definitions in MaterialX documents by the first type, and the nodes
    // of UsdPreviewSurface by the second, as without any types.
    return { _tokens->mtlx, _tokens->glslfx };
}

TfTokenVector HdOocPTRenderDelegate::GetRenderSettingsNamespaces() const
{
    // Those of others are for products and vars, whose settings users of other renderers write.
    return { _tokens->oocpt, _tokens->driver, _tokens->karma, _tokens->arnold, _tokens->ri };
}

bool HdOocPTRenderDelegate::IsParallelSyncEnabled(TfToken const& primType) const
{
    return primType == _tokens->mesh;
}

HdAovDescriptor HdOocPTRenderDelegate::GetDefaultAovDescriptor(TfToken const& name) const
{
    return HdOocPTDescribeAov(name);
}

// ---- settings, statistics, commands ----

void HdOocPTRenderDelegate::SetRenderSetting(TfToken const& key, VtValue const& value)
{
    HdOocPTGuard("setting a render setting", [&] {
        HdRenderDelegate::SetRenderSetting(key, value);
        _session->SetSetting(key, value);
        _session->DrainMessages();
    });
}

HdRenderSettingDescriptorList HdOocPTRenderDelegate::GetRenderSettingDescriptors() const
{
    return HdOocPTGuard("listing render settings", HdRenderSettingDescriptorList(), [this] {
        HdRenderSettingDescriptorList descriptors;
        for (HdOocPTSettingDescriptor const& setting : _session->GetSettingDescriptors()) {
            descriptors.push_back({ setting.name, setting.key, setting.defaultValue });
        }
        return descriptors;
    });
}

VtDictionary HdOocPTRenderDelegate::GetRenderStats() const
{
    return HdOocPTGuard("reading statistics", VtDictionary(), [this] { return _session->GetStats(); });
}

HdCommandDescriptors HdOocPTRenderDelegate::GetCommandDescriptors() const
{
    return HdOocPTGuard("listing commands", HdCommandDescriptors(), [] {
        return HdCommandDescriptors {
            HdCommandDescriptor(_tokens->restart, "Throw the image away and start again"),
            HdCommandDescriptor(_tokens->stop, "Stop rendering and keep the image"),
        };
    });
}

bool HdOocPTRenderDelegate::InvokeCommand(TfToken const& command, HdCommandArgs const&)
{
    if (command == _tokens->restart) {
        return Restart();
    }
    if (command == _tokens->stop) {
        return Stop(false);
    }
    TF_WARN("OocPT has no command '%s'", command.GetText());
    return false;
}

// ---- rendering under the host's control ----

bool HdOocPTRenderDelegate::IsPauseSupported() const
{
    return true;
}

bool HdOocPTRenderDelegate::IsPaused() const
{
    return HdOocPTGuard("asking for the pause", false, [this] { return _session->IsPaused(); });
}

bool HdOocPTRenderDelegate::Pause()
{
    return HdOocPTGuard("pausing", false, [this] {
        _session->Pause();
        return true;
    });
}

bool HdOocPTRenderDelegate::Resume()
{
    return HdOocPTGuard("resuming", false, [this] {
        _session->Resume();
        return true;
    });
}

bool HdOocPTRenderDelegate::IsStopSupported() const
{
    return true;
}

bool HdOocPTRenderDelegate::IsStopped() const
{
    return HdOocPTGuard("asking for the stop", true, [this] { return _session->IsStopped(); });
}

bool HdOocPTRenderDelegate::Stop(bool blocking)
{
    return HdOocPTGuard("stopping", false, [this, blocking] {
        _session->Stop(blocking);
        return true;
    });
}

bool HdOocPTRenderDelegate::Restart()
{
    return HdOocPTGuard("restarting", false, [this] {
        _session->Restart();
        return true;
    });
}

// ---- scene ----

void HdOocPTRenderDelegate::SetTerminalSceneIndex(HdSceneIndexBaseRefPtr const& terminalSceneIndex)
{
    HdOocPTGuard("taking the scene index", [&] { _session->SetTerminalSceneIndex(terminalSceneIndex); });
}

void HdOocPTRenderDelegate::CommitResources(HdChangeTracker*)
{
    HdOocPTGuard("reading the scene", [this] {
        _session->CommitScene();
        _session->DrainMessages();
    });
}

int32_t HdOocPTRenderDelegate::_FindPrimId(SdfPath const& path) const
{
    auto const found = _rprims.find(path);
    return found == _rprims.end() ? -1 : found->second->GetPrimId();
}

// ---- factory ----

HdRenderPassSharedPtr HdOocPTRenderDelegate::CreateRenderPass(HdRenderIndex* index, HdRprimCollection const& collection)
{
    return HdOocPTGuard("creating a render pass", HdRenderPassSharedPtr(),
        [&]() -> HdRenderPassSharedPtr { return std::make_shared<HdOocPTRenderPass>(index, collection, _session); });
}

HdInstancer* HdOocPTRenderDelegate::CreateInstancer(HdSceneDelegate* delegate, SdfPath const& id)
{
    return HdOocPTGuard(
        "creating an instancer", static_cast<HdInstancer*>(nullptr), [&] { return new HdInstancer(delegate, id); });
}

void HdOocPTRenderDelegate::DestroyInstancer(HdInstancer* instancer)
{
    delete instancer;
}

HdRprim* HdOocPTRenderDelegate::CreateRprim(TfToken const&, SdfPath const& rprimId)
{
    return HdOocPTGuard("creating a prim", static_cast<HdRprim*>(nullptr), [&]() -> HdRprim* {
        auto prim = std::make_unique<HdOocPTPlaceholderRprim>(rprimId);
        _rprims[rprimId] = prim.get();
        return prim.release();
    });
}

void HdOocPTRenderDelegate::DestroyRprim(HdRprim* rprim)
{
    if (rprim) {
        _rprims.erase(rprim->GetId());
        delete rprim;
    }
}

HdSprim* HdOocPTRenderDelegate::CreateSprim(TfToken const& typeId, SdfPath const& sprimId)
{
    return HdOocPTGuard("creating a prim", static_cast<HdSprim*>(nullptr), [&]() -> HdSprim* {
        if (typeId == _tokens->camera) {
            return new HdCamera(sprimId);
        }
        return new HdOocPTPlaceholderSprim(sprimId);
    });
}

HdSprim* HdOocPTRenderDelegate::CreateFallbackSprim(TfToken const& typeId)
{
    return CreateSprim(typeId, SdfPath::EmptyPath());
}

void HdOocPTRenderDelegate::DestroySprim(HdSprim* sprim)
{
    delete sprim;
}

HdBprim* HdOocPTRenderDelegate::CreateBprim(TfToken const& typeId, SdfPath const& bprimId)
{
    return HdOocPTGuard("creating a buffer prim", static_cast<HdBprim*>(nullptr), [&]() -> HdBprim* {
        if (typeId == _tokens->renderBuffer) {
            return new HdOocPTRenderBuffer(bprimId, _session);
        }
        if (typeId == _tokens->renderSettings) {
            return new HdOocPTPlaceholderRenderSettings(bprimId);
        }
        TF_CODING_ERROR("OocPT: unknown buffer prim type '%s'", typeId.GetText());
        return nullptr;
    });
}

HdBprim* HdOocPTRenderDelegate::CreateFallbackBprim(TfToken const& typeId)
{
    return CreateBprim(typeId, SdfPath::EmptyPath());
}

void HdOocPTRenderDelegate::DestroyBprim(HdBprim* bprim)
{
    delete bprim;
}

PXR_NAMESPACE_CLOSE_SCOPE
