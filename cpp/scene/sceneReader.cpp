// SPDX-License-Identifier: Apache-2.0
#include "scene/sceneReader.h"

#include "bridge/text.h"
#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/vt/array.h"
#include "pxr/base/work/loops.h"
#include "scene/assetPath.h"
#include "scene/dataSource.h"
#include "scene/instancerReader.h"
#include "scene/labelReader.h"
#include "scene/lightReader.h"
#include "scene/materialReader.h"
#include "scene/meshReader.h"
#include "scene/primKind.h"
#include "scene/tokens.h"

#include <algorithm>
#include <exception>
#include <iterator>
#include <optional>
#include <string>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

/// A prim that the renderer knows.
struct HdOocPTSceneReader::_Record
{
    HdOocPTPrimKind kind = HdOocPTPrimKind::Other;
    TfToken type;
    /// Set for meshes and instancers, according to kind.
    std::unique_ptr<HdOocPTMeshState> mesh;
    std::unique_ptr<HdOocPTInstancerState> instancer;
    /// True if the mesh is also a light.
    bool isMeshLight = false;
};

/// A prim to read, and the results.
struct HdOocPTSceneReader::_Job
{
    SdfPath path;
    uint32_t dirtyBits;
    _RecordPtr record;
    std::optional<oocpt::MeshDesc> mesh;
    std::optional<oocpt::InstancerDesc> instancer;
    /// The light of a mesh that is also a light.
    std::optional<oocpt::LightDesc> light;
    /// True if the mesh is not a light any more.
    bool losesLight = false;
    std::optional<oocpt::MaterialDesc> material;
    /// True if the prim could not be read.
    bool isBroken = false;
};

namespace {

/// Returns true if the renderer, which compares paths as text with slashes, takes the path as below its ancestors.
bool _IsPlain(const SdfPath& path)
{
    return path.IsPrimPath() && !path.ContainsPrimVariantSelection();
}

} // namespace

HdOocPTSceneReader::HdOocPTSceneReader(const HdSceneIndexBaseRefPtr& scene)
    : _scene(scene)
{
    _scene->AddObserver(HdSceneIndexObserverPtr(&_observer));
    for (const SdfPath& path : _scene->GetChildPrimPaths(SdfPath::AbsoluteRootPath())) {
        _observer.AddSubtree(*_scene, path);
    }
}

HdOocPTSceneReader::~HdOocPTSceneReader()
{
    _scene->RemoveObserver(HdSceneIndexObserverPtr(&_observer));
}

void HdOocPTSceneReader::Read(const PrimIdLookup& primIdOf, oocpt::SceneEdits* edits, HdOocPTWarnings* warnings)
{
    ++_revision;
    const HdOocPTSceneChanges changes = _observer.Take();
    _DirtyBits dirty;
    _TakeRemovals(changes.removed, edits, &dirty);
    _TakeChanges(changes, edits, &dirty);
    if (_isShutterNew) {
        _isShutterNew = false;
        _Mark({ HdOocPTPrimKind::Mesh, HdOocPTPrimKind::Instancer, HdOocPTPrimKind::Light },
            HdOocPTDirtyTransform | HdOocPTDirtyInstancePrimvars | HdOocPTDirtyPoints, &dirty);
    }
    _ReadLinks(&dirty, warnings);
    _ReadPass(&dirty, warnings);
    _ReadPurposes(&dirty, warnings);
    std::vector<_Job> jobs = _MakeJobs(dirty, warnings);
    _RunJobs(&jobs, primIdOf, warnings);
    // Prims below a prim that is left out are removed with it in the renderer, and are added again from the kept state.
    _DirtyBits below;
    for (const _Job& job : jobs) {
        if (job.isBroken) {
            edits->removed.push_back(HdOocPTText(job.path));
            _AddBelow(job.path, &below);
        }
    }
    for (const auto& [path, bits] : dirty) {
        below.erase(path);
    }
    std::vector<_Job> more = _MakeJobs(below, warnings);
    _RunJobs(&more, primIdOf, warnings);
    std::move(more.begin(), more.end(), std::back_inserter(jobs));
    for (_Job& job : jobs) {
        if (job.losesLight) {
            edits->removed.push_back(HdOocPTText(job.path.GetString() + HdOocPTMeshLightSuffix));
        }
        if (job.mesh) {
            edits->meshes.push_back(std::move(*job.mesh));
            if (job.light) {
                edits->lights.push_back(std::move(*job.light));
            }
        } else if (job.instancer) {
            edits->instancers.push_back(std::move(*job.instancer));
        } else if (job.light) {
            edits->lights.push_back(std::move(*job.light));
        } else if (job.material) {
            edits->materials.push_back(std::move(*job.material));
        }
    }
    _ReadSettings(warnings);
}

