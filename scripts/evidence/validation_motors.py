#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines with a motor: numbers of another program (validation_motors_numbers.py), ours, difference.

Run by itself it prints the table or, with --write, puts it into docs/validation.md in place of the one there;
the exit code is 1 where a number differs.
"""

import os
import sys
from pathlib import Path

import numpy as np
import separatrix as sx
import validation_motors_numbers as theirs
from evidence_program import Program
from evidence_rows import COLUMNS, SOURCE, Row, arguments, show, table_of, version_of
from scipy.optimize import brentq, minimize_scalar
from separatrix import open_result
from separatrix.open import flag_names
from validation_motors_cycles import Cycle, closed, doubling, on_section
from validation_sections import write_section

EXAMPLES = SOURCE / "examples"
#: The heading of the section in the page.
HEADING = "Machines with a motor"
FILES = {"I": "motor_impact", "P": "motor_lever", "RI": "motor_unbalance"}
DRIVES = {"Y": 'law = "harmonic", amplitude = 0.02', "R": 'law = "unbalance", moment = 0.02'}
BODY = """\
body = {{ mass = 1, gravity = 1 }}
restoring = {{ law = "linear", stiffness = 88.82643960980423 }}
friction = {{ law = "viscous", damping = 0.5 }}
drive = {{ {drive} }}
start = {{ x0 = 0.02, v0 = 0 }}
run = {{ duration = 120, window = 20 }}
"""
MOTOR = "[motor]\n{law}inertia = 0.05\nbearing_damping = 0.002\n"
WITHOUT_INDUCTANCE = 'law = "dc"\nvoltage = 7\ntorque_constant = 0.5\nresistance = 5\n'
VALUE = {"P": "motor.no_load_speed"}
# the difference that their digits or their method allow
BAR, OF_MULTIPLIERS, OF_LIMITS, OF_PASSING = 1e-9, 1e-9, 1e-8, 1e-7


def case_of(machine: str, value: float | str) -> sx.Case:
    """The case of a machine at a value of its parameter, or with another motor."""
    path, law = VALUE.get(machine, "motor.voltage"), WITHOUT_INDUCTANCE
    if machine in FILES:
        return sx.load(EXAMPLES / f"{FILES[machine]}.toml").with_({path: value})
    if isinstance(value, str):
        law = value
    case = sx.Case.from_text(BODY.format(drive=DRIVES[machine]) + MOTOR.format(law=law))
    return case if isinstance(value, str) else case.with_({path: float(value)})


def row(machine: str, what: str, number: object, ours: object, bar: float = BAR, **more: object) -> Row:
    """A row of a machine."""
    return Row(machine, what, number, ours, bar, digits=15, **more)


def parts(values: tuple[complex, ...]) -> list[float]:
    """Real parts of multipliers and, of pairs, imaginary ones."""
    return [part for value in values for part in ((value.real, value.imag) if value.imag else (value.real,))]


def nearest(found: np.ndarray, wanted: tuple[complex, ...]) -> list[float]:
    """The multipliers that are nearest to others, in their order, as `parts`."""
    chosen = [found[np.argmin(np.abs(found - one))] for one in wanted]
    return parts(
        tuple(one if abs(two.imag) else one.real + 0j for one, two in zip(chosen, wanted, strict=True))
    )


def cycles(_program: Program) -> list[Row]:
    """Cycles by Newton's method on segments of the library, their multipliers and impact speeds."""
    rows = []
    for machine, value, name, word, speed, point, multipliers, hit in theirs.CYCLES:
        case = case_of(machine, value)
        found = closed(case.model, np.array(point), 2 * np.pi / speed)
        about = f"cycle {name}" + ("" if isinstance(value, str) else f" at {value:g}")
        rows += [
            row(machine, f"{about}: mean speed (rad/s)", speed, found.speed),
            row(machine, f"{about}: x, v, w" + (", own state" if len(point) > 3 else ""), point, found.point),
            row(
                machine,
                f"{about}: multipliers",
                parts(multipliers),
                nearest(found.multipliers, multipliers),
                OF_MULTIPLIERS,
            ),
        ]
        if hit is not None:
            rows.append(row(machine, f"{about}: impact speed (m/s)", hit, found.impact_speed))
        seen = word_of(case, found)
        if seen != word:
            raise ValueError(f"{machine}, {name}: word {seen} for {word}")
    return rows


