// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_SCENE_SCENE_READER_H
#define HDOOCPT_SCENE_SCENE_READER_H

#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"
#include "pxr/usd/sdf/pathTable.h"
#include "rust/cxx.h"
#include "scene/cameraReader.h"
#include "scene/links.h"
#include "scene/motionReader.h"
#include "scene/passCollections.h"
#include "scene/primKind.h"
#include "scene/productReader.h"
#include "scene/sceneObserver.h"
#include "scene/settingsReader.h"
#include "scene/warnings.h"

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <map>
#include <memory>
#include <set>
#include <vector>

namespace oocpt {
struct LightDesc;
struct PrimTextsDesc;
struct SceneEdits;
}

PXR_NAMESPACE_OPEN_SCOPE

/// Turns the changes of a scene index into edits for the renderer.
///
/// Keeps the last state of every mesh and instancer, whose arrays share their data with the scene, so that an edit
/// reads only what it dirtied. The edits and their order do not depend on threads.
///
/// Threads: one at a time; Read() itself reads prims in parallel.
class HdOocPTSceneReader
{
public:
    using PrimIdLookup = std::function<int32_t(const SdfPath&)>;

    /// Listens to the scene from now on; existing prims count as added.
    explicit HdOocPTSceneReader(const HdSceneIndexBaseRefPtr& scene);
    ~HdOocPTSceneReader();
    HdOocPTSceneReader(const HdOocPTSceneReader&) = delete;
    HdOocPTSceneReader& operator=(const HdOocPTSceneReader&) = delete;

    /// Returns true if Read() has anything to do.
    bool HasChanges() const { return !_observer.IsEmpty() || _isShutterNew; }

    /// Sets the camera whose shutter counts; empty means the one that the scene names. Prims that may move are read
    /// again if the shutter differs from the previous one.
    void SetCamera(const SdfPath& camera, HdOocPTWarnings* warnings);

    /// Forgets all motion, or reads it again.
    void SetMotionBlur(bool isOn, HdOocPTWarnings* warnings);

    /// Returns true if something can move: the shutter is open, and motion blur is not turned off.
    bool IsShutterOpen() const { return _shutter.IsOpen(); }

    /// The shutter that counts.
    const HdOocPTShutter& GetShutter() const { return _shutter; }

    /// Returns true if a camera's shutter opens and closes at the times that count, or motion blur is off.
    bool IsShutterOf(const SdfPath& camera) const;

    /// The number of time codes per second, see HdOocPTFindTimeCodes(); 0 if it is in doubt.
    double GetTimeCodesPerSecond() const;

    /// Returns true if the active render settings turn motion blur off, as of the last Read().
    bool IsMotionDisabled() const { return _isMotionDisabled; }

    /// Reads what changed since the last call.
    void Read(const PrimIdLookup& primIdOf, oocpt::SceneEdits* edits, HdOocPTWarnings* warnings);

    /// The settings of the active render settings prim, as of the last Read().
    const HdOocPTSettingMap& GetSettings() const { return _settings; }

    /// The part of the picture that the active render settings ask for, as of the last Read(); see
    /// HdOocPTReadDataWindow().
    const std::optional<GfRange2d>& GetDataWindow() const { return _dataWindow; }

    /// The products of the active render settings, as of the last Read().
    const std::vector<HdOocPTProduct>& GetProducts() const { return _products; }

    /// The number of calls of Read() so far: what is read of the scene may differ where it does.
    uint64_t GetRevision() const { return _revision; }

    /// The texts that prims and instancers have in a primvar, as of the scene's current state. Warns of one that is
    /// neither for a whole prim nor for instances.
    rust::Vec<oocpt::PrimTextsDesc> ReadTexts(const TfToken& primvar, HdOocPTWarnings* warnings) const;

    /// The current view of a product's camera, see HdOocPTReadProductView().
    std::optional<HdOocPTProductView> GetProductView(const HdOocPTProduct& product) const
    {
        return HdOocPTReadProductView(*_scene, product);
    }

    /// See HdOocPTReadCurrentFrame().
    std::optional<double> GetCurrentFrame() const { return HdOocPTReadCurrentFrame(*_scene); }

