// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_IMAGE_SOURCE_H
#define HDOOCPT_BRIDGE_IMAGE_SOURCE_H

#include "bridge/heldImage.h"
#include "images/imageLibrary.h"
#include "pxr/pxr.h"

#include <memory>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// Files by the host's asset resolver: plain ones, members of usdz packages, whatever its plugins serve. Images are
/// decoded by the library in cpp/images, which is loaded when the first one is opened.
std::unique_ptr<oocpt::ImageSource> HdOocPTMakeImageSource();

/// Opens a file as the images of the source are opened. Throws std::runtime_error with the reason, which follows on the
/// file's name.
std::unique_ptr<HdOocPTImageFile> HdOocPTOpenHostImage(const std::string& resolved);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
