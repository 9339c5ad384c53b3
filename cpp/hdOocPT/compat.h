// SPDX-License-Identifier: Apache-2.0
/// The only place where the shim depends on the version of OpenUSD that it is compiled for.
///
/// Compiled: 25.08 and 26.03 (wheel hosts, declarations under cpp/abi) and 24.11 (SDK headers). For newer SDKs the
/// switch follows their published interface and was not compiled here.
#ifndef HDOOCPT_COMPAT_H
#define HDOOCPT_COMPAT_H

#include "pxr/pxr.h"

#if PXR_VERSION < 2411
#error "hdOocPT needs OpenUSD 24.11 or newer: HdRenderDelegate::SetTerminalSceneIndex is how it reads the scene"
#endif

#if !defined(OOCPT_ABI_HEADERS)
#include "pxr/imaging/hd/version.h"
#endif

/// Since API version 83, IsSupported takes a struct, and may return a reason.
#if (defined(HD_API_VERSION) && HD_API_VERSION >= 83) || (defined(OOCPT_ABI_HEADERS) && PXR_VERSION >= 2603)
#define HDOOCPT_IS_SUPPORTED_PARAMETERS HdRendererCreateArgs const&, std::string*
#else
#define HDOOCPT_IS_SUPPORTED_PARAMETERS bool
#endif

#endif
