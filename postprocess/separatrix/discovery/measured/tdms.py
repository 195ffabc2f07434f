# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records in TDMS files: channels with waveforms of their own, in one burst or in several."""

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from separatrix.discovery.measured.arrays import Found, column_of, common_times
from separatrix.discovery.measured.header import is_stated
from separatrix.discovery.measured.tables import is_column
from separatrix.discovery.measured.tdms_bursts import OFFSET, START, STEP, Burst, bursts_of
from separatrix.discovery.policy import RECORDS
from separatrix.errors import SeparatrixError
from separatrix.extras import library


def read_tdms(path: Path, names: Mapping[str, str]) -> Found:
    """Channels named t, x, ..., of any group; t may be the waveform of the channels."""
    nptdms = library("nptdms", path, "formats")
    # it prints bytes of damaged files
    logging.getLogger("nptdms").setLevel(logging.CRITICAL)
    file = nptdms.TdmsFile.read(path, raw_timestamps=True)
    found, waves = Found(), {}
    bursts = bursts_of(path, found.notes)
    for properties in (file.properties, *(group.properties for group in file.groups())):
        for key, value in properties.items():
            found.key(key, value)
    for group in file.groups():
        for channel in group.channels():
            name = column_of(channel.name, names)
            if not is_column(name):
                found.unused.append(channel.name)
                continue
            if name in found.values:
                raise SeparatrixError(f"{path}: two channels are named '{name}'")
            values = channel[:]
            stamps = isinstance(values, nptdms.timestamp.TimestampArray)
            found.values[name] = values.as_datetime64("ns") if stamps else values
            unit = str(channel.properties.get("unit_string", ""))
            found.units |= {name: unit} if is_stated(unit) else {}
            if name != "t" and STEP in channel.properties:
                waves[name] = _times(path, name, len(values), bursts.get(channel.path, []), found)
    if "t" not in found.values and waves:
        begin = min(start for start, _ in waves.values())
        found.values["t"] = common_times(path, {name: t + (s - begin) for name, (s, t) in waves.items()})
        found.units.setdefault("t", "s")
    return found


def _times(path: Path, name: str, size: int, bursts: list[Burst], found: Found) -> tuple[float, np.ndarray]:
    """When the waveform of a channel begins [s], and its times since then, with the gaps between bursts."""
    axis = str(bursts[-1].properties.get("wf_xunit_string", "")) if bursts else ""
    found.units |= {"t": axis} if is_stated(axis) else {}
    if all(burst.clock == bursts[0].clock for burst in bursts):
        # one after the other, whatever their lengths
        bursts = [Burst(size, bursts[0].properties)] if bursts else []
    parts, begin, before, end = [], None, None, 0.0
    for burst in bursts:
        properties = burst.properties
        step = float(properties.get(STEP, 0.0))
        if not step > 0:
            raise SeparatrixError(f"{path}: {STEP} of '{name}' is {step:g} s, expected more than 0")
        start = properties.get(START)
        begin = start if begin is None else begin
        first = float(properties.get(OFFSET, 0.0))
        if start is not None:
            seconds, fractions = (a - b for a, b in zip(start, begin, strict=True))
            first += seconds + fractions / 2.0**64
        before, stated = burst.clock, before
        if parts and (before == stated or abs(first - end) <= RECORDS.beside_burst * step):
            first = end
        elif parts:
            if first < end:
                raise SeparatrixError(
                    f"{path}: a burst of '{name}' begins at {first:.9g} s, before the end of the one before "
                    f"it at {end:.9g} s"
                )
            found.notes.append(
                f"a burst begins {first - end + step:.6g} s after the sample before it ({name})"
            )
        parts.append(first + step * np.arange(burst.samples))
        end = first + step * burst.samples
    t = np.concatenate(parts or [np.zeros(0)])
    if t.size != size:
        raise SeparatrixError(f"{path}: the bursts of '{name}' have {t.size} samples, the channel {size}")
    seconds, fractions = begin or (0, 0)
    return seconds + fractions / 2.0**64, t
