# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws cases: machine, experiments, sensor, and the hidden effect with the requested size."""

import math
from dataclasses import dataclass, field

import numpy as np
from effects import (
    ASYMMETRIC_VISCOUS,
    CATALOGUE,
    OUTSIDE,
    PAIRS,
    SENSORS,
    SHAPES,
    Effect,
    changes,
    parameters,
)
from experiment import REGIMES, Experiment
from simulator import Machine, SimulationError, X
from size import COARSE, IMITATORS, Information, Noise

BLOCK = 40
"""Cases in which every kind has its share."""
SHARES = {"none": 8, "outside": 6, "pair": 4}
LONG = 9
"""Cases of a block with as many samples as a rig records."""
MOST_SAMPLES = (52_000, 100_000)
"""Of the three records of a long case together."""
LONGEST = 36
"""Drive periods of a long record at most."""
PLANNED = 100
"""Samples per drive period on which the size of an effect of a long case is chosen."""
RIG = (1e-4, 1e-3)
"""Small imperfections of a rig over the signal: a slightly nonlinear sensor, further harmonics; of the crank
angle in rad."""
ANOTHER_SHAPE = 2 / 3
TARGETS = (3.0, 5.0, 10.0, 30.0)
LEVELS = (0.001, 0.005, 0.01, 0.03, 0.05)
PERIODS = 12
PHASE_ERROR = 0.02
"""Of the crank angle at the first sample where it is not measured [rad]."""
ATTEMPTS = 12
MEMORY = 0.5
MARGIN = 1.2
"""A size is accepted from its target to so many times its target."""
SCATTER = {
    "stiffness": 0.02,
    "coulomb": 0.1,
    "viscous": 0.1,
    "restitution": 0.04,
    "upper": 0.005,
    "scale": 0.02,
}
"""Standard deviation of the true machine from its base case, relative."""
NEEDS_DRY = ("stribeck", "static_excess", "dahl", "asymmetric_friction", "position_dependent_friction")


class Unreachable(Exception):
    """No size of the effect has the requested d' here."""


@dataclass
class Hidden:
    """One effect with its size."""

    name: str
    effect: Effect
    shape: dict[str, float]
    sign: float
    size: float = 0.0

    def on(self, machine: Machine) -> Machine:
        """The machine with the effect."""
        return machine.copy(**changes(machine, self.name, self.effect, self.sign * self.size, self.shape))

    @property
    def another_shape(self) -> dict[str, float]:
        """What makes its law another one than that of the catalogue."""
        return {key: value for key, value in self.shape.items() if key in SHAPES}

    @property
    def parameters(self) -> dict[str, float]:
        """In the words of the case file."""
        return parameters(self.name, self.effect, self.sign * self.size, self.shape)


@dataclass
class Case:
    """Everything about a case; `machine` has the effects."""

    number: int
    kind: str
    regime: str
    base: Machine
    machine: Machine
    hidden: list[Hidden]
    training: list[Experiment]
    held_out: Experiment
    level: float
    colour: str
    velocity: bool
    crank_angle: bool
    states_noise: bool
    phase_error: list[float]
    target: float
    seed: list[int]
    rig: dict[str, float] = field(default_factory=dict)
    """Imperfections of the rig: crank_noise [rad]; curved, cubic (sensor) and harmonics over the signal."""
    density: int = 1
    """Samples of a record for each on which its size was chosen."""
    d_prime: dict[str, float] = field(default_factory=dict)
    beyond: dict[str, float] = field(default_factory=dict)
    """d' if one other effect of the catalogue is fitted too, and the worst of them."""


def sizes_of_noise(seen: np.ndarray, level: float) -> tuple[float, float]:
    """Standard deviations of the noise of position and velocity."""
    x, v = np.std(seen, axis=0)
    return level * float(x), level * float(v)


