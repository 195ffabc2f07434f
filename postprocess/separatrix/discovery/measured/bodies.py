# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a machine of several bodies: coordinates, joints between them, and locations where forces act.

A location is a pair of bodies, or a body and the ground, between which a joint may lie; its coordinate is
second minus first. Joints at the same location share the forces there.
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from separatrix.cases import toml
from separatrix.errors import SeparatrixError
from separatrix.library import Model

KINDS = ("spring", "friction", "contact")
"""Tables of a case that are joints."""
GROUND = "ground"
BODY, CRANK = CRANKED = "body", "crank"
"""Coordinates of a machine with a motor."""
# tables of a case that a base machine does not need
_OF_RUNS = ("axis", "sweep", "record", "grid", "refine")


@dataclass(frozen=True)
class Joint:
    """A joint of the case: its path, as `spring.coupling`, its law, ends, row over the coordinates, table."""

    path: str
    law: str
    ends: tuple[str, str]
    row: np.ndarray
    table: Mapping[str, object]


@dataclass(frozen=True)
class Location:
    """Two bodies, or one on the ground: name, ends, row over the coordinates, paths of the joints there."""

    name: str
    ends: tuple[str, str]
    row: np.ndarray
    joints: tuple[str, ...]

    def text(self) -> str:
        """In words."""
        first, second = self.ends
        where = f"on {second}" if first == GROUND else f"between {first} and {second}"
        return f"{where} ({', '.join(self.joints)})" if self.joints else f"{where} (no joint in the case)"


@dataclass(frozen=True)
class Structure:
    """A machine of several bodies as its case defines it."""

    names: tuple[str, ...]
    mass: np.ndarray
    joints: tuple[Joint, ...]
    locations: tuple[Location, ...]
    watched: str
    # bodies that a drive acts on
    driven: tuple[str, ...]

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.names)

    def joint(self, path: str) -> Joint:
        """The joint with a path."""
        return next(one for one in self.joints if one.path == path)

    def location(self, name: str) -> Location:
        """The location with a name."""
        return next(one for one in self.locations if one.name == name)


def is_structure(model: Model) -> bool:
    """Whether a machine has coordinates by name."""
    return "body.in_sequence" in model.parameters


def has_motor(model: Model) -> bool:
    """Whether a motor drives a machine: its coordinates are a body and a crank."""
    return "motor.inertia" in model.parameters


def is_pair(model: Model) -> bool:
    """Whether a machine is a frictional pair."""
    return "body.driven_mass" in model.parameters


@lru_cache(maxsize=256)
def structure_of(model: Model) -> Structure:
    """The structure of a model; one that no base machine can have is refused."""
    case = tomllib.loads(model.to_text({}))
    if has_motor(model):
        return _with_crank(case)
    if case.get("structure"):
        raise SeparatrixError(
            "structure: found a structure of matrices or modes, allowed for a base machine bodies "
            "and joints: "
            "its inner coordinates have no joints of their own"
        )
    names = model.coordinates
    bodies = [name for name, table in case["body"].items() if isinstance(table, dict)]
    joints = []
    for kind in KINDS:
        for name, table in case.get(kind, {}).items():
            ends = tuple(table["between"])
            joints.append(Joint(f"{kind}.{name}", table["law"], ends, _row(ends, names), table))
    locations: dict[tuple[str, str], list[str]] = {}
    for joint in joints:
        locations.setdefault(_sorted(joint.ends, bodies), []).append(joint.path)
    for name in names:
        locations.setdefault((GROUND, name), [])
    found = []
    for ends, paths in locations.items():
        row = _row(ends, names)
        if row.any():
            name = ends[1] if ends[0] == GROUND else "-".join(ends)
            found.append(Location(name, ends, row, tuple(paths)))
    mass = np.array([case["body"][name].get("mass", case["body"][name].get("inertia")) for name in names])
    watched = case.get("watch", {}).get("body", names[0])
    drives = case.get("drive", {}).values()
    driven = tuple(dict.fromkeys(one["body"] for one in drives if isinstance(one, dict) and "body" in one))
    return Structure(names, mass, tuple(joints), tuple(found), watched, driven)


def _with_crank(case: dict) -> Structure:
    """A body and the crank of a motor; the laws of the body and the motor are joints to the ground."""
    rows = dict(zip(CRANKED, np.eye(2), strict=True))
    joints = [
        Joint(name, case[name]["law"], (GROUND, body), rows[body], case[name])
        for name, body in (("restoring", BODY), ("friction", BODY), ("contact", BODY), ("motor", CRANK))
    ]
    locations = tuple(
        Location(body, (GROUND, body), row, tuple(one.path for one in joints if one.ends[1] == body))
        for body, row in rows.items()
    )
    mass = np.array([case["body"]["mass"], case["motor"]["inertia"]])
    return Structure(CRANKED, mass, tuple(joints), locations, BODY, ())


def contact_paths(model: Model) -> tuple[str, ...]:
    """Paths of the joints that are contacts, in the order in which impacts count them."""
    if has_motor(model):
        return ("contact",)
    return tuple(name if "." in name else f"contact.{name}" for name in model.contacts)


def _sorted(ends: tuple[str, str], bodies: list[str]) -> tuple[str, str]:
    """Ends of a joint in the order of the case, the ground first."""
    order = [GROUND, *bodies]
    return tuple(sorted(ends, key=order.index))


def _row(ends: tuple[str, str], names: tuple[str, ...]) -> np.ndarray:
    """Second minus first; ground and bodies whose motion is given are no coordinates."""
    first, second = ends
    return np.array([(name == second) - (name == first) for name in names], float)


def edited(model: Model, change: Callable[[dict], None]) -> Model:
    """The model whose case a function has changed, without tables of runs if these no longer fit."""
    case = tomllib.loads(model.to_text({}))
    change(case)
    try:
        return _model(case)
    except SeparatrixError:
        return _model({key: value for key, value in case.items() if key not in _OF_RUNS})


def _model(case: dict) -> Model:
    return Model.from_text("\n".join(f"{key} = {toml(value)}" for key, value in case.items()) + "\n")


def pair_as_structure(model: Model) -> Model:
    """Return a frictional pair as bodies and joints; one that no base machine can be is refused."""
    case = tomllib.loads(model.to_text({}))
    law, impulse = case["drive"]["law"], case["body"].get("impulse")
    if law not in ("none", "force", "sine") or impulse:
        raise SeparatrixError(
            f"drive.law: found {law}{' with an impulse' if impulse else ''}, allowed for a pair as "
            "base machine none, force, sine, without an impulse"
        )
    return model.written_out()
