# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Starting positions of a case kept between its barriers when a fit has moved these a little."""

import re
import tomllib


def kept_between(text: str, lower: float, upper: float) -> str:
    """A resolved case whose starts, axis x0 and starts of the sweep lie in [`lower`, `upper`]."""
    case = tomllib.loads(text)
    within = {
        "[start]": ("x0",),
        "[sweep]": ("x0",),
        "[[axis]]": ("from", "to"),
    }
    axes = iter(case.get("axis", []))
    keys: tuple[str, ...] = ()
    lines = []
    for line in text.splitlines():
        if line.startswith("["):
            keys = within.get(line.strip(), ())
            if line.strip() == "[[axis]]" and next(axes)["name"] != "x0":
                keys = ()
        key, found, value = line.partition(" = ")
        if found and key in keys:
            line = f"{key} = {_clipped(value, lower, upper)}"
        lines.append(line)
    return "\n".join([*lines, ""])


def _clipped(value: str, lower: float, upper: float) -> str:
    def inside(number: re.Match) -> str:
        given = float(number[0])
        return number[0] if lower <= given <= upper else repr(float(min(max(given, lower), upper)))

    return re.sub(r"[-+.\w]+", inside, value)
