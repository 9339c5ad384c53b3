// SPDX-License-Identifier: Apache-2.0
/// Version and namespace of the wheel host: OpenUSD 25.08 or 26.03 as bundled by its Python wheel.
///
/// The build says which (OOCPT_ABI_VERSION). The wheels of headers name namespaces of their own versions; the build
/// maps each of these names to the runtime's own with a -D flag. This folder holds interface declarations only, written
/// from the runtime binaries.
#ifndef OOCPT_ABI_PXR_H
#define OOCPT_ABI_PXR_H

#if !defined(OOCPT_ABI_VERSION) || (OOCPT_ABI_VERSION != 2508 && OOCPT_ABI_VERSION != 2603)
#error "cpp/abi describes the runtimes 2508 and 2603 only; build against the headers of your own OpenUSD instead"
#endif

#define PXR_MAJOR_VERSION 0
#define PXR_MINOR_VERSION (OOCPT_ABI_VERSION / 100)
#define PXR_PATCH_VERSION (OOCPT_ABI_VERSION % 100)
#define PXR_VERSION OOCPT_ABI_VERSION

#define PXR_NS pxr
#define PXR_INTERNAL_NS pxrInternal_v0_25_8__pxrReserved__
#define PXR_NS_GLOBAL ::PXR_NS

namespace PXR_INTERNAL_NS {
}

namespace PXR_NS {
using namespace PXR_INTERNAL_NS;
}

#define PXR_NAMESPACE_OPEN_SCOPE namespace PXR_INTERNAL_NS {
#define PXR_NAMESPACE_CLOSE_SCOPE }
#define PXR_NAMESPACE_USING_DIRECTIVE using namespace PXR_NS;

/// Tells translation units that the imaging declarations are ours, not an SDK's.
#define OOCPT_ABI_HEADERS 1

#endif
