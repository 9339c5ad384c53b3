// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_IMAGES_IMAGE_LIMITS_H
#define HDOOCPT_IMAGES_IMAGE_LIMITS_H

#include "images/imageLibrary.h"

#include <OpenImageIO/imageio.h>

#include <cstddef>
#include <string>

/// Limits on image files, which may be wrong or hostile: every size is checked here before memory is allocated for it.
/// All functions throw std::runtime_error with the reason, which follows on the file's name.

/// Most texels a side, as many as textures have.
constexpr int HdOocPTMaxSide = 65536;
/// Most bytes of a decoded level: 65536 x 65536 texels of 4 bytes.
constexpr std::size_t HdOocPTMaxLevelBytes = std::size_t { 1 } << 34;
/// Most bytes that a reader may have to hold at once: a tile, a strip, a block of rows; the whole image for JPEG in
/// several scans, interlaced PNG, TGA and BMP.
constexpr std::size_t HdOocPTMaxHeldBytes = std::size_t { 1 } << 31;
/// Decoded bytes that a file of any size may have; beyond, it has to be as long as its compression needs.
constexpr std::size_t HdOocPTAlwaysAllowedBytes = std::size_t { 64 } << 20;

/// Checks the windows, tiles, channels and tables of all parts before OpenImageIO opens an OpenEXR file.
void HdOocPTCheckExrHeader(const HdOocPTImageBytes& bytes);

/// Checks size and number of scans before OpenImageIO opens a JPEG, which may decode all of it at once. `content` is
/// the whole file.
void HdOocPTCheckJpegHeader(const unsigned char* content, std::size_t size);

/// Checks the size in the header of a PNG against that of the file.
void HdOocPTCheckPngHeader(const HdOocPTImageBytes& bytes);

/// Checks that the first directory of a TIFF exists and states what OpenImageIO takes for granted.
void HdOocPTCheckTiffHeader(const HdOocPTImageBytes& bytes);

/// Checks one level, as OpenImageIO describes it.
void HdOocPTCheckSpec(const OIIO::ImageSpec& spec, const std::string& format, std::size_t fileSize);

/// Checks `decoded` bytes from `stored` ones, where one stored byte gives at most `mostPerByte`.
void HdOocPTCheckRatio(double decoded, double stored, double mostPerByte);

#endif