def plan(seed: int, number: int) -> tuple[str, str, float]:
    """Kind, name and target of a case, in equal shares over every block of cases."""
    block, index = divmod(number, BLOCK)
    random = np.random.default_rng([seed, 1, block])
    kinds = [kind for kind, share in SHARES.items() for _ in range(share)]
    kinds += ["single"] * (BLOCK - len(kinds))
    order = random.permutation(BLOCK)
    kind = kinds[order[index]]
    before = int(np.sum(np.array(kinds)[order[:index]] == kind)) + block * kinds.count(kind)
    names = {
        "none": [""],
        "outside": list(OUTSIDE),
        "pair": ["+".join(pair) for pair in PAIRS],
        "single": [*CATALOGUE, "asymmetric_viscous"],
    }[kind]
    turn, index = divmod(before, len(names))
    order = np.random.default_rng([seed, 2, turn, len(names)]).permutation(len(names))
    index = int(order[index])
    targets = (10.0, 30.0) if kind in ("outside", "pair") else TARGETS
    return kind, names[index], targets[(turn + index) % len(targets)]


def is_long(seed: int, number: int) -> bool:
    """Whether a case has records as long as those of a rig."""
    block, index = divmod(number, BLOCK)
    return int(np.random.default_rng([seed, 4, block]).permutation(BLOCK)[index]) < LONG


def draw(seed: int, number: int, plain: bool = False) -> Case:
    """The case of this number; a regime in which its effect cannot have the requested size is drawn again.

    `plain`: a short one with the law of the catalogue and no imperfections of the rig.
    """
    kind, name, target = plan(seed, number)
    long = is_long(seed, number) and not plain
    return _attempted(seed, number, plain, (kind, name, target, long, {}))


def draw_shaped(seed: int, number: int, name: str, shape: dict[str, float], target: float) -> Case:
    """A short case with one effect of a given shape and size, and no imperfections of the rig."""
    return _attempted(seed, number, True, ("single", name, target, False, shape))


def _attempted(seed: int, number: int, plain: bool, what: tuple) -> Case:
    """The case in the first regime in which its effect can have its size."""
    for attempt in range(ATTEMPTS):
        random = np.random.default_rng([seed, 3, number, attempt])
        more = None if plain else np.random.default_rng([seed, 5, number, attempt])
        try:
            case = _draw(random, more, number, *what)
        except (SimulationError, Unreachable):
            continue
        case.seed = [seed, number, attempt]
        return case
    raise Unreachable(f"case {number}: {what[1]} with d' = {what[2]:g}")


def _regime(random: np.random.Generator, name: str) -> str:
    """A regime in which an effect makes sense and is not a parameter of the base case."""
    allowed = []
    for regime, its in REGIMES.items():
        parts = name.split("+")
        if any(part in its.friction for part in parts):
            continue
        if "coulomb" not in its.friction and any(
            part in NEEDS_DRY or part == "drifting_friction" for part in parts
        ):
            continue
        if name == "asymmetric_viscous" and regime != "damped":
            continue
        allowed.append(regime)
    return str(random.choice(allowed))


def _ratios(random: np.random.Generator, regime: str) -> list[float]:
    its = REGIMES[regime]
    while True:
        ratios = random.uniform(*its.ratios, 3)
        if min(abs(ratios[i] - ratios[k]) for i in range(3) for k in range(i)) > its.spacing:
            return [round(float(ratio), 3) for ratio in ratios]


def _experiments(random: np.random.Generator, regime: str, periods: int | None) -> list[Experiment]:
    samples = int(random.choice([50, 100, 400], p=[0.6, 0.35, 0.05]))
    if periods:
        samples = PLANNED
    upper = REGIMES[regime].upper
    return [
        Experiment(
            ratio=ratio,
            phase=float(random.uniform(0, 2 * math.pi)),
            x0=float(random.uniform(0.3, 0.95) * upper),
            v0=float(random.uniform(-2, 2)),
            settling=int(random.choice([0, 12])),
            samples_per_period=samples,
            periods=periods or PERIODS,
        )
        for ratio in _ratios(random, regime)
    ]


