// SPDX-License-Identifier: Apache-2.0
#ifndef HDOOCPT_BRIDGE_PLAIN_MESSAGES_H
#define HDOOCPT_BRIDGE_PLAIN_MESSAGES_H

#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// Turns every diagnostic of this process that Tf would print into one line on standard error, without the place in the
/// source: "OocPT: warning: text" for ours, "USD: warning: text" for the host's. For the rest of the process; call it
/// once. For our own command lines only: in other hosts messages are the host's business.
void HdOocPTPrintPlainMessages();

PXR_NAMESPACE_CLOSE_SCOPE

#endif
