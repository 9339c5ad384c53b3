// SPDX-License-Identifier: Apache-2.0
/// One concrete class per interface that cpp/abi declares, so that a library that includes this has their virtual
/// tables. Included by probe.cpp alone.
///
/// No `override` anywhere: the test also compiles this against headers with planted faults, and those must compile.
#ifndef OOCPT_TESTS_ABI_PROBE_CLASSES_H
#define OOCPT_TESTS_ABI_PROBE_CLASSES_H

#include "pxr/imaging/hd/camera.h"
#include "pxr/imaging/hd/instancer.h"
#include "pxr/imaging/hd/renderBuffer.h"
#include "pxr/imaging/hd/renderDelegate.h"
#include "pxr/imaging/hd/rendererPluginRegistry.h"
#include "pxr/imaging/hd/renderSettings.h"
#include "pxr/imaging/hd/retainedDataSource.h"
#include "pxr/imaging/hd/rprim.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/imaging/hdsi/extComputationPrimvarPruningSceneIndex.h"
#include "pxr/imaging/hdsi/implicitSurfaceSceneIndex.h"
#include "pxr/imaging/hdsi/nurbsApproximatingSceneIndex.h"
#include "pxr/imaging/hdsi/tetMeshConversionSceneIndex.h"

#include <sstream>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

struct ProbeRendererPlugin : HdRendererPlugin
{
    ~ProbeRendererPlugin();
    HdRenderDelegate* CreateRenderDelegate() { return nullptr; }
    HdRenderDelegate* CreateRenderDelegate(HdRenderSettingsMap const&) { return nullptr; }
    void DeleteRenderDelegate(HdRenderDelegate*) { }
#if PXR_VERSION >= 2603
    bool IsSupported(HdRendererCreateArgs const&, std::string*) const { return false; }
#else
    bool IsSupported(bool) const { return false; }
#endif
};
ProbeRendererPlugin::~ProbeRendererPlugin() = default;

struct ProbeRenderDelegate : HdRenderDelegate
{
    ~ProbeRenderDelegate();
    TfTokenVector const& GetSupportedRprimTypes() const { return none; }
    TfTokenVector const& GetSupportedSprimTypes() const { return none; }
    TfTokenVector const& GetSupportedBprimTypes() const { return none; }
    HdResourceRegistrySharedPtr GetResourceRegistry() const { return nullptr; }
    HdRenderPassSharedPtr CreateRenderPass(HdRenderIndex*, HdRprimCollection const&) { return nullptr; }
    HdInstancer* CreateInstancer(HdSceneDelegate*, SdfPath const&) { return nullptr; }
    void DestroyInstancer(HdInstancer*) { }
    HdRprim* CreateRprim(TfToken const&, SdfPath const&) { return nullptr; }
    void DestroyRprim(HdRprim*) { }
    HdSprim* CreateSprim(TfToken const&, SdfPath const&) { return nullptr; }
    HdSprim* CreateFallbackSprim(TfToken const&) { return nullptr; }
    void DestroySprim(HdSprim*) { }
    HdBprim* CreateBprim(TfToken const&, SdfPath const&) { return nullptr; }
    HdBprim* CreateFallbackBprim(TfToken const&) { return nullptr; }
    void DestroyBprim(HdBprim*) { }
    void CommitResources(HdChangeTracker*) { }

    VtValue MapValue(TfToken const& key) { return _settingsMap[key]; }
    unsigned int Version() const { return _settingsVersion; }
    void Populate(HdRenderSettingDescriptorList const& list) { _PopulateDefaultSettings(list); }

    TfTokenVector none;
};
ProbeRenderDelegate::~ProbeRenderDelegate() = default;

struct ProbeRenderPass : HdRenderPass
{
    using HdRenderPass::HdRenderPass;
    ~ProbeRenderPass();
    void _Execute(HdRenderPassStateSharedPtr const&, TfTokenVector const&) { }
};
ProbeRenderPass::~ProbeRenderPass() = default;

struct ProbeRenderPassState : HdRenderPassState
{
    ~ProbeRenderPassState();
};
ProbeRenderPassState::~ProbeRenderPassState() = default;

struct ProbeRenderBuffer : HdRenderBuffer
{
    using HdRenderBuffer::HdRenderBuffer;
    ~ProbeRenderBuffer();
    bool Allocate(GfVec3i const&, HdFormat, bool) { return false; }
    unsigned int GetWidth() const { return 0; }
    unsigned int GetHeight() const { return 0; }
    unsigned int GetDepth() const { return 0; }
    HdFormat GetFormat() const { return HdFormatInvalid; }
    bool IsMultiSampled() const { return false; }
    void* Map() { return nullptr; }
    void Unmap() { }
    bool IsMapped() const { return false; }
    void Resolve() { }
    bool IsConverged() const { return false; }
    void _Deallocate() { }
};
ProbeRenderBuffer::~ProbeRenderBuffer() = default;

