# SPDX-License-Identifier: Apache-2.0
"""Unpacks the members of a wheel that begin with one of the given prefixes (all members if none is given).

usage: unpack_wheel.py WHEEL FOLDER [PREFIX ...]
"""
import sys
import zipfile

wheel, folder, prefixes = sys.argv[1], sys.argv[2], tuple(sys.argv[3:]) or ("",)
with zipfile.ZipFile(wheel) as archive:
    # extract() strips drive letters, absolute roots and "..", and checks each member's CRC.
    members = [name for name in archive.namelist() if name.startswith(prefixes)]
    if not members:
        sys.exit(f"{wheel}: no member begins with {prefixes}")
    archive.extractall(folder, members)
