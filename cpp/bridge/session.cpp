// SPDX-License-Identifier: Apache-2.0
#include "bridge/session.h"

#include "bridge/imageSource.h"
#include "bridge/productDesc.h"
#include "bridge/renderDesc.h"
#include "bridge/scalar.h"
#include "bridge/turns.h"
#include "oocpt-bridge/src/ffi_runner.rs.h"
#include "oocpt-bridge/src/lib.rs.h"
#include "pxr/base/tf/diagnostic.h"
#include "pxr/base/tf/stringUtils.h"
#include "scene/dataSource.h"
#include "scene/sceneChain.h"
#include "scene/sceneReader.h"
#include "scene/tokens.h"
#include "scene/warnings.h"

#include <algorithm>
#include <exception>
#include <initializer_list>
#include <iterator>
#include <mutex>
#include <optional>
#include <set>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

rust::Str _Str(const std::string& text)
{
    return rust::Str(text.data(), text.size());
}

} // namespace

class HdOocPTSession::_Impl
{
public:
    /// Runs a call of the bridge. An exception of Rust or of C++ becomes one error message for DrainMessages().
    template <typename Function>
    bool Try(Function&& function) noexcept
    {
        try {
            std::forward<Function>(function)();
            return true;
        } catch (const std::exception& error) {
            Report(error.what());
        } catch (...) {
            Report("an exception of unknown type");
        }
        return false;
    }

    void Report(const char* text) noexcept
    {
        try {
            const std::lock_guard<std::mutex> lock(mutex);
            errors.emplace_back(text);
        } catch (...) {
            // There is no memory left for a message.
        }
    }

    void ForwardSetting(const TfToken& key, const VtValue& value);
    HdOocPTSettingMap TakeSceneSettings();
    void ForwardPrimSettings();
    void ForwardNames(const rust::Vec<oocpt::ProductDesc>& products);
    bool IsAnySet(std::initializer_list<TfToken> switches) const;
    bool IsStill() const;
    bool IsConverged();
    HdOocPTTurns::Jobs FindJobs();

    std::optional<rust::Box<oocpt::Session>> session;
    std::unique_ptr<HdOocPTSceneReader> reader;
    HdOocPTSceneReader::PrimIdLookup primIdLookup;
    HdOocPTWarnings warnings;
    /// The settings of the host, and those of the active render settings prim, which override them.
    HdOocPTSettingMap hostSettings;
    HdOocPTSettingMap primSettings;
    /// Settings of the scene that were refused, each reported once.
    std::set<TfToken> refusedSettings;
    /// The primvars that were read to name what Cryptomatte layers show, and the revision of the scene then.
    std::vector<std::string> naming;
    uint64_t namingRevision = 0;
    HdOocPTTurns turns;

    /// Guards the members that follow.
    std::mutex mutex;
    std::vector<std::string> errors;
};

void HdOocPTSession::_Impl::ForwardSetting(const TfToken& key, const VtValue& value)
{
    if (!session) {
        return;
    }
    try {
        if (value.IsEmpty()) {
            (*session)->clear_setting(_Str(key.GetString()));
            return;
        }
        const bool isOurs = TfStringStartsWith(key.GetString(), "oocpt:");
        oocpt::ScalarValue scalar {};
        if (HdOocPTToScalar(value, &scalar)) {
            const oocpt::SettingOutcome outcome = (*session)->set_setting(_Str(key.GetString()), scalar);
            if (isOurs && outcome == oocpt::SettingOutcome::Unknown) {
                TF_WARN("OocPT: %s It is ignored", std::string(oocpt::unknown_setting(_Str(key.GetString()))).c_str());
            }
        } else if (isOurs) {
            TF_WARN("OocPT: the setting %s cannot hold a %s; ignored", key.GetText(), value.GetTypeName().c_str());
        }
    } catch (const std::exception& error) {
        TF_WARN("OocPT: %s", error.what());
    }
}

