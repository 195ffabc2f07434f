# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two bodies coupled by friction, by their short form and part by part, as an author would write it."""

from pathlib import Path

import numpy as np
import pytest
from program import succeed
from separatrix.open import decode_flags, open_result

BODIES = """
[body.frame]
mass = {mass}
[body.ball]
mass = {driven_mass}
[watch]
body = "ball"
[friction.interface]
between = ["frame", "ball"]
force = {friction}
"""

RUN = """
run = {{ duration = {duration}, window = 20, average = "window" }}
axis = [
  {{ name = "x0", from = {low}, to = {high}, count = 9 }},
  {{ name = "v0", from = -1.5, to = 1.5, count = 9 }},
]
"""

# name: numbers, the positions of the stops, laws of the two forms, duration
CASES = {
    # nothing ties the two to the ground: what they do is seen from a frame that moves along
    "backlash": (
        {"mass": 1, "driven_mass": 0.5, "friction": 0.4},
        ["frame", "ball"],
        'drive = { law = "force", amplitude = 4, frequency = 10 }',
        '[drive.shaker]\nlaw = "force"\nbody = "frame"\namplitude = 4\nfrequency = 10\n',
        60,
    ),
    # the frame on a spring, the stops on the ground
    "ground": (
        {"mass": 1, "driven_mass": 0.5, "friction": 1.2},
        ["ball"],
        'drive = { law = "force", amplitude = 2, frequency = 1.6 }\n'
        'restoring = { law = "linear", stiffness = 1 }\nfriction = { law = "viscous", damping = 0.3 }',
        '[drive.shaker]\nlaw = "force"\nbody = "frame"\namplitude = 2\nfrequency = 1.6\n'
        '[spring.foot]\nbetween = ["frame"]\nstiffness = 1\ndamping = 0.3\n',
        300,
    ),
    # the motion of the frame is given
    "shaken": (
        {"mass": 1, "driven_mass": 0.5, "friction": 0.5},
        ["ball"],
        'drive = { law = "sine", amplitude = 0.3, frequency = 4 }',
        '[drive.shaker]\nlaw = "motion"\nbody = "frame"\nsine = [0.3]\nfrequency = 4\n',
        100,
    ),
}
# name: law, its parameters
STOPS = {
    "rigid": ("newton", ["restitution = 0.6"]),
    "pushing": ("kelvin_voigt", ["stiffness = 400", "damping = 2", "tension = 0"]),
    "pulling": ("kelvin_voigt", ["stiffness = 400", "damping = 2", "tension = 1"]),
}


def two_forms(name: str, stop: str) -> tuple[str, str]:
    """The case of a pair, and of the same two bodies part by part."""
    numbers, between, short, parts, duration = CASES[name]
    carried = len(between) == 2
    stop_law, parameters = STOPS[stop]
    law = "backlash_pair" if carried else "friction_pair"
    body = ", ".join(f"{key} = {value}" for key, value in numbers.items())
    contact = [f'law = "{stop_law}"', *parameters, "upper = 0.2", "lower = -0.25"]
    run = RUN.format(duration=duration, low=-0.24, high=0.19)
    quoted = ", ".join(f'"{one}"' for one in between)
    joint = "\n".join(["[contact.stops]", f"between = [{quoted}]", *contact])
    pair = f'{run}{short}\nbody = {{ law = "{law}", {body} }}\ncontact = {{ {", ".join(contact)} }}\n'
    return pair, run + BODIES.format(**numbers) + parts + joint


@pytest.mark.parametrize(
    "stop", [pytest.param(stop, marks=[] if stop == "rigid" else [pytest.mark.long]) for stop in STOPS]
)
@pytest.mark.parametrize("name", CASES)
def test_labels_of_both_forms_are_the_same(separatrix: Path, tmp_path: Path, name, stop):
    maps = []
    for form, text in zip(("pair", "structure"), two_forms(name, stop), strict=True):
        (tmp_path / f"{form}.toml").write_text(text)
        succeed(separatrix, "basin", f"{form}.toml", "-o", f"{form}.h5", folder=tmp_path)
        with open_result(tmp_path / f"{form}.h5") as result:
            maps.append(result.load())
    pair, structure = maps
    columns = ["mean_impact_speed"]
    # of what drifts only the relative motion is the same
    columns += ["amplitude", "x_max", "x_min"] if name != "backlash" else []
    for column in columns:
        assert structure[column].values == pytest.approx(pair[column].values, rel=1e-6, abs=1e-9), column
    for column in ("attractor", "period", "regime", "reason", "event_word", "impacts_per_period"):
        assert np.array_equal(pair[column], structure[column], equal_nan=True), column
    parts = ("catalogue_multiplier_real", "catalogue_multiplier_imaginary")
    multipliers = [np.hypot(*(one[part] for part in parts)) for one in maps]
    for own, other in zip(*(np.sort(one, axis=-1) for one in multipliers), strict=True):
        shared = min(len(own), len(other))
        assert other[-shared:] == pytest.approx(own[-shared:], abs=1e-6, nan_ok=True)


@pytest.mark.parametrize("stop", ["rigid", "pushing"])
@pytest.mark.parametrize("name", CASES)
def test_the_adaptive_flight_is_that_in_closed_form(separatrix: Path, tmp_path: Path, name, stop):
    """Twenty seconds with impacts, sticking and sliding: neither flight knows of the other."""
    (tmp_path / "pair.toml").write_text(two_forms(name, stop)[0])
    runs = []
    for flight in ("exact", "adaptive"):
        settings = (f"integrator.flight='{flight}'", "run.duration=20", "start.x0=0.05", "start.v0=0.3")
        words = [word for one in settings for word in ("--set", one)]
        succeed(separatrix, "trajectory", "pair.toml", *words, "-o", f"{flight}.h5", folder=tmp_path)
        with open_result(tmp_path / f"{flight}.h5") as result:
            runs.append(result.load())
    exact, marched = runs
    kinds = [decode_flags(one["event_kind"]).values for one in runs]
    # where a chatter dies away, marched gaps close by the rounding of their margins, some impacts earlier
    chatters = np.isin(kinds[0], ["chatter_upper", "chatter_lower"]).any()
    assert chatters or np.array_equal(*kinds)
    assert kinds[0].size > 10
    bar = 1e-6 if chatters else 1e-9
    for column in ("x", "v", "driver_x", "driver_v"):
        assert marched[column].values == pytest.approx(exact[column].values, abs=bar), column
