# SPDX-License-Identifier: Apache-2.0
"""Makes the scene generators importable for every Python test, also when pytest runs isolated (`-I
--import-mode=importlib`), and keeps the texture cache of tests apart from the user's own."""

import atexit
import os
import pathlib
import shutil
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
# The last one is found first: `conftest` is that of `hydra`.
for folder in ("scenes", "images", "hydra"):
    if str(HERE / folder) not in sys.path:
        sys.path.insert(0, str(HERE / folder))

# OpenUSD 26.03 warns of the old front end where it is asked for, and says of each such setting that it is set.
os.environ["USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX_DEPRECATION_WARNING"] = "0"
os.environ["TF_ENV_SETTING_ALERTS_ENABLED"] = "0"

# Of every process that a test starts, unless it says otherwise.
CACHE = tempfile.mkdtemp(prefix="oocpt-test-textures-")
os.environ["OOCPT_TEXTURE_CACHE"] = CACHE
atexit.register(shutil.rmtree, CACHE, ignore_errors=True)
