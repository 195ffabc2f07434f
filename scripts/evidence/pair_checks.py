# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What two bodies coupled by friction must show, also with impacts: a function per table."""

import math

import numpy as np
from evidence_rows import Row
from pair_runs import Program, Run, check
from separatrix import decode_flags

# time, x1, v1 = v2, x2, energy of the first events of a free pair, computed by another program
FREE_PAIR = (
    (2.541443831, -0.642726417, -0.508288766, -0.645893675, 0.400316726),
    (6.145756432, 0.612546021, 0.212573754, -1.178818347, 0.221497015),
    (8.985437487, -0.326155545, -0.355362457, -1.381555534, 0.147900577),
    (12.307393192, 0.186234308, 0.309028684, -1.458514905, 0.088965654),
    (12.716382731, 0.3, 0.242117477, -1.344749213, 0.088965654),
    (15.439474148, 0.015654672, -0.302500807, -1.426963878, 0.068752588),
    (16.645504937, -0.3, -0.177960999, -1.742618550, 0.068752588),
)
HALF_DIGIT = 5.1e-10


def free_bodies(program: Program) -> list[Row]:
    """Without spring and drive the bodies come together."""
    m1, m2, b, v1, v2 = 2.0, 0.5, 0.7, 1.0, -2.0
    reduced = m1 * m2 / (m1 + m2)
    body = f'law="friction_pair", mass={m1}, driven_mass={m2}, friction={b}, driver_x0=0.3, driver_v0={v1}'
    run = program.trajectory(
        "pair_free", f"body={{{body}}}", 'restoring={law="none"}', f"start.v0={v2}", "run.duration=5"
    )
    slid = float(run.data["driver_x"][-1] - run.data["x"][-1]) - 0.3
    loss = reduced * (v1 - v2) ** 2 / 2
    found = (
        ("time until sticking (s)", run.of("event_time", "stick")[0], (v1 - v2) * reduced / b),
        ("common velocity (m/s)", run.events["event_v_after"][0], (m1 * v1 + m2 * v2) / (m1 + m2)),
        ("energy loss (J)", run.number("energy_lost_to_friction"), loss),
        ("slip length (m)", slid, loss / b),
    )
    return [check(f"A-V1 {what}", ours, expected, 1e-12) for what, ours, expected in found]


def carried_off(program: Program) -> list[Row]:
    """A platform at constant velocity carries a body off that was at rest."""
    m2, b, velocity = 0.7, 0.3, 0.5
    run = program.trajectory("pair_platform", 'contact={law="none"}', "start.v0=0")
    slid = float(run.data["driver_x"][-1] - run.data["x"][-1])
    return [
        check("A-V2 time until sticking (s)", run.of("event_time", "stick")[0], m2 * velocity / b, 1e-12),
        check("A-V2 slip length (m)", slid, m2 * velocity**2 / (2 * b), 1e-12),
    ]


def shaken(program: Program) -> list[Row]:
    """Stick and slip on a shaken platform with kappa = friction."""
    stuck = program.trajectory("sweep_pair_kappa", "body.friction=1", "start.v0=1")
    slipping = program.trajectory("sweep_pair_kappa", "body.friction=0.5")
    limits = program.limits("sweep_pair_kappa")
    slip, stick = 2 / math.sqrt(4 + math.pi**2), 1.0
    return [
        check("A-V3 events at kappa = 1, equal initial velocities", stuck.kinds.size, 0, 0),
        check("A-V3 stick phases at kappa = 0.5", slipping.of("event_time", "stick").size, 0, 0),
        check("A-V3 peak of v2 at kappa = 0.5 (m/s)", slipping.number("v_max"), math.pi * 0.5 / 2, 1e-9),
        *(
            check(f"A-V3 kappa at the {what}", limits[name], expected, 5e-5, digits=7)
            for what, name, expected in (
                ("onset of stick, run-up", "non_impact_to_sticking_up", slip),
                ("end of stick, run-down", "sticking_to_non_impact_down", slip),
                ("end of slip, run-up", "sticking_to_stuck_up", stick),
                ("onset of slip, run-down", "stuck_to_sticking_down", stick),
            )
        ),
    ]


