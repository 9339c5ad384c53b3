// SPDX-License-Identifier: Apache-2.0
/// Loaded into the wheel host by tests/abi/test_abi.py: tells what cpp/abi believes, and checks it in action.
///
/// - The virtual tables of one concrete class per declared interface (probe_classes.h).
/// - oocpt_abi_sizes(): the sizes that the headers declare, to compare with the runtime's deleting destructors.
/// - oocpt_abi_run(): passes values through functions of the runtime and back through inline members of the headers.
#include "probe_classes.h"

#include "pxr/usd/sdr/registry.h"
#include "pxr/usd/sdr/shaderNode.h"

#include <sstream>
#include <string>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

// ---- runtime functions that the headers do not declare ----

#if PXR_VERSION == 2508
#define RUNTIME(name) __asm__("_ZN32pxrBlender_v25_08__pxrReserved__" name)
#else
#define RUNTIME(name) __asm__("_ZN32pxrBlender_v26_03__pxrReserved__" name)
#endif
void RuntimeSetFraming(HdRenderPassState*, CameraUtilFraming const&)
    RUNTIME("17HdRenderPassState10SetFramingERKNS_17CameraUtilFramingE");
void RuntimeSetAovBindings(HdRenderPassState*, HdRenderPassAovBindingVector const&)
    RUNTIME("17HdRenderPassState14SetAovBindingsERKSt6vectorINS_22HdRenderPassAovBindingESaIS2_EE");
void RuntimeSetCamera(HdRenderPassState*, HdCamera const*) RUNTIME("17HdRenderPassState9SetCameraEPKNS_8HdCameraE");
void RuntimeSetPrimId(HdRprim*, int) RUNTIME("7HdRprim9SetPrimIdEi");
void RuntimeMakeCollection(void*) RUNTIME("17HdRprimCollectionC1Ev");
void RuntimeSendPrimsDirtied(HdSceneIndexBase*, HdSceneIndexObserver::DirtiedPrimEntries const&) RUNTIME(
    "16HdSceneIndexBase17_SendPrimsDirtiedERKNS_13TfSmallVectorINS_20HdSceneIndexObserver16DirtiedPrimEntryELj16EEE");

