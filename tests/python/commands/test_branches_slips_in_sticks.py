# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `branches` where a body that sticks begins or ceases to be let go of, against closed forms."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from program import succeed
from separatrix import open_result
from separatrix.open import decode_flags

CASE = """
body = {{ mass = 1, gravity = 1 }}
restoring = {{ law = "linear", stiffness = 1 }}
friction.law = "coulomb_viscous"
friction.kinetic_coefficient = {sliding}
friction.static_coefficient = {holding}
friction.damping = {damping}
contact = {{ law = "none" }}
drive = {{ law = "fourier", ratio = 0.095, cosine = {cosine}, sine = {sine} }}
start = {{ x0 = 0 }}
run = {{ duration = 400 }}
axis = [
  {{ name = "x0", from = -2, to = 2, count = 20 }},
  {{ name = "v0", from = -1, to = 1, count = 20 }},
]
"""
STRUCTURE = """
body.b.mass = 1
spring.s = {{ between = ["b"], stiffness = 1, damping = {damping} }}
friction.f = {{ between = ["b"], force = {sliding} }}
drive.d = {{ law = "force", body = "b", frequency = 0.095, cosine = {cosine}, sine = {sine} }}
start = {{ x0 = 0 }}
run = {{ duration = 400 }}
axis = [
  {{ name = "x0", from = -2, to = 2, count = 20 }},
  {{ name = "v0", from = -1, to = 1, count = 20 }},
]
"""


def zero(f: Callable[[float], float], low: float, high: float) -> float:
    """By halving."""
    sign = np.sign(f(low))
    for _ in range(52):
        middle = (low + high) / 2
        low, high = (middle, high) if np.sign(f(middle)) == sign else (low, middle)
    return (low + high) / 2


def first_zero(f: Callable, start: float, end: float) -> float:
    """Where f first rises through zero."""
    t = np.linspace(start, end, 2_001)
    i = np.flatnonzero((f(t[:-1]) < 0) & (f(t[1:]) >= 0))[0]
    return zero(f, t[i], t[i + 1])


@dataclass
class Oscillator:
    """x'' + b x' + x = Re sum c_n exp(i n w t) - friction, half-periods mirror images, in closed form."""

    series: dict[int, complex]
    damping: float
    sliding: float
    holding: float

    def case(self, text: str) -> str:
        cosine = [self.series.get(n, 0.0).real for n in range(1, max(self.series) + 1)]
        sine = [0.0 - self.series.get(n, 0.0).imag for n in range(1, max(self.series) + 1)]
        numbers = {"sliding": self.sliding, "holding": self.holding, "damping": self.damping}
        return text.format(cosine=cosine, sine=sine, **numbers)

    def force(self, w: float, t, order: int = 0):
        return sum(((1j * n * w) ** order * c * np.exp(1j * n * w * t)).real for n, c in self.series.items())

    def slip(self, w: float, release: float, x: float) -> tuple[float, float]:
        """When and where a slip upwards ends."""
        linear = {n: 1 - (n * w) ** 2 + 1j * self.damping * n * w for n in self.series}
        steady = Oscillator({n: c / linear[n] for n, c in self.series.items()}, 0, 0, 0)
        rate = -self.damping / 2 + 1j * np.sqrt(1 - self.damping**2 / 4)
        real = x - steady.force(w, release) + self.sliding
        free = real + 1j * (rate.real * real + steady.force(w, release, 1)) / rate.imag

        def slows(t):
            return -steady.force(w, t, 1) - (rate * free * np.exp(rate * (t - release))).real

        end = first_zero(slows, release + 1e-3, release + 40)
        return end, steady.force(w, end) - self.sliding + (free * np.exp(rate * (end - release))).real

    def stick(self, w: float) -> tuple[float, float, float]:
        """Position, beginning and end of the stick after the slip upwards, with one slip each way."""
        x, begin, half = -0.6, -0.4 * np.pi / w, np.pi / w
        for _ in range(60):
            release = first_zero(lambda t, x=x: self.force(w, t) - x - self.holding, begin, begin + 2 * half)
            end, y = self.slip(w, release, x)
            x, begin = -y, end - half
        return y, end, release + half

    def reserve(self, w: float) -> float:
        """What is least left, in that stick, of the friction that holds against being moved further up."""
        x, begin, end = self.stick(w)
        t = np.linspace(begin, end, 2_001)
        top = np.argmax(self.force(w, t))
        top = zero(lambda t: self.force(w, t, 1), t[top - 1], t[top + 1])
        return self.holding + x - self.force(w, top)