struct ProbeRprim : HdRprim
{
    using HdRprim::HdRprim;
    ~ProbeRprim();
    HdDirtyBits GetInitialDirtyBitsMask() const { return 0; }
    void Sync(HdSceneDelegate*, HdRenderParam*, HdDirtyBits*, TfToken const&) { }
    TfTokenVector const& GetBuiltinPrimvarNames() const { return none; }
    HdDirtyBits _PropagateDirtyBits(HdDirtyBits bits) const { return bits; }
    void _InitRepr(TfToken const&, HdDirtyBits*) { }
    TfTokenVector none;
};
ProbeRprim::~ProbeRprim() = default;

struct ProbeSprim : HdSprim
{
    using HdSprim::HdSprim;
    ~ProbeSprim();
    void Sync(HdSceneDelegate*, HdRenderParam*, HdDirtyBits*) { }
    HdDirtyBits GetInitialDirtyBitsMask() const { return 0; }
};
ProbeSprim::~ProbeSprim() = default;

struct ProbeBprim : HdBprim
{
    using HdBprim::HdBprim;
    ~ProbeBprim();
    void Sync(HdSceneDelegate*, HdRenderParam*, HdDirtyBits*) { }
    HdDirtyBits GetInitialDirtyBitsMask() const { return 0; }
};
ProbeBprim::~ProbeBprim() = default;

struct ProbeRenderSettings : HdRenderSettings
{
    explicit ProbeRenderSettings(SdfPath const& id)
        : HdRenderSettings(id)
    {
    }
    ~ProbeRenderSettings();
};
ProbeRenderSettings::~ProbeRenderSettings() = default;

struct ProbeInstancer : HdInstancer
{
    using HdInstancer::HdInstancer;
    ~ProbeInstancer();
};
ProbeInstancer::~ProbeInstancer() = default;

struct ProbeSceneDelegate : HdSceneDelegate
{
    using HdSceneDelegate::HdSceneDelegate;
    ~ProbeSceneDelegate();
};
ProbeSceneDelegate::~ProbeSceneDelegate() = default;

struct ProbeCamera : HdCamera
{
    using HdCamera::HdCamera;
    ~ProbeCamera();
};
ProbeCamera::~ProbeCamera() = default;

struct ProbeRenderParam : HdRenderParam
{
    ~ProbeRenderParam();
};
ProbeRenderParam::~ProbeRenderParam() = default;

struct ProbeResourceRegistry : HdResourceRegistry
{
    ~ProbeResourceRegistry();
};
ProbeResourceRegistry::~ProbeResourceRegistry() = default;

struct ProbeContainerDataSource : HdContainerDataSource
{
    ~ProbeContainerDataSource();
    std::vector<TfToken> GetNames() { return {}; }
    HdDataSourceBaseHandle Get(TfToken const&) { return nullptr; }
};
ProbeContainerDataSource::~ProbeContainerDataSource() = default;

struct ProbeVectorDataSource : HdVectorDataSource
{
    ~ProbeVectorDataSource();
    std::size_t GetNumElements() { return 0; }
    HdDataSourceBaseHandle GetElement(std::size_t) { return nullptr; }
};
ProbeVectorDataSource::~ProbeVectorDataSource() = default;

struct ProbeTokenDataSource : HdTypedSampledDataSource<TfToken>
{
    ~ProbeTokenDataSource();
    VtValue GetValue(Time) { return {}; }
    bool GetContributingSampleTimesForInterval(Time, Time, std::vector<Time>*) { return false; }
    TfToken GetTypedValue(Time) { return {}; }
};
ProbeTokenDataSource::~ProbeTokenDataSource() = default;

struct ProbeObserver : HdSceneIndexObserver
{
    ~ProbeObserver();
    void PrimsAdded(HdSceneIndexBase const&, AddedPrimEntries const& entries)
    {
        for (auto const& entry : entries) {
            seen << "+" << entry.primPath << ":" << entry.primType << " ";
        }
    }
    void PrimsRemoved(HdSceneIndexBase const&, RemovedPrimEntries const& entries)
    {
        for (auto const& entry : entries) {
            seen << "-" << entry.primPath << " ";
        }
    }
    void PrimsDirtied(HdSceneIndexBase const&, DirtiedPrimEntries const& entries)
    {
        for (auto const& entry : entries) {
            seen << "*" << entry.primPath;
            for (auto const& locator : entry.dirtyLocators) {
                seen << "," << locator.GetString();
            }
            seen << " ";
        }
    }
    void PrimsRenamed(HdSceneIndexBase const& sender, RenamedPrimEntries const& entries)
    {
        ConvertPrimsRenamedToRemovedAndAdded(sender, entries, this);
    }
    std::ostringstream seen;
};
ProbeObserver::~ProbeObserver() = default;

struct ProbeSceneIndex : HdSceneIndexBase
{
    ~ProbeSceneIndex();
    HdSceneIndexPrim GetPrim(SdfPath const& path) const
    {
        TfToken const name("name");
        HdDataSourceBaseHandle const value = HdRetainedTypedSampledDataSource<TfToken>::New(path.GetNameToken());
        return { TfToken("probe"), HdRetainedContainerDataSource::New(1, &name, &value) };
    }
    SdfPathVector GetChildPrimPaths(SdfPath const&) const { return {}; }
};
ProbeSceneIndex::~ProbeSceneIndex() = default;

PXR_NAMESPACE_CLOSE_SCOPE

#endif