void HdOocPTSceneReader::_TakeRemovals(const std::vector<SdfPath>& removed, oocpt::SceneEdits* edits, _DirtyBits* dirty)
{
    for (const SdfPath& root : removed) {
        const auto known = _records.find(root);
        if (known != _records.end() && known->second && known->second->kind == HdOocPTPrimKind::GeomSubset) {
            // Only the mesh above uses the subset. If that is removed, too, nothing has to be read again.
            (*dirty)[root.GetParentPath()] |= HdOocPTDirtySubsets;
            _records.erase(root);
            continue;
        }
        bool any = false;
        const auto range = _records.FindSubtreeRange(root);
        for (auto it = range.first; it != range.second; ++it) {
            if (!it->second) {
                continue;
            }
            any = true;
            _settingsPrims.erase(it->first);
            _links.Remove(it->first);
            if (!_IsPlain(it->first) && it->first != root) {
                edits->removed.push_back(HdOocPTText(it->first));
            }
        }
        if (any) {
            edits->removed.push_back(HdOocPTText(root));
        }
        _records.erase(root);
    }
}

void HdOocPTSceneReader::_RemoveAlone(const SdfPath& path, oocpt::SceneEdits* edits, _DirtyBits* dirty)
{
    edits->removed.push_back(HdOocPTText(path));
    _settingsPrims.erase(path);
    _links.Remove(path);
    _AddBelow(path, dirty);
    _records[path].reset();
}

void HdOocPTSceneReader::_AddBelow(const SdfPath& path, _DirtyBits* dirty)
{
    const auto range = _records.FindSubtreeRange(path);
    for (auto it = range.first; it != range.second; ++it) {
        if (it->second && it->first != path) {
            dirty->emplace(it->first, 0);
        }
    }
}

void HdOocPTSceneReader::_TakeChanges(
    const HdOocPTSceneChanges& changes, oocpt::SceneEdits* edits, _DirtyBits* dirtyBits)
{
    _DirtyBits& dirty = *dirtyBits;
    for (const auto& [path, change] : changes.changes) {
        if (change.added) {
            const HdOocPTPrimKind kind = HdOocPTKindOfPrim(change.type);
            const auto known = _records.find(path);
            const bool isKnown = known != _records.end() && known->second;
            if (isKnown && known->second->type != change.type) {
                // The renderer removes whole subtrees: prims that only lost their parent are added again.
                _RemoveAlone(path, edits, &dirty);
            }
            if (kind == HdOocPTPrimKind::Other) {
                continue;
            }
            _RecordPtr& record = _records[path];
            if (!record) {
                record = std::make_shared<_Record>();
                record->kind = kind;
                record->type = change.type;
                if (kind == HdOocPTPrimKind::RenderSettings) {
                    _settingsPrims.insert(path);
                }
            }
        }
        const auto known = _records.find(path);
        const bool isSubset
            = known != _records.end() && known->second && known->second->kind == HdOocPTPrimKind::GeomSubset;
        if (isSubset) {
            dirty[path.GetParentPath()] |= HdOocPTDirtySubsets;
        } else if (change.dirtyBits != 0) {
            dirty[path] |= change.dirtyBits;
        }
    }
}

void HdOocPTSceneReader::_ReadLinks(_DirtyBits* dirty, HdOocPTWarnings* warnings)
{
    std::vector<std::pair<SdfPath, HdOocPTLightLinks>> lights;
    for (const auto& [path, bits] : *dirty) {
        const auto known = _records.find(path);
        const bool isLight = known != _records.end() && known->second && known->second->kind == HdOocPTPrimKind::Light;
        // For a light of a scene delegate, a change of its collection counts as a change of the light.
        if (isLight && (bits & (HdOocPTDirtyLinks | HdOocPTDirtyLight))) {
            lights.push_back({ path, {} });
        }
    }
    WorkParallelForN(lights.size(), [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            const HdSceneIndexPrim prim = _scene->GetPrim(lights[i].first);
            lights[i].second = HdOocPTLinks::Read({ lights[i].first, prim.dataSource, HdOocPTDirtyLinks, warnings });
        }
    });
    HdOocPTLinkChange changed = HdOocPTLinkChange::Nothing;
    for (const auto& [path, links] : lights) {
        changed = std::max(changed, _links.Set(path, links, warnings));
    }
    // Any mesh or instance may be in the collection, or no longer be.
    if (changed == HdOocPTLinkChange::Everything) {
        _Mark({ HdOocPTPrimKind::Mesh, HdOocPTPrimKind::Instancer }, HdOocPTDirtyCategories, dirty);
    } else if (changed == HdOocPTLinkChange::Instances) {
        _Mark({ HdOocPTPrimKind::Instancer }, HdOocPTDirtyCategories, dirty);
    }
}