namespace {

std::ostringstream _failures;

void _Expect(bool isTrue, char const* what)
{
    if (!isTrue) {
        _failures << what << "\n";
    }
}

void _CheckPrims()
{
    SdfPath const path("/probe/prim");
    ProbeRprim rprim(path);
    RuntimeSetPrimId(&rprim, 1234567);
    _Expect(rprim.GetPrimId() == 1234567 && rprim.GetId() == path, "HdRprim: prim id or path");
    _Expect(ProbeSprim(path).GetId() == path && HdCamera(path).GetId() == path, "HdSprim: path");
    _Expect(ProbeBprim(path).GetId() == path && ProbeRenderSettings(path).GetId() == path, "HdBprim: path");
    _Expect(!ProbeRenderSettings(path).IsActive(), "HdRenderSettings: active without a scene");
}

void _CheckShaders()
{
    SdrRegistry& registry = SdrRegistry::GetInstance();
    SdrShaderNode const* const node = registry.GetShaderNodeByIdentifier(TfToken("UsdPreviewSurface"), {});
    std::string const words = node ? node->SdrShaderNode::GetInfoString() : "";
    bool const isIt = words.rfind("UsdPreviewSurface", 0) == 0;
    _Expect(isIt && words.find("implementation URI: '") != std::string::npos, "SdrShaderNode: what is said of it");
    _Expect(!registry.GetShaderNodeByIdentifier(TfToken("no such shader"), {}), "SdrRegistry: one that is not there");
}

void _CheckPassState()
{
    ProbeRenderPassState state;
    HdCamera const camera(SdfPath("/probe/camera"));
    CameraUtilFraming framing;
    framing.displayWindow = GfRange2f(GfVec2f(1, 2), GfVec2f(3, 4));
    framing.dataWindow = GfRect2i(GfVec2i(5, 6), GfVec2i(7, 8));
    framing.pixelAspectRatio = 9.0f;
    HdRenderPassAovBindingVector bindings(3);
    bindings[2].aovName = TfToken("third");
    bindings[2].clearValue = VtValue(7);
    RuntimeSetCamera(&state, &camera);
    RuntimeSetFraming(&state, framing);
    RuntimeSetAovBindings(&state, bindings);
    _Expect(state.GetCamera() == &camera, "HdRenderPassState: camera");
    _Expect(state.GetFraming().displayWindow == framing.displayWindow
            && state.GetFraming().dataWindow == framing.dataWindow && state.GetFraming().pixelAspectRatio == 9.0f
            && state.GetFraming().IsValid(),
        "HdRenderPassState: framing");
    HdRenderPassAovBindingVector const& kept = state.GetAovBindings();
    _Expect(kept.size() == 3 && kept[2].aovName == "third" && kept[2].clearValue == VtValue(7),
        "HdRenderPassState: outputs");

    alignas(16) unsigned char collection[0x100] = {};
    RuntimeMakeCollection(collection);
    auto* const index = reinterpret_cast<HdRenderIndex*>(collection);
    ProbeRenderPass const pass(index, *reinterpret_cast<HdRprimCollection const*>(collection));
    _Expect(pass.GetRenderIndex() == index, "HdRenderPass: render index");
}

void _CheckDelegate()
{
    ProbeRenderDelegate delegate;
    TfToken const key("probe:key");
    unsigned int const version = delegate.Version();
    delegate.SetRenderSetting(key, VtValue(3));
    _Expect(delegate.GetRenderSetting(key) == VtValue(3) && delegate.MapValue(key) == VtValue(3),
        "HdRenderDelegate: settings map");
    _Expect(delegate.Version() == version + 1 && delegate.GetRenderSettingsVersion() == version + 1,
        "HdRenderDelegate: settings version");
    TfToken const other("probe:other");
    delegate.Populate({ { "Other", other, VtValue(std::string("text")) }, { "Key", key, VtValue(4) } });
    _Expect(delegate.GetRenderSetting(other) == VtValue(std::string("text"))
            && delegate.GetRenderSetting(key) == VtValue(3),
        "HdRenderSettingDescriptor: defaults");
    HdAovDescriptor const aov = delegate.HdRenderDelegate::GetDefaultAovDescriptor(TfToken("color"));
    _Expect(aov.format == HdFormatInvalid && !aov.multiSampled && aov.clearValue.IsEmpty(), "HdAovDescriptor");
    _Expect(
        !delegate.GetCapabilities() && delegate.GetCommandDescriptors().empty(), "HdRenderDelegate: returned values");
}

void _CheckFormats()
{
    struct
    {
        HdFormat format;
        size_t components;
        size_t bytes;
        HdFormat component;
    } const expected[] = {
        { HdFormatUNorm8, 1, 1, HdFormatUNorm8 },
        { HdFormatUNorm8Vec4, 4, 4, HdFormatUNorm8 },
        { HdFormatSNorm8Vec3, 3, 3, HdFormatSNorm8 },
        { HdFormatFloat16Vec2, 2, 4, HdFormatFloat16 },
        { HdFormatFloat16Vec4, 4, 8, HdFormatFloat16 },
        { HdFormatFloat32, 1, 4, HdFormatFloat32 },
        { HdFormatFloat32Vec3, 3, 12, HdFormatFloat32 },
        { HdFormatFloat32Vec4, 4, 16, HdFormatFloat32 },
        { HdFormatInt16, 1, 2, HdFormatInt16 },
        { HdFormatUInt16, 1, 2, HdFormatUInt16 },
        { HdFormatInt32, 1, 4, HdFormatInt32 },
        { HdFormatInt32Vec4, 4, 16, HdFormatInt32 },
    };
    for (auto const& row : expected) {
        bool const isEqual = HdGetComponentCount(row.format) == row.components
            && HdDataSizeOfFormat(row.format) == row.bytes && HdGetComponentFormat(row.format) == row.component;
        _Expect(isEqual, ("HdFormat " + std::to_string(row.format)).c_str());
    }
}

void _CheckSceneIndices()
{
    TfToken const sphere("sphere");
    HdDataSourceBaseHandle const toMesh = HdRetainedTypedSampledDataSource<TfToken>::New(TfToken("toMesh"));
    HdSceneIndexBaseRefPtr const scene = TfCreateRefPtr(new ProbeSceneIndex);
    HdSceneIndexBaseRefPtr const meshes
        = HdsiImplicitSurfaceSceneIndex::New(scene, HdRetainedContainerDataSource::New(1, &sphere, &toMesh));
    HdSceneIndexBaseRefPtr const curves = HdsiNurbsApproximatingSceneIndex::New(meshes);
    HdSceneIndexBaseRefPtr const surfaces = HdsiTetMeshConversionSceneIndex::New(curves);
    HdSceneIndexBaseRefPtr const last = HdSiExtComputationPrimvarPruningSceneIndex::New(surfaces);
    ProbeObserver observer;
    last->AddObserver(HdSceneIndexObserverPtr(&observer));

    HdDataSourceLocator const name(TfToken("name"));
    HdSceneIndexPrim const prim = last->GetPrim(SdfPath("/a/b"));
    auto const source = HdTypedSampledDataSource<TfToken>::Cast(HdContainerDataSource::Get(prim.dataSource, name));
    _Expect(prim.primType == "probe" && source && source->GetTypedValue(0) == "b", "HdSceneIndexBase: prim");

    HdSceneIndexObserver::DirtiedPrimEntries dirtied;
    dirtied.emplace_back(SdfPath("/x"), HdDataSourceLocatorSet { name, HdDataSourceLocator(sphere, sphere) });
    dirtied.emplace_back(SdfPath("/y"), HdDataSourceLocatorSet(name));
    RuntimeSendPrimsDirtied(get_pointer(scene), dirtied);
    HdSceneIndexObserver::RenamedPrimEntries renamed;
    renamed.emplace_back(SdfPath("/from"), SdfPath("/to"));
    observer.PrimsRenamed(*scene, renamed);
    _Expect(observer.seen.str() == "*/x,name,sphere/sphere */y,name -/from +/to:probe ", observer.seen.str().c_str());
}

} // namespace