/// The settings of the scene, without those that belong to the machine.
HdOocPTSettingMap HdOocPTSession::_Impl::TakeSceneSettings()
{
    HdOocPTSettingMap settings = reader->GetSettings();
    for (auto setting = settings.begin(); setting != settings.end();) {
        const TfToken& key = setting->first;
        if (oocpt::scene_may_set(_Str(key.GetString()))) {
            ++setting;
            continue;
        }
        if (refusedSettings.insert(key).second) {
            TF_WARN("OocPT: the scene sets %s, which belongs to the machine: only the host and the environment set it; "
                    "ignored",
                key.GetText());
        }
        setting = settings.erase(setting);
    }
    return settings;
}

void HdOocPTSession::_Impl::ForwardPrimSettings()
{
    const HdOocPTSettingMap current = TakeSceneSettings();
    if (current == primSettings) {
        return;
    }
    for (const auto& [key, value] : primSettings) {
        if (current.count(key) == 0) {
            const auto host = hostSettings.find(key);
            ForwardSetting(key, host == hostSettings.end() ? VtValue() : host->second);
        }
    }
    for (const auto& [key, value] : current) {
        ForwardSetting(key, value);
    }
    primSettings = current;
}

/// Forwards the primvars that name what products show, if they may be others.
void HdOocPTSession::_Impl::ForwardNames(const rust::Vec<oocpt::ProductDesc>& products)
{
    std::vector<std::string> names;
    for (const rust::String& name : oocpt::naming_primvars(products)) {
        names.emplace_back(name);
    }
    if (names == naming && (names.empty() || namingRevision == reader->GetRevision())) {
        return;
    }
    rust::Vec<oocpt::NamingPrimvarDesc> primvars;
    for (const std::string& name : names) {
        primvars.push_back({ rust::String(name), reader->ReadTexts(TfToken(name), &warnings) });
    }
    (*session)->set_naming_primvars(std::move(primvars));
    naming = std::move(names);
    namingRevision = reader->GetRevision();
}

/// Returns true if a setting of the host, or a namespaced one of the scene, turns one of these switches on.
bool HdOocPTSession::_Impl::IsAnySet(std::initializer_list<TfToken> switches) const
{
    bool isSet = false;
    for (const HdOocPTSettingMap* settings : { &hostSettings, &primSettings }) {
        for (const TfToken& name : switches) {
            const auto setting = settings->find(name);
            bool value = false;
            isSet = isSet || (setting != settings->end() && HdOocPTConvert(setting->second, &value) && value);
        }
    }
    return isSet;
}

bool HdOocPTSession::_Impl::IsStill() const
{
    return IsAnySet({ HdOocPTSceneTokens->disableMotionBlur, HdOocPTSceneTokens->instantaneousShutter });
}

bool HdOocPTSession::_Impl::IsConverged()
{
    // A session that throws will make no progress either: a host must not wait for it.
    bool converged = true;
    if (session) {
        Try([&] { converged = (*session)->is_converged(); });
    }
    return converged;
}

HdOocPTTurns::Jobs HdOocPTSession::_Impl::FindJobs()
{
    HdOocPTTurns::Jobs jobs;
    if (session) {
        Try([&] {
            for (const oocpt::NamedValue& entry : (*session)->stats()) {
                const std::string key(entry.key);
                if (key == "oocpt:job") {
                    jobs.newest = static_cast<uint64_t>(entry.value.integer);
                } else if (key == "oocpt:shownJob") {
                    jobs.shown = static_cast<uint64_t>(entry.value.integer);
                } else if (key == "oocpt:commitPending") {
                    jobs.isCommitPending = entry.value.flag;
                }
            }
        });
    }
    return jobs;
}

HdOocPTSession::HdOocPTSession()
    : _impl(std::make_unique<_Impl>())
{
    _impl->Try([this] { _impl->session.emplace(oocpt::open_session(HdOocPTMakeImageSource())); });
}

HdOocPTSession::~HdOocPTSession()
{
    _impl->reader.reset();
    if (_impl->session) {
        _impl->Try([this] { oocpt::close_session(std::move(*_impl->session)); });
        // close_session() has taken the session out; only the empty box is left.
        _impl->session.reset();
    }
}

void HdOocPTSession::SetTerminalSceneIndex(const HdSceneIndexBaseRefPtr& terminal)
{
    _impl->reader.reset();
    if (_impl->session) {
        _impl->Try([this] { (*_impl->session)->clear_scene(); });
    }
    if (terminal) {
        _impl->Try([&] { _impl->reader = std::make_unique<HdOocPTSceneReader>(HdOocPTChainSceneIndices(terminal)); });
    }
}

