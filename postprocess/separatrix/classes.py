# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names and colours of the classes of a coded field: regimes, attractors, periods, event words."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from separatrix import style
from separatrix.labels import flag_text, positions_are_angles, unit
from separatrix.open import decode_word, flag_names, table

CLASS_FIELDS = ("regime", "attractor", "reason", "period", "event_word", "origin", "crank_outcome")
# of the largest value, below which another is 0 to rounding
_NOTHING = 1e-12


@dataclass(frozen=True)
class Class:
    """One entry of a legend and the codes that it stands for."""

    text: str
    colour: str
    codes: tuple[int, ...]


def classes(result: xr.Dataset, field: str, counts: dict[int, int]) -> list[Class]:
    """Return the classes that occur, ascending by code; beyond ten colours the rarest are one class.

    The colour of a regime, and of an outcome of a crank, is always the same. That of an attractor follows
    its id as long as the catalogue has at most ten, so that maps of one family keep their colours.
    """
    present = sorted(code for code, count in counts.items() if count > 0)
    fixed = {"regime": style.REGIMES, "crank_outcome": style.CRANKS}.get(field)
    if fixed is not None:
        names = flag_names(result[field])
        texts = {code: names.get(code, str(code)) for code in present}
        return [Class(flag_text(text), fixed.get(text, style.OTHER), (code,)) for code, text in texts.items()]
    nothing = [Class(_text(result, field, 0), style.NOTHING, (0,))] if 0 in present else []
    coded = [code for code in present if code != 0]
    # other classes than attractors are numbered as they occur
    ids = coded if field == "attractor" else [*range(1, len(coded) + 1)]
    highest = max(_known_ids(result) + ids if field == "attractor" else ids, default=0)
    number_of = dict(zip(coded, ids, strict=True))
    colours = style.of_attractors({number_of[code]: counts[code] for code in coded}, highest)
    entries = [
        Class(_text(result, field, code), colours[number_of[code]], (code,))
        for code in coded
        if number_of[code] in colours
    ]
    rest = tuple(code for code in coded if number_of[code] not in colours)
    return nothing + entries + ([Class(f"{len(rest)} others", style.OTHER, rest)] if rest else [])


def recoloured(entries: list[Class], colours: Sequence[str]) -> list[Class]:
    """Return the classes with other colours, in their order, for as many as are given."""
    coded = [entry for entry in entries if entry.codes != (0,)]
    new = dict(zip((entry.codes for entry in coded), colours, strict=False))
    return [replace(entry, colour=new.get(entry.codes, entry.colour)) for entry in entries]


def class_index(image: np.ndarray, entries: list[Class]) -> np.ndarray:
    """Return the position in `entries` of the code at each pixel."""
    index = np.zeros(image.shape, dtype=np.int16)
    for position, entry in enumerate(entries):
        index[np.isin(image, entry.codes)] = position
    return index


def class_counts(entries: list[Class], counts: dict[int, int]) -> np.ndarray:
    """Return how many points belong to each class."""
    return np.array([sum(counts.get(code, 0) for code in entry.codes) for entry in entries], dtype=np.int64)


def _known_ids(result: xr.Dataset) -> list[int]:
    catalogue = table(result, "catalogue")
    return [int(i) for i in np.unique(catalogue["attractor"].values)] if "attractor" in catalogue else []


def _text(result: xr.Dataset, field: str, code: int) -> str:
    if field == "attractor":
        return _attractor_text(result, code) if code else "no attractor"
    if field == "period":
        return f"period {code}" if code else "no period known"
    if field == "event_word":
        return _word_text(decode_word(code)) if code else "no cycle known"
    return flag_text(flag_names(result[field]).get(code, str(code)))


def _word_text(word: str) -> str:
    return f"word {word}" if word.strip(".") else "no events"