def event_energies(run: Run) -> np.ndarray:
    """Energy at each event of the free pair (J)."""
    return (
        run.events["event_driver_x"] ** 2
        + run.events["event_driver_v"] ** 2
        + 0.5 * run.events["event_v_after"] ** 2
    ) / 2


def free_pair(program: Program) -> list[Row]:
    """Every event of the free pair as printed, and its book of energy."""
    run = program.trajectory("pair_free", "run.duration=386.9297")
    energies = event_energies(run)
    columns = [run.events[f"event_{name}"] for name in ("time", "driver_x", "driver_v", "x")]
    kinds = {"turning_point": "reversal", "stick": "stick", "release": "slip"}
    checks = [
        check(
            f"P1 event {i + 1}, {kinds[str(run.kinds[i])]}: t, x1, v, x2, E",
            [*(float(column[i]) for column in columns), float(energies[i])],
            expected,
            HALF_DIGIT,
        )
        for i, expected in enumerate(FREE_PAIR)
    ]
    positions = np.concatenate([[1.0], columns[1] - columns[3]])
    slid = np.abs(np.diff(positions)).sum()
    lost = run.number("energy_start") - float(energies[-1])
    return [
        *checks,
        check("P1 events until t = 386.9297 s", run.kinds.size, 200, 0),
        check("P1 time of the last event (s)", run.events["event_time"][-1], 386.929691, 5.1e-7),
        check("P1 energy after the last event (J)", energies[-1], 0.045409125, HALF_DIGIT),
        check("P1 amplitude after the last event (m)", math.sqrt(2 * energies[-1]), 0.301360663, HALF_DIGIT),
        check("A-V4 energy loss (J) = b times the slip path", lost, 0.1 * slid, 1e-13, digits=13),
    ]


def algebraic(program: Program) -> list[Row]:
    """The energy above the limit of stick falls like 1/(k n) with the number n of slips."""
    run = program.trajectory("pair_free", "run.duration=40000", "trajectory.samples_per_period=2")
    above = event_energies(run)[run.kinds == "stick"] - 0.045
    k = 25.0
    # one episode of slip, however often reversed, ends with each stick
    rows = [
        check(f"A-V5 (E - E_c) n after n = {n} slips (J)", above[n - 1] * n, 1 / k, bar, True, 6)
        for n, bar in ((100, 0.05), (1000, 0.01), (10000, 0.001))
    ]
    rate = (1 / above[9999] - 1 / above[4999]) / 5000
    return [
        *rows,
        check("A-V5 growth of 1/(E - E_c) per slip, n = 5000 to 10000 (1/J)", rate, k, 1e-3, True, 7),
    ]


def bouncing(program: Program) -> list[Row]:
    """A platform at constant velocity carries a body into a stop."""
    m2, b, velocity, e = 0.7, 0.3, 0.5, 0.6
    run = program.trajectory("pair_platform")
    time, before, after = (
        run.of(name, "impact_upper") for name in ("event_time", "event_v_before", "event_v_after")
    )
    count = 8
    k = np.arange(count)
    lows = []
    for first, last in zip(time[:count], time[1 : count + 1], strict=True):
        times = f"run.duration={float(last)!r}", f"run.window={float(last - first)!r}"
        flight = program.trajectory("pair_platform", *times)
        lows.append(flight.number("x_min"))
    chatter = run.of("event_time", "chatter_upper")
    names = decode_flags(run.data["mode"]).values.astype(str)
    speeds = velocity * e**k
    found = (
        (f"impact speeds V e^k, k = 0 to {count - 1} (m/s)", before[:count], speeds),
        ("rebound speeds V e^(k+1) (m/s)", -after[:count], e * speeds),
        ("return times 2 m2 V e^(k+1)/b (s)", np.diff(time)[:count], 2 * m2 * e * speeds / b),
        ("excursions m2 (V e^(k+1))^2/(2b) (m)", 1 - np.array(lows), m2 * (e * speeds) ** 2 / (2 * b)),
    )
    power, passed = (np.diff(run.data[name].values[-2:])[0] for name in ("friction_loss", "time"))
    ending = 2 + 2 * m2 * velocity * e / (b * (1 - e))
    return [
        *(check(f"B.3 {what}", ours, expected, 1e-10, digits=4) for what, ours, expected in found),
        check("B.3 accumulation of the impacts (s)", chatter[0], ending, 1e-10),
        check("B.3 last sample: distance from the stop (m)", 1 - float(run.data["x"][-1]), 0, 0),
        check("B.3 last sample in contact with the stop (1 = yes)", names[-1] == "upper_barrier", 1, 0),
        check("B.3 friction power in contact (W) = b V", float(power / passed), b * velocity, 1e-10),
    ]


