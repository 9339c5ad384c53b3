// SPDX-License-Identifier: Apache-2.0
/// Visibility of declarations whose definitions live in the host's runtime library.
#ifndef OOCPT_ABI_SDR_API_H
#define OOCPT_ABI_SDR_API_H

#define SDR_API __attribute__((visibility("default")))

#endif
