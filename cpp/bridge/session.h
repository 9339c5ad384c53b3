// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_SESSION_H
#define HDOOCPT_BRIDGE_SESSION_H

#include "pxr/base/gf/matrix4d.h"
#include "pxr/base/gf/range2f.h"
#include "pxr/base/gf/rect2i.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/vt/dictionary.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// One AOV that the host bound, by its Hydra name ("color", "depth", "primId"…).
struct HdOocPTAovRequest
{
    TfToken name;
    /// The value as the host gave it: any scalar or vector of float, double or int; empty takes the AOV's own default.
    VtValue clearValue;
};

/// Everything one image needs from the render pass state. Matrices are Gf's (row vectors), exactly as Hydra hands them
/// out.
struct HdOocPTRenderRequest
{
    /// What tells viewports of one delegate apart: the first buffer that the pass binds.
    const void* viewport = nullptr;
    /// Size of the render buffers in pixels.
    int width = 0;
    int height = 0;
    /// The camera prim, for its lens (fStop, focalLength, focusDistance); empty means a pinhole.
    SdfPath cameraPath;
    /// HdRenderPassState::GetWorldToViewMatrix() and GetProjectionMatrix(): GL clip space, window policy and framing
    /// applied.
    GfMatrix4d worldToView { 1.0 };
    GfMatrix4d projection { 1.0 };
    /// CameraUtilFraming's data window, y down with inclusive maximum, as Hydra hands it out: the projection's [-1, 1]
    /// square lands on it, and nothing else is rendered. An empty one means the whole buffer.
    GfRect2i dataWindow;
    /// CameraUtilFraming's display window, as the data window; an empty one means the whole buffer.
    GfRange2f displayWindow;
    std::vector<HdOocPTAovRequest> aovs;
    /// Render tags of the pass ("geometry" = default purpose, "render", "proxy", "guide"); empty means all.
    TfTokenVector renderTags;
};

/// One setting for HdRenderDelegate::GetRenderSettingDescriptors(). The default holds bool, int, float or std::string.
/// It is the environment's value where an OOCPT_* variable is set.
struct HdOocPTSettingDescriptor
{
    TfToken key;
    std::string name;
    VtValue defaultValue;
};

/// The renderer as Hydra sees it: owns the Rust session, the scene observer and the chain of scene indices in front of
/// it.
///
/// One per render delegate. Nothing thrown by Rust leaves this class: every failure becomes a message that
/// DrainMessages() posts. No function blocks for longer than a wave, or waits for a commit of the scene, but for
/// Stop(true), which waits for the render thread, and the destructor, which waits for a commit under way too.
///
/// Threads: unless said otherwise, call from the thread that drives Hydra (one at a time). IsConverged, ReadAov,
/// GetStats, Pause, Resume and IsPaused/IsStopped may be called from any thread.
class HdOocPTSession
{
public:
    HdOocPTSession();
    ~HdOocPTSession();
    HdOocPTSession(const HdOocPTSession&) = delete;
    HdOocPTSession& operator=(const HdOocPTSession&) = delete;

    // ---- scene ----

    /// Takes the host's terminal scene index; implicit shapes and ext computations are resolved on the way to the
    /// observer. A second call drops the scene of the first. A null pointer drops the scene.
    void SetTerminalSceneIndex(const HdSceneIndexBaseRefPtr& terminal);

    /// Finds a mesh's Hydra prim id (HdRprim::GetPrimId by path, -1 if unknown). Called from several threads during
    /// CommitScene(), never afterwards. Meshes read before the lookup is set have id -1.
    void SetPrimIdLookup(std::function<int32_t(const SdfPath&)> lookup);

    /// Reads what was added, removed or dirtied since the last call and queues it for the commit thread. Call it from
    /// HdRenderDelegate::CommitResources. Cheap if nothing is pending. Posts the reader's warnings through Tf itself.
    ///
    /// `camera`: the camera whose shutter counts from now on; empty if it is not known yet.
    void CommitScene(const SdfPath& camera = SdfPath());

    // ---- settings ----

    /// Forwards one setting that the host sets explicitly: it overrides OOCPT_* variables, which override defaults. An
    /// empty value removes the explicit one. Keys of other renderers are ignored; an unknown oocpt: key, a value of the
    /// wrong type or one out of range warns and changes nothing.
    void SetSetting(const TfToken& key, const VtValue& value);

    std::vector<HdOocPTSettingDescriptor> GetSettingDescriptors() const;

    // ---- viewports (HdOocPTTurns) ----

    /// Has `keep` called before another viewport gets the turn, while the buffer is known.
    void AddBuffer(const void* viewport, const void* buffer, std::function<bool()> keep);
    void RemoveBuffer(const void* buffer);

    /// Returns true if this image is to be rendered now, and false while the picture of another viewport is, or if this
    /// one is final.
    bool TakeTurn(const HdOocPTRenderRequest& request);

    /// Returns true if the session renders for another viewport than this one.
    bool IsWaiting(const void* viewport) const;

    // ---- rendering ----

    /// Asks for this image of the scene as it was read. Returns at once; restarts only if scene, camera, AOVs or
    /// settings changed since the last request.
    void Render(const HdOocPTRenderRequest& request);

    /// Returns true if the viewport's latest image is final and resolved, or if rendering ended for good (error, stop).
    bool IsConverged(const void* viewport) const;

    void Pause();
    void Resume();
    void Stop(bool blocking);
    void Restart();
    bool IsPaused() const;
    bool IsStopped() const;

    /// Copies the viewport's newest resolved image of an AOV into destination: tightly packed, bottom row first, in the
    /// AOV's own format (color f32x4; depth, cameraDepth, sampleCount f32; primId, instanceId, elementId i32; normal,
    /// Neye, albedo, motion f32x3). An image whose version is `known` is not copied again: destination must hold it.
    /// Returns the version of the image in destination; 0, destination untouched, if there is none yet, the name is
    /// unknown, the size differs, or another viewport has its turn.
    uint64_t ReadAov(
        const void* viewport, const TfToken& name, uint64_t known, void* destination, size_t byteCount) const;

    /// GetRenderStats() of the delegate, with the keys that hosts read.
    VtDictionary GetStats() const;

    /// Posts the renderer's messages as TF_STATUS, TF_WARN and TF_RUNTIME_ERROR. Call it on the host's thread: errors
    /// posted on another one are lost to the host.
    void DrainMessages();

private:
    class _Impl;
    std::unique_ptr<_Impl> _impl;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
