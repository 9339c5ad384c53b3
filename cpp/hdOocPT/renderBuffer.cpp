// SPDX-License-Identifier: Apache-2.0
#include "hdOocPT/renderBuffer.h"

#include "bridge/session.h"
#include "hdOocPT/guard.h"
#include "pxr/base/tf/diagnostic.h"

#include <cstdint>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Beyond any film format in use, and far from overflow of width * height * 16 bytes.
constexpr int _maxDimension = 1 << 16;
constexpr uint64_t _maxBytes = uint64_t(1) << 33;

} // namespace

HdOocPTRenderBuffer::HdOocPTRenderBuffer(SdfPath const& id, std::shared_ptr<HdOocPTSession> session)
    : HdRenderBuffer(id)
    , _session(std::move(session))
{
}

HdOocPTRenderBuffer::~HdOocPTRenderBuffer() = default;

void HdOocPTRenderBuffer::Bind(HdOocPTAov const* aov, VtValue const& clearValue)
{
    std::lock_guard<std::mutex> const lock(_mutex);
    // The render pass binds every buffer at every execution. A buffer that nobody has read since still holds the clear
    // value, and is not cleared again.
    bool const isCleared = _isCleared && _clearValue == clearValue;
    if (_isBound && _aov == aov && (_holdsImage || isCleared)) {
        return;
    }
    _isBound = true;
    _aov = aov;
    _holdsImage = false;
    _isCleared = _mapCount == 0;
    if (_isCleared) {
        _clearValue = clearValue;
        HdOocPTFillPixels(clearValue, _pixels.data(), _format, _PixelCount());
    }
}

bool HdOocPTRenderBuffer::Allocate(GfVec3i const& dimensions, HdFormat format, bool)
{
    return HdOocPTGuard("allocating a render buffer", false, [&] {
        _Deallocate();
        bool const isInRange = dimensions[0] >= 0 && dimensions[0] <= _maxDimension && dimensions[1] >= 0
            && dimensions[1] <= _maxDimension && dimensions[2] == 1;
        if (!isInRange || !HdOocPTIsStorable(format)) {
            TF_RUNTIME_ERROR("OocPT: render buffer <%s> cannot be %d x %d x %d pixels of format %d", GetId().GetText(),
                dimensions[0], dimensions[1], dimensions[2], static_cast<int>(format));
            return false;
        }
        uint64_t const byteCount
            = uint64_t(dimensions[0]) * uint64_t(dimensions[1]) * uint64_t(HdDataSizeOfFormat(format));
        if (byteCount > _maxBytes) {
            TF_RUNTIME_ERROR("OocPT: render buffer <%s> of %d x %d pixels is too large", GetId().GetText(),
                dimensions[0], dimensions[1]);
            return false;
        }
        std::lock_guard<std::mutex> const lock(_mutex);
        _pixels.assign(static_cast<size_t>(byteCount), 0);
        _width = static_cast<unsigned int>(dimensions[0]);
        _height = static_cast<unsigned int>(dimensions[1]);
        _format = format;
        return true;
    });
}

void HdOocPTRenderBuffer::_Deallocate()
{
    std::lock_guard<std::mutex> const lock(_mutex);
    _width = 0;
    _height = 0;
    _format = HdFormatInvalid;
    _holdsImage = false;
    _isCleared = false;
    std::vector<unsigned char>().swap(_pixels);
    std::vector<unsigned char>().swap(_aovPixels);
}

unsigned int HdOocPTRenderBuffer::GetWidth() const
{
    std::lock_guard<std::mutex> const lock(_mutex);
    return _width;
}

unsigned int HdOocPTRenderBuffer::GetHeight() const
{
    std::lock_guard<std::mutex> const lock(_mutex);
    return _height;
}

HdFormat HdOocPTRenderBuffer::GetFormat() const
{
    std::lock_guard<std::mutex> const lock(_mutex);
    return _format;
}

void* HdOocPTRenderBuffer::Map()
{
    // Blender maps without resolving, and asks only the render pass whether it has converged.
    HdOocPTGuard("mapping a render buffer", [this] { _CopyLatest(); });
    std::lock_guard<std::mutex> const lock(_mutex);
    ++_mapCount;
    return _pixels.empty() ? nullptr : _pixels.data();
}

void HdOocPTRenderBuffer::Unmap()
{
    std::lock_guard<std::mutex> const lock(_mutex);
    if (_mapCount > 0) {
        --_mapCount;
    }
}

bool HdOocPTRenderBuffer::IsMapped() const
{
    std::lock_guard<std::mutex> const lock(_mutex);
    return _mapCount > 0;
}

void HdOocPTRenderBuffer::Resolve()
{
    HdOocPTGuard("resolving a render buffer", [this] {
        _CopyLatest();
        _session->DrainMessages();
    });
}

bool HdOocPTRenderBuffer::IsConverged() const
{
    return HdOocPTGuard("asking a render buffer for convergence", true, [this] {
        // IsConverged comes before DrainMessages: after a fatal error the session queues the message first, then says
        // converged.
        bool const isFinal = _session->IsConverged();
        bool const isUpToDate = isFinal && _CopyLatest();
        _session->DrainMessages();
        return isUpToDate || !_IsBound();
    });
}

bool HdOocPTRenderBuffer::_IsBound() const
{
    std::lock_guard<std::mutex> const lock(_mutex);
    return _isBound;
}

bool HdOocPTRenderBuffer::_CopyLatest() const
{
    std::lock_guard<std::mutex> const lock(_mutex);
    if (_mapCount > 0) {
        return false;
    }
    if (_aov && !_pixels.empty() && _ReadAov(*_aov)) {
        _holdsImage = true;
    }
    return true;
}

bool HdOocPTRenderBuffer::_ReadAov(HdOocPTAov const& aov) const
{
    // Hosts resolve at every execution; the session copies nothing if this buffer has the newest image already.
    uint64_t const heldVersion = _holdsImage ? _version : 0;
    bool const needsConversion = aov.format != _format;
    if (needsConversion) {
        _aovPixels.resize(_PixelCount() * HdDataSizeOfFormat(aov.format));
    }
    std::vector<unsigned char>& pixels = needsConversion ? _aovPixels : _pixels;
    _version = _session->ReadAov(aov.name, heldVersion, pixels.data(), pixels.size());
    if (_version == 0 || _version == heldVersion || !needsConversion) {
        return _version != 0;
    }
    return HdOocPTConvertPixels(_aovPixels.data(), aov.format, _pixels.data(), _format, _PixelCount());
}

PXR_NAMESPACE_CLOSE_SCOPE
