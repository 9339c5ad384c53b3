// SPDX-License-Identifier: Apache-2.0
#include "hdOocPT/renderBuffer.h"

#include "bridge/session.h"
#include "hdOocPT/guard.h"
#include "pxr/base/tf/diagnostic.h"

#include <cstdint>
#include <cstring>
#include <utility>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// The same picture in another number of pixels, the nearest of each.
std::vector<unsigned char> _Resized(std::vector<unsigned char> const& pixels, size_t width, size_t height,
    size_t newWidth, size_t newHeight, size_t pixelBytes)
{
    std::vector<unsigned char> resized(newWidth * newHeight * pixelBytes);
    unsigned char* to = resized.data();
    for (size_t y = 0; y < newHeight; ++y) {
        unsigned char const* const row = pixels.data() + y * height / newHeight * width * pixelBytes;
        for (size_t x = 0; x < newWidth; ++x, to += pixelBytes) {
            std::memcpy(to, row + x * width / newWidth * pixelBytes, pixelBytes);
        }
    }
    return resized;
}

// Beyond any film format in use, and far from overflow of width * height * 16 bytes.
constexpr int _maxSide = 1 << 16;
constexpr uint64_t _maxBytes = uint64_t(1) << 33;

} // namespace

HdOocPTRenderBuffer::HdOocPTRenderBuffer(SdfPath const& id, std::shared_ptr<HdOocPTSession> session)
    : HdRenderBuffer(id)
    , _session(std::move(session))
{
}

HdOocPTRenderBuffer::~HdOocPTRenderBuffer()
{
    HdOocPTGuard("destroying a render buffer", [this] { _session->RemoveBuffer(this); });
}

void HdOocPTRenderBuffer::Bind(void const* viewport, HdOocPTAov const* aov, VtValue const& clearValue)
{
    if (_Viewport() != viewport) {
        // Before the lock: whoever takes the turn has the session's locks when it asks the buffer to keep its picture.
        _session->AddBuffer(viewport, this, [this] { return _CopyLatest(); });
    }
    std::lock_guard<std::mutex> const lock(_mutex);
    // Hosts bind buffers at every execution, and read few of the images that they bind, so the others stay as they were
    // filled.
    bool const isFilled = _isFilled && _clearValue == clearValue;
    _viewport = viewport;
    if (_isBound && _aov == aov && (_holdsImage || _isStretched || isFilled)) {
        return;
    }
    _isBound = true;
    _aov = aov;
    _holdsImage = false;
    _isStretched = false;
    _isFilled = !_isHandedOut;
    if (_isFilled) {
        _clearValue = clearValue;
        HdOocPTFillPixels(clearValue, _pixels.data(), _format, _PixelCount());
    }
}

bool HdOocPTRenderBuffer::Allocate(GfVec3i const& dimensions, HdFormat format, bool)
{
    return HdOocPTGuard("allocating a render buffer", false, [&] {
        bool const isInRange = dimensions[0] >= 0 && dimensions[0] <= _maxSide && dimensions[1] >= 0
            && dimensions[1] <= _maxSide && dimensions[2] == 1;
        if (!isInRange || !HdOocPTIsStorable(format)) {
            _Deallocate();
            TF_RUNTIME_ERROR("OocPT: render buffer <%s> cannot be %d x %d x %d pixels of format %d", GetId().GetText(),
                dimensions[0], dimensions[1], dimensions[2], static_cast<int>(format));
            return false;
        }
        uint64_t const byteCount
            = uint64_t(dimensions[0]) * uint64_t(dimensions[1]) * uint64_t(HdDataSizeOfFormat(format));
        if (byteCount > _maxBytes) {
            _Deallocate();
            TF_RUNTIME_ERROR("OocPT: render buffer <%s> of %d x %d pixels is too large", GetId().GetText(),
                dimensions[0], dimensions[1]);
            return false;
        }
        // Held throughout: another thread may read the buffer meanwhile.
        std::lock_guard<std::mutex> const lock(_mutex);
        // Until there is a picture of the new size the host shows the one that was there.
        if (!_StretchTo(static_cast<size_t>(dimensions[0]), static_cast<size_t>(dimensions[1]), format)) {
            _Clear();
        }
        _pixels.resize(static_cast<size_t>(byteCount), 0);
        _width = static_cast<unsigned int>(dimensions[0]);
        _height = static_cast<unsigned int>(dimensions[1]);
        _format = format;
        return true;
    });
}

