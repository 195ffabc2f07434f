# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The modules of the page as one, for where there is no server: notebooks and pages that open offline."""

import re
from importlib import resources

__all__ = ["module_text", "style_text"]

_IMPORT = re.compile(r'^import (\{[^}]*\}) from "\./(\w+)\.js";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export ((?:async )?(?:function|class|const) (\w+))", re.MULTILINE)


def module_text() -> str:
    """Return the modules as one text, each in its own scope, with `mount` and the transports as names."""
    parts: dict[str, str] = {}

    def add(name: str) -> None:
        text = _read(f"{name}.js")
        for _, wanted in _IMPORT.findall(text):
            if f"of_{wanted}" not in parts:
                add(wanted)
        exports = ", ".join(found for _, found in _EXPORT.findall(text))
        text = _EXPORT.sub(r"\1", _IMPORT.sub(r"const \1 = of_\2;\n", text))
        parts[f"of_{name}"] = f"const of_{name} = (() => {{\n{text}\nreturn {{ {exports} }};\n}})();\n"

    add("transport")
    add("app")
    names = "const { mount } = of_app;\nconst { StoredTransport, WidgetTransport } = of_transport;\n"
    return "".join(parts.values()) + names


def style_text() -> str:
    """Return the style sheet."""
    return _read("style.css")


def _read(name: str) -> str:
    return resources.files("separatrix.view").joinpath("static", name).read_text(encoding="utf-8")