PXR_NAMESPACE_CLOSE_SCOPE

PXR_NAMESPACE_USING_DIRECTIVE

/// "Class size" lines, sizes in decimal.
extern "C" char const* oocpt_abi_sizes()
{
    static std::string const lines = [] {
        std::ostringstream text;
#define SIZE(type) text << #type << " " << sizeof(type) << "\n"
        SIZE(HdSceneIndexBase);
        SIZE(HdRenderPassState);
        SIZE(HdRenderParam);
        SIZE(HdRenderSettings);
        SIZE(HdInstancer);
        SIZE(HdCamera);
        SIZE(HfPluginBase);
        SIZE(HdRenderDelegate);
        SIZE(HdRenderPass);
        SIZE(HdRenderBuffer);
        SIZE(HdRprim);
        SIZE(HdSprim);
        SIZE(HdBprim);
        SIZE(HdSceneIndexObserver);
        SIZE(HdRendererPlugin);
#undef SIZE
        return text.str();
    }();
    return lines.c_str();
}

/// One line per check that failed; empty when all hold.
extern "C" char const* oocpt_abi_run()
{
    static std::string const lines = [] {
        _CheckPrims();
        _CheckPassState();
        _CheckShaders();
        _CheckDelegate();
        _CheckFormats();
        _CheckSceneIndices();
        return _failures.str();
    }();
    return lines.c_str();
}