    /// The current lens of a camera prim; none if the active render settings turn it off.
    HdOocPTLens GetLens(const SdfPath& camera) const
    {
        return _isLensDisabled ? HdOocPTLens {} : HdOocPTReadLens(*_scene, camera);
    }

    /// Warns if the render settings include other purposes than the host shows, and some prim has one of them.
    void CheckPurposes(const TfTokenVector& renderTags, HdOocPTWarnings* warnings);

    /// The exposure scale of a camera prim, see HdOocPTReadExposureScale().
    float GetExposureScale(const SdfPath& camera, HdOocPTWarnings* warnings) const
    {
        return HdOocPTReadExposureScale(*_scene, camera, warnings);
    }

    /// The current clipping planes of a camera prim.
    std::vector<GfVec4d> GetClippingPlanes(const SdfPath& camera, HdOocPTWarnings* warnings) const
    {
        return HdOocPTReadClippingPlanes(*_scene, camera, warnings);
    }

    /// The current motion of a camera prim over the shutter interval; empty if its transform is not `viewToWorld`.
    HdOocPTTransformSamples GetCameraMotion(const SdfPath& camera, const GfMatrix4d& viewToWorld) const;

private:
    struct _Record;
    struct _Job;
    using _RecordPtr = std::shared_ptr<_Record>;

    /// The parts to read again, in the order in which prims are sent to the renderer.
    using _DirtyBits = std::map<SdfPath, uint32_t>;

    void _TakeRemovals(const std::vector<SdfPath>& removed, oocpt::SceneEdits* edits, _DirtyBits* dirty);
    void _TakeChanges(const HdOocPTSceneChanges& changes, oocpt::SceneEdits* edits, _DirtyBits* dirty);
    void _ReadLinks(_DirtyBits* dirty, HdOocPTWarnings* warnings);
    /// Reads the active render pass; marks what it may have changed.
    void _ReadPass(_DirtyBits* dirty, HdOocPTWarnings* warnings);
    /// Applies the active render pass to a light as it was last read.
    void _ApplyPass(const HdOocPTPrimSource& source, oocpt::LightDesc* light) const;
    /// Marks prims of these kinds to be read again.
    void _Mark(std::initializer_list<HdOocPTPrimKind> kinds, uint32_t bits, _DirtyBits* dirty) const;
    /// Reads the purposes and colours of the active render settings.
    void _ReadPurposes(_DirtyBits* dirty, HdOocPTWarnings* warnings);
    std::vector<_Job> _MakeJobs(const _DirtyBits& dirty, HdOocPTWarnings* warnings);
    void _RemoveAlone(const SdfPath& path, oocpt::SceneEdits* edits, _DirtyBits* dirty);
    /// Adds the prims below a prim.
    void _AddBelow(const SdfPath& path, _DirtyBits* dirty);
    /// Reads prims in parallel; one that cannot be read is left out, with a warning.
    void _RunJobs(std::vector<_Job>* jobs, const PrimIdLookup& primIdOf, HdOocPTWarnings* warnings) const;
    void _ReadJob(_Job* job, const PrimIdLookup& primIdOf, HdOocPTWarnings* warnings) const;
    void _ReadSettings(HdOocPTWarnings* warnings);
    void _SetShutter(const HdOocPTShutter& shutter);

    const HdSceneIndexBaseRefPtr _scene;
    HdOocPTSceneObserver _observer;
    /// Every prim that OocPT handles; entries without a record are mere ancestors.
    SdfPathTable<_RecordPtr> _records;
    HdOocPTLinks _links;
    HdOocPTPassCollections _pass;
    std::set<SdfPath> _settingsPrims;
    HdOocPTSettingMap _settings;
    std::optional<GfRange2d> _dataWindow;
    std::vector<HdOocPTProduct> _products;
    SdfPath _camera;
    HdOocPTShutter _shutter;
    uint64_t _revision = 0;
    /// Time codes per second, and the revision at which they were found.
    mutable std::pair<double, uint64_t> _rate { 0.0, 0 };
    bool _isShutterNew = false;
    bool _isMotionBlurred = true;
    bool _isMotionDisabled = false;
    bool _isLensDisabled = false;
    HdOocPTPurposes _purposes;
    bool _arePurposesChecked = false;
    TfTokenVector _checkedTags;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
