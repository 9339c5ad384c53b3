# SPDX-License-Identifier: Apache-2.0
"""What a user does in usdview, done by `testusdview --testScript`: tumble, zoom, walk, pick, resize, edit, change
complexity, cameras and AOVs, pause, stop, change settings, take another renderer and come back, close while it renders.

Writes into the folder `OOCPT_USDVIEW_OUT` a picture of the viewport for each shot and `log.json`: a list of
`{"step", "shots": [{"file", "seconds", "changed"}], ...facts}`, with the seconds since the event that the shot follows.
A step that raises is logged with its traceback, and the others go on.

`OOCPT_USDVIEW_INTERVAL`: seconds from an event to its shot; 0, the default, waits until the viewport has changed.
`OOCPT_USDVIEW_STEPS`: names of steps, separated by commas.
"""

import json
import os
import time
import traceback
from pathlib import Path

from pxr import Gf, UsdGeom, UsdLux
from pxr.Usdviewq.common import PickModes
from pxr.Usdviewq.qt import QtCore, QtGui, QtWidgets

OUT = Path(os.environ["OOCPT_USDVIEW_OUT"])
INTERVAL = float(os.environ.get("OOCPT_USDVIEW_INTERVAL", "0"))
# Most seconds that a step waits for its picture.
PATIENCE = float(os.environ.get("OOCPT_USDVIEW_PATIENCE", "60"))
MOVES = 20


