// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_TEXTURE_FILE_NOISE_H
#define HDOOCPT_TEXTURE_FILE_NOISE_H

#include <cstdint>
#include <vector>

/// A picture that compresses about as a photograph does: octaves of value noise, some color, and noise of each pixel by
/// itself. A pure function of size and seed: texels in any order would be the same, rows are made one after the other.
class Noise
{
public:
    /// Noise of `size` x `size` pixels, at least 4.
    Noise(int size, std::uint32_t seed);

    /// Row `y` from the top as red, green, blue of each pixel, 0 to 1, encoded as sRGB pictures are.
    void GetRow(int y, std::vector<float>* row);

private:
    struct _Octave
    {
        /// Pixels from one random value to the next.
        int period;
        float weight;
        std::uint32_t seed;
    };

    /// Adds an octave to a row of `_size` values.
    void _Add(const _Octave& octave, int y, std::vector<float>* values);

    const int _size;
    const std::uint32_t _seed;
    /// Octaves of brightness, and of the two axes of color.
    std::vector<_Octave> _brightness;
    std::vector<_Octave> _color[2];
    std::vector<float> _lattice;
    std::vector<float> _values[3];
};

#endif