void HdOocPTSceneReader::_ReadPass(_DirtyBits* dirty, HdOocPTWarnings* warnings)
{
    const bool isNew = _pass.Read(*_scene, warnings);
    // What an instancer places is in the collections of its instances.
    const auto places = [&](const auto& entry) {
        const auto known = _records.find(entry.first);
        return known != _records.end() && known->second && known->second->kind == HdOocPTPrimKind::Instancer
            && (entry.second & (HdOocPTDirtyInstances | HdOocPTDirtyInstancedBy));
    };
    if (isNew || (_pass.IsActive() && std::any_of(dirty->begin(), dirty->end(), places))) {
        _Mark({ HdOocPTPrimKind::Mesh, HdOocPTPrimKind::Light }, HdOocPTDirtyCategories, dirty);
    }
}

void HdOocPTSceneReader::_Mark(std::initializer_list<HdOocPTPrimKind> kinds, uint32_t bits, _DirtyBits* dirty) const
{
    for (const auto& [path, record] : _records) {
        if (record && std::find(kinds.begin(), kinds.end(), record->kind) != kinds.end()) {
            (*dirty)[path] |= bits;
        }
    }
}

void HdOocPTSceneReader::_ReadPurposes(_DirtyBits* dirty, HdOocPTWarnings* warnings)
{
    _arePurposesChecked = false;
    HdOocPTPurposes purposes = HdOocPTReadPurposes(*_scene, _settingsPrims);
    if (purposes == _purposes) {
        return;
    }
    if (purposes.bindings != _purposes.bindings) {
        _Mark({ HdOocPTPrimKind::Mesh }, HdOocPTDirtyMaterialBinding | HdOocPTDirtySubsets, dirty);
    }
    _purposes = std::move(purposes);
    HdOocPTWarnOfPurposes(_purposes, warnings);
}

void HdOocPTSceneReader::CheckPurposes(const TfTokenVector& renderTags, HdOocPTWarnings* warnings)
{
    if (_arePurposesChecked && _checkedTags == renderTags) {
        return;
    }
    _arePurposesChecked = true;
    _checkedTags = renderTags;
    const std::set<TfToken> disputed = HdOocPTFindDisputedPurposes(_purposes, renderTags);
    const auto isDisputed = [&](const auto& entry) {
        const HdOocPTMeshState* mesh = entry.second ? entry.second->mesh.get() : nullptr;
        return mesh && mesh->prim.visible && disputed.count(mesh->prim.purpose) > 0;
    };
    if (!disputed.empty() && std::any_of(_records.begin(), _records.end(), isDisputed)) {
        warnings->Add(_purposes.settings,
            "its includedPurposes are not those that the host shows, which makes a difference here: the host decides");
    }
}

std::vector<HdOocPTSceneReader::_Job> HdOocPTSceneReader::_MakeJobs(const _DirtyBits& dirty, HdOocPTWarnings* warnings)
{
    std::vector<_Job> jobs;
    jobs.reserve(dirty.size());
    for (const auto& [path, bits] : dirty) {
        const auto known = _records.find(path);
        if (known == _records.end() || !known->second) {
            continue;
        }
        const _RecordPtr& record = known->second;
        if (record->kind == HdOocPTPrimKind::RenderSettings) {
            // It is read as a whole, below.
            continue;
        }
        if (record->kind == HdOocPTPrimKind::Unsupported) {
            warnings->Add(path, "a " + record->type.GetString() + " is not supported yet; left out");
        } else {
            _Job job;
            job.path = path;
            job.dirtyBits = bits;
            job.record = record;
            jobs.push_back(std::move(job));
        }
    }
    return jobs;
}

void HdOocPTSceneReader::_RunJobs(
    std::vector<_Job>* jobs, const PrimIdLookup& primIdOf, HdOocPTWarnings* warnings) const
{
    const auto read = [&](_Job& job) {
        try {
            _ReadJob(&job, primIdOf, warnings);
        } catch (const std::exception& error) {
            // Hydra's scene indices convert NURBS and tetrahedral meshes when they are read, and throw if memory is
            // short. One bad prim must not end the render: its results and its kept state are dropped.
            warnings->Add(job.path, std::string("it could not be read (") + error.what() + "); left out");
            job = _Job { job.path, 0, job.record, {}, {}, {}, false, {}, true };
            job.record->mesh.reset();
            job.record->instancer.reset();
        }
    };
    WorkParallelForN(jobs->size(), [&, context = HdOocPTFindResolverContext(*_scene)](size_t begin, size_t end) {
        const ArResolverContextBinder bound(context);
        std::for_each(jobs->begin() + begin, jobs->begin() + end, read);
    });
}

