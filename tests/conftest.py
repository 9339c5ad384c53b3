# SPDX-License-Identifier: Apache-2.0
"""Makes the scene generators importable for every Python test, also when pytest runs isolated (`-I --import-mode=importlib`)."""

import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
for folder in ("scenes", "hydra", "images"):
    if str(HERE / folder) not in sys.path:
        sys.path.insert(0, str(HERE / folder))
