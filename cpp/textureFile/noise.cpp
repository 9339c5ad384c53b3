// SPDX-License-Identifier: Apache-2.0
#include "textureFile/noise.h"

#include <algorithm>

namespace {

/// Noise of each pixel by itself, to each side: that of a camera at a middling sensitivity.
constexpr float grain = 0.03F;

/// A finalizer of the kind of MurmurHash3's: every bit of the input changes every bit of the output.
std::uint32_t Hash(std::uint32_t value)
{
    value ^= value >> 16;
    value *= 0x7feb352dU;
    value ^= value >> 15;
    value *= 0x846ca68bU;
    return value ^ (value >> 16);
}

/// A random number from -1 to 1.
float Random(int x, int y, std::uint32_t seed)
{
    const std::uint32_t hash = Hash(static_cast<std::uint32_t>(x) + Hash(static_cast<std::uint32_t>(y) + Hash(seed)));
    return static_cast<float>(hash >> 8) * (2.0F / 16777215.0F) - 1.0F;
}

float Smooth(float t)
{
    return t * t * (3.0F - 2.0F * t);
}

} // namespace

Noise::Noise(int size, std::uint32_t seed)
    : _size(size)
    , _seed(seed)
{
    // Weights fall as those of photographs do, about as the square root of the area that a value covers.
    float weight = 0.3F;
    std::uint32_t number = Hash(seed);
    for (int period = std::max(size / 4, 2); period >= 2; period /= 4) {
        _brightness.push_back({ period, weight, ++number });
        weight *= 0.6F;
    }
    for (auto& axis : _color) {
        axis.push_back({ std::max(size / 8, 2), 0.12F, ++number });
        axis.push_back({ std::max(size / 128, 2), 0.05F, ++number });
    }
    for (auto& values : _values) {
        values.resize(size);
    }
}

void Noise::_Add(const _Octave& octave, int y, std::vector<float>* values)
{
    const int period = octave.period;
    const int row = y / period;
    const float down = Smooth(static_cast<float>(y % period) / static_cast<float>(period));
    const int count = _size / period + 2;
    _lattice.resize(count);
    for (int i = 0; i < count; ++i) {
        const float above = Random(i, row, octave.seed);
        const float below = Random(i, row + 1, octave.seed);
        _lattice[i] = octave.weight * (above + (below - above) * down);
    }
    for (int x = 0, cell = 0; x < _size; ++cell) {
        const float left = _lattice[cell];
        const float step = _lattice[cell + 1] - left;
        for (int i = 0; i < period && x < _size; ++i, ++x) {
            (*values)[x] += left + step * Smooth(static_cast<float>(i) / static_cast<float>(period));
        }
    }
}

void Noise::GetRow(int y, std::vector<float>* row)
{
    std::fill(_values[0].begin(), _values[0].end(), 0.5F);
    for (const _Octave& octave : _brightness) {
        _Add(octave, y, &_values[0]);
    }
    for (int axis = 0; axis < 2; ++axis) {
        std::fill(_values[axis + 1].begin(), _values[axis + 1].end(), 0.0F);
        for (const _Octave& octave : _color[axis]) {
            _Add(octave, y, &_values[axis + 1]);
        }
    }
    row->resize(static_cast<std::size_t>(_size) * 3);
    for (int x = 0; x < _size; ++x) {
        const float brightness = _values[0][x] + grain * Random(x, y, _seed);
        const float warm = _values[1][x];
        const float green = _values[2][x];
        float* const pixel = row->data() + static_cast<std::size_t>(x) * 3;
        pixel[0] = std::clamp(brightness + warm, 0.0F, 1.0F);
        pixel[1] = std::clamp(brightness + green, 0.0F, 1.0F);
        pixel[2] = std::clamp(brightness - warm, 0.0F, 1.0F);
    }
}