def hammer(program: Program) -> list[Row]:
    """An impulse on a body on a resting platform; two free bodies with a stop between them."""
    m2, b, distance, e, v0 = 0.5, 1.5, 0.2, 0.7, 2.0
    run = program.trajectory("hammer")
    arrival = math.sqrt(v0**2 - 2 * b / m2 * distance)
    rest = distance - m2 * (e * arrival) ** 2 / (2 * b)
    pair = 'law="backlash_pair", mass=1, driven_mass=0.5, friction=0, impulse=0.5'
    both = program.trajectory("pair_backlash", f"body={{{pair}}}", 'drive={law="none"}', "start.v0=0")
    w, v2 = (both.of(name, "impact_upper")[0] for name in ("event_v_before", "event_v_after"))
    # the driving body was at rest, and keeps its velocity up to the next impact
    v1 = both.data["driver_v"].values[both.data["time"].values > both.of("event_time", "impact_upper")[0]][0]
    hit = [run.of(name, "impact_upper")[0] for name in ("event_v_before", "event_v_after")]
    found = (
        ("B.3 hammer: velocity before the impact (m/s)", hit[0], arrival),
        ("B.3 hammer: velocity after the impact (m/s)", hit[1], -e * arrival),
        ("B.3 hammer: rest position (m)", run.of("event_x", "stick")[0], rest),
        ("B.2 stop on m1: relative velocity after an impact (m/s)", v2 - v1, -0.85 * w),
        ("B.2 stop on m1: momentum after an impact (N s)", v1 + 0.5 * v2, 0.5 * w),
    )
    return [check(what, ours, expected, 1e-12) for what, ours, expected in found]


def recovered(record: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return durations (s) and heights (m) of the first five flights between impacts in a record with noise.

    A parabola is fitted to each flight, for single samples determine the instant of an impact poorly.
    """
    t, x = record["t"], record["x"]
    stop = x[t > 7].mean()
    edges = np.flatnonzero(np.diff((stop - x > 1e-4).astype(int)))
    # up to the first edge the body comes from far away
    flights = [(a, b) for a, b in zip(edges[1::2], edges[2::2], strict=False) if b - a > 100][:5]
    times, heights = [], []
    for a, b in flights:
        inside = slice(a + 3, b - 2)
        second, first, level = np.polyfit(t[inside] - t[inside].mean(), stop - x[inside], 2)
        times.append(math.sqrt(first**2 - 4 * second * level) / abs(second))
        heights.append(level - first**2 / (4 * second))
    return np.array(times), np.array(heights)


def identified(program: Program) -> list[Row]:
    """Restitution and friction from records at 2 kHz with 8 micrometres of noise."""
    checks = []
    for seed in (1, 2, 3):
        settings = f'record={{rate="2 kHz", noise="8 um", seed={seed}}}'
        times, heights = recovered(program.record("pair_platform", settings))
        e_times, e_heights = times[1:] / times[:-1], np.sqrt(heights[1:] / heights[:-1])
        friction = 8 * heights / times**2
        name = f"B.3 record, noise seed {seed}: "
        checks += [
            check(f"{name}e from successive flight times", e_times, [0.6] * 4, 2e-3, digits=5),
            check(f"{name}e from successive heights", e_heights, [0.6] * 4, 1e-3, digits=5),
            check(f"{name}b/m2 of each flight (m/s^2)", friction, [0.3 / 0.7] * 5, 5e-3, True, 5),
        ]
    return checks
