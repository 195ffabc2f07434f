# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What contact laws and the book of energy must show, and the hard cases: a function per table."""

import math

import numpy as np
from evidence_rows import Row
from pair_runs import Program, Run, check, restitution_of

FORMULAS = {
    "hunt_crossley_1975": (0.952, 0.909, 0.833, 0.768, 0.712, 0.663, 0.620, 0.581, 0.547, 0.516),
    "lankarani_nikravesh": (0.954, 0.913, 0.847, 0.796, 0.756, 0.725, 0.702, 0.684, 0.672, 0.665),
    "herbert_mcwhannell": (0.950, 0.901, 0.807, 0.723, 0.651, 0.594, 0.550, 0.520, 0.501, 0.491),
    "gonthier": (0.936, 0.876, 0.768, 0.670, 0.577, 0.488, 0.398, 0.304, 0.205, 0.101),
    "flores": (0.947, 0.894, 0.789, 0.683, 0.577, 0.470, 0.363, 0.256, 0.156, 0.069),
    "hu_guo": (0.950, 0.900, 0.799, 0.697, 0.594, 0.488, 0.380, 0.271, 0.166, 0.074),
}
ASKED = (0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1)
EXACT_DAMPING = (
    *(0.07893, 0.16648, 0.37315, 0.63483, 0.97487),
    *(1.43275, 2.08250, 3.08708, 4.91917, 9.99816),
)


def impact(program: Program, law: str, duration: float = 1, *settings: str) -> Run:
    """Return one impact of a free body of 1 kg at 1 m/s."""
    free = ('restoring={law="none"}', "start.x0=-1e-3", "start.v0=1")
    times = (f"run.duration={duration!r}", "trajectory.samples_per_period=2")
    return program.trajectory(
        "contact_hunt_crossley", f"contact={{{law}, upper=0}}", *free, *times, *settings
    )


def exact_restitution(d: float) -> float:
    """Solve (1 + d)/(1 - e d) = exp(d (1 + e)) for e by bisection."""
    low, high = 0.0, 1.0
    while high - low > 1e-15:
        e = (low + high) / 2
        gap = math.log1p(d) - math.log1p(-e * d) - d * (1 + e) if e * d < 1 else 1.0
        low, high = (low, e) if gap > 0 else (e, high)
        if e in (low, high) and (low + high) / 2 in (low, high):
            break
    return (low + high) / 2


def hunt_crossley(program: Program) -> list[Row]:
    """Restitution, loss and peaks of K p^n (1 + a p')."""
    checks = []
    dampings = (0.1, 0.5, 1.43275, 5.0, 20.0)
    for n in (1, 1.5, 2):
        law = f'law="hunt_crossley", stiffness=1e6, exponent={n}, damping='
        runs = [impact(program, f"{law}{d}") for d in dampings]
        expected = [exact_restitution(d) for d in dampings]
        checks.append(
            check(
                f"C.2 e, n = {n}, d = {', '.join(f'{d:g}' for d in dampings)}",
                [restitution_of(run) for run in runs],
                expected,
                1e-8,
                digits=6,
            )
        )
        checks.append(
            check(
                f"C.2 area of the loop, n = {n} (J) = energy loss of the body",
                [run.number("contact_work") for run in runs],
                [(1 - restitution_of(run) ** 2) / 2 for run in runs],
                1e-8,
                digits=6,
            )
        )
    law = 'law="hunt_crossley_exact", stiffness=1e6, speed=1, restitution='
    checks.append(
        check(
            "C.2 e of hunt_crossley_exact for nominal e",
            [restitution_of(impact(program, f"{law}{e}")) for e in ASKED],
            ASKED,
            1e-8,
            digits=6,
        )
    )
    for n, damping, expected in (
        (1.5, 0, (4.35275e-3, 1.28113e-2, 287.17)),
        (1.5, 1.43275, (3.37592e-3, 1.43460e-2, 266.98)),
        (1, 0, (1e-3, math.pi * 1e-3, 1000)),
        (1, 1.43275, (7.2784e-4, 3.28533e-3, 1027.2)),
    ):
        run = impact(program, f'law="hunt_crossley", stiffness=1e6, exponent={n}, damping={damping}')
        lasted = run.of("event_time", "separation")[0] - run.of("event_time", "touch_upper")[0]
        found = (run.number("peak_penetration"), lasted, run.number("peak_force"))
        name = f"C.2 n = {n}, d = {damping:g}: largest p (m), duration (s), largest force (N)"
        checks.append(check(name, found, expected, 5e-5, True, 6))
    return checks


