# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws cases of a machine with a motor, simulates them by crank.c, and writes base case and records."""

import ctypes
import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from simulator import FOLDER, NOWHERE, SimulationError, compiled

PHI, W, X, V, CURRENT, MAXWELL = range(6)
SCALARS = (
    "mass stiffness damping coulomb stribeck stribeck_velocity upper restitution offset"
    " amplitude second_harmonic inertia bearing_damping bearing_friction"
    " voltage torque_constant resistance inductance maxwell_stiffness maxwell_time inertia_wave"
).split()
RATE = 100.0
GRAVITY = 9.81
TRAINING, HELD_OUT, BASE = ("first.csv", "second.csv"), "held_out.csv", "base.toml"
MACHINES = {
    "free": {"damping": 0.5},
    "impact": {"damping": 0.3, "upper": 0.12, "restitution": 0.7},
    "dry": {"coulomb": 0.25, "damping": 0.2},
}
"""Machines: what differs from the yoke of docs/machines/motor.md."""
EFFECTS = (
    "motor_line", "crank_inertia", "current_lag", "bearing_friction", "coulomb", "viscous",
)  # fmt: skip
MIMICS = ("second_harmonic", "maxwell", "inertia_wave", "late_sensor")
"""What no effect of the catalogue is: nothing may be named."""


class CrankMachine(ctypes.Structure):
    """`struct crank_machine` of crank.c."""

    _fields_ = [(name, ctypes.c_double) for name in SCALARS]


@dataclass
class CrankCase:
    """A case: its machine as it is and as its owner thinks, voltages of the records, sensors."""

    number: int
    machine: str
    effect: str
    base: dict[str, float]
    true: dict[str, float]
    voltages: list[float]
    sensors: tuple[str, ...]
    delay: float = 0.0
    seed: list[int] = field(default_factory=list)


def library() -> ctypes.CDLL:
    """The compiled simulator."""
    found = ctypes.CDLL(str(compiled("crank", [FOLDER / "crank.c"])))
    found.crank_size.restype = ctypes.c_long
    if found.crank_size() != ctypes.sizeof(CrankMachine):
        raise RuntimeError("crank.c and cranks.py differ")
    array = np.ctypeslib.ndpointer
    found.fly_crank.argtypes = [
        ctypes.POINTER(CrankMachine), array(np.float64, ndim=1, flags="C"), ctypes.c_double, ctypes.c_long,
        ctypes.c_long, array(np.float64, ndim=2, flags="C"),
    ]  # fmt: skip
    return found


def simulate(values: dict[str, float], start: np.ndarray, interval: float, count: int) -> np.ndarray:
    """States (count, 6) of a machine at equal intervals."""
    machine = CrankMachine(**{"upper": NOWHERE, **values})
    states = np.empty((count, 6))
    if library().fly_crank(machine, start, interval, count, 10, states) or not np.isfinite(states).all():
        raise SimulationError
    return states


def draw(seed: int, number: int, effect: str = "") -> CrankCase:
    """A case with an effect, a mimic, or nothing ('')."""
    random = np.random.default_rng([seed, 42, number])
    kind = list(MACHINES)[int(random.integers(len(MACHINES)))]
    if effect == "coulomb":
        kind = "free"
    base = {
        "mass": 1.0, "stiffness": 88.8, "amplitude": 0.02 if kind == "free" else 0.03, "inertia": 0.05,
        "bearing_damping": 0.002, "torque_constant": 0.5, "resistance": 5.0, **MACHINES[kind],
    }  # fmt: skip
    true = dict(base)
    sign = float(random.choice([-1.0, 1.0]))
    delay = 0.0
    if effect == "motor_line":
        true["torque_constant"] *= 1 + sign * random.uniform(0.04, 0.1)
        true["resistance"] *= 1 + float(random.choice([-1.0, 1.0])) * random.uniform(0.05, 0.15)
    elif effect == "crank_inertia":
        true["inertia"] *= 1 + sign * random.uniform(0.05, 0.2)
    elif effect == "current_lag":
        true["inductance"] = base["resistance"] * random.uniform(0.01, 0.03)
    elif effect == "bearing_friction":
        true["bearing_friction"] = random.uniform(0.01, 0.03)
    elif effect == "coulomb":
        true["coulomb"] = random.uniform(0.05, 0.15)
    elif effect == "viscous":
        base.pop("damping")
        true["damping"] = random.uniform(0.2, 0.5)
    elif effect == "second_harmonic":
        true["second_harmonic"] = 0.05 * base["amplitude"]
    elif effect == "maxwell":
        true |= {"maxwell_stiffness": 0.05 * base["stiffness"], "maxwell_time": 0.1}
    elif effect == "inertia_wave":
        true["inertia_wave"] = 0.1 * base["inertia"]
    elif effect == "late_sensor":
        delay = 0.004
    # unknowns of the base machine are not those of its owner
    true["stiffness"] *= 1 + random.normal(0, 0.01)
    for name in ("damping", "coulomb"):
        if base.get(name) and effect not in ("viscous",):
            true[name] *= 1 + random.normal(0, 0.05)
    motion = str(random.choice(["x", "x", "a"]))
    crank = str(random.choice(["phi", "phi", "pulse"]))
    more = ("current",) if random.random() < 0.5 else ()
    voltages = [float(one) for one in random.uniform(6.0, 9.0, 3).round(2)]
    return CrankCase(
        number, kind, effect, base, true, voltages, (motion, crank, *more), delay, [seed, number]
    )


