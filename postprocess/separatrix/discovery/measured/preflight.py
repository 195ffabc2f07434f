# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of a record before any fit: noise, resolution, drive, delay of channels."""

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from separatrix.discovery.measured.condense import Samples, whole
from separatrix.discovery.measured.driven import Driven
from separatrix.discovery.measured.records import Record
from separatrix.discovery.measured.signals import resolution_of, white_noise
from separatrix.discovery.measured.sizes import at_rest, check_size, moves
from separatrix.discovery.measured.smoother import Smoothed
from separatrix.discovery.policy import RECORDS
from separatrix.discovery.wording import units_of
from separatrix.errors import SeparatrixError


@dataclass
class Prepared:
    """A record with its noise and its drive; `frequency` [rad/s] is None where the machine has no crank."""

    record: Record
    sigma: float
    velocity_sigma: float
    resolution: float
    # correlation of neighbouring noise, and its standard error
    memory: float = 0.0
    memory_error: float = 0.0
    sigma_stated: bool = False
    velocity_sigma_stated: bool = False
    frequency: float | None = None
    # of the free machine [rad/s], where it has one
    natural: float | None = None
    phase: float = 0.0
    # known: measured as a channel; stated: in the header, refined by the fit
    phase_known: bool = False
    # standard errors of a measured crank angle at the origin [rad], and of its rate, relative
    phase_error: float = 0.0
    clock_error: float = 0.0
    phase_stated: bool = True
    drive_scale: float = 1.0
    origin: float = 0.0
    # whether the body does not move: dry friction holds it
    rests: bool = False
    notes: list[str] = field(default_factory=list)
    # fitted rows: all samples, or fewer with the same information
    samples: Samples | None = None
    # the known motion, where the force is compared
    driven: Driven | None = None
    # the measured force on fewer knots (interval, samples), and what that was allowed to change
    thinned: tuple[tuple[float, float, float], tuple[float, np.ndarray]] | None = None

    # key of the header that states the noise; whether the mass is nearly that of the case
    noise_key: ClassVar[str] = "sensor_noise_sigma_m"
    near_mass: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Fit every sample by default."""
        if self.samples is None:
            self.samples = whole(self.record)

    @property
    def noise(self) -> tuple:
        """Memory of the noise, and its size in each column that is compared."""
        return (self.memory, self.sigma, *(() if self.record.v is None else (self.velocity_sigma,)))

    @noise.setter
    def noise(self, known: tuple) -> None:
        self.memory, self.sigma = known[:2]
        if len(known) > 2:
            self.velocity_sigma = known[2]

    @property
    def doubt(self) -> float:
        """Factor of chi^2 that two standard errors of the memory may make of noise.

        Noise of correlation r^|k| that is freed of the correlation m has (1 - 2 r m + m^2) / (1 - m^2) of its
        power left.
        """
        return 1 + 2 * self.memory_error * 2 * self.memory / (1 - self.memory**2)

    @property
    def column(self) -> np.ndarray:
        """The column of one body that is compared."""
        return self.record.x

    @property
    def signal(self) -> np.ndarray:
        """What is compared first."""
        return self.column

    @property
    def sensor_noise(self) -> dict[str, float]:
        """Noise of each sensor, where there are several."""
        return {}

    def details(self) -> dict[str, tuple[np.ndarray, dict]]:
        """Columns beside t and x that are compared, with attributes."""
        return {}

    def known_motion(self, oscillation: float) -> Smoothed | None:
        """The motion, where it is known and not compared."""
        return None

    def deviation(self, rows: np.ndarray) -> np.ndarray:
        """Standard deviation of the noise of what is compared at some rows."""
        return self.sigma * self.samples.spread(self.memory)[rows]

    @property
    def period_samples(self) -> float | None:
        """Samples per drive period."""
        if self.frequency is None:
            return None
        return 2 * np.pi / self.frequency / self.record.interval


def prepare(record: Record, model, rest: Record | None = None) -> Prepared:
    """Measure what the header does not state, and refuse a record that cannot be of this machine."""
    notes = list(record.notes)
    if record.v is not None:
        check_velocity(record, notes)
    record = _with_its_force(record, model, notes)
    resolution = record.header.get("sensor_resolution_m") or resolution_of(record.x)
    unit = units_of(model.parameters).position
    sigma = _noise(record, rest, resolution, unit, notes)
    rests = not moves(record, sigma, rest, unit)
    prepared = Prepared(
        record,
        sigma,
        velocity_noise(record),
        resolution,
        notes=notes,
        origin=record.header.get("phase_origin_s", float(record.t[0])),
    )
    prepared.drive_scale = record.header.get("drive_scale", 1.0)
    prepared.sigma_stated = rest is not None or bool(record.header.get("sensor_noise_sigma_m"))
    prepared.velocity_sigma_stated = bool(record.header.get("sensor_noise_sigma_m_s"))
    _find_drive(prepared, model)
    if rests:
        at_rest(prepared, model)
    check_size(prepared, model)
    return prepared


def _noise(record: Record, rest: Record | None, resolution: float, unit: str, notes: list[str]) -> float:
    floor = resolution / np.sqrt(12)
    stated = record.header.get("sensor_noise_sigma_m")
    if rest is not None:
        drift = np.polyval(np.polyfit(rest.t, rest.x, 1), rest.t)
        sigma = float(np.std(rest.x - drift))
    elif stated:
        sigma = float(np.hypot(stated, floor))
    else:
        sigma = white_noise(record.x)
        notes.append(f"noise {sigma:.3g} {unit}, from fourth differences of x")
    sigma = max(sigma, floor)
    # a record that states zero noise was computed
    least = RECORDS.quiet * float(np.std(record.x))
    if sigma <= (least if stated == 0 else 0):
        sigma = least
        notes.append(f"no noise found: {sigma:.3g} {unit} is taken")
    return sigma


def velocity_noise(record: Record) -> float:
    """Standard deviation of the noise of the measured velocity, stated or found; infinite without one."""
    if record.v is None:
        return np.inf
    stated = record.header.get("sensor_noise_sigma_m_s")
    if stated:
        return stated
    return max(
        white_noise(record.v), resolution_of(record.v) / np.sqrt(12), RECORDS.quiet * float(np.std(record.v))
    )


def _find_drive(prepared: Prepared, model) -> None:
    record = prepared.record
    ratio = model.parameters.get("drive.ratio")
    if ratio is None or not ratio.value:
        return
    prepared.natural = model.drive_frequency({"drive.ratio": 1.0})
    if record.phi is not None:
        from_measured_angle(prepared)
    else:
        header = record.header
        if "drive_frequency_rad_s" in header:
            prepared.frequency = header["drive_frequency_rad_s"]
        else:
            if "drive_ratio" not in header:
                prepared.notes.append(f"no drive_ratio: that of the case, {ratio.value:g}, is taken")
            values = {"drive.ratio": header.get("drive_ratio", ratio.value)}
            prepared.frequency = model.drive_frequency(values)
        prepared.phase = header.get("phase", 0.0)
        prepared.phase_stated = "phase" in header
        if not prepared.phase_stated:
            prepared.notes.append("no phase: it is searched for")
    check_periods(prepared)


def check_periods(prepared: Prepared) -> None:
    """Refuse a record with too few samples in a period of the drive, or too few periods."""
    record, samples = prepared.record, prepared.period_samples
    if samples < RECORDS.samples_per_period:
        raise SeparatrixError(
            f"{record.file}: {samples:.1f} samples per drive period, "
            f"at least {RECORDS.samples_per_period} are needed"
        )
    periods = record.duration / record.interval / samples
    if periods < RECORDS.fewest_periods:
        raise SeparatrixError(
            f"{record.file}{record.part}: {periods:.2f} drive periods, "
            f"at least {RECORDS.fewest_periods:g} are needed"
        )


def from_measured_angle(prepared: Prepared) -> None:
    """Take frequency and phase of the drive, with their standard errors, from the measured crank angle."""
    record = prepared.record
    prepared.frequency, prepared.phase = _turning(record)
    if prepared.frequency * record.duration < np.pi:
        raise SeparatrixError(
            f"{record.file}: 'phi' advances by {prepared.frequency * record.duration:.3g} rad in all: "
            "too short a record, or not the angle of a turning crank"
        )
    stated = record.header.get("drive_frequency_rad_s")
    if stated is not None and abs(prepared.frequency / stated - 1) > RECORDS.frequency_off:
        prepared.notes.append(
            f"drive_frequency_rad_s is {stated:g}, phi turns at {prepared.frequency:.4g} rad/s: that is taken"
        )
    # the errors of angle and rate are independent in the middle of the record
    prepared.origin = float(record.t.mean())
    prepared.phase += prepared.frequency * (prepared.origin - float(record.t[0]))
    prepared.phase_known = True
    _errors_of_angle(prepared)


def _turning(record: Record) -> tuple[float, float]:
    """Frequency of a measured crank angle [rad/s] and the angle at the first row.

    Each piece is unwrapped by itself; the turns in a gap follow from the frequency within the pieces.
    """
    t = record.t - record.t[0]
    angles = [np.unwrap(record.phi[first:last]) for first, last in record.pieces]
    above = below = 0.0
    for (first, last), angle in zip(record.pieces, angles, strict=True):
        centred = t[first:last] - t[first:last].mean()
        above += float(centred @ angle)
        below += float(centred @ centred)
    slope = above / below
    ahead = np.concatenate(
        [angle - slope * t[first:last] for (first, last), angle in zip(record.pieces, angles, strict=True)]
    )
    for first, last in record.pieces[1:]:
        turns = np.round((np.mean(ahead[first:last]) - ahead[first - 1]) / (2 * np.pi))
        ahead[first:last] -= 2 * np.pi * turns
    more, start = np.polyfit(t, ahead, 1)
    return slope + float(more), float(start)


def _errors_of_angle(prepared: Prepared) -> None:
    """Standard errors of angle and rate of a measured crank, from its noise: stated, or its scatter."""
    record = prepared.record
    t = record.t - prepared.origin
    scatter = record.phi - prepared.phase - prepared.frequency * t
    scatter = scatter - 2 * np.pi * np.round(scatter / (2 * np.pi))
    sigma = float(np.std(scatter))
    stated = record.header.get("phi_noise_sigma_rad", 0.0)
    if stated and sigma > RECORDS.angle_disagreement * stated:
        prepared.notes.append(
            f"noise of phi is stated as {stated:.3g} rad, it scatters by {sigma:.3g} rad about even turning"
        )
    # neighbours with correlated errors carry less information
    memory = float(np.corrcoef(scatter[1:], scatter[:-1])[0, 1]) if sigma > 0 else 0.0
    memory = min(max(memory, 0.0), 0.99)
    error = max(sigma, stated) * np.sqrt((1 + memory) / (1 - memory) / t.size)
    if error > RECORDS.angle_rounding:
        prepared.phase_error = error
        prepared.clock_error = error / float(np.sqrt(np.mean(t**2))) / prepared.frequency


def even_interval(record: Record) -> float:
    """Time between the samples of a record within its pieces [s]."""
    steps = sum(last - 1 - first for first, last in record.pieces)
    return float(sum(record.t[last - 1] - record.t[first] for first, last in record.pieces) / steps)


def _with_its_force(record: Record, model, notes: list[str]) -> Record:
    """The record with a force where the machine has one; all pieces must be sampled at one rate."""
    wanted = 'law = "measured_force"' in model.to_text({})
    if record.force is None:
        if wanted:
            raise SeparatrixError(
                f"{record.file}: the machine has a measured force, the record has no column 'force'"
            )
        return record
    if not wanted:
        notes.append(
            "the machine has no measured force: column 'force' is not used (that of a joint which is driven "
            'along its motion is compared with --compare force and drive.law = "measured_force")'
        )
        return replace(record, force=None)
    usual = None
    for first, last in record.pieces:
        steps = last - 1 - first
        # shorter ones are not fitted
        if steps < RECORDS.fewest_in_piece:
            continue
        interval = float((record.t[last - 1] - record.t[first]) / steps)
        usual = usual or interval
        if abs(interval - usual) > usual * max(RECORDS.uneven_pieces, 1 / steps):
            raise SeparatrixError(
                f"{record.file}, from {record.t[first]:.6g} s on: samples every {interval:.6g} s, before "
                f"every {usual:.6g} s: a measured force needs one rate"
            )
    return record


def check_velocity(record: Record, notes: list[str]) -> None:
    """Compare v with the slope of x: another quantity, another unit, a delay."""
    if np.ptp(record.v) == 0:
        raise SeparatrixError(f"{record.file}: 'v' is constant")
    inner = slice(8, -8)
    width = 1
    while True:
        # sampled fast, x changes by less than its noise from sample to sample: means of blocks do not
        t, x, v = (_block_means(values, width) for values in (record.t, record.x, record.v))
        slope = np.gradient(x, t)
        shifts = np.arange(-(RECORDS.most_lag // width), RECORDS.most_lag // width + 1)
        overlap = [float(np.corrcoef(np.roll(v, shift)[inner], slope[inner])[0, 1]) for shift in shifts]
        best = int(np.argmax(overlap))
        if overlap[best] > RECORDS.speed_alike or t.size < 2 * RECORDS.speed_blocks:
            break
        width *= 2
    if overlap[best] < 0.5:
        raise SeparatrixError(
            f"{record.file}: 'v' is not the velocity of 'x' (correlation {overlap[best]:.2f})"
        )
    ratio = float(np.std(v[inner]) / np.std(slope[inner]))
    # noise of either one moves the ratio by no more than the correlation
    if not overlap[best] / RECORDS.speed_ratio < ratio < RECORDS.speed_ratio / overlap[best]:
        raise SeparatrixError(
            f"{record.file}: 'v' is {ratio:.4g} times the slope of 'x': wrong units? v is read in m/s, of an "
            "angle in rad/s"
        )
    if shifts[best]:
        notes.append(f"x seems to lag {shifts[best] * width * record.interval:.3g} s behind v")


def _block_means(values: np.ndarray, width: int) -> np.ndarray:
    """Means of blocks of so many values; the remainder at the end is dropped."""
    count = values.size // width
    return values[: count * width].reshape(count, width).mean(axis=1)
