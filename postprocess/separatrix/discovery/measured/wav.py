# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records in WAV files: numbers over full scale, whose size the user states."""

import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.io import wavfile

from separatrix.discovery.measured.arrays import Found, column_of
from separatrix.discovery.measured.tables import is_column
from separatrix.errors import SeparatrixError

FULL_SCALE = "full scale"
"""The unit of such numbers."""
# warning of SciPy on chunks without samples
_HARMLESS = "Chunk (non-data) not understood"


def read_wav(path: Path, names: Mapping[str, str]) -> Found:
    """Channels 1, 2, ... as shares of full scale (of integers) or as they are; the only one is x."""
    with warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        rate, samples = wavfile.read(path)
    for one in raised:
        if not str(one.message).startswith(_HARMLESS):
            raise SeparatrixError(f"{path}: is damaged: {one.message}")
    channels = samples[:, None] if samples.ndim == 1 else samples
    if rate <= 0 or not channels.size:
        raise SeparatrixError(f"{path}: {len(channels)} samples at {rate} Hz")
    found = Found({"t": np.arange(len(channels)) / rate}, {"t": "s"}, [f"{rate} samples a second"])
    for number, channel in enumerate(channels.T, start=1):
        own = "x" if channels.shape[1] == 1 and not names else str(number)
        name = column_of(own, names)
        if not is_column(name):
            found.unused.append(own)
            continue
        found.units[name] = FULL_SCALE
        found.values[name] = _shares(name, channel, found.notes)
    return found


def _shares(name: str, channel: np.ndarray, notes: list[str]) -> np.ndarray:
    """Integers over full scale; values at its ends may be clipped."""
    if channel.dtype.kind == "f":
        return channel.astype(float)
    middle = 128 if channel.dtype == np.uint8 else 0
    limits = np.iinfo(channel.dtype)
    # 24 bits stand above eight zeros
    least = 256 if channel.dtype == np.int32 and not np.any(channel & 0xFF) else 1
    clipped = int(np.sum((channel >= limits.max + 1 - least) | (channel == limits.min)))
    if clipped:
        notes.append(f"{clipped} samples of {name} are at full scale: clipped?")
    return (channel.astype(float) - middle) / (limits.max + 1 - middle)
