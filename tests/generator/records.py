# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes a case: the base case file, the records, and the truth under a seal that can be published before."""

import hashlib
import json
import math
from pathlib import Path

import numpy as np
from design import MEMORY, PERIODS, PHASE_ERROR, Case, sizes_of_noise
from experiment import ANGLE, COSINE, FINE, GRAVITY, REGIMES, SINE, STIFFNESS, Experiment, Regime
from simulator import Machine, X
from size import COARSE

TRAINING = ("first.csv", "second.csv")
HELD_OUT = "held_out.csv"
BASE = "base.toml"
ASKED = "asked.csv"
QUANTUM = math.sqrt(6)
"""Resolution over the standard deviation of the noise, half of whose power it has."""
FRICTION = {
    ("coulomb",): 'law = "coulomb"\nkinetic_coefficient = {coefficient!r}',
    ("viscous",): 'law = "viscous"\ndamping = {damping!r}',
    (
        "coulomb",
        "viscous",
    ): 'law = "coulomb_viscous"\nkinetic_coefficient = {coefficient!r}\ndamping = {damping!r}',
}


def base_case(regime: Regime, ratio: float) -> str:
    """The case file of the machine as its owner believes it to be."""
    friction = FRICTION[regime.friction].format(coefficient=regime.coefficient, damping=regime.damping)
    return f"""[body]
mass = 1.0
gravity = {GRAVITY!r}

[restoring]
law = "linear"
stiffness = {STIFFNESS!r}
free_length = 0.4

[friction]
{friction}

[contact]
law = "newton"
restitution = {regime.restitution!r}
upper = {regime.upper!r}

[drive]
law = "fourier"
ratio = {ratio!r}
mean = 0.31055
cosine = {list(COSINE)!r}
sine = {list(SINE)!r}
angle = {ANGLE!r}
"""


def with_imperfections(case: Case, experiment: Experiment) -> tuple[Machine, dict[str, float]]:
    """Machine and sensor of an experiment with the small imperfections of the rig."""
    driven = experiment.driven(case.machine)
    if not case.rig:
        return driven, {}
    first = case.training[0]
    deviation = float(np.std(first.states(first.driven(case.machine), COARSE)[0][:, X]))
    size = case.rig["harmonics"] * deviation / math.sqrt(3)
    driven = driven.copy(cosine=(*COSINE, size, 0.0, size), sine=(*SINE, 0.0, size, 0.0))
    return driven, {"sensor_curved": case.rig["curved"], "sensor_cubic": case.rig["cubic"]}


def seen_by(case: Case, experiment: Experiment) -> np.ndarray:
    """Position and velocity (samples, 2) that the sensors show but for their noise."""
    driven, imperfections = with_imperfections(case, experiment)
    experiment.sensor = {**experiment.sensor, **imperfections}
    states, _ = experiment.states(driven, FINE)
    return experiment.observe(driven, states, FINE)


def measured(
    case: Case, experiment: Experiment, random: np.random.Generator, like: Experiment | None = None
) -> tuple[dict, float, float]:
    """Columns of a record as the sensors show them, the noise of the position, and its resolution [m].

    The noise is as large as in the record `like`, or in proportion to the signal.
    """
    seen = seen_by(case, experiment)
    sigma, sigma_v = sizes_of_noise(seen if like is None else seen_by(case, like), case.level)
    noise = random.standard_normal(seen.shape)
    resolution = 0.0
    if case.colour == "coloured":
        for i in range(1, len(noise)):
            noise[i] = MEMORY * noise[i - 1] + math.sqrt(1 - MEMORY**2) * noise[i]
    if case.colour == "quantised":
        sigma /= math.sqrt(2)
        resolution = QUANTUM * sigma * math.sqrt(2)
    x = seen[:, X] + sigma * noise[:, 0]
    if resolution > 0:
        x = resolution * np.round(x / resolution)
    time = np.arange(len(x)) * experiment.interval
    columns = {"t": time, "x": x}
    if case.velocity:
        columns["v"] = seen[:, 1] + sigma_v * noise[:, 1]
    if case.crank_angle:
        columns["phi"] = experiment.phase + experiment.frequency * time
        if case.rig:
            columns["phi"] += case.rig["crank_noise"] * random.standard_normal(len(x))
    return columns, sigma, resolution


