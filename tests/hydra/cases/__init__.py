# SPDX-License-Identifier: Apache-2.0
"""What the scenes of `tests/scenes/cases` must show: a module per subject."""

import importlib
import pkgutil

from cases.case import Case

ALL: list[Case] = [
    case
    for module in sorted(found.name for found in pkgutil.iter_modules(__path__) if found.name != "case")
    for case in importlib.import_module(f"cases.{module}").CASES
]
