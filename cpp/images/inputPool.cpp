// SPDX-License-Identifier: Apache-2.0
#include "images/inputPool.h"

#include "images/imageKind.h"
#include "images/imageLimits.h"

#include <algorithm>
#include <cstdint>
#include <list>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

namespace {

constexpr std::size_t maxIdle = 64;
/// Each thread takes memory for two blocks in every open file.
constexpr unsigned maxExrThreads = 4;
constexpr std::size_t maxCopy = std::size_t { 1 } << 30;

/// An OpenImageIO proxy that reads an asset.
class Proxy final : public OIIO::Filesystem::IOProxy
{
public:
    Proxy(const std::string& name, std::shared_ptr<const HdOocPTImageBytes> bytes)
        : IOProxy(name, Read)
        , _bytes(std::move(bytes))
    {
    }

    const char* proxytype() const override { return "hdOocPT"; }

    bool seek(std::int64_t offset) override
    {
        m_pos = offset;
        return offset >= 0;
    }

    std::size_t read(void* destination, std::size_t size) override
    {
        const std::size_t count = pread(destination, size, m_pos);
        m_pos += static_cast<std::int64_t>(count);
        return count;
    }

    std::size_t pread(void* destination, std::size_t size, std::int64_t offset) override
    {
        const std::size_t end = _bytes->GetSize();
        if (offset < 0 || static_cast<std::size_t>(offset) >= end) {
            return 0;
        }
        const std::size_t start = static_cast<std::size_t>(offset);
        return _bytes->Read(destination, std::min(size, end - start), start);
    }

    std::size_t size() const override { return _bytes->GetSize(); }

private:
    const std::shared_ptr<const HdOocPTImageBytes> _bytes;
};

/// An idle input and its source.
struct Idle
{
    std::weak_ptr<const InputSource> source;
    OpenInput open;
};

struct Pool
{
    std::mutex mutex;
    /// Idle inputs, the last used ones first.
    std::list<Idle> idle;
};

Pool& ThePool()
{
    // The pool is never destroyed: threads may still read while the process ends.
    static Pool& pool = *new Pool;
    return pool;
}

void SetUpOnce()
{
    static std::once_flag once;
    std::call_once(once, [] {
        // The renderer decodes on threads of its own, one image each.
        OIIO::attribute("threads", 1);
        // OpenEXR decompresses blocks of rows and tiles on threads of its own: otherwise a single file would keep only
        // one core busy.
        OIIO::attribute(
            "exr_threads", static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, maxExrThreads)));
        OIIO::attribute("limits:channels", 1024);
        OIIO::attribute("limits:imagesize_MB", static_cast<int>(HdOocPTMaxLevelBytes >> 20));
    });
}

/// OpenImageIO 2.4's reader of JPEG takes files and memory, no other kind of proxy.
std::unique_ptr<OIIO::Filesystem::IOProxy> MakeProxy(
    const std::string& name, const std::string& format, OpenInput* open)
{
    if (format != "jpeg") {
        return std::make_unique<Proxy>(name, open->bytes);
    }
    const std::size_t size = open->bytes->GetSize();
    if (size > maxCopy) {
        throw std::runtime_error("is a JPEG of " + std::to_string(size) + " bytes, more than is read");
    }
    open->copy.resize(size);
    open->copy.resize(open->bytes->Read(open->copy.data(), size, 0));
    HdOocPTCheckJpegHeader(reinterpret_cast<const unsigned char*>(open->copy.data()), open->copy.size());
    return std::make_unique<OIIO::Filesystem::IOMemReader>(open->copy.data(), open->copy.size());
}

} // namespace

OpenInput HdOocPTOpenInput(const InputSource& source)
{
    SetUpOnce();
    OpenInput open;
    open.bytes = source.opener();
    if (!open.bytes) {
        throw std::runtime_error("cannot be opened");
    }
    const std::string format = HdOocPTFindImageFormat(source.name, *open.bytes);
    open.input = OIIO::ImageInput::create(format);
    if (!open.input) {
        throw std::runtime_error(
            "needs OpenImageIO's reader of " + format + ", which is not there: " + OIIO::geterror());
    }
    if (!open.input->supports("ioproxy")) {
        throw std::runtime_error("cannot be read: this OpenImageIO reads " + format + " only from plain files");
    }
    if (format == "openexr") {
        HdOocPTCheckExrHeader(*open.bytes);
    } else if (format == "png") {
        HdOocPTCheckPngHeader(*open.bytes);
    } else if (format == "tiff") {
        HdOocPTCheckTiffHeader(*open.bytes);
    }
    open.proxy = MakeProxy(source.name, format, &open);
    OIIO::ImageSpec config;
    OIIO::Filesystem::IOProxy* proxy = open.proxy.get();
    config.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &proxy);
    // Alpha stays as the file has it: the material decides its meaning.
    config.attribute("oiio:UnassociatedAlpha", 1);
    OIIO::ImageSpec spec;
    if (!open.input->open(source.name, spec, config)) {
        const std::string reason = open.input->geterror();
        throw std::runtime_error("cannot be read" + (reason.empty() ? "" : ": " + reason));
    }
    return open;
}

InputLease::InputLease(std::shared_ptr<const InputSource> source)
    : _source(std::move(source))
{
    Pool& pool = ThePool();
    {
        const std::lock_guard<std::mutex> lock(pool.mutex);
        const auto found = std::find_if(
            pool.idle.begin(), pool.idle.end(), [&](const Idle& idle) { return idle.source.lock() == _source; });
        if (found != pool.idle.end()) {
            _open = std::move(found->open);
            pool.idle.erase(found);
        }
    }
    if (!_open.input) {
        _open = HdOocPTOpenInput(*_source);
    }
}

InputLease::~InputLease()
{
    if (!_open.input) {
        return;
    }
    // Inputs are closed after the lock is released.
    std::list<Idle> closing;
    {
        Pool& pool = ThePool();
        const std::lock_guard<std::mutex> lock(pool.mutex);
        pool.idle.push_front({ _source, std::move(_open) });
        for (auto idle = pool.idle.begin(); idle != pool.idle.end();) {
            const auto next = std::next(idle);
            if (idle->source.expired()) {
                closing.splice(closing.end(), pool.idle, idle);
            }
            idle = next;
        }
        if (pool.idle.size() > maxIdle) {
            closing.splice(closing.end(), pool.idle, std::prev(pool.idle.end()));
        }
    }
}
