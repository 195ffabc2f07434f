# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulator as a function: other values for a case's numbers, many short segments, their derivatives.

This is the binding of libseparatrix (include/separatrix.h, docs/library.md).
"""

import contextlib
import ctypes
import functools
import os
import weakref
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from separatrix.binding import TEXT, array_of, call, library_path, loaded, pointer, size_of
from separatrix.errors import USAGE, CaseError
from separatrix.segments import (
    Impacts,
    Segments,
    checked_directions,
    checked_starts,
    propagate,
    segment_numbers,
    with_force,
)
from separatrix.structures.inline import inlined

__all__ = [
    "CaseError",
    "Effect",
    "Impacts",
    "Model",
    "Parameter",
    "Segments",
    "effects",
    "library_path",
]

_NONE = 1e308  # bounds beyond this mean that there is none


@dataclass(frozen=True)
class Parameter:
    """One number of a case: its value, SI unit and bounds (infinite where there is none)."""

    value: float
    unit: str
    lower: float
    upper: float


@dataclass(frozen=True)
class Effect:
    """A law of the family `effect`, its parameters; `value` is the default, NaN where it must be given.

    `family` is the function that it is one shape of; it acts on the "flight", at the "barrier" or in the
    "sensor". What it does is linear in the `amplitudes` near zero; the `sizes` are positive. A machine must
    have what it `needs` (a law, or the path of a parameter; ''). `confused`: effects that can be the same
    motion, and when.
    """

    name: str
    meaning: str
    parameters: dict[str, Parameter]
    family: str = ""
    acts: str = "flight"
    amplitudes: tuple[str, ...] = ()
    sizes: tuple[str, ...] = ()
    needs: str = ""
    confused: dict[str, str] = field(default_factory=dict)


class Model:
    """A case that has been read; its numbers have paths: "restoring.stiffness", "drive.cosine[1]"."""

    def __init__(self, handle: ctypes.c_void_p) -> None:
        """Take over a handle of the library; use `read` or `from_text`."""
        self._handle = handle
        self._free = weakref.finalize(self, loaded().separatrix_model_free, handle)
        count = loaded().separatrix_parameter_count(handle)
        self.parameters: dict[str, Parameter] = dict(self._parameter(i) for i in range(count))

    @classmethod
    def read(cls, path: str | Path) -> "Model":
        """Return the model of a case file."""
        with contextlib.suppress(OSError, UnicodeDecodeError):
            text = Path(path).read_text()
            if inlined(text, path):
                return cls.from_settings(text, path, [])
        handle = ctypes.c_void_p()
        call("separatrix_model_read", os.fsencode(path), ctypes.byref(handle))
        return cls(handle)

    @classmethod
    def from_text(cls, text: str, directory: str | Path = ".") -> "Model":
        """Return the model of a case in memory; files that it names are looked for in `directory`."""
        name = Path(directory) / "case"
        if inlined(text, name):
            return cls.from_settings(text, name, [])
        handle = ctypes.c_void_p()
        call("separatrix_model_from_text", text.encode(), os.fsencode(directory), ctypes.byref(handle))
        return cls(handle)

    @classmethod
    def from_settings(cls, text: str, name: str | Path, settings: Sequence[str]) -> "Model":
        """Return the model of a case in memory with "key.path=value" on top, as `--set` takes them.

        `name` stands for the file in messages; files that the case names are looked for in its folder.
        """
        settings = inlined(text, name, settings)
        handle = ctypes.c_void_p()
        lines = (ctypes.c_char_p * len(settings))(*(line.encode() for line in settings))
        call(
            "separatrix_model_with",
            *(text.encode(), os.fsencode(name), len(settings), lines, ctypes.byref(handle)),
        )
        return cls(handle)

    @property
    def period(self) -> float:
        """Drive period of the case as it is [s]."""
        return 2 * np.pi / self.drive_frequency({})

    def drive_frequency(self, values: Mapping[str, float]) -> float:
        """Return the angular frequency of the drive [rad/s] with other values."""
        frequency = ctypes.c_double()
        call("separatrix_drive_frequency", self._handle, *self._chosen(values), ctypes.byref(frequency))
        return frequency.value

    def to_text(self, values: Mapping[str, float]) -> str:
        """Return the resolved case with other values: the text of an ordinary case file."""
        chosen, length = self._chosen(values), ctypes.c_size_t()
        call("separatrix_model_text", self._handle, *chosen, None, ctypes.c_size_t(0), ctypes.byref(length))
        text = ctypes.create_string_buffer(length.value + 1)
        call("separatrix_model_text", self._handle, *chosen, text, size_of(text), ctypes.byref(length))
        return text.value.decode()

    def with_effect(self, name: str, values: Mapping[str, float]) -> "Model":
        """Return the model with an effect added; parameters without a value take their defaults."""
        handle = ctypes.c_void_p()
        keys = (ctypes.c_char_p * len(values))(*(key.encode() for key in values))
        numbers = (ctypes.c_double * len(values))(*values.values())
        arguments = (self._handle, name.encode(), len(values), keys, numbers, ctypes.byref(handle))
        call("separatrix_model_with_effect", *arguments)
        return Model(handle)

    def written_out(self) -> "Model":
        """Return the model of a friction or backlash pair body by body and joint by joint."""
        handle = ctypes.c_void_p()
        call("separatrix_model_written_out", self._handle, ctypes.byref(handle))
        return Model(handle)

    def segments(
        self,
        active: list[str],
        values: np.ndarray,
        start: np.ndarray,
        first: np.ndarray,
        times: np.ndarray,
        force: tuple[np.ndarray, float, np.ndarray] | None = None,
        derivatives: bool = True,
        tolerance: float = 1e-9,
        directions: np.ndarray | None = None,
    ) -> Segments:
        """Fly many segments, each from its own start, and sample them.

        `active` are the paths of the parameters with the `values` to use. The rows of `directions` are the
        directions in their space to differentiate along; None: each parameter by itself. The samples of
        segment i are at `times[first[i]:first[i + 1]]`, in seconds since its start, ascending from 0.
        `tolerance` is that of the adaptive flight. With `derivatives` false none are computed: `jacobian` is
        None then, and `directions` is not looked at.

        `start` (segments, numbers) is the state at the time 0 of each segment. One body has x [m], v [m/s]
        and crank angle [rad]. A structure with n coordinates has n positions, n velocities and crank angle.
        With a motor it is x, crank angle, v, crank speed [rad/s], and current [A] or integral of the speed
        control [rad]; a current that is NaN follows the speed.

        `force` = (time of each segment's start since the first sample [s], interval [s], samples [N])
        replaces the measured force of the case; the crank angles of `start` are not used.
        """
        chosen = self._along(active, values)
        start_numbers, sample_numbers = self._segment_numbers
        along = checked_directions(directions, len(active)) if derivatives else None
        start, first, times = checked_starts(start, start_numbers, first, times)
        start, *record = with_force(start, first, times, force)
        given = (start, first, times)
        return propagate(self._handle, chosen, along, given, record, sample_numbers, tolerance)

    @functools.cached_property
    def _segment_numbers(self) -> tuple[int, int]:
        return segment_numbers(self._handle)

    @functools.cached_property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates of a structure; none for other machines."""
        return self._names("separatrix_coordinate")

    @functools.cached_property
    def contacts(self) -> tuple[str, ...]:
        """Names of the contacts of a structure; none for other machines."""
        return self._names("separatrix_contact")

    def _names(self, function: str) -> tuple[str, ...]:
        found: list[str] = []
        name = ctypes.create_string_buffer(TEXT)
        while True:
            try:
                call(function, self._handle, len(found), name, size_of(name))
            except CaseError as reason:
                if reason.code != USAGE:
                    raise
                return tuple(found)
            found.append(name.value.decode())

    def joint_force(
        self, joint: str, active: Sequence[str], values: np.ndarray, extension: np.ndarray, speed: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the force of a spring or soft contact [N] that pulls its second end back, and its slopes.

        The slopes are over extension and speed; `active` parameters have other `values`.
        """
        extension, speed = (np.ascontiguousarray(one, float) for one in (extension, speed))
        found = np.empty((3, extension.size))
        call(
            "separatrix_joint_force",
            self._handle,
            *self._along(active, values),
            joint.encode(),
            extension.size,
            *(pointer(one) for one in (extension, speed, *found)),
        )
        return found[0], found[1], found[2]

    def _parameter(self, index: int) -> tuple[str, Parameter]:
        path, unit = ctypes.create_string_buffer(TEXT), ctypes.create_string_buffer(TEXT)
        numbers = (ctypes.c_double * 3)()
        call("separatrix_parameter", self._handle, index, path, size_of(path), unit, size_of(unit), numbers)
        value, lower, upper = numbers
        return path.value.decode(), _parameter(value, unit.value.decode(), lower, upper)

    def _chosen(self, values: Mapping[str, float]) -> tuple[int, ctypes.Array, ctypes.Array]:
        """Return number, indices and values of parameters by path."""
        index = (ctypes.c_int * len(values))(*(self.index_of(path) for path in values))
        return len(values), index, (ctypes.c_double * len(values))(*values.values())

    def _along(self, active: Sequence[str], values: np.ndarray) -> tuple[int, ctypes.Array, ctypes.Array]:
        """Return number, indices and values of the parameters along which a flight is differentiated."""
        for path in active:
            if active.count(path) > 1:
                raise CaseError(f"active: found '{path}' twice")
        return self._chosen(dict(zip(active, array_of(values, (len(active),), "values"), strict=True)))

    def index_of(self, path: str) -> int:
        """Return the index of a parameter in `parameters`, also by a name that it had in older cases."""
        found = ctypes.c_int()
        call("separatrix_find_parameter", self._handle, path.encode(), ctypes.byref(found))
        return found.value


@functools.cache
def effects() -> dict[str, Effect]:
    """Return the catalogue of effects that may be added to a case, by name, as the tables of laws have it.

    Examples
    --------
    >>> list(sx.effects())[:2]
    ['viscous', 'coulomb']
    """
    found: dict[str, Effect] = {}
    parameters: dict[str, dict[str, Parameter]] = {}
    meanings: dict[str, str] = {}
    numbers = (ctypes.c_double * 4)()
    for name, meaning, parameter, unit in _rows("separatrix_effect_parameter", 4, numbers):
        default, lower, upper, optional = numbers
        one = _parameter(default if optional else np.nan, unit, lower, upper)
        parameters.setdefault(name, {})[parameter] = one
        meanings[name] = meaning
    for name, family, acts, amplitudes, sizes, needs in _rows("separatrix_effect", 6):
        words = (tuple(amplitudes.split()), tuple(sizes.split()))
        found[name] = Effect(name, meanings[name], parameters[name], family, acts, *words, needs)
    for one, other, reason in _rows("separatrix_effect_confusion", 3):
        found[one].confused[other] = found[other].confused[one] = reason
    return found


def _rows(function: str, count: int, *numbers: ctypes.Array) -> Iterator[list[str]]:
    """Rows of a table of the library, of so many texts; `numbers` hold those of the last row."""
    index = 0
    while True:
        texts = [ctypes.create_string_buffer(TEXT) for _ in range(count)]
        sized = [argument for text in texts for argument in (text, size_of(text))]
        try:
            call(function, index, *sized, *numbers)
        except CaseError:
            return
        yield [text.value.decode() for text in texts]
        index += 1


def _parameter(value: float, unit: str, lower: float, upper: float) -> Parameter:
    lower = -np.inf if lower < -_NONE else lower
    upper = np.inf if upper > _NONE else upper
    return Parameter(value, unit, lower, upper)
