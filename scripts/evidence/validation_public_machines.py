# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines of practice whose equations scipy integrates, by itself or by tests/referee/structures.py."""

import sys
from collections.abc import Callable, Sequence
from math import cos, exp, pi, sin, sqrt

import numpy as np
from evidence_rows import SOURCE, Row
from scipy.integrate import solve_ivp
from validation_public_program import Program

sys.path.insert(0, str(SOURCE / "tests" / "referee"))
from structures import Friction, Structure  # noqa: E402

OWN = "equations, by `tests/referee/structures.py`"
TIGHT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}


def by_pieces(
    slope: Callable, switches: Sequence[Callable], start: Sequence[float], until: float
) -> np.ndarray:
    """State at `until` of y' = slope(t, y), integrated from zero to zero of the switching functions."""
    t, y = 0.0, np.asarray(start, float)
    while t < until:
        signs = [1 if switch(t, y) > 0 else -1 for switch in switches]

        def guard(switch: Callable, sign: int) -> Callable:
            def function(now: float, z: np.ndarray) -> float:
                return sign * switch(now, z) + 1e-15

            function.terminal, function.direction = True, -1
            return function

        guards = [guard(switch, sign) for switch, sign in zip(switches, signs, strict=True)]
        flight = solve_ivp(slope, (t, until), y, events=guards, **TIGHT)
        t, y = flight.t[-1], flight.y[:, -1]
        if flight.status != 1:
            break
        # Past the zero, where the slope is continuous.
        step = 1e-9
        y = y + step * np.asarray(slope(t, y))
        t += step
    return y


def by_modes(modes: dict, mode: str, start: Sequence[float], until: float) -> tuple[np.ndarray, int]:
    """State at `until` and number of events.

    A mode has a slope, and events: a function that falls to zero, and what mode and state follow.
    """
    t, y, count = 0.0, np.asarray(start, float), 0
    while t < until:
        slope, events = modes[mode]
        guards = []
        for function, _ in events:

            def guard(now: float, z: np.ndarray, function: Callable = function) -> float:
                return function(now, z)

            guard.terminal, guard.direction = True, -1
            guards.append(guard)
        flight = solve_ivp(slope, (t, until), y, events=guards, max_step=until / 200, **TIGHT)
        t, y = flight.t[-1], flight.y[:, -1]
        if flight.status != 1:
            break
        which = next(i for i, times in enumerate(flight.t_events) if len(times))
        mode, y = events[which][1](t, y)
        y, count = np.asarray(y, float), count + 1
    return y, count


def compared(
    program: Program,
    case: str,
    source: str,
    what: str,
    columns: Sequence[str],
    theirs: Sequence[float],
    bar: float,
) -> list[Row]:
    """The last samples of columns."""
    ours = program.ends(case, *columns)
    return [
        Row(source, f"{what}: {name}" if i == 0 else f"the same: {name}", float(value), found, bar)
        for i, (name, value, found) in enumerate(zip(columns, theirs, ours, strict=True))
    ]


def relief_valve(program: Program) -> list[Row]:
    """A valve that rebounds from its seat; the pressure follows its opening."""

    def slope(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -1.25 * y[1] - (y[0] + 10) + y[2], 20 * (3 - sqrt(max(y[2], 0)) * y[0])]

    modes = {"open": (slope, [(lambda t, y: y[0], lambda t, y: ("open", [0, -0.8 * y[1], y[2]]))])}
    end, _ = by_modes(modes, "open", [0.5, 0, 8], 8)
    source = "A. R. Champneys, C. J. Hos, equations, by scipy's DOP853"
    return compared(
        program, "relief_valve", source, "pressure relief valve", ("x", "v", "state_pressure"), end, 1e-8
    )


def slack_mooring(program: Program) -> list[Row]:
    """A hawser that does not push."""
    turn = 2 * pi / 9

    def slope(t: float, y: np.ndarray) -> list[float]:
        return [y[1], (-4e5 * y[1] + 1.5e6 * cos(turn * t) - 3e6 * max(y[0], 0)) / 2e7]

    end = by_pieces(slope, [lambda t, y: y[0]], [0.2, 0], 120)
    source = "J. M. T. Thompson (1983), equations, by scipy's DOP853"
    return compared(program, "slack_mooring", source, "vessel on a slack mooring", ("x", "v"), end, 1e-8)


def tapping(program: Program) -> list[Row]:
    """A cantilever over a surface that attracts, then repels."""

    def slope(t: float, y: np.ndarray) -> list[float]:
        gap = 12 + y[0]
        surface = -0.05 / 0.3**2 + 4 * (0.3 - gap) ** 1.5 if gap < 0.3 else -0.05 / gap**2
        return [y[1], -y[0] - y[1] / 40 + 0.5 * cos(t) + surface]

    end = by_pieces(slope, [lambda t, y: 12 + y[0] - 0.3], [0, 0], 60)
    source = "B. V. Derjaguin and others (1975), equations, by scipy's DOP853"
    return compared(program, "tapping", source, "atomic force microscope", ("x", "v"), end, 1e-7)


