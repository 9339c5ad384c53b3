// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_IMAGES_IMAGE_LIMITS_H
#define HDOOCPT_IMAGES_IMAGE_LIMITS_H

#include "images/imageLibrary.h"

#include <OpenImageIO/imageio.h>

#include <cstddef>
#include <string>

/// What is refused, since files may lie: every size here is checked before memory is taken for it. All functions throw
/// std::runtime_error with the reason, which follows on the file's name.

/// Texels a side, as many as textures have at most.
constexpr int HdOocPTMaxSide = 65536;
/// Bytes of a level when it is decoded: 65536 x 65536 texels of 4 bytes.
constexpr std::size_t HdOocPTMaxLevelBytes = std::size_t { 1 } << 34;
/// Bytes that a reader may have to hold at once: a tile, a strip, a block of rows; of JPEG in several scans, interlaced
/// PNG, TGA and BMP the image.
constexpr std::size_t HdOocPTMaxHeldBytes = std::size_t { 1 } << 31;
/// A file of any size may be that large when it is decoded; beyond, it has to be as long as its compression needs.
constexpr std::size_t HdOocPTAlwaysAllowedBytes = std::size_t { 64 } << 20;

/// Before OpenImageIO opens an OpenEXR file: the windows, tiles, channels and tables of all its parts.
void HdOocPTCheckExrHeader(const HdOocPTImageBytes& bytes);

/// Before OpenImageIO opens a JPEG, which may decode all of it at once: size, number of scans. `content` is the whole
/// file.
void HdOocPTCheckJpegHeader(const unsigned char* content, std::size_t size);

/// Of a PNG: the size in its header against that of the file.
void HdOocPTCheckPngHeader(const HdOocPTImageBytes& bytes);

/// Of a TIFF: whether its first directory is there, and says what OpenImageIO does not ask for.
void HdOocPTCheckTiffHeader(const HdOocPTImageBytes& bytes);

/// Of one level, as OpenImageIO tells of it.
void HdOocPTCheckSpec(const OIIO::ImageSpec& spec, const std::string& format, std::size_t fileSize);

/// Helper of all: `decoded` bytes from `stored` ones, where one stored byte gives at most `mostPerByte`.
void HdOocPTCheckRatio(double decoded, double stored, double mostPerByte);

#endif