void HdOocPTSession::SetPrimIdLookup(std::function<int32_t(const SdfPath&)> lookup)
{
    _impl->primIdLookup = std::move(lookup);
}

void HdOocPTSession::CommitScene(const SdfPath& camera)
{
    if (!_impl->session || !_impl->reader) {
        return;
    }
    _impl->Try([&] {
        HdOocPTSceneReader& reader = *_impl->reader;
        reader.SetCamera(camera, &_impl->warnings);
        // The second round is for settings that turn motion blur off or on.
        for (int round = 0; round < 2 && reader.HasChanges(); ++round) {
            oocpt::SceneEdits edits {};
            reader.Read(_impl->primIdLookup, &edits, &_impl->warnings);
            if (camera.IsEmpty()) {
                // A pass that names its camera may have another shutter, which concerns no other viewport.
                _impl->turns.Restart();
            }
            (*_impl->session)->apply_edits(std::move(edits));
            _impl->ForwardPrimSettings();
            reader.SetMotionBlur(!reader.IsMotionDisabled() && !_impl->IsStill(), &_impl->warnings);
        }
    });
    _impl->warnings.Post();
}

void HdOocPTSession::SetSetting(const TfToken& key, const VtValue& value)
{
    if (value.IsEmpty()) {
        _impl->hostSettings.erase(key);
    } else {
        _impl->hostSettings[key] = value;
    }
    _impl->turns.Restart();
    if (_impl->primSettings.count(key) == 0) {
        _impl->ForwardSetting(key, value);
    }
}

std::vector<HdOocPTSettingDescriptor> HdOocPTSession::GetSettingDescriptors() const
{
    std::vector<HdOocPTSettingDescriptor> descriptors;
    _impl->Try([&] {
        for (const oocpt::SettingDescriptor& entry : oocpt::setting_descriptors()) {
            descriptors.push_back({ TfToken(std::string(entry.key)), std::string(entry.name),
                HdOocPTSettingFromScalar(entry.default_value) });
        }
    });
    return descriptors;
}

void HdOocPTSession::Render(const HdOocPTRenderRequest& request)
{
    if (!_impl->session) {
        return;
    }
    _impl->Try([&] {
        const bool hasLens = _impl->reader && !_impl->IsAnySet({ HdOocPTSceneTokens->disableDepthOfField });
        const HdOocPTLens lens = hasLens ? _impl->reader->GetLens(request.cameraPath) : HdOocPTLens {};
        oocpt::RenderDesc desc = HdOocPTDescribeRender(request, lens);
        desc.exposure_scale = 1.0f;
        rust::Vec<oocpt::ProductDesc> products;
        if (_impl->reader) {
            _impl->reader->CheckPurposes(request.renderTags, &_impl->warnings);
            HdOocPTCrop(request, _impl->reader->GetDataWindow(), &desc);
            GfMatrix4d viewToWorld(1.0);
            std::copy_n(desc.world_from_view.begin(), 16, viewToWorld.GetArray());
            HdOocPTDescribeCamera(*_impl->reader, request.cameraPath, viewToWorld, &desc, &_impl->warnings);
            if ((*_impl->session)->writes_products()) {
                products = HdOocPTDescribeProducts(*_impl->reader, request, hasLens, &_impl->warnings);
                _impl->ForwardNames(products);
            }
        }
        const auto isMotion = [](const HdOocPTAovRequest& aov) { return aov.name == HdOocPTSceneTokens->motion; };
        if (_impl->reader && !_impl->reader->IsShutterOpen()
            && std::any_of(request.aovs.begin(), request.aovs.end(), isMotion)) {
            _impl->warnings.Add(request.cameraPath,
                "its shutter is not open, or motion blur is turned off: the AOV motion is 0 everywhere");
        }
        for (const HdOocPTAovRequest& aov : request.aovs) {
            const std::string wrong(oocpt::unknown_aov(_Str(aov.name.GetString())));
            if (!wrong.empty()) {
                _impl->warnings.Add(request.cameraPath, "the AOV " + aov.name.GetString() + " is left out: " + wrong);
            }
        }
        (*_impl->session)->render(std::move(desc), std::move(products));
    });
    _impl->warnings.Post();
}

