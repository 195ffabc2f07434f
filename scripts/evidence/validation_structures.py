#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines of several bodies beside closed forms, other programs and an independent simulator.

The cases are in examples/validation/structures/. Run by itself it prints the tables; the exit code is 1 where
a number differs. A motion with one impact per drive period of a linear structure solves a quadratic for any
number of coordinates, which gives twelve digits.
"""

import sys
from math import sin

import h5py
import numpy as np
from evidence_program import Program
from evidence_rows import SOURCE, Row, arguments, show
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from validation_structures_bouncing import bouncing, rattle
from validation_structures_impacts import COMPUTED as IMPACTS
from validation_structures_orbits import orbits
from validation_structures_others import COMPUTED as BENCHMARKS
from validation_structures_steps import simulated

sys.path.insert(0, str(SOURCE / "tests" / "referee"))
from structures import Friction, Structure  # noqa: E402

CLOSED = "closed form"


def crossing(function, points: list[float], level: float) -> float:
    """Where a smooth function reaches a level, extrapolated from a few points by a polynomial."""
    middle = float(np.mean(points))
    values = [function(p) for p in points]
    fit = np.polynomial.Polynomial.fit([p - middle for p in points], values, len(points) - 1)
    roots = (fit - level).convert().roots()
    return middle + float(min(roots[abs(roots.imag) < 1e-9].real, key=abs))


def two_masses(program: Program) -> list[Row]:
    """Impact speeds, multipliers and the Neimark-Sacker point of two masses with a stop."""
    found = []
    for frequency, speed, start in (
        (0.5, 1.592117718587, 0),
        (0.6, 1.714003981416, 0),
        (1.1, 6.040398539557, -2),
    ):
        last = program.events(
            "two_masses",
            "impact_upper",
            "contact.stop",
            drive__force__frequency=frequency,
            start__x0=start,
            run__duration=6000,
        )[-1]
        what = f"two masses with a stop, {frequency} rad/s: impact speed"
        found.append(Row(CLOSED, what, speed, last[2], 1e-9))
    wanted = [-0.59421013 + 0.30551758j, 0.19539904 + 0.60814241j]
    ours = program.multipliers("two_masses")
    for value in wanted:
        near = ours[np.argmin(abs(ours - value))]
        what = f"the same at 0.6 rad/s: multiplier near {value.real:.2f} + {value.imag:.2f} i, distance"
        found.append(Row(CLOSED, what, 0.0, abs(near - value), 5e-8))

    def modulus(frequency: float) -> float:
        return max(abs(program.multipliers("two_masses", drive__force__frequency=frequency)))

    edge = crossing(modulus, [0.911, 0.912, 0.913, 0.914, 0.915], 1.0)
    found.append(Row(CLOSED, "the same: Neimark-Sacker point (rad/s)", 0.909658534285, edge, 1e-6))
    coupled, ground = np.array([[2, -1], [-1, 1]]), np.array([1, 0])
    _, phase, position, velocity = min(
        orbits(1.1, np.eye(2), 0.04 * coupled, coupled, ground, [0, 1], 1, 0.8)
    )
    settings = {
        "start__x0": position[1],
        "start__v0": velocity[1],
        "body__first__x0": position[0],
        "body__first__v0": velocity[0],
        "start__crank_angle": phase,
        "drive__force__frequency": 1.1,
    }
    hit = program.events(
        "two_masses", "impact_upper", "contact.stop", run__duration=12, run__window=11, **settings
    )
    found.append(
        Row(CLOSED, "the same at 1.1 rad/s: impact speed of the saddle", 0.784894656865, hit[0, 2], 1e-9)
    )
    axes = {
        f"axis[{i}].{key}": value
        for i, ends in ((1, (-2, 1)), (2, (-3, 3)))
        for key, value in zip(("from", "to"), ends, strict=True)
    }
    axes |= {"axis[1].count": 41, "axis[2].count": 41, "drive.force.frequency": 1.1}
    with h5py.File(program.run("basin", "two_masses", **axes)) as file:
        impacting = np.isin(file["attractor"][:], hitting(file))
    share = float(np.mean(impacting))
    found.append(
        Row("other code, 400 starts", "the same: share of the impacting motion", 0.975, share, 0.024)
    )
    return found


def fold(program: Program) -> list[Row]:
    """Where the impacting motion of two masses with a stop ends: 1 - multiplier is a root of the distance."""
    frequencies = np.array([1.143, 1.1434, 1.1438, 1.144])
    left = [
        1 - max(program.multipliers("two_masses", drive__force__frequency=one).real) for one in frequencies
    ]
    powers = np.column_stack([np.power(left, k) for k in (0, 2, 3, 4)])
    edge = np.linalg.solve(powers, frequencies)[0]
    found = [Row(CLOSED, "two masses with a stop: saddle-node (rad/s)", 1.144117503720, edge, 2e-6)]
    labels = program.labels("two_masses", "drive.force.frequency", 0.9, 1.2)
    for label, what, frequency in (
        ("SN", "saddle-node", 1.144117503720),
        ("NS", "Neimark-Sacker point", 0.909658534285),
        ("GR-fold", "graze of the motion without impacts", 0.999206009038),
    ):
        name = f"two masses with a stop, `branches`: {what} (rad/s)"
        found.append(Row(CLOSED, name, frequency, labels[label], 1e-9))
    return found


def ball(program: Program) -> list[Row]:
    """A ball between floor and ceiling."""
    source = "Siconos, BouncingBallED-TwoContacts"
    upper = program.events("ball", "impact_upper", "contact.room")[:, 0]
    lower = program.events("ball", "impact_lower", "contact.room")[:, 0]
    ours = np.sort(np.concatenate([upper, lower]))
    theirs = (
        0.05131670194948630,
        0.2283187800528825,
        0.4665486160195453,
        0.7413599657472243,
        1.834535421015040,
    )
    found = [
        Row(source, f"ball between floor and ceiling: impact {k + 1} (s)", value, ours[k], 1e-12)
        for k, value in enumerate(theirs)
    ]
    # the fifth rebound, then a geometric series of bounces
    end = theirs[4] + 2 * 4.372701821 / (10 * (1 - 0.8))
    ended = program.events("ball", "chatter_lower", "contact.room")[0, 0]
    return [*found, Row(source, "the same: end of the chatter on the floor (s)", end, ended, 1e-9)]


def hitting(file: h5py.File) -> np.ndarray:
    """Labels of the attractors with impacts."""
    catalogue = file["catalogue"]
    return catalogue["attractor"][:][catalogue["impacts_per_period"][:] > 0]


def nonsmooth_modes(program: Program) -> list[Row]:
    """Motions of the undamped machine with one impact per period: a family."""
    found = []
    for period, speed, position in (
        (6, 2.737928468197, 0.468831036677),
        (8, 1.705838730562, 4.025271182025),
        (9, 0.333752276861, 0.700255641992),
    ):
        hit = program.events(
            "nonsmooth_mode",
            "impact_upper",
            "contact.stop",
            start__v0=-speed,
            body__first__x0=position,
            run__duration=12,
            run__window=11,
        )[0]
        what = f"nonsmooth mode of period {period} s: first impact from its closed form"
        found.append(Row("M. Thorin, J. Delezoide, M. Legrand (2016), " + CLOSED, what, period, hit[0], 1e-9))
    return found


def dampers(program: Program) -> list[Row]:
    """The impact damper, with and without mass."""
    source = "S. F. Masri, T. K. Caughey (1966), " + CLOSED
    hits = program.events("impact_damper", "impact_upper", "contact.cavity")
    # structure and particle after the upper impact: -0.1574010087592 and -7.083045394166
    found = [
        Row(source, "impact damper: relative speed after the impact", 6.925644385407, abs(hits[-1][3]), 1e-8)
    ]
    source = "slow manifold of the vibro-impact nonlinear energy sink, " + CLOSED
    with h5py.File(program.run("trajectory", "cavity")) as file:
        speed = np.max(file["v"][-2000:])
    found.append(Row(source, "cavity, amplitude 0.5: speed of the particle", 0.919310005995041, speed, 1e-9))

    def half(amplitude: float) -> float:
        return float(
            np.sqrt(max(abs(program.multipliers("cavity", drive__frame__amplitude=amplitude, **GRID))))
        )

    edge = crossing(half, [0.725, 0.7265, 0.728, 0.7295], 1.0)
    found.append(Row(source, "cavity: amplitude at the symmetry breaking", 0.7321398724, edge, 1e-6))
    return found


GRID = {"run__duration": 3000}


def others(program: Program) -> list[Row]:
    """Pounding, a cantilever by its first mode, a capsule."""
    found = []
    hit = program.events("pounding", "impact_upper", "contact.gap")[-1]
    found.append(Row(CLOSED, "pounding of two buildings: impact speed", 3.744189605107, hit[2], 1e-9))
    # tip: 2 per unit of the mode, that is a mass of 1/4 on a spring of 1/4; this motion is not stable
    _, phase, position, velocity = max(orbits(0.9, 1, 0.04, 1, [0.1], [2], 0.5, 0.8))
    settings = {"start__x0": 2 * position[0], "start__v0": 2 * velocity[0], "start__crank_angle": phase}
    hit = program.events(
        "cantilever", "impact_upper", "contact.stop", run__duration=14, run__window=7, **settings
    )[0]
    found.append(Row(CLOSED, "cantilever by one mode with a stop: impact speed", 0.2205597811, hit[2], 5e-10))
    capsule = SOURCE / "examples" / "structure_capsule.toml"
    with h5py.File(program.run("trajectory", capsule, run__duration=3000)) as file:
        period = 2 * np.pi / 0.95
        time, x = file["time"][:], file["shell_x"][:]
    last = int(time[-1] // period)
    ends = [x[np.argmin(abs(time - k * period))] for k in (last - 1, last)]
    source = "capsule after Y. Liu, E. Pavlovskaia, M. Wiercigroch (2013), other code"
    found.append(Row(source, "progress per period", 1.158146350, ends[1] - ends[0], 1e-8))
    return found


def blocks(program: Program) -> list[Row]:
    """Intervals between releases of the first of two blocks on a belt."""
    source = "two blocks on a belt after U. Galvanetto, S. R. Bishop, other code"
    machines = [
        ("blocks", 0.2, (0.6, 0.78), (1.0, 1.3), (3.8037379614,), 1e-9),
        ("blocks", 0.2, (0.6, 0.6), (1.0, 1.3), (3.5249190815, 4.7147505131), 1e-9),
        ("blocks", 0.2, (0.8, 0.8), (1.0, 1.0), (3.4552994741,), 1e-9),
        ("blocks", 0.1, (0.6, 0.78), (1.0, 1.3), (12.6315202, 12.8562417), 5e-8),
        ("blocks_hyperbolic", 0.2, (0, 0), (1.0, 1.3), (5.60636349, 6.28985273), 1e-8),
    ]
    found = []
    for case, belt, kinetic, static, intervals, bar in machines:
        settings: dict[str, str | float] = {"run__duration": 3000}
        for body, force, level in zip(("first", "second"), kinetic, static, strict=True):
            settings[f"friction__{body}__velocity"] = belt
            settings[f"friction__{body}__force"] = force
            settings[f"friction__{body}__static_force"] = level
        times = program.events(case, "release", "friction.first", **settings)[:, 0]
        ours = sorted(np.diff(times)[-len(intervals) :])
        for theirs, mine in zip(intervals, ours, strict=True):
            what = (
                f"{case}, belt {belt} m/s, kinetic friction {kinetic}, static {static}: release interval (s)"
            )
            found.append(Row(source, what, theirs, mine, bar))
        with h5py.File(program.run("trajectory", case, **settings)) as file:
            cycle = file.attrs.get("cycle_time", np.nan)
        what = f"{case}, belt {belt} m/s, kinetic friction {kinetic}, static {static}: limit cycle (s)"
        found.append(Row(source, what, sum(intervals), cycle, 2 * bar))
    return found


def slid(u: float) -> float:
    """Friction of belt_stribeck.toml over the sliding speed."""
    return 0.5 + 0.5 * np.exp(-u / 0.5)


def known(file: h5py.File, kind: str) -> np.ndarray:
    """Labels of the entries of a kind."""
    kinds = str(np.char.decode(np.bytes_(file["catalogue/kind"].attrs["flag_meanings"]))).split()
    return file["catalogue/attractor"][:][file["catalogue/kind"][:] == kinds.index(kind) + 1]


def end_of_sticking(mass: float = 1, damping: float = 0.05, kinetic: float = 1, static: float = 1.5) -> float:
    """Belt velocity that the slide of a mass on a spring of 1 N/m, let go, just comes back to."""
    decay = damping / 2 / mass
    turning = np.sqrt(1 / mass - decay**2)

    def excess(belt: float) -> float:
        cosine = static - damping * belt - kinetic
        sine = (belt + decay * cosine) / turning
        amplitude = cosine - 1j * sine
        # velocity and acceleration of Re amplitude exp((-decay + i turning) t)
        rate = -decay + 1j * turning
        first = (np.pi / 2 - np.angle(amplitude * rate**2)) / turning
        times = first + np.arange(1, 9) * np.pi / turning
        speeds = (amplitude * rate * np.exp(rate * times)).real
        return float(max(speeds[times > 2]) - belt)

    return float(brentq(excess, 0.1, 3, xtol=1e-15))


def end_of_stick_slip(program: Program) -> list[Row]:
    """Where the branch of the motion that sticks on a belt ends."""
    labels = program.labels("belt_coulomb", "friction.belt.velocity", 0.5, 1)
    what = "mass on a belt, `branches`: velocity at the end of the sticking motion (m/s)"
    return [Row(CLOSED, what, end_of_sticking(), labels["stick_onset"], 1e-11)]


#: At 1.175 m/s motions come to the equilibrium within hundreds of turns only.
SLOW = {"run__duration": 3000}


def belt_oscillator(program: Program) -> list[Row]:
    """Friction oscillator on a belt: share of the equilibrium, limit cycle, labels of single starts."""
    source = "M. Stender, N. Hoffmann, bSTAB (2022), 5000 starts"
    found = []
    for belt, share in ((1.175, 0.0126), (1.5, 0.312), (1.85, 1.0)):
        with h5py.File(program.run("basin", "belt_stribeck", friction__belt__velocity=belt, **SLOW)) as file:
            rests = np.isin(file["attractor"][:], known(file, "rest"))
            # Two samples of 5000, two standard errors.
            bar = 2 * np.sqrt(2 * share * (1 - share) / 5000) + 1e-9
            what = f"friction oscillator on a belt at {belt} m/s: share of the equilibrium"
            found.append(Row(source, what, share, float(np.mean(rests)), bar))
            if belt == 1.5:
                found += belt_by_steps(file, rests)
    return found


def turning_pendulum(program: Program) -> list[Row]:
    """A pendulum under a constant torque: share of the equilibrium, time of a turn."""
    found = []
    source = "P. J. Menck and others (2013) by bSTAB, 10000 starts"
    with h5py.File(program.run("basin", "pendulum_torque")) as file:
        rests = np.isin(file["attractor"][:], known(file, "rest"))
        what = "pendulum under a constant torque: share of the equilibrium"
        bar = 2 * np.sqrt(2 * 0.152 * 0.848 / 10000)
        found.append(Row(source, what, 0.152, float(np.mean(rests)), bar))
        cycle = max(file["catalogue/cycle_time"][:])
    turns = solve_ivp(
        lambda t, y: [y[1], 0.5 - 0.1 * y[1] - sin(y[0])],
        (0, 400),
        (0, 5),
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
        events=lambda t, y: sin((y[0] - np.pi) / 2),
    ).t_events[0]
    found.append(
        Row("scipy, DOP853", "the same: period of a rotation (s)", turns[-1] - turns[-2], cycle, 1e-9)
    )
    return found


def belt_by_steps(file: h5py.File, rests: np.ndarray) -> list[Row]:
    """The stick-slip cycle of belt_stribeck.toml, and where the first starts of its map go."""
    source = "`tests/referee/structures.py`"

    def slips(x: float, v: float, until: float, tolerance: float) -> list[float]:
        machine = Structure(
            [1], lambda t, q, v: -q - 0.1 * v, [Friction([1], slid, 1.0, 1.5)], tolerance=tolerance
        )
        machine.run([x], [v], until)
        return [at for kind, _, at in machine.events if kind == "slip"]

    late = slips(-1.5, 0, 60, 1e-12)
    cycle = max(file["catalogue/cycle_time"][:])
    found = [Row(source, "the same: limit cycle (s)", late[-1] - late[-2], cycle, 1e-8)]
    starts = np.column_stack([file[name][:] for name in ("x0", "v0")])[:40]
    # What still sticks after 60 s never stops.
    other = sum(
        (max(slips(*start, 90, 1e-8), default=0) > 60) == rest
        for start, rest in zip(starts, rests, strict=False)
    )
    what = f"the same: differing labels of {len(starts)} initial conditions"
    return [*found, Row(source, what, 0, other, 0)]


COMPUTED = (
    two_masses,
    fold,
    ball,
    bouncing,
    rattle,
    nonsmooth_modes,
    dampers,
    others,
    blocks,
    belt_oscillator,
    end_of_stick_slip,
    turning_pendulum,
    simulated,
    *BENCHMARKS,
    *IMPACTS,
)


def numbers(program: Program) -> list[Row]:
    """All of them."""
    return [number for compute in COMPUTED for number in compute(program)]


def main() -> int:
    """Print the rows."""
    parser = arguments(__doc__, "validation")
    parser.add_argument("--json", action="store_true", help="a line of JSON for each row")
    options = parser.parse_args()
    return show(numbers(Program(options.build.resolve(), options.out.resolve() / "structures")), options.json)


if __name__ == "__main__":
    sys.exit(main())