void HdOocPTSceneReader::_ReadJob(_Job* job, const PrimIdLookup& primIdOf, HdOocPTWarnings* warnings) const
{
    const HdSceneIndexPrim prim = _scene->GetPrim(job->path);
    if (!prim.dataSource) {
        return;
    }
    _Record& record = *job->record;
    HdOocPTPrimSource source { job->path, prim.dataSource, job->dirtyBits, warnings, _shutter };
    source.bindingPurposes = _purposes.bindings ? &*_purposes.bindings : nullptr;
    switch (record.kind) {
    case HdOocPTPrimKind::Mesh:
        if (!record.mesh) {
            record.mesh = std::make_unique<HdOocPTMeshState>();
            source.dirtyBits = HdOocPTDirtyAll;
        }
        HdOocPTReadMesh(*_scene, record.type, source, record.mesh.get());
        if (!_links.IsEmpty() && (source.dirtyBits & HdOocPTDirtyCategories)) {
            HdOocPTAddCategories(*_scene, _links, source, record.mesh.get());
        }
        record.mesh->pass = _pass.Find(*_scene, source.path, record.mesh->prim, warnings);
        job->mesh = HdOocPTDescribeMesh(job->path, *record.mesh, primIdOf ? primIdOf(job->path) : -1);
        if (source.dirtyBits & HdOocPTDirtyLight) {
            const bool isLight = HdOocPTIsMeshLight(prim.dataSource);
            job->losesLight = record.isMeshLight && !isLight;
            record.isMeshLight = isLight;
        }
        if (record.isMeshLight) {
            job->light = HdOocPTReadLight(source, HdOocPTSceneTokens->mesh);
        }
        break;
    case HdOocPTPrimKind::Instancer:
        if (!record.instancer) {
            record.instancer = std::make_unique<HdOocPTInstancerState>();
            source.dirtyBits = HdOocPTDirtyAll;
        }
        HdOocPTReadInstancer(*_scene, source, record.instancer.get());
        if (source.dirtyBits & (HdOocPTDirtyCategories | HdOocPTDirtyInstances | HdOocPTDirtyInstancedBy)) {
            record.instancer->links = _links.IsEmpty()
                ? HdOocPTInstanceLinks()
                : HdOocPTReadInstanceLinks(*_scene, _links, source, record.instancer->prim);
        }
        job->instancer = HdOocPTDescribeInstancer(job->path, *record.instancer);
        break;
    case HdOocPTPrimKind::Light:
        job->light = HdOocPTReadLight(source, record.type);
        HdOocPTSetCategories(_links.GetCategories(job->path), &*job->light);
        _ApplyPass(source, &*job->light);
        break;
    case HdOocPTPrimKind::Material:
        job->material = HdOocPTReadMaterial(source);
        break;
    case HdOocPTPrimKind::GeomSubset:
    case HdOocPTPrimKind::RenderSettings:
    case HdOocPTPrimKind::Unsupported:
    case HdOocPTPrimKind::Other:
        break;
    }
}

void HdOocPTSceneReader::_ApplyPass(const HdOocPTPrimSource& source, oocpt::LightDesc* light) const
{
    HdOocPTPrimState state;
    HdOocPTReadPrim({ source.path, source.container, HdOocPTDirtyInstancedBy, source.warnings }, &state);
    const HdOocPTPassMarks marks = _pass.Find(*_scene, source.path, state, source.warnings);
    light->prim.visible = light->prim.visible && !marks.isLeftOut;
    light->camera_visible = light->camera_visible && !marks.isHiddenFromCamera;
}

void HdOocPTSceneReader::SetCamera(const SdfPath& camera, HdOocPTWarnings* warnings)
{
    if (!camera.IsEmpty()) {
        _camera = camera;
    } else if (_camera.IsEmpty()) {
        const HdSceneIndexPrim root = _scene->GetPrim(SdfPath::AbsoluteRootPath());
        const auto& tokens = *HdOocPTSceneTokens;
        _camera
            = HdOocPTRead(root.dataSource, { tokens.sceneGlobals, tokens.primaryCameraPrim }).GetWithDefault<SdfPath>();
    }
    _SetShutter(_isMotionBlurred ? HdOocPTReadShutter(*_scene, _camera, warnings) : HdOocPTShutter());
}

