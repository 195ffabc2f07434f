# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The machines of the second table: each is the published one with one change."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from machine import SOURCE, V0, X0, start_points

if TYPE_CHECKING:
    from pathlib import Path

BACKLASH = ((-0.1, 0.1), (-1.0, 1.0))
CHAIN = ((-0.2, 0.05), (-2.0, 2.0))
KELVIN_VOIGT = {"law": "kelvin_voigt", "stiffness": 1e5, "damping": 100.0, "upper": "1.1 m"}
COULOMB = "basin_coulomb"


@dataclass
class Checks:
    """Starts in quadruple precision and how many of them a process takes, starts in lanes and one by one, and
    the side of the map whose labels are compared."""

    quadruple: int
    share: int
    single: int
    side: int


EXACT = Checks(100, 25, 10_000, 150)
ADAPTIVE = Checks(2, 1, 300, 60)
CHAINS = Checks(30, 0, 5_000, 60)


@dataclass
class Row:
    """A machine: what it is called, what is changed, and the rate that is its goal [trajectories/s/core]."""

    key: str
    title: str
    goal: int
    changes: dict = field(default_factory=dict)
    """Tables that replace those of the example, or effects that are added."""
    example: str = COULOMB
    linear: bool = False
    """Linear between its events: bar on its accuracy 1e-11, else 1e-10."""
    fast: tuple[int, int] = (30, 100)
    """Two maps of so many starts along either axis; their difference is timed."""
    sizes: Checks | None = None
    bodies: int = 0
    """Number of bodies of a chain (see `chain`) in place of the example; 0: the example."""

    def checks(self, quick: bool) -> Checks:
        """What is checked on how much."""
        sizes = self.sizes or (EXACT if self.linear else ADAPTIVE)
        return Checks(8, 1, min(sizes.single, 500), min(sizes.side, 50)) if quick else sizes

    def starts(self, count: int) -> np.ndarray:
        """Start points."""
        if self.example == COULOMB and not self.bodies:
            return start_points(count)
        (x_low, x_high), (v_low, v_high) = CHAIN if self.bodies else BACKLASH
        shares = start_points(count) / (X0[1], V0[1])
        return np.column_stack(
            [x_low + (x_high - x_low) * shares[:, 0], v_low + (v_high - v_low) * (0.5 + 0.5 * shares[:, 1])]
        )

    def write(self, folder: Path) -> Path:
        """The case file."""
        example = SOURCE / "examples" / f"{self.example}.toml"
        case = chain(self.bodies) if self.bodies else tomllib.loads(example.read_text())
        for name, change in self.changes.items():
            case[name] = change
        path = folder / f"{self.key}.toml"
        path.write_text(toml(case))
        return path

    @property
    def has_peers(self) -> bool:
        """The drivers of the peers know one body, and neither tables nor free play."""
        return (
            self.example == COULOMB
            and not self.bodies
            and not any(
                name.endswith("_curve") or name in ("backlash", "cubic_damping")
                for name in self.changes.get("effect", {})
            )
        )


def chain(bodies: int) -> dict:
    """Bodies on springs in a row: the first rubs on the ground, the last is driven and meets a stop."""
    names = [f"body_{i + 1}" for i in range(bodies)]
    springs = [names[max(0, i - 1) : i + 1] for i in range(bodies)]
    return {
        "title": f"Chain of {bodies}",
        "body": {name: {"mass": 1.0} for name in names},
        "spring": {
            f"spring_{i + 1}": {"between": ends, "stiffness": 400.0, "damping": 0.2}
            for i, ends in enumerate(springs)
        },
        "friction": {"base": {"between": names[:1], "force": 2.0}},
        "contact": {"stop": {"between": names[-1:], "law": "newton", "restitution": 0.8, "upper": 0.05}},
        "drive": {"shaker": {"law": "force", "body": names[-1], "amplitude": 8.0, "frequency": 8.0}},
        "watch": {"body": names[-1]},
        "run": {"duration": 50.0, "window": 12.5},
        "axis": [
            {"name": name, "from": low, "to": high, "count": 40}
            for name, (low, high) in zip(("x0", "v0"), CHAIN, strict=True)
        ],
    }


def effect(name: str, **parameters: float | list[float]) -> dict:
    """One effect."""
    return {"effect": {name: parameters}}