def write_record(
    path: Path,
    case: Case,
    experiment: Experiment,
    phase_error: float,
    random: np.random.Generator,
    like: Experiment | None = None,
) -> None:
    """A record of the CSV contract; `like`: the record whose noise it has."""
    columns, sigma, resolution = measured(case, experiment, random, like)
    units = {"t": "s", "x": "m", "v": "m/s", "phi": "rad"}
    head = {"units": ", ".join(units[name] for name in columns)}
    head["sampling_rate_hz"] = repr(1 / experiment.interval)
    head["drive_ratio"] = repr(experiment.ratio)
    if experiment.scale != 1:
        head["drive_scale"] = repr(experiment.scale)
    if case.states_noise:
        head["sensor_noise_sigma_m"] = repr(sigma)
    if resolution > 0:
        head["sensor_resolution_m"] = repr(resolution)
    if case.crank_angle and case.rig and case.states_noise:
        head["phi_noise_sigma_rad"] = repr(case.rig["crank_noise"])
    if not case.crank_angle:
        head["phase"] = f"{experiment.phase + phase_error:.4f}"
    lines = [f"# {key}: {value}" for key, value in head.items()]
    lines.append(",".join(columns))
    lines += [",".join(f"{value:.12g}" for value in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n")


def write_asked(path: Path, case: Case, ratio: float, scale: float) -> None:
    """A record that a verdict asked for: as long as the first one and with its noise, at another drive."""
    first = case.training[0]
    random = np.random.default_rng([*case.seed, 11])
    one = Experiment(ratio, 0.0, first.x0, first.v0, PERIODS, 1, 1, scale=scale)
    period = 2 * math.pi / one.frequency
    one.phase = float(random.uniform(0, 2 * math.pi))
    one.samples_per_period = round(period / first.interval)
    one.periods = max(1, round((first.count - 1) * first.interval / period))
    one.sensor = dict(first.sensor)
    write_record(path, case, one, float(random.normal(0, PHASE_ERROR)), random, first)


def truth_of(case: Case) -> dict:
    """What is sealed."""
    return {
        "number": case.number,
        "kind": case.kind,
        "names": [hidden.name for hidden in case.hidden],
        # a law of another shape has no parameters of the catalogue
        "parameters": {
            path: value
            for hidden in case.hidden
            if not hidden.another_shape
            for path, value in hidden.parameters.items()
        },
        "target": case.target,
        "d_prime": case.d_prime,
        "beyond": {
            name: {"d_prime": worst, "besides": other} for name, (worst, other) in case.beyond.items()
        },
        "regime": case.regime,
        "noise": case.level,
        "colour": case.colour,
        "samples_per_period": case.held_out.samples_per_period,
        "velocity": case.velocity,
        "crank_angle": case.crank_angle,
        "ratios": [experiment.ratio for experiment in [*case.training, case.held_out]],
        "base": {name: getattr(case.base, name) for name in REGIMES[case.regime].unknowns},
        "samples": sum(experiment.count for experiment in [*case.training, case.held_out]),
        "shapes": {hidden.name: hidden.another_shape for hidden in case.hidden if hidden.another_shape},
        "rig": case.rig,
        "seed": case.seed,
    }


def seal(path: Path) -> str:
    """The hash of a sealed file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def write_case(folder: Path, sealed: Path, case: Case) -> str:
    """Write what is given into `folder` and the truth into the file `sealed`; return its hash."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / BASE).write_text(base_case(REGIMES[case.regime], case.training[0].ratio))
    # the sensor's noise has nothing to do with the numbers that drew the case
    random = np.random.default_rng([*case.seed, 7])
    experiments = [*case.training, case.held_out]
    for name, one, error in zip((*TRAINING, HELD_OUT), experiments, case.phase_error, strict=True):
        write_record(folder / name, case, one, error, random)
    sealed.parent.mkdir(parents=True, exist_ok=True)
    sealed.write_text(json.dumps(truth_of(case), indent=1) + "\n")
    return seal(sealed)