def motion_of(case: sx.Case, point: np.ndarray, duration: float, samples: int = 2):
    """A motion from x, v, w at crank angle 0."""
    return sx.trajectory(
        case.with_({"motor.crank_speed": float(point[2])}), float(point[0]), float(point[1]), 0.0,
        duration=duration, samples=samples,
    )  # fmt: skip


def word_of(case: sx.Case, found: Cycle) -> str:
    """Events of a turn: T turning point, I impact, S section at the end."""
    if len(found.point) > 3:  # a trajectory has no start with a current
        return "TTS"
    motion = motion_of(case, found.point, 2 * np.pi / found.speed - 1e-6)
    names = flag_names(motion["event_kind"])
    letters = {"turning_point": "T", "impact_upper": "I"}
    return "".join(letters.get(names[int(kind)], "?") for kind in motion["event_kind"].values) + "S"


def events_of(motion) -> list[tuple]:
    """Kind, time, crank angle and speed, x, v before of the events of a motion."""
    names = flag_names(motion["event_kind"])
    columns = ("time", "crank_angle", "crank_speed", "x", "v_before")
    values = np.column_stack([motion[f"event_{name}"].values for name in columns])
    return [(names[int(kind)], *line) for kind, line in zip(motion["event_kind"].values, values, strict=True)]


def stick(_program: Program) -> list[Row]:
    """The cycle of I at 1.6 V, on which the motion settles, and when its body rests."""
    case = case_of("I", 1.6)
    turn = 2 * np.pi / theirs.STICK["mean speed (rad/s)"]
    motion = motion_of(case, (0.0274, 0.0, 2.9952), 400 * turn)
    last = [line for line in events_of(motion) if line[0] in ("stick", "release")][-10:]
    first = next(k for k in range(5) if last[k][0] == "stick" and last[k][4] > 0)
    one, again = last[first], last[first + 4]
    speed = 2 * np.pi / (again[1] - one[1])
    start = np.array([one[4], one[2], 0.0, one[3], 0.0])
    # the next passage of the crank through 0
    ahead = -one[2] % (2 * np.pi)
    duration, end = on_section(case.model, start, one[2] + ahead, ahead / speed)
    section = one[1] + duration
    instants = [line[1] - section for line in last[first + 1 : first + 4]] + [again[1] - section]
    ours = (speed, (end[0], end[2], end[3]), instants)
    about = zip(theirs.STICK.items(), ours, strict=True)
    return [row("I", f"cycle with rests at 1.6: {what}", number, mine) for (what, number), mine in about]


def limits(program: Program) -> list[Row]:
    """Folds, Neimark-Sacker points and grazes by the command `branches`, with the mean speed there."""
    rows = []
    for machine, what, ends, label, value, speed in theirs.LIMITS:
        case = program.folder / f"{machine}_{ends[0]}.toml"
        case.write_text(
            case_of(machine, 7.0 if machine in DRIVES else 8.0 if machine == "I" else 14.0).to_toml()
        )
        options = ("--parameter", VALUE.get(machine, "motor.voltage"), "--from", repr(ends[0]))
        options += ("--to", repr(ends[1]), "--searches", "2")
        with open_result(program.run("branches", case, options=options)) as result:
            names = sx.decode_flags(result["label"]).values
            at = np.flatnonzero(names == label)
            at = at[np.argmin(np.abs(result["parameter"].values[at] - value))]
            ours = float(result["parameter"][at])
            mean = 2 * np.pi * float(result["period"][at] / result["cycle_time"][at])
        rows.append(row(machine, what, value, ours, OF_LIMITS))
        # the speed at a fold is known to the root of the distance from it
        rows.append(row(machine, f"{what.split(':')[0]}: mean speed (rad/s)", speed, mean, 1e-6))
    return rows


