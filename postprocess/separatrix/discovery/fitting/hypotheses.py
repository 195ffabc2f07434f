# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Dependences of a missing force beyond the catalogue, as columns of a linear fit along the motion.

Every hypothesis has columns whose coefficients belong to the machine and are predicted on other records. It
may have columns with separate coefficients for each interval of a record: an oscillation of unknown phase,
the initial value of a hidden state.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import cont2discrete, lfilter, ss2tf

from separatrix.discovery.fitting.fit import Fit
from separatrix.discovery.fitting.likelihood import Likelihood
from separatrix.discovery.fitting.motions import (
    after_impacts,
    extensions,
    impacts_at,
    knots_of,
    products,
    scaled_motion,
    splines,
)
from separatrix.discovery.policy import SEARCH

Columns = np.ndarray | None


@dataclass(frozen=True)
class Motion:
    """A fitted motion of training or held-out records; times are from the start of each record [s]."""

    problem: Likelihood
    fit: Fit
    mass: float
    # natural frequency [rad/s]
    natural: float
    # time over which an oscillation keeps its phase [s]
    coherence_time: float
    t: np.ndarray
    phase: np.ndarray | None
    # extension of the spring at the samples [m]; None without a linear spring, or where it is the position
    spring: np.ndarray | None
    good: np.ndarray

    @property
    def x(self) -> np.ndarray:
        """Position at the samples [m], (segments, length)."""
        return self.fit.evaluation.x

    @property
    def v(self) -> np.ndarray:
        """Velocity at the samples [m/s], (segments, length)."""
        return self.fit.evaluation.v


@dataclass(frozen=True)
class Hypothesis:
    """What a missing force depends on.

    `columns` gives those of the machine and those of the records' own, for a value of the `constant` where
    there is one that is not linear.
    """

    depends_on: tuple[str, ...]
    columns: Callable[[Motion, float], tuple[Columns, Columns]]
    # the law in symbols, with the size a; '' for a function without a short one
    formula: str = ""
    # the constant: its name and unit, and the values that are tried
    constant: tuple[str, str] | None = None
    # whether it becomes another hypothesis below the lowest value: a hidden state without memory
    fades: bool = False
    values: np.ndarray = field(default_factory=lambda: np.zeros(1))


def motion_of(problem: Likelihood, fit: Fit, mass: float, natural: float) -> Motion:
    """The motion of a fit."""
    t = np.zeros(problem.segments.inside.shape)
    frequency = natural
    for number, prepared in enumerate(problem.prepared):
        rows = problem.segments.record == number
        t[rows] = prepared.samples.t[problem.segments.index[rows]] - prepared.samples.t[0]
        frequency = prepared.frequency or frequency
    phase = scaled_motion(problem, fit)["phase"]
    coherence_time = SEARCH.coherent_periods * 2 * np.pi / frequency
    spring = None if phase is None else extensions(problem, fit)
    good = problem.segments.inside & fit.good[:, None]
    return Motion(problem, fit, mass, natural, coherence_time, t, phase, spring, good)


def hypotheses(training: Motion, more: Iterable[Hypothesis] = ()) -> Iterator[Hypothesis]:
    """All that are tried, and `more`; knots and scales are those of the training records."""
    yield from _smooth(training)
    yield from _times(training)
    yield from memories(training)
    yield from more
    if np.count_nonzero(impacts_at(training.problem, training.fit)[1]) >= SEARCH.impacts_of_hypothesis:
        yield from _at_impacts(training)


def of_known_motion(training: Motion) -> Iterator[Hypothesis]:
    """Those of a force along a known motion: its way since it turned, the drift of its sensor."""
    yield _after_turning(training)
    yield Hypothesis(("slow time",), lambda m, _: (None, _force(m, _drifts(m))), "a + b t, of each record")