ROWS = (
    Row("coulomb", "Coulomb friction", 300_000, linear=True, fast=(100, 400)),
    Row(
        "viscous",
        "viscous friction",
        300_000,
        {"friction": {"law": "viscous", "damping": 0.2}},
        linear=True,
        fast=(100, 400),
    ),
    Row("ripple", "drive ripple", 200_000, effect("drive_ripple", sine=0.05), linear=True, fast=(100, 400)),
    Row(
        "slope",
        "restitution falls linearly",
        150_000,
        effect("restitution_slope", slope=0.03),
        linear=True,
        fast=(100, 400),
    ),
    Row(
        "power",
        "restitution falls as a power",
        150_000,
        {"contact": {"law": "newton_power", "restitution": 0.7, "yield_speed": 0.5, "upper": "1.1 m"}},
        linear=True,
        fast=(100, 400),
    ),
    Row(
        "viscoelastic",
        "viscoelastic restitution",
        150_000,
        {"contact": {"law": "newton_viscoelastic", "first": 0.4, "second": 0.096, "upper": "1.1 m"}},
        linear=True,
        fast=(100, 400),
    ),
    Row(
        "curve",
        "restitution by a table",
        150_000,
        effect("restitution_curve", speed=[0.0, 1.0, 2.0, 4.0], change=[0.0, -0.05, -0.08, -0.1]),
        linear=True,
        fast=(100, 400),
    ),
    Row(
        "kelvin_voigt",
        "Kelvin-Voigt wall, tension",
        50_000,
        {"contact": KELVIN_VOIGT | {"tension": 1}},
        linear=True,
        fast=(50, 200),
    ),
    Row(
        "kelvin_voigt_cut",
        "Kelvin-Voigt wall, no tension",
        50_000,
        {"contact": KELVIN_VOIGT | {"tension": 0}},
        linear=True,
        sizes=Checks(2, 1, 5_000, 150),
        fast=(50, 200),
    ),
    Row(
        "hunt_crossley",
        "Hunt-Crossley wall, 1e6 N/m^1.5",
        10_000,
        effect("compliant_contact", stiffness=1e6, damping=0.1),
        fast=(8, 16),
    ),
    Row("cubic", "cubic spring, 20 N/m^3", 10_000, effect("cubic_spring", stiffness=20.0)),
    Row("drag", "quadratic drag, 0.05 N s^2/m^2", 10_000, effect("quadratic_drag", coefficient=0.05)),
    Row("dahl", "Dahl's friction, 300 N/m", 5_000, effect("dahl", stiffness=300.0)),
    Row(
        "position",
        "position-dependent friction",
        10_000,
        effect("position_dependent_friction", slope=0.2),
        linear=True,
        sizes=Checks(1, 1, 1_000, 200),
        fast=(50, 200),
    ),
    Row(
        "asymmetric",
        "asymmetric friction",
        10_000,
        effect("asymmetric_friction", coulomb=0.3, viscous=0.1),
        linear=True,
        sizes=Checks(1, 1, 1_000, 200),
        fast=(50, 200),
    ),
    Row(
        "friction_curve",
        "friction by a table of the speed",
        10_000,
        effect(
            "friction_curve",
            speed=[0.0, 0.5, 2.0, 5.0],
            upwards=[0.2, 0.0, 0.1, 0.4],
            downwards=[0.1, 0.0, 0.2, 0.3],
        ),
    ),
    Row(
        "spring_curve",
        "spring by a table",
        10_000,
        effect("spring_curve", extension=[-1.0, 0.0, 1.0], force=[-5.0, 0.0, 6.0]),
    ),
    Row("backlash", "free play of the spring, 50 mm", 10_000, effect("backlash", gap=0.05)),
    Row("cubic_damping", "cubic damping, 0.05 N s^3/m^3", 10_000, effect("cubic_damping", coefficient=0.05)),
    Row("stribeck", "Stribeck effect, 0.2 m/s", 10_000, effect("stribeck", excess=0.5, velocity=0.2)),
    Row(
        "chain_2",
        "chain of 2, friction and a stop",
        60_000,
        linear=True,
        bodies=2,
        fast=(40, 160),
        sizes=CHAINS,
    ),
    Row(
        "chain_4",
        "chain of 4, friction and a stop",
        25_000,
        linear=True,
        bodies=4,
        fast=(40, 120),
        sizes=CHAINS,
    ),
    Row(
        "chain_8",
        "chain of 8, friction and a stop",
        8_000,
        linear=True,
        bodies=8,
        fast=(30, 90),
        sizes=CHAINS,
    ),
    Row(
        "pair",
        "two bodies with backlash, 60 s",
        30_000,
        example="basin_pair_backlash",
        fast=(16, 48),
        sizes=Checks(0, 0, 1000, 61),
    ),
)


def toml(table: dict, prefix: str = "") -> str:
    """A case file of a dictionary."""
    plain = {key: value for key, value in table.items() if not is_table(value)}
    text = "".join(f"{key} = {literal(value)}\n" for key, value in plain.items())
    for key, value in table.items():
        for part in value if isinstance(value, list) and is_table(value) else [value]:
            if isinstance(part, dict):
                mark = "[[{}]]" if isinstance(value, list) else "[{}]"
                text += "\n" + mark.format(prefix + key) + "\n" + toml(part, f"{prefix}{key}.")
    return text


def is_table(value: object) -> bool:
    """A table, or a list of them."""
    return isinstance(value, dict) or (
        isinstance(value, list) and any(isinstance(part, dict) for part in value)
    )


def literal(value: object) -> str:
    """A value."""
    return (
        f'"{value}"'
        if isinstance(value, str)
        else str(value).lower()
        if isinstance(value, bool)
        else repr(value)
    )