def formulas(program: Program) -> list[Row]:
    """What the published formulas return for the restitution that they are asked for."""
    checks = []
    for law, printed in FORMULAS.items():
        found = [
            restitution_of(impact(program, f'law="{law}", stiffness=1e6, speed=1, restitution={e}'))
            for e in ASKED
        ]
        checks.append(
            check(f"C.3 {law}, nominal e = 0.95, 0.9, 0.8 ... 0.1", found, printed, 5.1e-4, digits=3)
        )
    found = [
        restitution_of(impact(program, f'law="hunt_crossley", stiffness=1e6, damping={d}'))
        for d in EXACT_DAMPING
    ]
    checks.append(check("C.3 exact d as printed", found, ASKED, 1e-5, digits=5))
    return checks


def kelvin_voigt(program: Program) -> list[Row]:
    """The linear damper: restitution with and without tension, and the jump of the force."""
    ratios = (0.05, 0.1, 0.2, 0.3, 0.5)
    damping = [2 * zeta * 1e3 for zeta in ratios]
    checks = []
    for tension, what, printed in (
        (1, "p = 0", (0.8545, 0.7292, 0.5266, 0.3723, 0.1630)),
        (0, "F = 0", (0.8588, 0.7441, 0.5717, 0.4510, 0.2984)),
    ):
        laws = [f'law="kelvin_voigt", stiffness=1e6, damping={d}, tension={tension}' for d in damping]
        found = [restitution_of(impact(program, law)) for law in laws]
        closed = [released(zeta, tension == 1) for zeta in ratios]
        checks.append(
            check(f"C.4 e released at {what}, zeta = 0.05, 0.1, 0.2, 0.3, 0.5", found, closed, 1e-8, digits=6)
        )
        checks.append(check(f"C.4 e as printed, released at {what}", found, printed, 5.1e-5, digits=4))
    jumps = [
        impact(program, f'law="kelvin_voigt", stiffness=1e6, damping={d}', 1e-12, "start.x0=0").number(
            "peak_force"
        )
        / 1e3
        for d in damping
    ]
    checks.append(
        check("C.4 jump F(0+)/(v sqrt(K m)) = 2 zeta", jumps, [2 * zeta for zeta in ratios], 1e-8, digits=6)
    )
    return checks


def released(zeta: float, tension: bool) -> float:
    """Restitution of the linear damper."""
    root = math.sqrt(1 - zeta**2)
    angle = math.pi if tension else math.pi - math.atan2(2 * zeta * root, 1 - 2 * zeta**2)
    return math.exp(-zeta / root * angle)


def books(program: Program) -> list[Row]:
    """What is missing in the book of energy, relative to what was turned over."""
    soft = 'contact={law="hunt_crossley_exact", stiffness=1e6, restitution=0.6, upper=1}'
    linear = 'contact={law="kelvin_voigt_restitution", stiffness=1e4, restitution=0.6, upper=1}'
    controlled = (
        'drive={law="pid_sine", amplitude=0.3, frequency=2, proportional=50, derivative=5, integral=20}'
    )
    exact = {
        "free pair": ("pair_free",),
        "bouncing on a platform": ("pair_platform",),
        "hammer": ("hammer",),
        "shaken platform": ("sweep_pair_kappa", "body.friction=0.7", "run.duration=120"),
        "backlash under a force": ("pair_backlash",),
        "platform with a controller": ("pair_platform", controlled),
        "sampled controller": ("pair_platform", controlled.replace("}", ", sample_time=0.01}")),
        "bouncing on a linear stop": ("pair_platform", linear),
        "linear stop without tension": ("pair_platform", linear.replace("}", ", tension=0}")),
        "one body, Coulomb friction, impacts": ("trajectory_coulomb_1.05",),
        "one body on a linear barrier": ("contact_kelvin_voigt",),
    }
    adaptive = {
        "bouncing on a soft stop": ("pair_platform", soft),
        "soft backlash under a force": ("pair_backlash", soft.replace("upper=1", "upper=0.1, lower=-0.1")),
        "one body on a soft barrier": ("contact_hunt_crossley",),
        "one body, Stribeck friction, impacts": ("trajectory_stribeck_1.2_impact",),
    }
    return [
        check(f"{name}, {kind} flight", program.trajectory(*words).closing(), 0, bar, digits=2)
        for kind, bar, group in (("exact", 1e-10, exact), ("adaptive", 1e-8, adaptive))
        for name, words in group.items()
    ]


