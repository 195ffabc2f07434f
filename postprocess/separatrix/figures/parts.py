# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Captions of a machine of several bodies and structures, from its resolved case."""

from collections.abc import Iterator, Mapping, Set

_JOINTS = ("spring", "friction", "contact")
# 0 by default, so not mentioned where they are 0
_ZERO = (
    "load", "x0", "v0", "quadratic", "cubic", "modulation", "damping", "damping_ratios", "free_length",
    "velocity", "tension", "mean", "amplitude", "angle",
)  # fmt: skip
# numbers of a list beyond which a caption only counts them
_LONGEST = 16
# values beyond this mean "absent"
_HUGE = 1e300


def several_bodies(case: Mapping) -> bool:
    """Whether a case has tables [body.NAME] or [structure.NAME]."""
    return any(True for _ in _tables(case, "body", "structure"))


def numbers_of_parts(case: Mapping) -> str:
    """Return how many bodies, structures and joints there are, as text."""
    bodies, structures = (sum(1 for _ in _tables(case, kind)) for kind in ("body", "structure"))
    joints = sum(1 for _ in _tables(case, "friction", "contact"))
    counted = [
        (bodies, "body", "bodies"),
        (structures, "structure", "structures"),
        (joints, "joint", "joints"),
    ]
    return ", ".join(f"{n} {one if n == 1 else many}" for n, one, many in counted if n or one == "joint")


def parts(case: Mapping, axes: Set[str], units: Mapping[str, str]) -> list[str]:
    """Return every part with what it joins, its law and its numbers; what is an axis is left out.

    `axes`: names of what varies in the file; `units`: unit of each parameter by its path.
    """
    pieces = []
    for kind, name, part in _tables(case, "body", "structure", *_JOINTS, "drive"):
        heading = name if kind == "body" else f"{kind} {name}"
        if "between" in part:
            heading += " ({} to {})".format(*part["between"])
        elif kind == "drive":
            heading += f" (on {part.get('body', '')})"
        texts = _law(part) + _numbers(f"{kind}.{name}", part, axes, units)
        texts += [f"point {point} {_listed(row)}" for point, row in part.get("point", {}).items()]
        pieces.append(f"{heading}: {', '.join(texts)}" if texts else heading)
    if case.get("body", {}).get("in_sequence", 0) == 1 and "body_in_sequence" not in axes:
        pieces.append("impacts of several contacts at once: one after the other")
    watched = case.get("watch", {}).get("body")
    return [*pieces, f"$x$, $v$: {watched}"] if watched else pieces


def _tables(case: Mapping, *kinds: str) -> Iterator[tuple[str, str, Mapping]]:
    for kind in kinds:
        family = case.get(kind, {})
        for name, part in family.items() if isinstance(family, Mapping) else ():
            if isinstance(part, Mapping):
                yield kind, name, part


def _law(part: Mapping) -> list[str]:
    law = str(part.get("law", "linear"))
    return [] if law == "linear" else [law.replace("_", "-")]


def _numbers(path: str, part: Mapping, axes: Set[str], units: Mapping[str, str]) -> list[str]:
    texts = []
    for key, value in part.items():
        values = value if isinstance(value, list) else [value]
        if key == "between" or not all(isinstance(one, int | float) for one in values) or not values:
            continue
        # negative: none was given
        absent = key in ("damping_ratio", "static_force") and values[0] < 0
        same = key == "static_force" and value == part.get("force")
        if absent or same or (key in _ZERO and not any(values)) or abs(values[0]) >= _HUGE:
            continue
        if f"{path}.{key}".replace(".", "_") in axes:
            continue
        unit = units.get(f"{path}.{key}[1]" if isinstance(value, list) else f"{path}.{key}", "1")
        shown = _listed(value, f"{path}.{key}", axes) if isinstance(value, list) else f"{value:.6g}"
        texts.append(f"{key.replace('_', ' ')} {shown} {'' if unit == '1' else unit}".rstrip())
    return texts


def _listed(values: list, path: str = "", axes: Set[str] = frozenset()) -> str:
    """A list as text, with a dash for an element that is an axis; a long one is in the file."""
    if len(values) > _LONGEST:
        return f"of {len(values)} numbers, in the result file"
    varies = [f"{path.replace('.', '_')}_{number}" in axes for number in range(1, len(values) + 1)]
    return f"({', '.join('-' if axis else f'{one:.6g}' for one, axis in zip(values, varies, strict=True))})"