def doubled(_program: Program) -> list[Row]:
    """The period doubling of P: a multiplier of -1 of the cycle TIS, by Newton's method."""
    value, speed, point = theirs.DOUBLING
    ours, found = doubling(lambda at: case_of("P", at).model, np.array(point), value, 2 * np.pi / speed)
    return [
        row("P", "period doubling: no-load speed (rad/s)", value, ours, OF_LIMITS),
        row("P", "period doubling: mean speed (rad/s)", speed, found.speed, OF_LIMITS),
        row("P", "period doubling: x, v, w", point, found.point, OF_LIMITS),
    ]


def averaged(_program: Program) -> list[Row]:
    """The balance of torques with the load of the ideal drive, whose work the trajectory states."""

    def voltage(speed: float) -> float:
        return 10 * (0.052 * speed + load_of(speed))

    folds = [
        voltage(minimize_scalar(lambda w, s=sign: -s * voltage(w), bracket=near, tol=1e-12).x)
        for sign, near in ((1, (9.38, 9.43, 9.46)), (-1, (10.0, 10.3, 10.6)))
    ]
    speeds = [brentq(lambda w: voltage(w) - 7, *near, xtol=1e-13) for near in ((9, 9.4), (9.5, 10), (13, 14))]
    return [
        row("Y", f"averaged, {what}", number, ours, OF_LIMITS)
        for (what, number), ours in zip(theirs.AVERAGED.items(), (*folds, speeds), strict=True)
    ]


def load_of(speed: float) -> float:
    """Mean torque against the ideal drive of Y [N m]: its work in a period of the steady motion over 2 pi."""
    text = BODY.format(drive=f"{DRIVES['Y']}, frequency = {float(speed)!r}")
    response = 88.82643960980423 * 0.02 / (88.82643960980423 - speed**2 + 0.5j * speed)
    motion = sx.trajectory(
        sx.Case.from_text(text), response.real, (1j * speed * response).real, 0.0,
        duration=2 * np.pi / speed, samples=16,
    )  # fmt: skip
    return float(motion.attrs["energy_put_in"]) / (2 * np.pi)


def outcome(voltage: float) -> str:
    """Whether Y from standstill passes the resonance."""
    case = case_of("Y", voltage).with_({"run.average": "window"})
    return sx.trajectory(case, samples=2).attrs["crank_outcome"]


def passing(_program: Program) -> list[Row]:
    """The lowest voltage at which Y passes from standstill, by bisection of the outcome."""
    low, high = theirs.PASSING - 1e-6, theirs.PASSING + 1e-6
    if (outcome(low), outcome(high)) != ("captured", "passed"):
        raise ValueError(f"the threshold is not between {low} and {high} V")
    while high - low > 1e-10:
        middle = (low + high) / 2
        low, high = (middle, high) if outcome(middle) == "captured" else (low, middle)
    what = "passes the resonance from standstill: U (V)"
    return [row("Y", what, theirs.PASSING, (low + high) / 2, OF_PASSING)]


def basin(program: Program) -> list[Row]:
    """How many of 41 x 41 starts of I end on the free cycle."""
    with open_result(program.run("basin", EXAMPLES / "motor_impact.toml")) as result:
        speed = result.separatrix.of_attractor("crank_speed").values
    fast = int((speed > 4.5 * np.pi).sum())
    return [row("I", f"starts of {speed.size} that end fast", theirs.FAST_STARTS, fast, 0)]


def chaos(_program: Program) -> list[Row]:
    """Exponents of I at 5.25 V within three standard errors of the two, by `stability`."""
    numbers, errors, impacts, speed = theirs.CHAOS
    found = sx.stability(case_of("I", 5.25), 0.0, 0.0, 0.0, periods=20000)
    rows = [
        row("I", f"5.25 V: exponent {k} (1/s)", number, mine, 3 * float(np.hypot(error, ours)))
        for k, (number, error, mine, ours) in enumerate(
            zip(numbers, errors, found.exponents, found.errors, strict=True), 1
        )
    ]
    rows.append(row("I", "5.25 V: impacts per turn", impacts, found.impacts / found.periods, 0.02))
    mean = mean_speed_of(case_of("I", 5.25))
    return [*rows, row("I", "5.25 V: mean speed (rad/s)", speed, mean, 0.02)]