def base_text(case: CrankCase) -> str:
    """The case file of the machine as its owner believes it to be."""
    base = case.base
    friction = ["[friction]"]
    dry, viscous = base.get("coulomb", 0.0), base.get("damping", 0.0)
    law = "coulomb_viscous" if dry and viscous else "coulomb" if dry else "viscous" if viscous else "none"
    friction.append(f'law = "{law}"')
    if dry:
        friction.append(f"kinetic_coefficient = {dry / GRAVITY!r}")
    if viscous:
        friction.append(f"damping = {viscous!r}")
    stop = ""
    if "upper" in base:
        stop = f'[contact]\nlaw = "newton"\nrestitution = {base["restitution"]}\nupper = {base["upper"]}\n'
    return f"""[body]
mass = 1.0
gravity = {GRAVITY}
[restoring]
law = "linear"
stiffness = {base["stiffness"]}
{chr(10).join(friction)}
{stop}[drive]
law = "harmonic"
amplitude = {base["amplitude"]}
[motor]
law = "dc"
voltage = 8.0
torque_constant = {base["torque_constant"]}
resistance = {base["resistance"]}
inertia = {base["inertia"]}
bearing_damping = {base["bearing_damping"]}
"""


def write(folder: Path, case: CrankCase, seconds: float = 6.0) -> None:
    """Base case and records, and the truth beside them."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / BASE).write_text(base_text(case))
    random = np.random.default_rng([*case.seed, 7])
    for name, voltage in zip((*TRAINING, HELD_OUT), case.voltages, strict=True):
        (folder / name).write_text(_record(case, voltage, seconds, random))
    truth = {"effect": case.effect, "machine": case.machine, "sensors": case.sensors, "true": case.true}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


def _record(case: CrankCase, voltage: float, seconds: float, random: np.random.Generator) -> str:
    count = int(seconds * RATE)
    start = np.array([0.0, 0.0, 0.02, 0.0, 0.0, 0.0])
    start[PHI], start[W] = random.uniform(0, 2 * np.pi), random.uniform(4, 8)
    true = case.true | {"voltage": voltage}
    begun = simulate(true, start, 1 / RATE, int(0.3 * RATE))[-1]
    states = simulate(true, begun, 1 / RATE, count)
    seen = states
    if case.delay:
        fine = simulate(true, begun, case.delay, count * 2)
        t = np.arange(count) / RATE
        seen = states.copy()
        seen[:, X] = np.interp(t - case.delay, np.arange(len(fine)) * case.delay, fine[:, X])
    columns = {"t": np.arange(count) / RATE}
    motion, crank, *more = case.sensors
    units = ["s"]
    if motion == "x":
        columns["x"] = seen[:, X] + 0.003 * np.std(seen[:, X]) * random.standard_normal(count)
        units.append("m")
    else:
        a = _acceleration(true, states)
        columns["a.body"] = a + 0.01 * np.std(a) * random.standard_normal(count)
        units.append("m/s^2")
    if crank == "phi":
        columns["phi"] = states[:, PHI] + 0.002 * random.standard_normal(count)
        units.append("rad")
    else:
        columns["pulse"] = (np.mod(states[:, PHI] + 1.0, 2 * np.pi) < 0.4).astype(float)
        units.append("1")
    if more:
        i = (voltage - true["torque_constant"] * states[:, W]) / true["resistance"]
        i = states[:, CURRENT] if true.get("inductance") else i
        columns["current"] = i + 0.005 * np.abs(np.mean(i)) * random.standard_normal(count)
        units.append("A")
    head = [f"# units: {', '.join(f'{n} {u}' for n, u in zip(columns, units, strict=True))}"]
    head.append(f"# motor_voltage_v: {voltage}")
    rows = [",".join(f"{value:.10g}" for value in row) for row in zip(*columns.values(), strict=True)]
    return "\n".join([*head, ",".join(columns), *rows]) + "\n"


def _acceleration(true: dict[str, float], states: np.ndarray) -> np.ndarray:
    """Of a body that slips [m/s^2]."""
    foot = true["amplitude"] * np.cos(states[:, PHI])
    foot = foot + true.get("second_harmonic", 0.0) * np.cos(2 * states[:, PHI])
    force = (
        true["stiffness"] * (foot - states[:, X])
        - true.get("damping", 0.0) * states[:, V]
        - states[:, MAXWELL]
    )
    return (force - true.get("coulomb", 0.0) * np.sign(states[:, V])) / true["mass"]