bool HdOocPTSceneReader::IsShutterOf(const SdfPath& camera) const
{
    return !_isMotionBlurred || camera == _camera
        || HdOocPTReadShutterTimes(*_scene, camera) == HdOocPTReadShutterTimes(*_scene, _camera);
}

double HdOocPTSceneReader::GetTimeCodesPerSecond() const
{
    if (_rate.second != _revision) {
        const HdOocPTTimeCodes codes = HdOocPTFindTimeCodes(*_scene, _camera);
        _rate = { codes.doubt.empty() ? codes.perSecond : 0.0, _revision };
    }
    return _rate.first;
}

void HdOocPTSceneReader::SetMotionBlur(bool isOn, HdOocPTWarnings* warnings)
{
    if (_isMotionBlurred != isOn) {
        _isMotionBlurred = isOn;
        SetCamera(SdfPath(), warnings);
    }
}

void HdOocPTSceneReader::_SetShutter(const HdOocPTShutter& shutter)
{
    if ((shutter.IsOpen() || _shutter.IsOpen()) && shutter != _shutter) {
        _isShutterNew = true;
    }
    _shutter = shutter;
}

rust::Vec<oocpt::PrimTextsDesc> HdOocPTSceneReader::ReadTexts(const TfToken& primvar, HdOocPTWarnings* warnings) const
{
    struct _Named
    {
        SdfPath path;
        bool isInstancer;
        std::vector<std::string> texts;
    };
    std::vector<_Named> all;
    for (const auto& [path, record] : _records) {
        if (record && (record->kind == HdOocPTPrimKind::Mesh || record->kind == HdOocPTPrimKind::Instancer)) {
            all.push_back({ path, record->kind == HdOocPTPrimKind::Instancer, {} });
        }
    }
    WorkParallelForN(all.size(), [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            const HdContainerDataSourceHandle container = _scene->GetPrim(all[i].path).dataSource;
            all[i].texts = HdOocPTReadTexts(container, primvar, all[i].isInstancer);
            const auto& tokens = *HdOocPTSceneTokens;
            if (all[i].texts.empty() && !all[i].isInstancer
                && HdOocPTFind(container, { tokens.primvars, primvar, tokens.primvarValue })) {
                warnings->Add(all[i].path,
                    "its primvar " + primvar.GetString() + " is no text for the whole prim, and names nothing");
            }
        }
    });
    rust::Vec<oocpt::PrimTextsDesc> descs;
    for (const _Named& named : all) {
        if (named.texts.empty()) {
            continue;
        }
        oocpt::PrimTextsDesc desc;
        desc.path = HdOocPTText(named.path);
        desc.texts.reserve(named.texts.size());
        for (const std::string& text : named.texts) {
            desc.texts.push_back(HdOocPTText(text));
        }
        descs.push_back(std::move(desc));
    }
    return descs;
}

HdOocPTTransformSamples HdOocPTSceneReader::GetCameraMotion(const SdfPath& camera, const GfMatrix4d& viewToWorld) const
{
    const auto& tokens = *HdOocPTSceneTokens;
    const HdContainerDataSourceHandle container = camera.IsEmpty() ? nullptr : _scene->GetPrim(camera).dataSource;
    GfMatrix4d transform(1.0);
    if (!container || !HdOocPTConvert(HdOocPTRead(container, { tokens.xform, tokens.matrix }), &transform)
        || !GfIsClose(transform, viewToWorld, 1e-6)) {
        return {};
    }
    return HdOocPTReadTransformSamples(container, _shutter);
}

void HdOocPTSceneReader::_ReadSettings(HdOocPTWarnings* warnings)
{
    _settings.clear();
    _dataWindow = std::nullopt;
    _products = HdOocPTReadProducts(*_scene, _settingsPrims);
    _isMotionDisabled = false;
    _isLensDisabled = false;
    for (const SdfPath& path : _settingsPrims) {
        for (auto& [name, value] : HdOocPTReadRenderSettings(*_scene, path)) {
            _settings[name] = value;
        }
        _isMotionDisabled = _isMotionDisabled || HdOocPTReadsMotionDisabled(*_scene, path);
        if (const std::optional<GfRange2d> window = HdOocPTReadDataWindow(*_scene, path, warnings)) {
            _dataWindow = window;
        }
        _isLensDisabled = _isLensDisabled || HdOocPTReadsLensDisabled(*_scene, path);
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
