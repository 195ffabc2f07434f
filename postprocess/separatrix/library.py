# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulator as a function: other values for a case's numbers, many short segments, their derivatives.

This is the binding of libseparatrix (include/separatrix.h, docs/library.md).
"""

import contextlib
import ctypes
import functools
import os
import shutil
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from separatrix.errors import USAGE, CaseError
from separatrix.program import NATIVE, SOURCE_TREE
from separatrix.structures.inline import inlined

__all__ = [
    "CaseError",
    "CoordinateSegments",
    "Effect",
    "Impacts",
    "Model",
    "Parameter",
    "Segments",
    "effects",
    "library_path",
]

_NONE = 1e308  # bounds beyond this mean that there is none
_TEXT = 4096


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


@dataclass(frozen=True)
class Impacts:
    """Every impact of every segment, in order: arrays of equal length."""

    segment: np.ndarray
    time: np.ndarray
    speed_before: np.ndarray
    speed_after: np.ndarray
    side: np.ndarray


@dataclass(frozen=True)
class Segments:
    """Samples of all segments, one after the other.

    `x` is what the sensor shows, `v` the velocity. Columns of the Jacobians: the directions (each active
    parameter by itself, unless others were asked for), then x, v and crank angle of the start; None without
    derivatives. Per segment: the number of impacts, whether it is
    steady (its neighbours meet the same barriers in the same order and none is grazed; otherwise the
    derivatives mean little) and the reason why it could not be flown, 0 if it was.
    """

    x: np.ndarray
    v: np.ndarray
    jacobian: np.ndarray | None
    velocity_jacobian: np.ndarray | None
    impacts: np.ndarray
    impact: Impacts
    steady: np.ndarray
    reason: np.ndarray


@dataclass(frozen=True)
class CoordinateSegments:
    """Samples of all segments of a structure, one after the other.

    `motion` (samples, 2 n): positions, then velocities of the n coordinates. `jacobian` (samples, 2 n,
    columns): by the directions, then by positions, velocities and crank angle of the start. The `side` of an
    impact is that of `contact`, which is counted from 0. All else is as in `Segments`.
    """

    motion: np.ndarray
    jacobian: np.ndarray | None
    impacts: np.ndarray
    impact: Impacts
    contact: np.ndarray
    steady: np.ndarray
    reason: np.ndarray


class Model:
    """A case that has been read; its numbers have paths: "restoring.stiffness", "drive.cosine[1]"."""

    def __init__(self, handle: ctypes.c_void_p) -> None:
        """Take over a handle of the library; use `read` or `from_text`."""
        self._handle = handle
        self._free = weakref.finalize(self, _library().separatrix_model_free, handle)
        count = _library().separatrix_parameter_count(handle)
        self.parameters: dict[str, Parameter] = dict(self._parameter(i) for i in range(count))

    @classmethod
    def read(cls, path: str | Path) -> "Model":
        """Return the model of a case file."""
        with contextlib.suppress(OSError, UnicodeDecodeError):
            text = Path(path).read_text()
            if inlined(text, path):
                return cls.from_settings(text, path, [])
        handle = ctypes.c_void_p()
        _call("separatrix_model_read", os.fsencode(path), ctypes.byref(handle))
        return cls(handle)

    @classmethod
    def from_text(cls, text: str, directory: str | Path = ".") -> "Model":
        """Return the model of a case in memory; files that it names are looked for in `directory`."""
        name = Path(directory) / "case"
        if inlined(text, name):
            return cls.from_settings(text, name, [])
        handle = ctypes.c_void_p()
        _call("separatrix_model_from_text", text.encode(), os.fsencode(directory), ctypes.byref(handle))
        return cls(handle)

    @classmethod
    def from_settings(cls, text: str, name: str | Path, settings: Sequence[str]) -> "Model":
        """Return the model of a case in memory with "key.path=value" on top, as `--set` takes them.

        `name` stands for the file in messages; files that the case names are looked for in its folder.
        """
        settings = inlined(text, name, settings)
        handle = ctypes.c_void_p()
        lines = (ctypes.c_char_p * len(settings))(*(line.encode() for line in settings))
        _call(
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
        _call("separatrix_drive_frequency", self._handle, *self._chosen(values), ctypes.byref(frequency))
        return frequency.value

    def to_text(self, values: Mapping[str, float]) -> str:
        """Return the resolved case with other values: the text of an ordinary case file."""
        chosen, length = self._chosen(values), ctypes.c_size_t()
        _call("separatrix_model_text", self._handle, *chosen, None, ctypes.c_size_t(0), ctypes.byref(length))
        text = ctypes.create_string_buffer(length.value + 1)
        _call("separatrix_model_text", self._handle, *chosen, text, _size(text), ctypes.byref(length))
        return text.value.decode()

    def with_effect(self, name: str, values: Mapping[str, float]) -> "Model":
        """Return the model with an effect added; parameters without a value take their defaults."""
        handle = ctypes.c_void_p()
        keys = (ctypes.c_char_p * len(values))(*(key.encode() for key in values))
        numbers = (ctypes.c_double * len(values))(*values.values())
        arguments = (self._handle, name.encode(), len(values), keys, numbers, ctypes.byref(handle))
        _call("separatrix_model_with_effect", *arguments)
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
        directions in their space to differentiate along; None: each parameter by itself. `start` is (n, 3):
        x [m], v [m/s] and crank angle [rad] at the time 0 of each segment. The samples of segment i are at
        `times[first[i]:first[i + 1]]`, in seconds since its start, ascending from 0.
        `tolerance` is that of the adaptive flight. With `derivatives` false none are computed: `jacobian` and
        `velocity_jacobian` are None then, and `directions` is not looked at.

        `force` = (time of each segment's start since the first sample [s], interval [s], samples [N])
        replaces the measured force of the case; the crank angles of `start` are not used.
        """
        chosen = self._along(active, values)
        start, first, times = _many(start, 3, first, times)
        directions = _directions(directions, len(active), derivatives)
        count = len(start)
        start, interval, series = _with_force(start, first, times, force)
        m, columns = len(times), len(directions) + 3
        x, v = np.empty(m), np.empty(m)
        slopes = [np.empty((m, columns)) for _ in range(2)] if derivatives else [None, None]
        report = np.zeros((3, count), np.int32)
        room = 4 * count + 64
        while True:
            found = ctypes.c_int()
            impact_segment, impact = np.empty(room, np.int32), np.empty((room, 4))
            _call(
                "separatrix_segments",
                self._handle,
                *chosen,
                len(directions),
                _pointer(directions),
                count,
                *(_pointer(array) for array in (start, first, times)),
                len(series),
                ctypes.c_double(interval),
                _pointer(series),
                int(derivatives),
                ctypes.c_double(tolerance),
                *(_pointer(array) for array in (x, v, *slopes, *report)),
                room,
                ctypes.byref(found),
                _pointer(impact_segment),
                _pointer(impact),
            )
            if found.value <= room:
                break
            room = found.value
        time, before, after, side = impact[: found.value].T
        impacts = Impacts(impact_segment[: found.value], time, before, after, side.astype(int))
        return Segments(x, v, *slopes, report[0], impacts, report[1].astype(bool), report[2])

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
        name = ctypes.create_string_buffer(_TEXT)
        while True:
            try:
                _call(function, self._handle, len(found), name, _size(name))
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
        _call(
            "separatrix_joint_force",
            self._handle,
            *self._along(active, values),
            joint.encode(),
            extension.size,
            *(_pointer(one) for one in (extension, speed, *found)),
        )
        return found[0], found[1], found[2]

    def coordinate_segments(
        self,
        active: Sequence[str],
        values: np.ndarray,
        start: np.ndarray,
        first: np.ndarray,
        times: np.ndarray,
        derivatives: bool = True,
        tolerance: float = 1e-10,
        directions: np.ndarray | None = None,
    ) -> CoordinateSegments:
        """Fly many segments of a structure; `start` (segments, 2 n + 1): positions, velocities, crank angle.

        All else is as for `segments`.
        """
        n = len(self.coordinates)
        chosen = self._along(active, values)
        start, first, times = _many(start, 2 * n + 1, first, times)
        directions = _directions(directions, len(active), derivatives)
        given = (len(directions), _pointer(directions), len(start), n)
        more = (int(derivatives), ctypes.c_double(tolerance))
        arrays = (_pointer(start), _pointer(first), _pointer(times))
        columns = len(directions) + 2 * n + 1 if derivatives else 0
        call = functools.partial(
            _call, "separatrix_coordinate_segments", self._handle, *chosen, *given, *arrays, *more
        )
        motion, slopes, report, segment, impact = _flown(call, (times.size, 2 * n), columns, len(start), 5)
        time, contact, before, after, side = impact.T
        impacts = Impacts(segment, time, before, after, side.astype(int))
        done = (report[1].astype(bool), report[2])
        return CoordinateSegments(motion, slopes, report[0], impacts, contact.astype(int), *done)

    def crank_segments(
        self,
        active: Sequence[str],
        values: np.ndarray,
        start: np.ndarray,
        first: np.ndarray,
        times: np.ndarray,
        derivatives: bool = True,
        tolerance: float = 1e-10,
        directions: np.ndarray | None = None,
    ) -> CoordinateSegments:
        """Fly many segments of a machine with a motor.

        `start` (segments, 5): x [m], crank angle [rad], v [m/s], crank speed [rad/s], and current [A] or
        integral of the speed control [rad] of a motor that has one as a state; a current that is NaN follows
        the speed. The `motion` (samples, 5) has the same. All else is as for `segments`; the contact is 0.
        """
        chosen = self._along(active, values)
        start, first, times = _many(start, 5, first, times)
        directions = _directions(directions, len(active), derivatives)
        given = (len(directions), _pointer(directions), len(start))
        more = (int(derivatives), ctypes.c_double(tolerance))
        arrays = (_pointer(start), _pointer(first), _pointer(times))
        columns = len(directions) + 5 if derivatives else 0
        call = functools.partial(
            _call, "separatrix_crank_segments", self._handle, *chosen, *given, *arrays, *more
        )
        motion, slopes, report, segment, impact = _flown(call, (times.size, 5), columns, len(start), 4)
        time, before, after, side = impact.T
        impacts = Impacts(segment, time, before, after, side.astype(int))
        done = (np.zeros(len(segment), int), report[1].astype(bool), report[2])
        return CoordinateSegments(motion, slopes, report[0], impacts, *done)

    def _parameter(self, index: int) -> tuple[str, Parameter]:
        path, unit = ctypes.create_string_buffer(_TEXT), ctypes.create_string_buffer(_TEXT)
        numbers = (ctypes.c_double * 3)()
        _call("separatrix_parameter", self._handle, index, path, _size(path), unit, _size(unit), numbers)
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
        return self._chosen(dict(zip(active, _array(values, (len(active),), "values"), strict=True)))

    def index_of(self, path: str) -> int:
        """Return the index of a parameter in `parameters`, also by a name that it had in older cases."""
        found = ctypes.c_int()
        _call("separatrix_find_parameter", self._handle, path.encode(), ctypes.byref(found))
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
        texts = [ctypes.create_string_buffer(_TEXT) for _ in range(count)]
        sized = [argument for text in texts for argument in (text, _size(text))]
        try:
            _call(function, index, *sized, *numbers)
        except CaseError:
            return
        yield [text.value.decode() for text in texts]
        index += 1


