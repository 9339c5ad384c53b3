// SPDX-License-Identifier: Apache-2.0
/// The interface by which Hydra drives a renderer.
#ifndef OOCPT_ABI_HD_RENDER_DELEGATE_H
#define OOCPT_ABI_HD_RENDER_DELEGATE_H

#include "pxr/base/tf/hashmap.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/vt/dictionary.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/aov.h"
#include "pxr/imaging/hd/api.h"
#include "pxr/imaging/hd/command.h"
#include "pxr/imaging/hd/renderPass.h"
#include "pxr/imaging/hd/resourceRegistry.h"
#include "pxr/imaging/hd/rprimCollection.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <string>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdBprim;
class HdChangeTracker;
class HdDriver;
class HdInstancer;
class HdRenderIndex;
class HdRprim;
class HdSceneDelegate;
class HdSprim;

using HdDriverVector = std::vector<HdDriver*>;
using HdRenderSettingsMap = TfHashMap<TfToken, VtValue, TfToken::HashFunctor>;

/// Opaque object that Hydra hands to every Sync.
class HD_API HdRenderParam
{
public:
    HdRenderParam() = default;
    virtual ~HdRenderParam();

    virtual bool SetArbitraryValue(TfToken const& key, VtValue const& value);
    virtual VtValue GetArbitraryValue(TfToken const& key) const;
    virtual bool HasArbitraryValue(TfToken const& key) const;
    virtual bool IsValid() const;
};

struct HdRenderSettingDescriptor
{
    std::string name;
    TfToken key;
    VtValue defaultValue;
};

using HdRenderSettingDescriptorList = std::vector<HdRenderSettingDescriptor>;

class HD_API HdRenderDelegate
{
public:
    virtual ~HdRenderDelegate();

    virtual void SetDrivers(HdDriverVector const& drivers);
    virtual TfTokenVector const& GetSupportedRprimTypes() const = 0;
    virtual TfTokenVector const& GetSupportedSprimTypes() const = 0;
    virtual TfTokenVector const& GetSupportedBprimTypes() const = 0;
    virtual HdRenderParam* GetRenderParam() const;
    virtual HdResourceRegistrySharedPtr GetResourceRegistry() const = 0;
    virtual void SetRenderSetting(TfToken const& key, VtValue const& value);
    virtual VtValue GetRenderSetting(TfToken const& key) const;
    virtual HdRenderSettingDescriptorList GetRenderSettingDescriptors() const;
    virtual unsigned int GetRenderSettingsVersion() const;
    virtual VtDictionary GetRenderStats() const;
    virtual HdContainerDataSourceHandle GetCapabilities() const;
    virtual bool IsPauseSupported() const;
    virtual bool IsPaused() const;
    virtual bool Pause();
    virtual bool Resume();
    virtual bool IsStopSupported() const;
    virtual bool IsStopped() const;
    virtual bool Stop(bool blocking = true);
    virtual bool Restart();
    virtual HdRenderPassSharedPtr CreateRenderPass(HdRenderIndex* index, HdRprimCollection const& collection) = 0;
    virtual HdRenderPassStateSharedPtr CreateRenderPassState() const;
    virtual HdInstancer* CreateInstancer(HdSceneDelegate* delegate, SdfPath const& id) = 0;
    virtual void DestroyInstancer(HdInstancer* instancer) = 0;
    virtual HdRprim* CreateRprim(TfToken const& typeId, SdfPath const& rprimId) = 0;
    virtual void DestroyRprim(HdRprim* rprim) = 0;
    virtual HdSprim* CreateSprim(TfToken const& typeId, SdfPath const& sprimId) = 0;
    virtual HdSprim* CreateFallbackSprim(TfToken const& typeId) = 0;
    virtual void DestroySprim(HdSprim* sprim) = 0;
    virtual HdBprim* CreateBprim(TfToken const& typeId, SdfPath const& bprimId) = 0;
    virtual HdBprim* CreateFallbackBprim(TfToken const& typeId) = 0;
    virtual void DestroyBprim(HdBprim* bprim) = 0;

    /// Called once after each round of Sync, before any task executes.
    virtual void CommitResources(HdChangeTracker* tracker) = 0;
    virtual TfToken GetMaterialBindingPurpose() const;
    virtual TfToken GetMaterialNetworkSelector() const;
    virtual TfTokenVector GetMaterialRenderContexts() const;
    virtual TfTokenVector GetRenderSettingsNamespaces() const;
    virtual bool IsPrimvarFilteringNeeded() const;
    virtual TfTokenVector GetShaderSourceTypes() const;
    virtual HdAovDescriptor GetDefaultAovDescriptor(TfToken const& name) const;
    virtual HdCommandDescriptors GetCommandDescriptors() const;
    virtual bool InvokeCommand(TfToken const& command, HdCommandArgs const& args);

    /// Called once per render index, before any prim is added.
    virtual void SetTerminalSceneIndex(HdSceneIndexBaseRefPtr const& terminalSceneIndex);
    virtual void Update();
    virtual bool IsParallelSyncEnabled(TfToken const& primType) const;
#if PXR_VERSION >= 2603
    /// Whether only Storm's tasks can draw what this delegate makes.
    virtual bool RequiresStormTasks() const;
#endif

protected:
    HdRenderDelegate();
    explicit HdRenderDelegate(HdRenderSettingsMap const& settingsMap);

    /// Fills the settings that the map does not hold yet.
    void _PopulateDefaultSettings(HdRenderSettingDescriptorList const& defaultSettings);

    HdRenderSettingsMap _settingsMap;
    unsigned int _settingsVersion;

private:
    unsigned char _opaque[0x58 - 0x38];
};

static_assert(sizeof(HdRenderParam) == 0x8);
static_assert(sizeof(HdRenderSettingDescriptor) == 0x38);
static_assert(sizeof(HdRenderDelegate) == 0x58);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