class Driver:
    """One usdview window."""

    def __init__(self, app):
        self.app = app
        self.view = app._stageView
        self.stage = app._dataModel.stage
        self.log = []
        self.shown = None
        self.count_shots = 0
        self.paints = 0
        paint = type(self.view).paintGL

        def counted(view):
            self.paints += 1
            paint(view)

        type(self.view).paintGL = counted

    def events(self, seconds=0.0):
        """Has Qt work for so long."""
        end = time.monotonic() + seconds
        while True:
            QtWidgets.QApplication.processEvents(QtCore.QEventLoop.AllEvents, 5)
            if time.monotonic() >= end:
                return

    def wait(self, condition):
        """Has Qt work until it is so; tells whether it came."""
        end = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > end:
                return False
            self.events()
            time.sleep(0.002)
        return True

    def converge(self):
        """Waits until the picture of what is set now is done."""
        self.events()
        painted = self.paints
        self.view.update()
        return self.wait(lambda: self.paints > painted) and self.wait(self.view.IsRendererConverged)

    def grab(self):
        image = self.app.GrabViewportShot()
        return image, bytes(image.constBits())

    def shot(self, row, since, follows=False):
        """The viewport as it is shown now, or if it follows a move, as soon as it has changed."""
        image, pixels = self.grab()
        if follows and INTERVAL == 0:
            end = time.monotonic() + PATIENCE
            while pixels == self.shown and time.monotonic() < end:
                self.events(0.005)
                image, pixels = self.grab()
        seconds = time.monotonic() - since
        name = f"{self.count_shots:03}-{row['step']}.png"
        self.count_shots += 1
        image.save(str(OUT / name), "PNG")
        row["shots"].append({"file": name, "seconds": round(seconds, 4), "changed": pixels != self.shown})
        self.shown = pixels

    def moved(self, row, since):
        """The shot that follows a move."""
        self.events(INTERVAL)
        self.shot(row, since, follows=True)

    def step(self, name, action):
        row = {"step": name, "shots": []}
        self.log.append(row)
        try:
            row.update(action(row) or {})
        except Exception:
            row["error"] = traceback.format_exc()
        (OUT / "log.json").write_text(json.dumps(self.log, indent=1))

    def at_rest(self, row):
        """The picture when it is done."""
        since = time.monotonic()
        done = self.converge()
        self.shot(row, since)
        return {"converged": done}

    def mouse(self, kind, place, button=QtCore.Qt.LeftButton, modifiers=QtCore.Qt.NoModifier):
        held = QtCore.Qt.NoButton if kind == QtCore.QEvent.MouseButtonRelease else button
        event = QtGui.QMouseEvent(kind, QtCore.QPointF(*place), self.view.mapToGlobal(QtCore.QPointF(*place)),
                                  button, held, modifiers)
        QtWidgets.QApplication.sendEvent(self.view, event)

    def drag(self, row, button, moves, modifiers=QtCore.Qt.AltModifier):
        """Drags by `moves`, a list of pixel offsets, and takes a picture an interval after each."""
        x, y = self.view.width() / 2, self.view.height() / 2
        self.mouse(QtCore.QEvent.MouseButtonPress, (x, y), button, modifiers)
        for dx, dy in moves:
            x, y = x + dx, y + dy
            since = time.monotonic()
            self.mouse(QtCore.QEvent.MouseMove, (x, y), button, modifiers)
            self.moved(row, since)
        self.mouse(QtCore.QEvent.MouseButtonRelease, (x, y), button, modifiers)

    def tumble(self, row):
        # There and back: pictures of sky and floor alone would all be alike.
        self.drag(row, QtCore.Qt.LeftButton, [(6, 1)] * (MOVES // 2) + [(-6, -1)] * (MOVES // 2))

    def zoom(self, row):
        self.drag(row, QtCore.Qt.RightButton, [(4, 2)] * (MOVES // 2) + [(-4, -2)] * (MOVES // 2))

    def walk(self, row):
        self.drag(row, QtCore.Qt.MiddleButton, [(5, 0)] * (MOVES // 2) + [(-5, 0)] * (MOVES // 2))

    def pick(self, row):
        """Clicks on each prim of `/World` named Pick*, where it is in the view."""
        found = {}
        self.app._dataModel.viewSettings.pickMode = PickModes.INSTANCES
        # Ids are those of the picture that is shown: it has to be one of this camera.
        self.converge()
        for prim in self.stage.GetPrimAtPath("/World").GetChildren():
            if not prim.GetName().startswith("Pick"):
                continue
            frustum = self.view.resolveCamera()[0].frustum
            matrix = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
            box = UsdGeom.Imageable(prim).ComputeWorldBound(0, "default").ComputeCentroid()
            ndc = matrix.Transform(box)
            x = (ndc[0] + 1) / 2 * self.view.width()
            y = (1 - ndc[1]) / 2 * self.view.height()
            since = time.monotonic()
            self.mouse(QtCore.QEvent.MouseButtonPress, (x, y))
            self.mouse(QtCore.QEvent.MouseButtonRelease, (x, y))
            self.events(INTERVAL)
            chosen = self.app._dataModel.selection.getPrimPathInstances()
            found[str(prim.GetPath())] = {
                # All instances of a prim are -1 here.
                "paths": {str(path): sorted(instances) if isinstance(instances, set) else []
                          for path, instances in chosen.items()},
                "seconds": round(time.monotonic() - since, 4),
            }
            self.shot(row, since)
        return {"picked": found}

    def resize(self, row):
        sizes = []
        for width, height in [(500, 400), (640, 300), (597, 540)]:
            since = time.monotonic()
            self.view.setFixedSize(width, height)
            self.moved(row, since)
            sizes.append([width, height])
        return {"sizes": sizes}

    def edit(self, row):
        light = UsdLux.DomeLight(self.stage.GetPrimAtPath("/World/Dome"))
        ball = UsdGeom.XformCommonAPI(self.stage.GetPrimAtPath("/World/PickBall"))
        for number in range(MOVES // 2):
            since = time.monotonic()
            light.GetColorAttr().Set(Gf.Vec3f(1.0, 1.0 - 0.04 * number, 1.0 - 0.04 * number))
            ball.SetTranslate(Gf.Vec3d(-2.5 + 0.1 * number, 0.3, 0.0))
            self.moved(row, since)
        light.GetColorAttr().Set(Gf.Vec3f(1.0))
        ball.SetTranslate(Gf.Vec3d(-2.5, 0.3, 0.0))

    def complexity(self, row):
        levels = []
        for _ in range(2):
            since = time.monotonic()
            self.app._incrementComplexity()
            self.moved(row, since)
            levels.append(str(self.app._dataModel.viewSettings.complexity))
        self.app._decrementComplexity()
        self.app._decrementComplexity()
        return {"levels": levels}

    def cameras(self, row):
        seen = []
        for path in ["/World/Camera", "/World/Other", "/World/Camera"]:
            since = time.monotonic()
            self.app._dataModel.viewSettings.cameraPrim = self.stage.GetPrimAtPath(path)
            self.moved(row, since)
            seen.append(path)
        return {"cameras": seen}

    def aovs(self, row):
        names = [str(name) for name in self.view.GetRendererAovs()]
        for name in names:
            self.app._rendererAovChanged(name)
            self.converge()
            self.shot(row, time.monotonic())
        self.app._rendererAovChanged("color")
        self.converge()
        return {"aovs": names}

    def pause(self, row):
        facts = {"supported": bool(self.view.IsPauseRendererSupported())}
        self.app._togglePause()
        self.events(0.05)
        self.shot(row, time.monotonic())
        facts["paused"] = bool(self.app._paused)
        self.events(0.3)
        self.shot(row, time.monotonic())
        self.app._togglePause()
        facts["converged"] = self.converge()
        self.shot(row, time.monotonic())
        return facts

    def stop(self, row):
        facts = {"supported": bool(self.view.IsStopRendererSupported())}
        self.app._toggleStop()
        self.events(0.05)
        self.shot(row, time.monotonic())
        self.app._toggleStop()
        facts["converged"] = self.converge()
        self.shot(row, time.monotonic())
        return facts

    def settings(self, row):
        """Opens the panel of settings, sets one in it and applies."""
        self.app._moreRendererSettings()
        widgets = {widget.key: widget for widget in self.app._ui.settingsMoreWidgets}
        before = self.view.GetRendererSetting("oocpt:maxBounces")
        widgets["oocpt:maxBounces"].setValue(0)
        self.app._applyMoreRendererSettings()
        self.app._ui.settingsMoreDialog.grab().save(str(OUT / "settings.png"), "PNG")
        self.app._ui.settingsMoreDialog.accept()
        self.converge()
        self.shot(row, time.monotonic())
        after = self.view.GetRendererSetting("oocpt:maxBounces")
        self.view.SetRendererSetting("oocpt:maxBounces", before)
        self.converge()
        self.shot(row, time.monotonic())
        return {"names": sorted(map(str, widgets)), "before": before, "after": after}

    def renderers(self, row):
        """Storm and back, from the menu."""
        back = self.view.GetCurrentRendererId()
        names = {}
        for plugin in ["HdStormRendererPlugin", back]:
            for action in self.app._ui.rendererPluginActionGroup.actions():
                if action.pluginType == plugin:
                    action.trigger()
            self.converge()
            self.shot(row, time.monotonic())
            names[str(plugin)] = str(self.view.rendererDisplayName)
        return {"renderers": names}

    def window(self, row):
        """The whole window, menus and panels."""
        self.converge()
        name = f"{self.count_shots:03}-window.png"
        self.count_shots += 1
        self.app.GrabWindowShot().save(str(OUT / name), "PNG")
        row["shots"].append({"file": name, "seconds": 0.0, "changed": True})
        return {"renderer": str(self.view.GetCurrentRendererId())}


STEPS = ["at_rest", "tumble", "zoom", "walk", "cameras", "pick", "resize", "edit", "complexity", "aovs", "pause",
         "stop", "settings", "renderers", "window"]


def testUsdviewInputFunction(app):
    """Called by testusdview, which closes the window when this returns."""
    OUT.mkdir(parents=True, exist_ok=True)
    driver = Driver(app)
    chosen = os.environ.get("OOCPT_USDVIEW_STEPS", ",".join(STEPS)).split(",")
    for name in chosen:
        driver.step(name, getattr(driver, name))
    # The window closes while the picture is in the making.
    driver.mouse(QtCore.QEvent.MouseButtonPress, (100, 100), QtCore.Qt.LeftButton, QtCore.Qt.AltModifier)
    driver.mouse(QtCore.QEvent.MouseMove, (140, 100), QtCore.Qt.LeftButton, QtCore.Qt.AltModifier)
    driver.events(0.02)
    driver.step("closing", lambda row: {"converged": bool(driver.view.IsRendererConverged())})