def _hide(
    random: np.random.Generator, name: str, base: Machine, shapes: np.random.Generator | None
) -> Hidden:
    label, effect = name, CATALOGUE.get(name) or OUTSIDE.get(name)
    if name == "asymmetric_viscous":
        label, effect = "asymmetric_friction", ASYMMETRIC_VISCOUS
    driven = base.copy(frequency=math.sqrt(base.stiffness))
    sign = float(random.choice([-1, 1])) if effect.signed else 1.0
    shape = effect.shape(driven, random)
    if shapes is not None and effect.another and shapes.random() < ANOTHER_SHAPE:
        shape |= effect.another(shapes)
    return Hidden(label, effect, shape, sign)


def _rig(random: np.random.Generator) -> dict[str, float]:
    """The small imperfections of a rig, which half of the cases have."""
    if random.random() < 0.5:
        return {}
    sizes = np.exp(random.uniform(*np.log(RIG), 4)) * [1, *random.choice([-1, 1], 2), 1]
    return dict(zip(("crank_noise", "curved", "cubic", "harmonics"), map(float, sizes), strict=True))


def _draw(
    random: np.random.Generator,
    more: np.random.Generator | None,
    number: int,
    kind: str,
    name: str,
    target: float,
    long: bool,
    shape: dict[str, float],
) -> Case:
    """A case; what is only drawn of some comes from `more`, if there is one."""
    regime = _regime(random, name)
    its = REGIMES[regime]
    nominal = its.machine()
    scatter = {
        key: getattr(nominal, key) * (1 + SCATTER[key] * random.standard_normal()) for key in its.unknowns
    }
    base = nominal.copy(**scatter)
    rig = {} if more is None else _rig(more)
    periods = int(more.integers(PERIODS, LONGEST + 1)) if long else None
    experiments = _experiments(random, regime, periods)
    shapes = more if kind == "single" else None
    case = Case(
        number=number,
        kind=kind,
        regime=regime,
        base=base,
        machine=base,
        hidden=[_hide(random, part, base, shapes) for part in name.split("+") if part],
        training=experiments[:2],
        held_out=experiments[2],
        level=float(random.choice(LEVELS, p=[0.15, 0.2, 0.3, 0.2, 0.15])),
        colour=str(random.choice(["white", "coloured", "quantised"], p=[0.6, 0.2, 0.2])),
        velocity=bool(random.random() < 0.3),
        crank_angle=name == "sensor_delay" or bool(random.random() < 0.4),
        states_noise=bool(random.random() < 0.5),
        phase_error=[float(error) for error in random.normal(0, PHASE_ERROR, 3)],
        target=target if name else 0.0,
        seed=[],
        rig=rig,
    )
    if shape:
        case.hidden[0].shape |= shape
    if name == "second_barrier":
        lowest = [
            experiment.states(experiment.driven(base), COARSE)[0][:, X].min() for experiment in experiments
        ]
        case.hidden[0].shape["lowest"] = float(min(lowest))
    if name:
        _choose_sizes(case)
    information = _assemble(case)
    if sum(part.impacts for part in information.parts) < 6:
        raise Unreachable
    if name:
        _measure(case, information)
    if long:
        _sample_densely(case, more)
    return case


def _sample_densely(case: Case, random: np.random.Generator) -> None:
    """Records of as many samples as a rig takes: the effect is worth as many standard errors more."""
    experiments = [*case.training, case.held_out]
    planned = sum(one.count for one in experiments)
    case.density = round(float(random.uniform(*MOST_SAMPLES)) / planned)
    for one in experiments:
        one.samples_per_period *= case.density
    case.d_prime = {name: worth * math.sqrt(case.density) for name, worth in case.d_prime.items()}
    case.beyond = {
        name: (worth * math.sqrt(case.density), other) for name, (worth, other) in case.beyond.items()
    }