def mean_speed_of(case: sx.Case) -> float:
    """Mean speed over 2000 s after 300 s, without a search for a cycle."""
    motion = sx.trajectory(case.with_({"run.average": "window"}), 0.0, 0.0, 0.0, duration=2300.0, samples=2)
    time, angle = motion["time"].values, motion["crank_angle"].values
    begin = np.searchsorted(time, 300.0)
    return float((angle[-1] - angle[begin]) / (time[-1] - time[begin]))


KINDS = {"turning_point": "T", "impact_upper": "I", "stick": "R"}


def events(_program: Program) -> list[Row]:
    """Lists of events: turning points, impacts, rests, sections; the largest difference of a list."""
    rows = []
    for (machine, value, start), text in theirs.EVENTS.items():
        wanted = [(line.split()[0], *map(float, line.split()[1:])) for line in text.strip().splitlines()]
        case = case_of(machine, value)
        motion = motion_of(case, start, wanted[-1][1] + 0.6)
        found = []
        for kind, *numbers in events_of(motion):
            if kind == "release":
                found[-1][-1] = numbers[0]
            else:
                found.append([KINDS[kind], *numbers])
        if any(kind == "S" for kind, *_ in wanted):
            found = sorted([*found, *sections_of(case, start, found)], key=lambda line: line[1])
        found = found[: len(wanted)]
        if [line[0] for line in found] != [line[0] for line in wanted]:
            raise ValueError(f"{machine} at {value}: events {[line[0] for line in found]}")
        away = max(np.abs(np.array(a[1:]) - b[1:]).max() for a, b in zip(found, wanted, strict=True))
        what = f"the first {len(wanted)} events at {value:g}: largest difference (s, rad, rad/s, m, m/s)"
        rows.append(row(machine, what, 0.0, away))
    return rows