def library_path() -> Path:
    """Return where the library is: $SEPARATRIX_LIBRARY, in this package, beside the program, in build/lib."""
    asked = os.environ.get("SEPARATRIX_LIBRARY")
    if asked:
        return Path(asked)
    program = shutil.which("separatrix")
    folders = [NATIVE / "lib"]
    folders += [Path(program).resolve().parent.parent / "lib"] if program else []
    folders.append(SOURCE_TREE / "build" / "lib")
    for folder in folders:
        path = folder / "libseparatrix.so"
        if path.is_file():
            return path
    tried = ", ".join(str(folder) for folder in folders)
    raise CaseError(
        f"no libseparatrix.so in {tried}; build it (cmake --build build --target separatrix_library) "
        "or name it in SEPARATRIX_LIBRARY"
    )


@functools.cache
def _library() -> ctypes.CDLL:
    path = library_path()
    try:
        library = ctypes.CDLL(str(path))
    except OSError as reason:
        raise CaseError(f"{path}: cannot be loaded: {reason}") from reason
    library.separatrix_model_free.restype = None
    return library


def _call(name: str, *arguments: object) -> None:
    """Call a function that ends with a buffer for its message; refusals become a CaseError."""
    message = ctypes.create_string_buffer(_TEXT)
    code = getattr(_library(), name)(*arguments, message, _size(message))
    if code:
        raise CaseError(message.value.decode(errors="replace"), code)


