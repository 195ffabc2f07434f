# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws cases of slow stick-slip: a drive far below resonance, long rests, small motions, a fast sensor."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from design import Case, Hidden
from effects import CATALOGUE
from experiment import REGIMES, Experiment
from records import BASE, HELD_OUT, TRAINING, base_case, write_record
from simulator import X

SLOW = replace(REGIMES["published"], ratios=(0.15, 0.25), spacing=0.02)
"""The published machine, driven slowly."""
RATE = 2000.0
"""Samples per second."""
SAMPLES = (30_000, 40_000)
"""Of each record."""
NOISE = 8e-6
"""Standard deviation of the noise [m]."""
SMALL = 0.3
"""Drive of a record that hardly moves, over that of the others."""
REST = "rest.csv"
SLOWNESS = {
    "stribeck": (1.4715, {"stribeck_velocity": 0.2}),
    "position_dependent_friction": (2.5, {"friction_wave": 10.0, "friction_wave_phase": 0.6}),
    "static_excess": (1.4715, {}),
    "dahl": (2000.0, {}),
}
"""Sizes and shapes of the effects: mu_s 0.35 beside mu 0.2; mu (1 + 0.25 sin(x/0.1 m + 0.6))."""


def draw_slow(seed: int, number: int, name: str, small: bool = False) -> Case:
    """A case with an effect, or none (''); with `small` the second record hardly moves."""
    random = np.random.default_rng([seed, 8, number])
    machine = base = SLOW.machine()
    hidden = []
    if name:
        size, shape = SLOWNESS[name]
        hidden = [Hidden(name, CATALOGUE[name], shape, 1.0, size)]
        machine = hidden[0].on(base)
    first, second, third = (_experiment(random, ratio) for ratio in _ratios(random))
    if small:
        second.scale = SMALL
    deviation = float(np.std(first.states(first.driven(machine))[0][:, X]))
    return Case(
        number=number,
        kind="slow",
        regime="published",
        base=base,
        machine=machine,
        hidden=hidden,
        training=[first, second],
        held_out=third,
        level=NOISE / deviation,
        colour="white",
        velocity=False,
        crank_angle=bool(random.random() < 0.5),
        states_noise=bool(random.random() < 0.5),
        phase_error=[float(error) for error in random.normal(0, 0.005, 3)],
        target=0.0,
        seed=[seed, number, 0],
    )


def _ratios(random: np.random.Generator) -> list[float]:
    while True:
        ratios = np.sort(random.uniform(*SLOW.ratios, 3))
        if np.min(np.diff(ratios)) > SLOW.spacing:
            return [round(float(ratio), 3) for ratio in random.permutation(ratios)]


def _experiment(random: np.random.Generator, ratio: float) -> Experiment:
    one = Experiment(ratio, float(random.uniform(0, 2 * np.pi)), 0.7, 0.0, 0, 1, 1)
    period = 2 * np.pi / one.frequency
    one.samples_per_period = round(RATE * period)
    one.periods = max(2, round(random.uniform(*SAMPLES) / one.samples_per_period))
    return one


def write_slow(folder: Path, case: Case) -> None:
    """The base case, the records, and a record at rest."""
    folder.mkdir(parents=True, exist_ok=True)
    first = case.training[0]
    (folder / BASE).write_text(base_case(SLOW, first.ratio))
    random = np.random.default_rng([*case.seed, 7])
    experiments = [*case.training, case.held_out]
    for name, one, error in zip((*TRAINING, HELD_OUT), experiments, case.phase_error, strict=True):
        write_record(folder / name, case, one, error, random, first)
    t = np.arange(4000) / RATE
    x = 0.7 + NOISE * random.standard_normal(t.size)
    rows = "\n".join(f"{a:.12g},{b:.12g}" for a, b in zip(t, x, strict=True))
    (folder / REST).write_text(f"# units: s, m\n# sampling_rate_hz: {RATE!r}\nt,x\n{rows}\n")