def _smooth(training: Motion) -> Iterator[Hypothesis]:
    """Functions of position, speed and phase of the drive."""
    x, v = training.x[training.good], training.v[training.good]
    over_x, over_v, few_x, few_v = (
        knots_of(values, count) for values, count in ((x, 7), (v, 7), (x, 5), (v, 5))
    )
    for power, formula in enumerate(("-a sign(v)", "-a v", "-a v |v|")):
        yield _function(
            ("speed",), lambda m, n=power: -(np.sign(m.v) * np.abs(m.v) ** n)[:, :, None], formula
        )
    yield _function(("speed",), lambda m: splines(m.v, over_v, m.good))
    yield _function(("position",), lambda m: splines(m.x, over_x, m.good))
    if training.spring is not None:
        over_s = knots_of(training.spring[training.good], 7)

        def over_extension(m: Motion) -> np.ndarray:
            # without a known extension nothing is predicted
            known = m.good if m.spring is not None else np.zeros_like(m.good)
            return splines(m.x if m.spring is None else m.spring, over_s, known)

        yield _function(("extension",), over_extension)
    yield _function(
        ("speed", "position"), lambda m: products(splines(m.v, few_v, m.good), splines(m.x, few_x, m.good))
    )
    if training.phase is not None:
        middle, size = x.mean(), x.std()
        yield _function(("drive phase",), lambda m: _harmonics(m, 6))
        yield _function(
            ("drive phase", "position"), lambda m: _harmonics(m, 2) * ((m.x - middle) / size)[:, :, None]
        )


def _times(training: Motion) -> Iterator[Hypothesis]:
    """What drifts, and what oscillates at a frequency of its own."""
    middle = training.x[training.good].mean()
    factors = (
        ((), lambda m: np.ones_like(m.x)[:, :, None], ""),
        (("direction of motion",), lambda m: np.sign(m.v)[:, :, None], " sign(v)"),
        (("position",), lambda m: np.stack([m.x - middle, np.ones_like(m.x)], axis=2), " (x - x0)"),
    )
    waves = _frequencies(training, SEARCH.waves)
    for names, factor, text in factors:
        yield _function(("slow time", *names), lambda m, f=factor: m.t[:, :, None] * f(m), f"a t{text}")
        yield Hypothesis(
            ("oscillating time", *names),
            lambda m, w, f=factor: (None, _force(m, _in_intervals(m, _wave(m, w, f(m))))),
            f"a cos(w t + c){text}", ("frequency w", "rad/s"), values=waves,
        )  # fmt: skip


def memories(training: Motion) -> Iterator[Hypothesis]:
    """Hidden states: relaxation, a delay, an attached mass on a spring."""
    period = 2 * np.pi / training.natural
    yield Hypothesis(
        ("memory",),
        lambda m, tau: (
            _force(m, -_by_record(m, lambda t, x: _relaxed(t, x, tau))),
            _force(m, _in_records(m, _by_record(m, lambda t, x: np.exp(-t / tau)[:, None]))),
        ),
        "-a z, z' = v - z/tau", ("time constant tau", "s"), True,
        period * np.geomspace(*SEARCH.relaxations, SEARCH.hidden_grid),
    )  # fmt: skip
    yield Hypothesis(
        ("memory",),
        lambda m, tau: (
            _force(m, -_by_record(m, lambda t, x: _late(t, x, tau))),
            _force(m, _in_records(m, _beginning(m, tau))),
        ),
        "-a (x(t - tau) - x0)", ("delay tau", "s"), True,
        period * np.linspace(*SEARCH.delays, SEARCH.hidden_grid),
    )  # fmt: skip
    for zeta in SEARCH.attached_dampings:
        yield Hypothesis(
            ("memory",),
            lambda m, w, zeta=zeta: (
                _force(m, _by_record(m, lambda t, x: _attached(t, x, w, zeta))),
                _force(m, _in_records(m, _by_record(m, lambda t, x: _rings(t, w, zeta)))),
            ),
            "a (z - x), z'' + 2 zeta w z' + w^2 z = w^2 x",
            (f"damping ratio zeta near {zeta:g} and a frequency w", "rad/s"),
            values=training.natural * np.geomspace(*SEARCH.attached, 2 * SEARCH.hidden_grid),
        )  # fmt: skip