def _parameter(value: float, unit: str, lower: float, upper: float) -> Parameter:
    lower = -np.inf if lower < -_NONE else lower
    upper = np.inf if upper > _NONE else upper
    return Parameter(value, unit, lower, upper)


def _size(buffer: ctypes.Array) -> ctypes.c_size_t:
    return ctypes.c_size_t(len(buffer))


def _array(values: np.ndarray, shape: tuple[int, ...], name: str) -> np.ndarray:
    array = np.ascontiguousarray(values, float)
    if array.shape != shape:
        raise CaseError(f"{name}: found shape {array.shape}, allowed {shape}")
    return array


def _many(
    start: np.ndarray, width: int, first: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return starts (segments, width), first samples and times, as the library reads them."""
    start = np.asarray(start, float)
    start = _array(start, (len(start), width), "start")
    first = np.ascontiguousarray(first, np.int32)
    if first.shape != (len(start) + 1,):
        raise CaseError(f"first: found shape {first.shape}, allowed ({len(start) + 1},)")
    return start, first, _array(times, (int(first[-1]),), "times")


def _directions(directions: np.ndarray | None, parameters: int, derivatives: bool) -> np.ndarray:
    """Return the directions to differentiate along, a row each: as given, else each parameter by itself."""
    if not derivatives:
        return np.zeros((0, parameters))
    if directions is None:
        return np.eye(parameters)
    return _array(directions, (len(directions), parameters), "directions")


def _flown(
    call: Callable[..., None], shape: tuple[int, int], columns: int, count: int, width: int
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray, np.ndarray, np.ndarray]:
    """Return motion of a `shape` and its slopes along `columns`, report, segments and rows of impacts.

    `call` takes the arrays that the library fills, for `count` segments; an impact has `width` numbers.
    """
    motion, report = np.empty(shape), np.zeros((3, count), np.int32)
    slopes = np.empty((*shape, columns)) if columns else None
    room = 4 * count + 64
    while True:
        found = ctypes.c_int()
        segment, impact = np.empty(room, np.int32), np.empty((room, width))
        arrays = (_pointer(array) for array in (motion, slopes, *report))
        call(*arrays, room, ctypes.byref(found), _pointer(segment), _pointer(impact))
        if found.value <= room:
            return motion, slopes, report, segment[: found.value], impact[: found.value]
        room = found.value


def _with_force(
    start: np.ndarray,
    first: np.ndarray,
    times: np.ndarray,
    force: tuple[np.ndarray, float, np.ndarray] | None,
) -> tuple[np.ndarray, float, np.ndarray]:
    """Return starts whose crank angle is the phase of the force, its interval and its samples."""
    if force is None:
        return start, 0.0, np.empty(0)
    begins, interval, series = force
    series = _array(series, (len(series),), "force")
    begins = _array(begins, (len(start),), "force: begin of each segment")
    duration = (len(series) - 1) * interval
    last_sample = np.minimum(first[1:], len(times)) - 1
    ends = begins + np.where(np.diff(first) > 0, times[last_sample], 0.0) if len(times) else begins
    lowest, highest = begins.min(initial=0.0), ends.max(initial=0.0)
    if not (duration > 0 and lowest >= 0 and highest <= duration * (1 + 1e-9)):
        raise CaseError(f"force: segments from {lowest} to {highest} s, allowed 0 to {duration} s")
    angle = 2 * np.pi * begins / duration
    return np.column_stack([start[:, :2], angle]), float(interval), series


def _pointer(array: np.ndarray | None) -> ctypes.c_void_p | None:
    return None if array is None else ctypes.c_void_p(array.ctypes.data)
