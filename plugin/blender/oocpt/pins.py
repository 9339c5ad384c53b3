# SPDX-License-Identifier: Apache-2.0
"""What the plugin in this extension is compiled for. `pack.py` writes the host's own versions here."""

BLENDER = "5.0"
OPENUSD = (0, 25, 8)