def _after_turning(training: Motion) -> Hypothesis:
    """Friction that builds up over a way after a turning point, by a spring or a play in series."""
    longest = float(_ways(training)[training.good].max())
    inner = longest * np.append(0.0, np.geomspace(SEARCH.shortest_way, 1.0, SEARCH.way_knots))
    knots = np.concatenate([[0.0] * 3, inner, [longest] * 3])
    return _function(
        ("direction of motion", "way since it turned"),
        lambda m: np.sign(m.v)[:, :, None] * splines(_ways(m), knots, m.good),
    )


def _drifts(m: Motion) -> np.ndarray:
    """Zero and drift of a load cell in each record."""
    return _in_records(m, np.stack([np.ones_like(m.t), m.t], axis=2))


def _ways(m: Motion) -> np.ndarray:
    """Way since the last turning point of the known motion of a record [m], at the samples."""
    found = np.zeros(m.x.shape)
    for number, prepared in enumerate(m.problem.prepared):
        rows = np.flatnonzero(m.problem.segments.record == number)
        found[rows] = prepared.driven.ways(prepared.record.pieces)[m.problem.segments.index[rows]]
    return found


def _at_impacts(training: Motion) -> Iterator[Hypothesis]:
    """Changes of the speed after an impact, and forces after it."""
    speed = np.sqrt(np.mean(training.v[training.good] ** 2))

    def rebounds(m: Motion, power: int = 1) -> np.ndarray:
        before, at = impacts_at(m.problem, m.fit)
        return (at * speed * (before / speed) ** power)[:, :, None]

    def kick(m: Motion, changes: np.ndarray) -> np.ndarray:
        return m.problem.kick_columns(m.fit, changes)

    yield Hypothesis(
        ("impact speed",),
        lambda m, _: (kick(m, np.concatenate([rebounds(m, n) for n in (2, 3, 4)], axis=2)), None),
    )
    yield Hypothesis(
        ("slow time", "impacts"), lambda m, _: (kick(m, m.t[:, :, None] * rebounds(m)), None), "a t V"
    )
    since = after_impacts(training.problem, training.fit)
    known = training.good & np.isfinite(since)
    if np.count_nonzero(known) > SEARCH.samples_after_impacts:
        knots = knots_of(since[known], 12)

        def after(m: Motion) -> np.ndarray:
            passed = after_impacts(m.problem, m.fit)
            return splines(passed, knots, m.good & np.isfinite(passed))

        yield _function(("time since impact",), after)
    yield Hypothesis(
        ("oscillating time", "impacts"),
        lambda m, w: (None, kick(m, _in_intervals(m, _wave(m, w, rebounds(m))))),
        "a cos(w t + c) V", ("frequency w", "rad/s"),
        values=_frequencies(training, SEARCH.slow_waves),
    )  # fmt: skip


def _function(depends_on: tuple[str, ...], values: Callable, formula: str = "") -> Hypothesis:
    """A force without a constant that is not linear."""
    return Hypothesis(depends_on, lambda m, _: (_force(m, values(m)), None), formula)


def _force(m: Motion, values: np.ndarray) -> np.ndarray:
    return m.problem.force_columns(m.fit, values, m.mass)


def _frequencies(m: Motion, ends: tuple[float, float]) -> np.ndarray:
    """Frequencies at the resolution of one coherence time."""
    return np.arange(ends[0] * m.natural, ends[1] * m.natural, np.pi / (2 * m.coherence_time))


def _wave(m: Motion, w: float, factors: np.ndarray) -> np.ndarray:
    angle = w * m.t[:, :, None]
    return np.concatenate([factors * np.cos(angle), factors * np.sin(angle)], axis=2)