def _choose_sizes(case: Case) -> None:
    for hidden in case.hidden:
        _choose_size(case, hidden)
    if len(case.hidden) == 1:
        return
    # each once more beside the other
    for hidden in case.hidden:
        _choose_size(case, hidden)
    information = _assemble(case)
    if any(_worth(information, case, hidden) < case.target / 2 for hidden in case.hidden):
        raise Unreachable


def _assemble(case: Case) -> Information:
    """The machine with the effects that have a size, and its information."""
    machine = case.base
    sensor = {}
    for hidden in case.hidden:
        if hidden.size == 0:
            continue
        machine = hidden.on(machine)
        if hidden.name in SENSORS:
            sensor[hidden.name] = hidden.sign * hidden.size
    case.machine = machine
    noise = []
    for experiment in [*case.training, case.held_out]:
        experiment.sensor = sensor
    for experiment in case.training:
        driven = experiment.driven(machine)
        states, _ = experiment.states(driven, COARSE)
        memory = MEMORY if case.colour == "coloured" else 0.0
        noise.append(Noise(sizes_of_noise(states[:, :2], case.level), memory, case.velocity))
    return Information(machine, case.training, noise)


def fitted(case: Case, besides: Hidden) -> tuple[list[str], list[str]]:
    """What is fitted beside the size of an effect: parameters of all records, and of each record."""
    void = {name for hidden in case.hidden for name in hidden.effect.instead_of}
    shared = [name for name in REGIMES[case.regime].unknowns if name not in void]
    for hidden in case.hidden:
        shared += hidden.effect.free
        if hidden is not besides and hidden.size > 0:
            shared.append(hidden.effect.field)
    return shared, [] if case.crank_angle else ["phase"]


def _worth(information: Information, case: Case, hidden: Hidden, *imitators: str) -> float:
    """d' of an effect."""
    shared, separate = fitted(case, hidden)
    unit = 1.0 if hidden.name == "second_barrier" else hidden.size
    return unit * information.surviving(hidden.effect.field, [*shared, *imitators], separate)


def _choose_size(case: Case, hidden: Hidden) -> None:
    """Bisects the logarithm of the size; a jump of the motion may make it unreachable."""
    low, high = (math.log(size) for size in hidden.effect.sizes)
    before = math.log(hidden.size) if hidden.size > 0 else math.inf

    def worth(logarithm: float) -> float:
        hidden.size = math.exp(logarithm)
        try:
            return _worth(_assemble(case), case, hidden)
        except SimulationError:
            return math.inf

    if max(worth(0.1 * low + 0.9 * high), worth(0.3 * low + 0.7 * high)) < case.target:
        raise Unreachable
    guess = before if -math.inf < before < math.inf else 0.5 * (low + high)
    for _ in range(14):
        found = worth(guess)
        if case.target <= found <= MARGIN * case.target:
            return
        if found < case.target:
            low = guess
        else:
            high = guess
        step = math.log(1.08 * case.target / found) if 0 < found < math.inf else 0.0
        guess += math.copysign(1, high - low) * step
        if not min(low, high) < guess < max(low, high) or step == 0:
            guess = 0.5 * (low + high)
        if abs(high - low) < 1e-3:
            break
    raise Unreachable


def _measure(case: Case, information: Information) -> None:
    """d' of the effects in the records, and the part that no other effect imitates."""
    for hidden in case.hidden:
        case.d_prime[hidden.name] = _worth(information, case, hidden)
        own = {hidden.name, *(other.name for other in case.hidden)}
        shared, _ = fitted(case, hidden)
        worst = (math.inf, "")
        for name, columns in IMITATORS.items():
            if "asymmetric_viscous" in columns and "viscous" not in REGIMES[case.regime].friction:
                columns = columns[:1]
            if name in own or any(column in shared or column == hidden.effect.field for column in columns):
                continue
            worst = min(worst, (_worth(information, case, hidden, *columns), name))
        case.beyond[hidden.name] = worst