def hard(program: Program) -> list[Row]:
    """Cases where something is nil, infinite or exactly at a limit: they end, with sense or with a reason."""
    stop = 'contact={{law="newton", restitution={}, upper={}}}'
    shake = 'drive={law="sine", amplitude=0.3, frequency=2}'
    no_room = 'contact={law="newton", restitution=0.5, upper=0, lower=0}'
    rows = []

    def ended(name: str, run: Run, what: str, found: float, expected: float, bar: float) -> None:
        over = run.data.attrs["reason"] == "time_over"
        rows.append(check(f"{name}: run completes (1 = yes)", over, 1, 0))
        rows.append(check(f"{name}: {what}", found, expected, bar))

    run = program.trajectory("pair_platform", no_room, shake, "start.v0=0")
    ended(
        "no gap, stop on the ground", run, "largest displacement of m2 (m)", np.abs(run.data["x"]).max(), 0, 0
    )
    run = program.trajectory("pair_backlash", no_room, "start.x0=0")
    apart = np.abs(run.data["x"] - run.data["driver_x"]).max()
    ended("no gap, stop on m1", run, "largest x2 - x1 (m)", apart, 0, 1e-14)
    run = program.trajectory("pair_platform", stop.format(0, 1))
    lost = run.number("energy_lost_to_contacts")
    ended("e = 0", run, "energy loss at the stop (J) = m2 V^2/2", lost, 0.7 * 0.5**2 / 2, 1e-14)
    run = program.trajectory("pair_platform", stop.format(1, 1), "run.duration=40")
    speeds = run.of("event_v_before", "impact_upper")
    ended("e = 1", run, "lowest impact speed (m/s) = V", speeds.min(), 0.5, 1e-12)
    run = program.trajectory("pair_platform", "run.duration=1.9", "run.window=1")
    ended("equal velocities at the start", run, "events before the first impact", run.kinds.size, 0, 0)
    body = 'body={law="friction_pair", mass=1, driven_mass=0.7, friction=0}'
    run = program.trajectory("pair_platform", body, "start.v0=0.1", "run.duration=20")
    ended("b = 0", run, "x2 after 20 s, one impact at 10 s (m)", run.data["x"][-1], 0.4, 1e-12)
    law = 'contact={law="hunt_crossley_exact", stiffness=1e16, restitution=0.6, upper=1}'
    run = program.trajectory("pair_platform", law)
    ended("stiffness 1e16 N/m^1.5", run, "first restitution", restitution_of(run), 0.6, 1e-6)
    amplitude = 0.1 * 1.5 / 0.5
    body = f'body={{law="friction_pair", mass=1, driven_mass=0.5, friction=0.1, driver_x0={amplitude!r}}}'
    run = program.trajectory("pair_free", body)
    lost = run.number("energy_lost_to_friction")
    ended("sticking exactly at the friction limit", run, "friction loss (J)", lost, 0, 1e-12)
    for case in ("pair_platform", "contact_hunt_crossley", "pair_backlash"):
        code = program.refused("trajectory", case, "start.x0=1.5")
        # a soft stop may be pressed from the start
        expected = 0 if case == "contact_hunt_crossley" else 65
        rows.append(check(f"start inside the stop, {case}: exit code", code, expected, 0))
    return rows
