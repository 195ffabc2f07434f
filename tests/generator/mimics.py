# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws mechanisms that pass for a law of friction or impacts, and the laws that they pass for."""

from pathlib import Path

import numpy as np
from design import Case
from experiment import REGIMES, Experiment
from records import BASE, HELD_OUT, TRAINING, base_case, write_record
from simulator import POWER, Machine

LEVEL = 0.003
"""Noise over the signal."""
PERIODS, SAMPLES = 12, 100
MIMICS = ("delayed_spring", "sensor_lag", "maxwell_element", "second_mode")
LAWS = ("viscous", "quadratic_drag", "stribeck", "friction_over_position", "restitution", "sensor_delay")


def draw_mimic(seed: int, number: int, name: str, regime: str = "published") -> Case:
    """A case with the crank angle measured, three drives, and one mechanism of either tuple."""
    random = np.random.default_rng([seed, 12, number])
    base = REGIMES[regime].machine()
    machine, sensor = _changed(base, name, random)
    while True:
        ratios = random.uniform(*REGIMES[regime].ratios, 3)
        if np.diff(np.sort(ratios)).min() > REGIMES[regime].spacing:
            break
    upper = REGIMES[regime].upper
    three = [
        Experiment(
            ratio=round(float(ratio), 3),
            phase=float(random.uniform(0, 2 * np.pi)),
            x0=float(random.uniform(0.3, 0.95) * upper),
            v0=float(random.uniform(-2, 2)),
            settling=12,
            samples_per_period=SAMPLES,
            periods=PERIODS,
            sensor=sensor,
        )
        for ratio in ratios
    ]
    return Case(
        number=number,
        kind="mimic" if name in MIMICS else "law",
        regime=regime,
        base=base,
        machine=machine,
        hidden=[],
        training=three[:2],
        held_out=three[2],
        level=LEVEL,
        colour="white",
        velocity=False,
        crank_angle=True,
        states_noise=True,
        phase_error=[0.0] * 3,
        target=0.0,
        seed=[seed, number, 0],
    )


def _changed(base: Machine, name: str, random: np.random.Generator) -> tuple[Machine, dict[str, float]]:
    """The machine with a mechanism, and its sensor; sizes stand far out of the noise."""
    k, period = base.stiffness, 2 * np.pi / np.sqrt(base.stiffness)
    if name in ("sensor_lag", "sensor_delay"):
        return base, {name: float(period * random.uniform(0.004, 0.02))}
    if name == "delayed_spring":
        # half of the spring lags by twice the time; its foot moves twice as far
        lag = period * random.uniform(0.003, 0.015)
        return base.copy(stiffness=k / 2, delayed_stiffness=k / 2, delay=2 * lag, scale=2.0), {}
    if name == "maxwell_element":
        share, time = random.uniform(0.02, 0.1), period * random.uniform(0.05, 0.4)
        return base.copy(maxwell_stiffness=share * k, maxwell_time=time), {}
    if name == "second_mode":
        mass, frequency = random.uniform(0.02, 0.08), np.sqrt(k) * random.uniform(2.2, 5)
        spring = {"second_stiffness": mass * frequency**2, "second_damping": 0.04 * mass * frequency}
        return base.copy(second_mass=mass, **spring), {}
    wave = random.uniform(4, 12)
    laws = {
        "viscous": {"viscous": base.viscous + random.uniform(0.1, 0.5)},
        "quadratic_drag": {"quadratic": random.uniform(0.02, 0.1)},
        "stribeck": {"stribeck": random.uniform(0.3, 1.0), "stribeck_velocity": random.uniform(0.1, 0.4)},
        "friction_over_position": {"friction_wave": wave, "friction_slope": 0.2 * wave},
        "restitution": {
            "restitution_shape": POWER, "restitution_constant": 0.5,
            "restitution_slope": random.uniform(0.03, 0.1),
        },
    }  # fmt: skip
    return base.copy(**laws[name]), {}


def write_mimic(folder: Path, case: Case) -> None:
    """The base case and the records."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / BASE).write_text(base_case(REGIMES[case.regime], case.training[0].ratio))
    random = np.random.default_rng([*case.seed, 7])
    for name, one in zip((*TRAINING, HELD_OUT), [*case.training, case.held_out], strict=True):
        write_record(folder / name, case, one, 0.0, random)
