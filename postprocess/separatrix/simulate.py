# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole motions and labels of starts by the library, without files: as `trajectory`, `points`, `basin`."""

import contextlib
import ctypes
import weakref
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from separatrix.binding import call, loaded, pointer
from separatrix.errors import GIVEN_UP, CaseError, GivenUpError
from separatrix.library import Model
from separatrix.variables import MAP

__all__ = [
    "LABEL_VARIABLES",
    "Attractor",
    "Catalogue",
    "Motion",
    "StopFlag",
    "StoppedError",
    "number",
    "search_slices",
    "section_points",
    "trajectory",
]

SAMPLE_COLUMNS = (
    "time", "x", "v", "mode", "driver_x", "driver_v", "contact_force", "energy", "kinetic_energy",
    "friction_loss", "damping_loss", "contact_loss", "drive_work",
)  # fmt: skip
EVENT_COLUMNS = ("kind", "time", "x", "v_before", "v_after", "driver_x", "driver_v")
SUMMARY = (
    "x", "v", "impacts", "last_impact_speed", "regime", "reason", "amplitude", "x_max", "x_min", "v_max",
    "impacts_per_period", "mean_impact_speed", "drive_period", "barrier_upper", "barrier_lower", "soft",
    "two_bodies",
    "trajectory_reason", "energy_start", "energy_lost_to_friction", "energy_lost_to_damping",
    "energy_lost_to_contacts", "energy_put_in", "energy_end", "energy_closing_error", "period", "driven",
    "position_is_angle",
)  # fmt: skip
ATTRACTOR = (
    "attractor", "regime", "period", "event_word", "x", "v", "driver_x", "driver_v", "multiplier",
    "capture_radius", "amplitude", "x_max", "x_min", "v_max", "impacts_per_period", "mean_impact_speed",
    "grazing_margin", "rests", "any_position", "coordinates", "two_bodies", "kind", "cycle_time",
)  # fmt: skip
#: Variables of a label in the order of the library, with the types that a file has.
LABEL_VARIABLES = {name: kind for name, (kind, *_) in MAP.items()}
# coordinates on the section, at most
_COORDINATES = 16
_WHOLE = {
    "impacts",
    "regime",
    "reason",
    "trajectory_reason",
    "attractor",
    "period",
    "event_word",
    "coordinates",
    "kind",
}
_STOPPED = 75


class StoppedError(CaseError):
    """A search or a labelling that was asked to stop."""


class StopFlag:
    """What ends a search or a labelling from another thread: `flag.set()`."""

    def __init__(self) -> None:
        """A flag that is not set."""
        self._value = ctypes.c_int(0)

    def set(self) -> None:
        """Ask to stop."""
        self._value.value = 1

    def is_set(self) -> bool:
        """Whether it was asked to stop."""
        return self._value.value != 0


@dataclass(frozen=True)
class Motion:
    """One motion: columns of its samples and events, and numbers of the motion as a whole.

    `samples` and `events` have the columns `SAMPLE_COLUMNS` and `EVENT_COLUMNS` (m, s, rad, N, J).
    `driver_x` is the foot of the spring where there is one body, `driver_v` with a motor the crank angle
    since the start [rad]. The `summary` has the state at the end with
    the bits of the command `points`, the rest with those of `trajectory`.
    """

    samples: dict[str, np.ndarray]
    events: dict[str, np.ndarray]
    summary: dict[str, float]


@dataclass(frozen=True)
class Attractor:
    """An attractor: its numbers as in a file's catalogue, points on the section (rows), all multipliers."""

    numbers: dict[str, float]
    points: np.ndarray
    multipliers: np.ndarray