def _attractor_text(result: xr.Dataset, identity: int) -> str:
    """Return 'attractor 1: non-impact, period 1' from the catalogue, over all of its slices.

    Attractors of one class are distinguished by their event words, or else by their amplitudes.
    """
    catalogue = table(result, "catalogue")
    if "attractor" not in catalogue:
        return f"attractor {identity}"
    ids = catalogue["attractor"].values
    if identity not in ids:
        return f"attractor {identity}"
    texts = {int(one): _class_text(result, catalogue, ids == one) for one in np.unique(ids)}
    alike = [one for one, text in texts.items() if text == texts[identity] and one != identity]
    apart = ""
    if alike:
        words = {one: _catalogue_word(catalogue, ids == one) for one in (identity, *alike)}
        mine = words.pop(identity)
        if mine.strip(".") and mine not in words.values():
            apart = f", {mine}"
        else:
            apart = _size_text(result, catalogue, ids, identity, alike)
    return f"attractor {identity}: {texts[identity]}{apart}"


def _class_text(result: xr.Dataset, catalogue: xr.Dataset, mine: np.ndarray) -> str:
    """Return 'impact, period 2' of the entries of an attractor."""
    names = flag_names(result["regime"])
    regimes = [flag_text(names.get(int(r), str(r))) for r in np.unique(catalogue["regime"].values[mine])]
    periods = [int(p) for p in np.unique(catalogue["period"].values[mine])]
    if periods == [0]:
        period = _aperiodic_text(catalogue, mine)
    else:
        period = ("period " if len(periods) == 1 else "periods ") + ", ".join(str(p) for p in periods)
    return f"{' or '.join(regimes)}, {period}{_rotation_text(catalogue, mine)}"


def _catalogue_word(catalogue: xr.Dataset, mine: np.ndarray) -> str:
    """Return the event word of an attractor; '' where it has none, or another one in each slice."""
    words = np.unique(catalogue["event_word"].values[mine]) if "event_word" in catalogue else []
    return decode_word(int(words[0])) if len(words) == 1 else ""


def _size_text(
    result: xr.Dataset, catalogue: xr.Dataset, ids: np.ndarray, identity: int, alike: list[int]
) -> str:
    """Return ', amplitude 0.0155 m', or ', x = 1 m' where amplitudes agree, as those of rests do."""
    for name, sign in (("amplitude", ""), ("x", "= ")):
        if name not in catalogue:
            continue
        values = catalogue[name].copy(data=_rounded(catalogue[name].values))
        # Files of version 1 have lengths there, of angles too.
        values.attrs["units"] = "rad" if positions_are_angles(result) else unit(values)
        texts = {one: _range_text(values, ids == one) for one in (identity, *alike)}
        if texts[identity] not in [texts[one] for one in alike]:
            return f", {name} {sign}{texts[identity]}"
    return ""


def _rounded(values: np.ndarray) -> np.ndarray:
    """Values with 0 for what is nothing beside the largest."""
    size = np.abs(values)
    return np.where(size < _NOTHING * np.max(size, initial=0.0), 0.0, values)


def _range_text(values: xr.DataArray, mine: np.ndarray) -> str:
    """Return '0.0155 m', or the range over the slices."""
    chosen = values.values[mine]
    ends = dict.fromkeys(f"{value:.4g}" for value in (chosen.min(), chosen.max()))
    return f"{' to '.join(ends)} {unit(values)}".rstrip()


def _rotation_text(catalogue: xr.Dataset, mine: np.ndarray) -> str:
    """Return ', -1 turns per period' for a cycle of an angle that goes round; '' for any other."""
    if "rotation_number" not in catalogue:
        return ""
    turns = np.unique(catalogue["rotation_number"].values[mine])
    return f", {turns[0]:+.4g} turns per period" if turns.size == 1 and abs(turns[0]) > 0 else ""


def _aperiodic_text(catalogue: xr.Dataset, mine: np.ndarray) -> str:
    """Return what is known of entries without a period; older files have no kinds."""
    if "kind" not in catalogue:
        return "not periodic"
    names = flag_names(catalogue["kind"])
    kinds = {names.get(int(kind), "") for kind in np.unique(catalogue["kind"].values[mine])}
    texts = {"chaotic": "chaotic", "family": "a family of cycles"}
    return texts.get("".join(kinds), "not known to be periodic")