@pytest.fixture
def follow(separatrix: Path, tmp_path: Path):
    """Runs the command on a case text; returns parameters, largest multipliers, labels and event words."""

    def follow_it(case: str, name: str, start: float, end: float, searches: int) -> tuple[np.ndarray, ...]:
        (tmp_path / "case.toml").write_text(case)
        over = ("--parameter", name, "--from", start, "--to", end, "--searches", searches)
        succeed(separatrix, "branches", "case.toml", *over, "--force", "-o", "out.h5", folder=tmp_path)
        with open_result(tmp_path / "out.h5") as result:
            labels = decode_flags(result["label"]).values
            multipliers = result["multiplier_real"].values[:, 0]
            return result["parameter"].values, multipliers, labels, result["event_word"].values

    return follow_it


@pytest.mark.parametrize("searches", [1, pytest.param(3, marks=pytest.mark.long)])
@pytest.mark.parametrize(("text", "name"), [(CASE, "drive.ratio"), (STRUCTURE, "drive.d.frequency")])
def test_a_slip_within_a_stick_begins_and_ends(follow, text: str, name: str, searches: int) -> None:
    """Where the second hump of the force only just reaches friction: from either side the branch goes on."""
    oscillator = Oscillator({1: 1.0, 3: -0.5 + 0.1j}, 0.2, 0.5, 0.5)
    parameter, multipliers, labels, words = follow(oscillator.case(text), name, 0.09, 0.1, searches)
    assert set(labels) == {"none", "end_of_range", "stick_onset"}
    onset = np.flatnonzero(labels == "stick_onset")
    assert parameter[onset] == pytest.approx([zero(oscillator.reserve, 0.092, 0.098)], abs=1e-9)
    assert (np.diff(parameter) > 0).all()
    # a slip each way above, two below
    assert len({words[0], words[-1]}) == 2
    assert set(words[parameter < parameter[onset]]) == {words[0]}
    assert set(words[parameter > parameter[onset]]) == {words[-1]}
    # the slip goes with the square of what the force is beyond friction: multipliers have no jump
    k = onset[0]
    assert multipliers[k - 1 : k + 2] == pytest.approx(multipliers[k], abs=5e-3)


def test_stick_slip_ends_where_the_force_reaches_friction_in_a_stick(follow) -> None:
    """With more friction at rest than in motion a body that is let go of slips on, to another motion."""
    oscillator = Oscillator({1: 1.5}, 0.1, 1.0, 1.1)
    parameter, _, labels, _ = follow(oscillator.case(CASE), "drive.ratio", 0.1, 0.3, 3)
    end = parameter[labels == "stiction_end"]
    assert end == pytest.approx([zero(oscillator.reserve, 0.108, 0.115)], abs=1e-9)


def test_stick_slip_ends_where_the_force_that_releases_just_reaches_friction(follow) -> None:
    """The body is let go of at the top of the force, and there no more."""
    w, damping, sliding, holding = 0.3, 0.1, 1.0, 1.5

    def missed(amplitude: float) -> float:
        x = amplitude - holding
        return Oscillator({1: amplitude}, damping, sliding, holding).slip(w, 0.0, x)[1] + x

    case = Oscillator({1: 1.5}, damping, sliding, holding).case(CASE).replace("ratio = 0.095", f"ratio = {w}")
    case = case.replace('law = "fourier"', 'law = "harmonic", amplitude = 1.5')
    case = case.replace(", cosine = [1.5], sine = [0.0]", "")
    parameter, _, labels, _ = follow(case, "drive.amplitude", 0.8, 1.6, 4)
    end = parameter[labels == "stiction_end"]
    assert end == pytest.approx([zero(missed, 0.7, 1.4)], abs=1e-9)