def pantograph(program: Program) -> list[Row]:
    """Two masses under a catenary."""
    turn = 2 * pi * 1.6666666666666667

    def slope(t: float, y: np.ndarray) -> list[float]:
        between = 8200 * (y[1] - y[0]) + 10 * (y[3] - y[2])
        wire = 3600 * (1 - 0.5 * cos(turn * t)) * max(y[1], 0)
        return [y[2], y[3], (40 - 120 * y[2] + between) / 15, (-between - wire) / 8]

    end = by_pieces(slope, [lambda t, y: y[1]], [0, 1e-30, 0, 0], 6)
    source = "T. X. Wu, M. J. Brennan (1999), equations, by scipy's DOP853"
    columns = ("frame_x", "head_x", "frame_v", "head_v")
    return compared(program, "pantograph", source, "pantograph", columns, end, 1e-8)


def percussion(program: Program) -> list[Row]:
    """A hammer, a bit, and rock that yields: positions and velocities of both, position of the slider."""

    def slope(slides: float) -> Callable:
        def function(t: float, y: np.ndarray) -> list[float]:
            rock = -slides * 150 if slides else -4e4 * (y[1] - y[4])
            motor = 20 + 120 * cos(30 * t) - 800 * y[0] - 4 * y[2]
            return [y[2], y[3], motor / 2, rock / 1, y[3] if slides else 0]

        return function

    def hit(mode: str) -> tuple:
        def change(t: float, y: np.ndarray) -> tuple[str, list[float]]:
            impulse = -1.6 * (y[3] - y[2]) * 2 / 3
            after = [y[0], y[1], y[2] - impulse / 2, y[3] + impulse, y[4]]
            # A slider whose bit turns round sticks.
            return ("stick" if (mode == "down" and after[3] > 0) else mode), after

        return (lambda t, y: y[1] - y[0], change)

    def yields(sign: float) -> tuple:
        return (lambda t, y: 150 - sign * 4e4 * (y[1] - y[4]), lambda t, y: ("up" if sign > 0 else "down", y))

    def stops(sign: float) -> tuple:
        return (lambda t, y: sign * y[3], lambda t, y: ("stick", [*y[:4], y[1] - sign * 150 / 4e4]))

    modes = {
        "stick": (slope(0), [hit("stick"), yields(1), yields(-1)]),
        "up": (slope(1), [hit("up"), stops(1)]),
        "down": (slope(-1), [hit("down"), stops(-1)]),
    }
    end, _ = by_modes(modes, "stick", [-0.02, 0, 0, 0, 0], 0.05)
    source = "A. M. Krivtsov, M. Wiercigroch (2001), with hysteresis, by scipy's DOP853"
    return compared(
        program,
        "percussion",
        source,
        "percussion drill",
        ("hammer_x", "bit_x", "hammer_v", "bit_v"),
        end[:4],
        1e-7,
    )


def judder(program: Program) -> list[Row]:
    """A disc that slides under a load that varies, until it sticks."""

    def shaft(y: np.ndarray) -> float:
        return 600 * (y[1] - y[0]) + (y[3] - y[2])

    def load(t: float) -> float:
        return 300 * (1 + 0.15 * cos(80 * t))

    def slope(sign: float) -> Callable:
        def function(t: float, y: np.ndarray) -> list[float]:
            mu = 0.25 + 0.15 * exp(-abs(y[2] - 80) / 30)
            disc = (shaft(y) - sign * mu * load(t)) / 0.15 if sign else 0
            return [y[2], y[3], disc, -shaft(y) / 8]

        return function

    def slips(sign: float) -> tuple:
        return (
            lambda t, y: 0.4 * load(t) - sign * shaft(y),
            lambda t, y: ("faster" if sign > 0 else "slower", [y[0], y[1], 80 + sign * 1e-13, y[3]]),
        )

    def sticks(sign: float) -> tuple:
        return (lambda t, y: sign * (y[2] - 80), lambda t, y: ("stick", [y[0], y[1], 80, y[3]]))

    modes = {
        "slower": (slope(-1), [sticks(-1)]),
        "faster": (slope(1), [sticks(1)]),
        "stick": (slope(0), [slips(1), slips(-1)]),
    }
    end, _ = by_modes(modes, "slower", [0, 0, 0, 0], 9)
    source = "A. Crowther, R. Singh, equations, by scipy's DOP853"
    return compared(
        program, "judder", source, "clutch judder", ("disc_x", "vehicle_x", "vehicle_v"), end[[0, 1, 3]], 1e-7
    )