def trajectory(
    model: Model,
    start: tuple[float, float, float],
    values: Mapping[str, float] | None = None,
    duration: float = 0.0,
    samples_per_period: int = 0,
    room: tuple[int, int] = (20000, 1000),
    partial: bool = False,
) -> Motion:
    """Fly one motion from `start` = x [m], v [m/s], crank angle [rad], with other `values` by path.

    `duration` in s and `samples_per_period` are those of the case if 0; no samples if negative. `room` for
    samples and events is only where to begin. A motion that was given up is returned as far as it went if
    `partial`; else it is a GivenUpError that has it as `result`.
    """
    start = np.array(start, float)
    if start.shape != (3,):
        raise CaseError(f"start: found shape {start.shape}, allowed (3,)")
    chosen = model._chosen(values or {})
    counts = (ctypes.c_int(), ctypes.c_int())
    summary = np.empty(len(SUMMARY))
    while True:
        samples, events = np.empty((room[0], len(SAMPLE_COLUMNS))), np.empty((room[1], len(EVENT_COLUMNS)))
        given_up = _call_or_given_up(
            "separatrix_trajectory",
            model._handle,
            *chosen,
            pointer(start),
            ctypes.c_double(duration),
            int(samples_per_period),
            room[0],
            ctypes.byref(counts[0]),
            pointer(samples),
            room[1],
            ctypes.byref(counts[1]),
            pointer(events),
            pointer(summary),
        )
        found = (counts[0].value, counts[1].value)
        if found[0] <= room[0] and found[1] <= room[1]:
            break
        room = found
    motion = Motion(
        _columns(SAMPLE_COLUMNS, samples[: found[0]]),
        _columns(EVENT_COLUMNS, events[: found[1]]),
        _numbers(SUMMARY, summary),
    )
    if given_up and not partial:
        raise GivenUpError(given_up, motion)
    return motion


def _call_or_given_up(name: str, *arguments: object) -> str:
    """Call a function; its message if a motion was given up, else ''."""
    try:
        call(name, *arguments)
    except CaseError as error:
        if error.code != GIVEN_UP:
            raise
        return str(error)
    return ""


def section_points(
    model: Model,
    point: tuple[float, float],
    period: int,
    angle: float = 0.0,
    values: Mapping[str, float] | None = None,
) -> np.ndarray:
    """Return all x [m], v [m/s] of a cycle at a crank angle [rad], from its `point` at crank angle 0.

    `period` in drive periods; one row for each.
    """
    if "motor.inertia" in model.parameters:
        raise CaseError("motor: found a machine with a motor, whose turns last no equal times")
    turn = angle % (2 * np.pi)
    length = 2 * np.pi / model.drive_frequency(values or {})
    found = [(float(point[0]), float(point[1]))]
    if turn > 0:
        found = [_end(model, (*found[0], 0.0), values, length * turn / (2 * np.pi))]
    for _ in range(period - 1):
        found.append(_end(model, (*found[-1], turn), values, length))
    return np.array(found)


def _end(
    model: Model, start: tuple[float, float, float], values: Mapping[str, float] | None, duration: float
) -> tuple[float, float]:
    end = trajectory(model, start, values, duration, samples_per_period=-1).summary
    return end["x"], end["v"]


class Catalogue:
    """A machine and its attractors; labels starts with them."""

    def __init__(self, model: Model, values: Mapping[str, float] | None = None) -> None:
        """Prepare the machine of a model with other `values` of parameters by path; no attractors yet."""
        self._handle = ctypes.c_void_p()
        call(
            "separatrix_catalogue_open",
            model._handle,
            *model._chosen(values or {}),
            ctypes.byref(self._handle),
        )
        self._free = weakref.finalize(self, loaded().separatrix_catalogue_free, self._handle)

    def search(self, starts: np.ndarray | None = None, stop: StopFlag | None = None) -> "Catalogue":
        """Add the attractors to which `starts` (n, 3) lead; None: the sample of `basin`.

        With a motor they may be (n, 5): with crank speed, and current or integral of the control.
        """
        size, starts = ((-1, 3), None) if starts is None else _starts(starts)
        with _stoppable():
            call("separatrix_catalogue_search_from", self._handle, *size, pointer(starts), _flag(stop))
        return self

    @property
    def attractors(self) -> list[Attractor]:
        """The attractors, in the order of their numbers within the machine."""
        return [self._attractor(index) for index in range(loaded().separatrix_catalogue_size(self._handle))]

    def _attractor(self, index: int) -> Attractor:
        numbers, room = np.empty(len(ATTRACTOR) + 2 * _COORDINATES), 64
        while True:
            points, count = np.empty((room, _COORDINATES)), ctypes.c_int()
            arrays = (pointer(numbers), room, ctypes.byref(count), pointer(points))
            call("separatrix_catalogue_attractor", self._handle, index, *arrays)
            if count.value <= room:
                break
            room = count.value
        named = _numbers(ATTRACTOR, numbers[: len(ATTRACTOR)])
        size = named["coordinates"]
        real, imaginary = numbers[len(ATTRACTOR) :].reshape(2, _COORDINATES)[:, :size]
        return Attractor(named, points[: count.value, :size], real + 1j * imaginary)

    def labels(self, starts: np.ndarray, stop: StopFlag | None = None) -> dict[str, np.ndarray]:
        """Where `starts` (n, 3) end up: the variables of a map in the types of its file.

        With a motor they may be (n, 5), as in `search`. `reason` is 0 where a start is not allowed. Several
        threads may ask at once.
        """
        size, starts = _starts(starts)
        values = np.empty((len(starts), len(LABEL_VARIABLES)))
        arrays = (pointer(starts), pointer(values))
        with _stoppable():
            call("separatrix_labels_from", self._handle, *size, *arrays, _flag(stop))
        with np.errstate(over="ignore"):
            columns = zip(LABEL_VARIABLES.items(), values.T, strict=True)
            return {name: column.astype(kind) for (name, kind), column in columns}


