# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Regions of a sweep: where motions impact, do not impact, or both are possible."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import xarray as xr

from separatrix.labels import flag_text, unit
from separatrix.open import flag_names

_IMPACTING = {"impact", "mixed", "chattering"}
_UNKNOWN = {"unresolved"}


@dataclass(frozen=True)
class Boundary:
    """A limit of a region: a bracket of the swept parameter."""

    lower: float
    upper: float

    @property
    def middle(self) -> float:
        """The middle of the bracket."""
        return (self.lower + self.upper) / 2


@dataclass(frozen=True)
class Region:
    """An interval of the swept parameter and what happens in it."""

    lower: float
    upper: float
    text: str


def brackets(limits: xr.Dataset, *, in_steps: bool = False) -> np.ndarray:
    """Return the ends of each limit: of the settled motion where known, else (or always) as seen in steps."""
    if "lower" not in limits:
        return np.zeros((0, 2))
    ends = np.stack([limits["lower"].values, limits["upper"].values], axis=1)
    if "observed_lower" in limits:
        seen = np.stack([limits["observed_lower"].values, limits["observed_upper"].values], axis=1)
        ends = np.where(np.isfinite(ends).all(axis=1, keepdims=True) & (not in_steps), ends, seen)
    return ends


def limit_texts(limits: xr.Dataset) -> list[str]:
    """Return each limit as text, with its run, and whether that of the settled motion is known."""
    known = np.isfinite(limits["lower"].values + limits["upper"].values) if "lower" in limits else []
    shown = f" {unit(limits['lower'])}".rstrip() if "lower" in limits else ""
    texts = []
    for name, (lower, upper), settled in zip(
        limits["name"].values if "name" in limits else [], brackets(limits), known, strict=True
    ):
        if not np.isfinite(lower + upper):
            continue
        what, _, run = str(name).rpartition("_")
        about = f"run-{run}" if settled else f"run-{run}, observed in steps"
        digits = next((n for n in range(6, 15) if f"{lower:.{n}g}" != f"{upper:.{n}g}"), 15)
        bracket = f"{lower:.{digits}g} to {upper:.{digits}g}" if lower != upper else f"{lower:.6g}"
        texts.append(f"{flag_text(what)} at {bracket}{shown} ({about})")
    return texts


def boundaries(limits: xr.Dataset) -> list[Boundary]:
    """Return the limits in ascending order; brackets that overlap or touch are one."""
    ends = np.sort(brackets(limits), axis=1)
    merged: list[Boundary] = []
    for lower, upper in sorted(ends[np.isfinite(ends).all(axis=1)].tolist()):
        if merged and lower <= merged[-1].upper:
            merged[-1] = Boundary(merged[-1].lower, max(upper, merged[-1].upper))
        else:
            merged.append(Boundary(lower, upper))
    return merged


def regions(result: xr.Dataset, name: str, lines: list[Boundary]) -> list[Region]:
    """Return the intervals between the limits, each named by what most of its values show.

    A value counts as 'multiple solutions' if run-up, run-down or any of the starts disagree on impacts.
    """
    values = result[name].values
    texts = _solutions(result, name)
    ends = [values.min(), *(line.middle for line in lines), values.max()]
    found = []
    for lower, upper in pairwise(ends):
        inside = texts[(values > lower) & (values < upper)]
        inside = inside[inside != ""]
        if inside.size:
            kinds, numbers = np.unique(inside, return_counts=True)
            found.append(Region(float(lower), float(upper), str(kinds[numbers.argmax()])))
    return found


def _solutions(result: xr.Dataset, name: str) -> np.ndarray:
    parts = [result["regime"].transpose(name, "direction").values]
    if "branch_regime" in result:
        parts.append(result["branch_regime"].transpose(name, "start").values)
    codes = np.concatenate(parts, axis=1)
    names = flag_names(result["regime"])
    impacting = np.isin(codes, [code for code, text in names.items() if text in _IMPACTING])
    unknown = np.isin(codes, [code for code, text in names.items() if text in _UNKNOWN])
    some = (impacting & ~unknown).any(axis=1)
    other = (~impacting & ~unknown).any(axis=1)
    return np.select([some & other, some, other], ["multiple solutions", "impact", "non-impact"], "")