bool HdOocPTSession::IsConverged(const void* viewport) const
{
    return _impl->turns.IsFinal(viewport, _impl->IsConverged());
}

void HdOocPTSession::AddBuffer(const void* viewport, const void* buffer, std::function<bool()> keep)
{
    _impl->turns.AddBuffer(viewport, buffer, std::move(keep));
}

void HdOocPTSession::RemoveBuffer(const void* buffer)
{
    _impl->turns.RemoveBuffer(buffer);
}

bool HdOocPTSession::TakeTurn(const HdOocPTRenderRequest& request)
{
    bool isTaken = true;
    _impl->Try([&] {
        const HdOocPTLens lens = _impl->reader ? _impl->reader->GetLens(request.cameraPath) : HdOocPTLens {};
        isTaken = _impl->turns.Take(request, lens, _impl->IsConverged(), [this] { return _impl->FindJobs(); });
    });
    return isTaken;
}

bool HdOocPTSession::IsWaiting(const void* viewport) const
{
    return _impl->turns.IsWaiting(viewport);
}

void HdOocPTSession::Pause()
{
    if (_impl->session) {
        _impl->Try([this] { (*_impl->session)->pause(); });
    }
}

void HdOocPTSession::Resume()
{
    if (_impl->session) {
        _impl->Try([this] { (*_impl->session)->resume(); });
    }
}

void HdOocPTSession::Stop(bool blocking)
{
    if (_impl->session) {
        _impl->Try([&] { (*_impl->session)->stop(blocking); });
    }
}

void HdOocPTSession::Restart()
{
    _impl->turns.Restart();
    if (_impl->session) {
        _impl->Try([this] { (*_impl->session)->restart(); });
    }
}

bool HdOocPTSession::IsPaused() const
{
    bool paused = false;
    if (_impl->session) {
        _impl->Try([&] { paused = (*_impl->session)->is_paused(); });
    }
    return paused;
}

bool HdOocPTSession::IsStopped() const
{
    bool stopped = true;
    if (_impl->session) {
        _impl->Try([&] { stopped = (*_impl->session)->is_stopped(); });
    }
    return stopped;
}

uint64_t HdOocPTSession::ReadAov(
    const void* viewport, const TfToken& name, uint64_t known, void* destination, size_t byteCount) const
{
    uint64_t version = 0;
    if (_impl->session && destination) {
        _impl->Try([&] {
            const rust::Slice<uint8_t> bytes(static_cast<uint8_t*>(destination), byteCount);
            const auto read = [&] { return (*_impl->session)->read_aov(_Str(name.GetString()), known, bytes); };
            version = _impl->turns.Read(
                viewport, [this] { return _impl->FindJobs(); }, read);
        });
    }
    return version;
}

VtDictionary HdOocPTSession::GetStats() const
{
    VtDictionary stats;
    if (_impl->session) {
        _impl->Try([&] {
            for (const oocpt::NamedValue& entry : (*_impl->session)->stats()) {
                stats[std::string(entry.key)] = HdOocPTStatisticFromScalar(entry.value);
            }
        });
    }
    return stats;
}

void HdOocPTSession::DrainMessages()
{
    rust::Vec<oocpt::UserMessage> messages;
    if (_impl->session) {
        _impl->Try([&] { messages = (*_impl->session)->take_messages(); });
    }
    std::vector<std::string> errors;
    {
        const std::lock_guard<std::mutex> lock(_impl->mutex);
        errors.swap(_impl->errors);
    }
    for (const oocpt::UserMessage& message : messages) {
        const std::string text(message.text);
        switch (message.severity) {
        case oocpt::MessageSeverity::Status:
            TF_STATUS("OocPT: %s", text.c_str());
            break;
        case oocpt::MessageSeverity::Error:
            TF_RUNTIME_ERROR("OocPT: %s", text.c_str());
            break;
        default:
            TF_WARN("OocPT: %s", text.c_str());
        }
    }
    for (const std::string& text : errors) {
        TF_RUNTIME_ERROR("OocPT: %s", text.c_str());
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