def sections_of(case: sx.Case, start: tuple, found: list) -> list[list]:
    """Passages of the crank through 0 among the events of a motion."""
    rows, (x, v, w) = [], start
    for turns in range(1, 1 + int(found[-1][2] // (2 * np.pi))):
        guess = np.interp(2 * np.pi * turns, [0, *(e[2] for e in found)], [0, *(e[1] for e in found)])
        time, end = on_section(case.model, np.array([x, 0, v, w, 0.0]), 2 * np.pi * turns, guess)
        rows.append(["S", time, end[1], end[3], end[0], end[2]])
    return rows


def run_up(_program: Program) -> list[Row]:
    """P from standstill, 50 s: counts, end, energies."""
    motion = motion_of(case_of("P", 14.0).with_({"run.average": "window"}), (0.4, 0.0, 0.0), 50.0)
    about = motion.attrs
    kinds = [name for name, *_ in events_of(motion)]
    angle = float(motion["crank_angle"][-1])
    gained = about["energy_end"] - about["energy_start"]
    ours = (
        (kinds.count("impact_upper"), int(angle // (2 * np.pi))),
        (angle, *(float(motion[name][-1]) for name in ("crank_speed", "x", "v"))),
        (
            *(
                about[name]
                for name in ("energy_put_in", "energy_lost_to_friction", "energy_lost_to_contacts")
            ),
            gained,
        ),
    )
    rows = [
        row("P", f"from standstill: {what}", number, mine)
        for (what, number), mine in zip(theirs.RUN_UP.items(), ours, strict=True)
    ]
    return [
        *rows,
        row("P", "from standstill: residual of the energy (J)", 0.0, about["energy_closing_error"], 1e-8),
    ]


def mechanism(_program: Program) -> list[Row]:
    """Foot, inertia and derivatives by the angle; second ones by differences of ours."""
    case = case_of("P", 14.0)
    weights = np.array([1, -8, 0, 8, -1]) / 12e-3
    rows = []
    for angle, number in theirs.MECHANISM.items():
        near = np.array([mechanism_at(case, angle + 1e-3 * step) for step in (-2, -1, 0, 1, 2)])
        foot, slope, inertia = near[2]
        _, curve, change = weights @ near
        what = f"mechanism at {angle:g} rad: x_A, x_A', x_A'', J, J'"
        rows.append(row("P", what, number, (foot, slope, curve, inertia, change)))
    return rows


def mechanism_at(case: sx.Case, angle: float) -> tuple[float, float, float]:
    """Position of the foot, its derivative and the inertia at a crank angle, by torque and energies."""
    turning = case.with_({"motor.crank_speed": 1.0})
    # above the foot the spring is compressed
    motion = sx.trajectory(turning, 1.0, 0.0, angle % (2 * np.pi), duration=1e-3, samples=2)
    stiffness = case.resolved["restoring"]["stiffness"]
    extension = -np.sqrt(2 * float(motion["potential_energy"][0]) / stiffness)
    foot = extension + 1.0 - case.resolved["restoring"]["free_length"]
    return (
        foot,
        float(motion["load_torque"][0]) / (stiffness * extension),
        2 * float(motion["kinetic_energy"][0]),
    )


def ideal_limit(_program: Program) -> list[Row]:
    """The cycle of P with impacts as its inertia grows, and that of the ideal drive."""
    rows, point = [], np.array([*theirs.IDEAL, theirs.IDEAL_SPEED])
    for inertia, number in theirs.IDEAL_LIMIT.items():
        torque = inertia * theirs.IDEAL_RATE * theirs.IDEAL_SPEED
        case = case_of("P", theirs.IDEAL_SPEED).with_(
            {"motor.stall_torque": torque, "motor.inertia": inertia}
        )
        point = closed(case.model, point, 2 * np.pi / theirs.IDEAL_SPEED).point
        for k, name in enumerate(("x (m)", "v (m/s)")):
            law = by_their_law(k, inertia)
            rows.append(
                row("P", f"inertia {inertia:g} kg m^2: {name}", number[k], float(point[k]), closed=law)
            )
    away = np.abs(point[:2] - theirs.IDEAL).max()
    return [*rows, row("P", "the last from the ideal drive (m, m/s)", 0.0, away, 3e-8)]


def by_their_law(number: int, inertia: float) -> float:
    """A number by (a + b/J)/J from the ideal drive, with a and b from theirs at the two least inertias."""
    (small, large), ideal = list(theirs.IDEAL_LIMIT)[:2], theirs.IDEAL[number]
    of_small, of_large = ((theirs.IDEAL_LIMIT[one][number] - ideal) * one for one in (small, large))
    slope = (of_small - of_large) / (1 / small - 1 / large)
    return ideal + (of_large + slope * (1 / inertia - 1 / large)) / inertia


COMPUTED = (
    cycles, stick, limits, doubled, averaged, passing, basin, chaos, events, run_up, mechanism, ideal_limit,
)  # fmt: skip


def numbers(program: Program) -> list[Row]:
    """All of them."""
    found = []
    for compute in COMPUTED:
        print(f"validation_motors: {compute.__name__}", file=sys.stderr, flush=True)
        found += compute(program)
    return found


def fields(found: list[Row]) -> dict[str, object]:
    """What the template names."""
    heads = ("machine", *COLUMNS)
    return {"motors": table_of(found, ("source", *COLUMNS), heads), "motor_count": len(found)}


def main() -> int:
    """Print the rows or write them."""
    parser = arguments(__doc__, "validation")
    parser.add_argument("--json", action="store_true", help="a line of JSON for each row")
    parser.add_argument("--write", action="store_true", help="into docs/validation.md")
    options = parser.parse_args()
    program = Program(options.build.resolve(), Path(options.out).resolve() / "motors")
    os.environ["SEPARATRIX_PROGRAM"] = str(program.path)
    os.environ["SEPARATRIX_LIBRARY"] = str(options.build.resolve() / "lib" / "libseparatrix.so")
    found = numbers(program)
    if options.write:
        commit = version_of(program.path)["commit"]
        write_section(HEADING, **fields(found), commit=commit)
    return show(found, options.json)


if __name__ == "__main__":
    sys.exit(main())
