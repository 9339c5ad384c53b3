// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_IMAGES_IMAGE_FACTS_H
#define HDOOCPT_IMAGES_IMAGE_FACTS_H

#include "images/imageLibrary.h"

#include <OpenImageIO/imageio.h>

#include <cstddef>
#include <string>
#include <vector>

/// Chooses the channels of a file that are its texels, by their numbers in the file, 1 to 4: by name if a file has more
/// than a texture needs (layers, depth, ids).
std::vector<int> HdOocPTChooseChannels(const std::vector<std::string>& names);

/// The facts of an open file, of which `channels` are read. Throws std::runtime_error if it is too large.
HdOocPTImageFacts HdOocPTFindFacts(
    OIIO::ImageInput& input, const HdOocPTImageBytes& bytes, const std::vector<int>& channels);

/// OpenImageIO's name of a format.
OIIO::TypeDesc HdOocPTTypeOf(HdOocPTTexelFormat format);

#endif
