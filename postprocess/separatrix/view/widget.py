# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewer in a notebook, where the package anywidget is there (`pip install separatrix[notebook]`).

from separatrix.view.widget import Viewer
Viewer("basin.h5", "sweep.h5")
"""

import threading
from collections.abc import Mapping
from pathlib import Path

import anywidget

from separatrix.errors import SeparatrixError
from separatrix.simulate import StoppedError
from separatrix.view.bundle import module_text, style_text
from separatrix.view.packing import pack
from separatrix.view.protocol import Desk, RefusedError

__all__ = ["Viewer"]

_RENDER = """
export default {
  async render({ model, el }) {
    const root = document.createElement("div");
    el.append(root);
    await mount(root, new WidgetTransport(model));
  },
};
"""


class Viewer(anywidget.AnyWidget):
    """Result files to look around in; the same requests as those of the viewer's server (docs/viewer.md)."""

    _esm = module_text() + _RENDER
    _css = style_text()

    def __init__(self, *paths: str | Path, keep: str | Path = ".") -> None:
        """Open files; kept views are written into the folder `keep`."""
        self._desk = Desk([Path(path) for path in paths], Path(keep))
        super().__init__()
        self.on_msg(self._asked)

    def _asked(self, _: object, message: Mapping[str, object], __: object) -> None:
        # Work in threads of their own, so that a newer view can end it.
        threading.Thread(target=self._answer, args=(message,), daemon=True).start()

    def _answer(self, message: Mapping[str, object]) -> None:
        number = message.get("id")
        try:
            name, parameters = str(message["name"]), dict(message["parameters"])
            answer = self._desk.answer(name, parameters, bool(message.get("act")))
        except StoppedError as error:
            answer = pack({"stopped": str(error)})
        except SeparatrixError as error:
            status = 400 if isinstance(error, RefusedError) else 422
            self.send({"id": number, "error": str(error), "status": status})
            return
        except (KeyError, TypeError, ValueError) as error:
            self.send({"id": number, "error": f"not understood ({error})", "status": 400})
            return
        self.send({"id": number}, [answer])
