// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_HELD_ARRAY_H
#define HDOOCPT_BRIDGE_HELD_ARRAY_H

#include "rust/cxx.h"

#include <cstdint>
#include <memory>
#include <vector>

namespace oocpt {

/// Element type of an array; listed in the bridge (rust/bridge/src/lib.rs).
enum class ElementTag : std::uint8_t;

/// An array that Rust reads in place and keeps alive by owning this object.
///
/// Contract for every subclass: bytes() is the same memory with the same content from construction to destruction, and
/// bytes(), element() and the destructor may run on any thread. No USD type appears here, so that the Rust side
/// compiles without USD.
class HeldArray
{
public:
    virtual ~HeldArray() = default;
    HeldArray(const HeldArray&) = delete;
    HeldArray& operator=(const HeldArray&) = delete;

    virtual rust::Slice<const std::uint8_t> bytes() const noexcept = 0;

    ElementTag element() const noexcept { return _element; }

protected:
    explicit HeldArray(ElementTag element)
        : _element(element)
    {
    }

private:
    const ElementTag _element;
};

/// A held array that owns a copy of its bytes: for data that does not outlive the call, and for tests.
class CopiedArray final : public HeldArray
{
public:
    CopiedArray(ElementTag element, rust::Slice<const std::uint8_t> bytes)
        : HeldArray(element)
        , _bytes(bytes.begin(), bytes.end())
    {
    }

    rust::Slice<const std::uint8_t> bytes() const noexcept override { return { _bytes.data(), _bytes.size() }; }

private:
    const std::vector<std::uint8_t> _bytes;
};

inline std::unique_ptr<HeldArray> copy_array(ElementTag element, rust::Slice<const std::uint8_t> bytes)
{
    return std::make_unique<CopiedArray>(element, bytes);
}

} // namespace oocpt

#endif
