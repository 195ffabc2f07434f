# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Segments of a TDMS file: the number of samples that each adds to a channel, and the stated waveform.

A reader that joins the segments keeps the last start time alone; the lead-ins have all of them.
"""

import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from separatrix.errors import SeparatrixError

START, STEP, OFFSET = "wf_start_time", "wf_increment", "wf_start_offset"
"""Properties of a waveform."""
_LEAD = 28
_META, _RAW, _NEW_LIST, _BIG = 1 << 1, 1 << 3, 1 << 2, 1 << 6
_NO_DATA, _AS_BEFORE = 0xFFFFFFFF, 0
# kinds of DAQmx data, and bytes of one of their scalers
_DAQMX = {0x1269: 20, 0x126A: 17}
_TEXT, _TIME = 0x20, 0x44
_NUMBERS = {1: "b", 2: "h", 3: "i", 4: "q", 5: "B", 6: "H", 7: "I", 8: "Q", 9: "f", 10: "d"}
_NUMBERS |= {0x19: "f", 0x1A: "d", 0x21: "?", 0x08000C: "2f", 0x10000D: "2d"}


@dataclass
class Burst:
    """Samples of a channel that one segment adds, and the properties of the channel then."""

    samples: int
    properties: dict[str, object]

    @property
    def clock(self) -> tuple:
        """The properties that define the times of the samples."""
        return tuple(self.properties.get(key) for key in (START, STEP, OFFSET))


@dataclass
class _Channel:
    """Known data of a channel: values of a chunk and their bytes, properties."""

    values: int = 0
    size: int = 0
    has_data: bool = False
    # bytes of a row of each raw buffer of DAQmx, by which several channels are stored together
    widths: tuple[int, ...] = ()
    properties: dict[str, object] = field(default_factory=dict)


def bursts_of(path: Path, notes: list[str]) -> dict[str, list[Burst]]:
    """The segments of each channel in order, by the path of the channel in the file."""
    found: dict[str, list[Burst]] = {}
    channels: dict[str, _Channel] = {}
    order: list[str] = []
    whole = path.stat().st_size
    with path.open("rb") as file:
        at = 0
        while at + _LEAD <= whole:
            file.seek(at)
            if file.read(4) != b"TDSm":
                raise SeparatrixError(f"{path}: is damaged: no segment at byte {at}")
            (mask,) = struct.unpack("<I", file.read(4))
            reader = _Reader(file, ">" if mask & _BIG else "<")
            _, following, raw = reader.numbers("IQQ")
            end = min(whole, at + _LEAD + following)
            if at + _LEAD + following > whole:
                notes.append("the file is cut off in its last segment")
            if mask & _META:
                order = _metadata(reader, channels, [] if mask & _NEW_LIST else order)
            if mask & _RAW:
                _count(channels, order, end - (at + _LEAD + raw), found)
            if end <= at:
                break
            at = end
    return found


def _count(channels: dict[str, _Channel], order: list[str], size: int, found: dict[str, list[Burst]]) -> None:
    """Add what a segment of so many bytes of samples has of each channel."""
    active = [name for name in order if channels[name].has_data]
    widths = next((channels[name].widths for name in active if channels[name].widths), ())
    if widths:
        chunk = channels[active[0]].values * sum(widths)
    else:
        chunk = sum(channels[name].size for name in active)
    if chunk <= 0 or size <= 0:
        return
    chunks, rest = divmod(size, chunk)
    for name in active:
        one = channels[name]
        samples = one.values * chunks + one.values * rest // chunk
        found.setdefault(name, []).append(Burst(samples, dict(one.properties)))


def _metadata(reader: "_Reader", channels: dict[str, _Channel], order: list[str]) -> list[str]:
    """Channels of a segment in order."""
    order = list(order)
    (count,) = reader.numbers("I")
    for _ in range(count):
        name = reader.text()
        one = channels.setdefault(name, _Channel())
        (head,) = reader.numbers("I")
        if head != _NO_DATA and head != _AS_BEFORE:
            _index(reader, head, one)
        one.has_data = head != _NO_DATA
        if name not in order:
            order.append(name)
        (properties,) = reader.numbers("I")
        for _ in range(properties):
            key = reader.text()
            (kind,) = reader.numbers("I")
            one.properties[key] = reader.value(kind)
    return order


def _index(reader: "_Reader", head: int, one: _Channel) -> None:
    """How many values of a channel a chunk has, and their bytes."""
    kind, _, one.values = reader.numbers("IIQ")
    if head in _DAQMX:
        (scalers,) = reader.numbers("I")
        reader.skip(scalers * _DAQMX[head])
        (count,) = reader.numbers("I")
        one.widths = reader.numbers(f"{count}I")
    elif kind == _TEXT:
        (one.size,) = reader.numbers("Q")
    else:
        one.size = one.values * (16 if kind == _TIME else struct.calcsize("<" + _NUMBERS[kind]))


class _Reader:
    """Numbers and texts of a file in its order of bytes."""

    def __init__(self, file: BinaryIO, order: str) -> None:
        self.file, self.order = file, order

    def numbers(self, form: str) -> tuple:
        form = self.order + form
        return struct.unpack(form, self.file.read(struct.calcsize(form)))

    def text(self) -> str:
        (length,) = self.numbers("I")
        return self.file.read(length).decode("utf-8", errors="replace")

    def skip(self, length: int) -> None:
        self.file.seek(length, 1)

    def value(self, kind: int) -> object:
        """A property; a time is (seconds, fractions of 2^-64 s)."""
        if kind == _TEXT:
            return self.text()
        if kind == _TIME:
            if self.order == "<":
                fractions, seconds = self.numbers("Qq")
            else:
                seconds, fractions = self.numbers("qQ")
            return seconds, fractions
        return self.numbers(_NUMBERS[kind])[0]
