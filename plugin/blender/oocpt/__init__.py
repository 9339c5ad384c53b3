# SPDX-License-Identifier: Apache-2.0
"""OocPT as a render engine of Blender.

`engine` renders, through Blender's own `HydraRenderEngine`; `stage` corrects the USD stage that Blender exports for it;
`plugin` loads the Hydra plugin that lies beside this file, and `pins` says for which Blender it was built; `passes` is
the table of passes; `progress` tells how far a render is; `settings` and `panels` are what the user sees.
"""

from . import engine, panels, plugin, settings, stage

MODULES = (settings, stage, engine, panels)


def register():
    plugin.prepare()
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