bool HdOocPTRenderBuffer::_StretchTo(size_t width, size_t height, HdFormat format)
{
    bool const showsImage = _holdsImage || _isStretched;
    if (!showsImage || format != _format || _PixelCount() == 0 || width * height == 0) {
        return false;
    }
    std::vector<unsigned char> resized = _Resized(_pixels, _width, _height, width, height, HdDataSizeOfFormat(format));
    _DropPixels();
    _pixels = std::move(resized);
    _holdsImage = false;
    _isStretched = true;
    return true;
}

void HdOocPTRenderBuffer::_DropPixels()
{
    if (_isHandedOut) {
        _stillMapped.push_back(std::move(_pixels));
        _isHandedOut = false;
    }
    std::vector<unsigned char>().swap(_pixels);
    std::vector<unsigned char>().swap(_unconverted);
}

void HdOocPTRenderBuffer::_Clear()
{
    _width = 0;
    _height = 0;
    _format = HdFormatInvalid;
    _holdsImage = false;
    _isStretched = false;
    _isFilled = false;
    _DropPixels();
}

void HdOocPTRenderBuffer::_Deallocate()
{
    std::lock_guard<std::mutex> const lock(_mutex);
    _Clear();
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
    _isHandedOut = !_pixels.empty();
    return _isHandedOut ? _pixels.data() : nullptr;
}

void HdOocPTRenderBuffer::Unmap()
{
    std::lock_guard<std::mutex> const lock(_mutex);
    if (_mapCount > 0 && --_mapCount == 0) {
        _isHandedOut = false;
        _stillMapped.clear();
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
        // The session is asked before its messages are drained: a fatal one is queued before the session says
        // converged.
        void const* const viewport = _Viewport();
        bool const isFinal = _session->IsConverged(viewport);
        // Where another viewport has the turn, the buffer took the final picture before that.
        bool const isUpToDate = isFinal && (_session->IsWaiting(viewport) || _CopyLatest() || _HoldsNewest());
        _session->DrainMessages();
        return isUpToDate || !_IsBound();
    });
}

void const* HdOocPTRenderBuffer::_Viewport() const
{
    std::lock_guard<std::mutex> const lock(_mutex);
    return _viewport;
}

bool HdOocPTRenderBuffer::_IsBound() const
{
    std::lock_guard<std::mutex> const lock(_mutex);
    return _isBound;
}

bool HdOocPTRenderBuffer::_CopyLatest() const
{
    std::lock_guard<std::mutex> const lock(_mutex);
    if (_isHandedOut) {
        return false;
    }
    if (_aov && !_pixels.empty() && _ReadFrom(*_aov)) {
        _holdsImage = true;
        _isStretched = false;
    }
    return true;
}

bool HdOocPTRenderBuffer::_HoldsNewest() const
{
    std::lock_guard<std::mutex> const lock(_mutex);
    if (!_aov || !_holdsImage || _version == 0) {
        return false;
    }
    // Where the session has a newer picture it is copied here, not to where the host looks.
    _unconverted.resize(_PixelCount() * HdDataSizeOfFormat(_aov->format));
    return _session->ReadAov(_viewport, _aov->name, _version, _unconverted.data(), _unconverted.size()) == _version;
}

bool HdOocPTRenderBuffer::_ReadFrom(HdOocPTAov const& aov) const
{
    // Hosts resolve at every execution, even if there is no new image.
    uint64_t const known = _holdsImage ? _version : 0;
    bool const isConverted = aov.format != _format;
    if (isConverted) {
        _unconverted.resize(_PixelCount() * HdDataSizeOfFormat(aov.format));
    }
    std::vector<unsigned char>& pixels = isConverted ? _unconverted : _pixels;
    uint64_t const version = _session->ReadAov(_viewport, aov.name, known, pixels.data(), pixels.size());
    bool const isNew = version != 0 && version != known;
    if (isNew && isConverted
        && !HdOocPTConvertPixels(_unconverted.data(), aov.format, _pixels.data(), _format, _PixelCount())) {
        return false;
    }
    _version = version;
    return version != 0;
}

PXR_NAMESPACE_CLOSE_SCOPE