def yaw(program: Program) -> list[Row]:
    """A brake that sticks and slips in wind."""
    turn = 0.4 * pi

    def torque(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        wind = 3e5 + 9e5 * cos(turn * t) + 4e5 * sin(2 * turn * t) + 2.5e5 * sin(3 * turn * t)
        return wind - 2e7 * q - 1e5 * v

    machine = Structure([3e6], torque, [Friction([1], lambda u: 8e5, 1e6)])
    end = machine.run([0], [0], 60)
    return compared(program, "yaw", f"wind turbine, {OWN}", "yaw brake", ("x", "v"), end, 1e-8)


def valve_train(program: Program) -> list[Row]:
    """A valve on its seat, free, pressed by the tappet."""
    turn = 5000 * 2 * pi / 60

    def lift(t: float) -> float:
        return 8e-3 * exp((-cos(turn * t) - 1) / 0.25)

    def press(t: float, y: np.ndarray) -> float:
        rate = lift(t) * sin(turn * t) * turn / 0.25
        return 2e6 * (lift(t) - 1e-4 - y[0]) + 100 * (rate - y[1])

    def slope(pressed: bool) -> Callable:
        return lambda t, y: [y[1], (-60 - 2e4 * y[0] - 5 * y[1] + pressed * press(t, y)) / 0.1]

    def lands(mode: str) -> tuple:
        return (
            lambda t, y: y[0],
            lambda t, y: (mode, [0, -0.3 * y[1]]) if y[1] < -3e-7 else ("seat", [0, 0]),
        )

    def meets(mode: str) -> tuple:
        return (lambda t, y: y[0] - lift(t) + 1e-4, lambda t, y: (mode, y))

    modes = {
        "seat": (lambda t, y: [0, 0], [meets("loaded")]),
        "loaded": (lambda t, y: [0, 0], [(lambda t, y: 60 - press(t, y), lambda t, y: ("pressed", y))]),
        "free": (slope(False), [meets("pressed"), lands("free")]),
        "pressed": (slope(True), [(press, lambda t, y: ("free", y)), lands("pressed")]),
    }
    end, _ = by_modes(modes, "seat", [0, 0], 0.03)
    return compared(
        program,
        "valve_train",
        "valve train, equations, by scipy's DOP853",
        "valve train",
        ("x", "v"),
        end,
        1e-8,
    )


def rocking(program: Program) -> list[Row]:
    """A block on a base that shakes, from rest."""
    inertia = 4 / 3 * (1 + 0.25**2)
    kept = 1 - 2 * 0.25**2 / inertia

    def slope(side: float) -> Callable:
        return lambda t, y: [y[1], (9.81 * (y[0] - side * 0.25) - 5 * sin(10 * t)) / inertia]

    def change(t: float, y: np.ndarray) -> tuple[str, list[float]]:
        return ("left" if y[1] > 0 else "right"), [0, kept * y[1]]

    modes = {
        "rest": (
            lambda t, y: [0, 0],
            [(lambda t, y: 9.81 * 0.25 - 5 * sin(10 * t), lambda t, y: ("right", y))],
        ),
        "left": (slope(1), [(lambda t, y: y[0], change)]),
        "right": (slope(-1), [(lambda t, y: -y[0], change)]),
    }
    end, _ = by_modes(modes, "rest", [0, 0], 4)
    source = "G. W. Housner (1963), equations, by scipy's DOP853"
    return compared(program, "rocking_base", source, "block on a base that shakes", ("x", "v"), end, 1e-8)


def flat_wheel(program: Program) -> list[Row]:
    """A wheel whose flat meets the rail once per turn."""

    def slope(t: float, y: np.ndarray) -> list[float]:
        deep = y[1] - y[0] - 6e-4 * exp((cos(30 * t - pi) - 1) / 0.1**2)
        force = 9e10 * max(deep, 0) ** 1.5
        return [y[2], y[3], (force - 6e4) / 600, (-force - 7e7 * y[1] - 5e4 * y[3]) / 150]

    end = solve_ivp(slope, (0, 0.3), [-1e-3, 0, 0, 0], **TIGHT).y[:2, -1]
    source = "S. G. Newton, R. A. Clark (1979), equations, by scipy's DOP853"
    return compared(program, "flat_wheel", source, "wheel with a flat", ("wheel_x", "rail_x"), end, 1e-9)


COMPUTED = (
    flat_wheel,
    relief_valve, slack_mooring, tapping, pantograph, percussion, judder, yaw, valve_train, rocking,
)  # fmt: skip
