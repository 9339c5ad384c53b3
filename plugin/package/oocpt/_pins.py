# SPDX-License-Identifier: Apache-2.0
"""The host of this package: its OpenUSD, the version of the package `bpy` that it is part of, and its Python. pack.py
writes those of the host that it packs for; in the clone they are the default host's."""

OPENUSD = "25.08"
BPY = "5.0.1"
PYTHON = "3.11"
