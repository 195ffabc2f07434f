# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records in ASAM MDF files: channels with clocks of their own, samples that the recorder marks invalid."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from separatrix.discovery.measured.arrays import Found, column_of, common_times
from separatrix.discovery.measured.header import is_stated
from separatrix.discovery.measured.tables import is_column
from separatrix.errors import SeparatrixError
from separatrix.extras import library

# of a master channel: time
_TIME = 1


def read_mdf(path: Path, names: Mapping[str, str]) -> Found:
    """Channels named x, v, ...; t is their clock, and samples that are invalid are gaps."""
    found, times, invalid = Found(), {}, {}
    with library("asammdf", path, "mdf").MDF(path) as file:
        masters = set(file.masters_db.items())
        for own, channels in file.channels_db.items():
            channels = [one for one in channels if one not in masters]
            name = column_of(own, names)
            if not channels:
                continue
            if not is_column(name) or name == "t":
                found.unused.append(own)
                continue
            if len(channels) > 1 or name in times:
                raise SeparatrixError(f"{path}: {max(2, len(channels))} channels are '{name}', expected one")
            group, index = channels[0]
            signal = file.get(group=group, index=index, ignore_invalidation_bits=True)
            master, kind = signal.master_metadata or ("", _TIME)
            if kind != _TIME:
                raise SeparatrixError(f"{path}: '{name}' is recorded over '{master}', expected over time")
            found.values[name] = np.asarray(signal.samples)
            times[name] = np.asarray(signal.timestamps, float)
            found.units |= {name: signal.unit} if is_stated(signal.unit) else {}
            bits = signal.invalidation_bits
            invalid[name] = np.zeros(times[name].size, bool) if bits is None else np.asarray(bits, bool)
    if not times:
        return found
    t = common_times(path, times)
    bad = np.any(list(invalid.values()), axis=0)
    if bad.any():
        found.notes.append(f"{np.sum(bad)} samples are marked invalid by the recorder: left out")
    found.values = {name: np.asarray(values)[~bad] for name, values in found.values.items()}
    found.values["t"], found.units["t"] = t[~bad], "s"
    return found