def _harmonics(m: Motion, count: int) -> np.ndarray:
    return np.stack([f(n * m.phase) for n in range(1, count + 1) for f in (np.sin, np.cos)], axis=2)


def _in_records(m: Motion, columns: np.ndarray) -> np.ndarray:
    """Columns of each record by itself."""
    return _apart(columns, m.problem.segments.record)


def _in_intervals(m: Motion, columns: np.ndarray) -> np.ndarray:
    """Separate columns for each coherent interval of each record."""
    part = np.floor(m.t[:, 0] / m.coherence_time).astype(int)
    _, number = np.unique(np.stack([m.problem.segments.record, part]), axis=1, return_inverse=True)
    return _apart(columns, number)


def _apart(columns: np.ndarray, group: np.ndarray) -> np.ndarray:
    groups = np.unique(group)
    parts = [columns * (group == one)[:, None, None] for one in groups]
    return np.concatenate(parts, axis=2)


def _by_record(m: Motion, make: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    """Functions of the whole past: `make` gets even times of a record and its fitted position there."""
    found = np.zeros((*m.x.shape, 1))
    segments = m.problem.segments
    for number, prepared in enumerate(m.problem.prepared):
        rows = np.flatnonzero(segments.record == number)
        usable = m.good[rows]
        t = m.t[rows][usable]
        if t.size < 2:
            continue
        t, first = np.unique(t, return_index=True)
        even = np.arange(
            0.0, prepared.samples.t[-1] - prepared.samples.t[0], 2 * np.pi / m.natural / SEARCH.hidden_steps
        )
        values = make(even, np.interp(even, t, m.x[rows][usable][first]))
        if found.shape[2] != values.shape[1]:
            found = np.zeros((*m.x.shape, values.shape[1]))
        for column in range(values.shape[1]):
            found[rows, :, column] = np.interp(m.t[rows], even, values[:, column])
    return found


def _relaxed(t: np.ndarray, x: np.ndarray, tau: float) -> np.ndarray:
    """z' = x' - z/tau from z = 0."""
    forgets = np.exp(-(t[1] - t[0]) / tau)
    # exact for a speed that is constant over a step
    gain = tau * (1 - forgets) / (t[1] - t[0])
    return lfilter([gain], [1, -forgets], np.diff(x, prepend=x[0]))[:, None]


def _late(t: np.ndarray, x: np.ndarray, tau: float) -> np.ndarray:
    """The delayed position and the unknown position at which the force vanishes."""
    return np.stack([np.interp(t - tau, t, x) - x.mean(), np.ones_like(x)], axis=1)


def _beginning(m: Motion, tau: float) -> np.ndarray:
    """Tent functions over the first `tau` of a record, where the delayed motion is unknown."""
    centre = np.arange(SEARCH.beginnings) * tau / (SEARCH.beginnings - 1)
    tents = np.maximum(0, 1 - np.abs(m.t[:, :, None] - centre) * (SEARCH.beginnings - 1) / tau)
    return tents * (m.t <= tau)[:, :, None]


def _attached(t: np.ndarray, x: np.ndarray, w: float, zeta: float) -> np.ndarray:
    """Extension of the spring of an attached mass."""
    system = (np.array([[0, 1], [-w * w, -2 * zeta * w]]), np.array([[0], [w * w]]), np.array([[1.0, 0]]))
    a, b, c, d, _ = cont2discrete((*system, np.zeros((1, 1))), t[1] - t[0], method="foh")
    numerator, denominator = ss2tf(a, b, c, d)
    from_middle = x - x.mean()
    return (lfilter(numerator[0], denominator, from_middle) - from_middle)[:, None]


def _rings(t: np.ndarray, w: float, zeta: float) -> np.ndarray:
    return np.exp(-zeta * w * t)[:, None] * np.stack([np.cos(w * t), np.sin(w * t)], axis=1)