def search_slices(
    model: Model,
    slices: list[Mapping[str, float]],
    shape: tuple[int, ...],
    stop: StopFlag | None = None,
) -> list[Catalogue]:
    """Find and number the attractors of all slices of a map as `basin` does.

    `slices` are the values of the parameters, by path, over `shape` values of each, the last fastest.
    """
    catalogues = [Catalogue(model, values).search(stop=stop) for values in slices]
    if len(catalogues) > 1:
        sections = [_sections(catalogue) for catalogue in catalogues]
        for i, catalogue in enumerate(catalogues):
            starts = [sections[j] for j in _neighbours(i, shape)]
            catalogue.search(np.concatenate(starts), stop)
    number(catalogues, shape)
    return catalogues


def _sections(catalogue: Catalogue) -> np.ndarray:
    """Return starts on the attractors of one body: a start has no state of the driving body of two."""
    found = [one for one in catalogue.attractors if not (one.numbers["rests"] or one.numbers["two_bodies"])]
    rows = [(*one.points[0][:2], 0.0) for one in found]
    return np.array(rows).reshape(-1, 3)


def _neighbours(position: int, shape: tuple[int, ...]) -> list[int]:
    """Return the slices next to one along each axis, the last axis first."""
    found, stride = [], 1
    for length in reversed(shape):
        at = position // stride % length
        found += [position - stride] * (at > 0) + [position + stride] * (at < length - 1)
        stride *= length
    return found


def number(catalogues: Iterable[Catalogue], shape: tuple[int, ...]) -> None:
    """Number the attractors of the slices of a map so that branches keep their labels; last axis fastest."""
    handles = [catalogue._handle for catalogue in catalogues]
    given = (ctypes.c_void_p * len(handles))(*(handle.value for handle in handles))
    call("separatrix_catalogue_number", len(handles), given, len(shape), (ctypes.c_int * len(shape))(*shape))


def _starts(starts: np.ndarray) -> tuple[tuple[int, int], np.ndarray]:
    starts = np.ascontiguousarray(starts, float)
    if starts.ndim != 2 or starts.shape[1] not in (3, 5):
        raise CaseError(f"starts: found shape {starts.shape}, allowed (n, 3), with a motor (n, 5)")
    return starts.shape, starts


@contextlib.contextmanager
def _stoppable() -> Iterable[None]:
    try:
        yield
    except CaseError as error:
        if error.code == _STOPPED:
            raise StoppedError(str(error), _STOPPED) from None
        raise


def _flag(stop: StopFlag | None) -> object:
    return None if stop is None else ctypes.byref(stop._value)


def _columns(names: tuple[str, ...], rows: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(names, np.ascontiguousarray(rows.T), strict=True))


def _numbers(names: tuple[str, ...], values: np.ndarray) -> dict[str, float]:
    return {
        name: int(value) if name in _WHOLE and np.isfinite(value) else float(value)
        for name, value in zip(names, values, strict=True)
    }
