# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What columns of machines of several bodies are of."""

import numpy as np
import pytest
from separatrix.discovery.fitting.sensed import gather_sensed
from separatrix.discovery.measured.records import Record, make_record
from separatrix.discovery.measured.sensors import prepare_sensors
from separatrix.discovery.workflow import _cut
from separatrix.errors import SeparatrixError
from separatrix.library import Model

pytestmark = pytest.mark.usefixtures("library")

TWO = """
body.first.mass = 1
body.second.mass = 0.8
watch.body = "second"
drive.force = {law = "force", body = "first", amplitude = 4, frequency = 7}
run.duration = 20
[spring.frame]
between = ["first"]
stiffness = 40
damping = 0.3
[spring.coupling]
between = ["first", "second"]
stiffness = 60
damping = 0.2
"""
RATE = 7.3
T = np.arange(1000) / 100
X, V = np.sin(RATE * T), RATE * np.cos(RATE * T)
OTHER, FORCE = 0.3 * np.sin(RATE * T + 1), 50 * np.cos(RATE * T)


def record(**columns: np.ndarray) -> Record:
    """Columns whose names have `_` for the dot, with a little noise."""
    random = np.random.default_rng(0)
    noisy = {
        name.replace("_", "."): column + 1e-3 * np.std(column) * random.standard_normal(T.size)
        for name, column in columns.items()
    }
    header = {"units": "t s, x m", "drive_frequency_rad_s": RATE, "phase": 0}
    return make_record("record", {"t": T} | noisy, header)


@pytest.mark.parametrize(
    ("columns", "found"),
    [
        ({"x": X}, ["x.second"]),
        ({"x": X, "v": V}, ["x.second", "v.second"]),
        ({"F_coupling": FORCE, "x": X}, ["x.second", "F.coupling"]),
        ({"x_first": OTHER, "x": X}, ["x.second", "x.first"]),
        ({"x_first": OTHER, "v": V}, ["x.first", "v.second"]),
        ({"x_first": OTHER, "v_second": V}, ["x.first", "v.second"]),
    ],
)
def test_x_and_v_are_of_the_watched_body_also_beside_named_columns(columns, found):
    whole, model = record(**columns), Model.from_text(TWO)
    for one in (whole, _cut(whole, 0, 900, "")):
        prepared = prepare_sensors(one, model)
        assert [sensor.name for sensor in prepared.sensors] == found
        for name, kind in (("x.second", "x"), ("v.second", "v")):
            if kind in columns:
                assert np.array_equal(prepared.sensor(name).values, getattr(one, kind))
        assert prepared.place == ("second" if "x" in columns else "first")
        assert np.array_equal(prepared.sensor(f"x.{prepared.place}").values, one.x)
    # that there is a place to follow
    assert gather_sensed([prepared], 1.0, None, model).last == 2


@pytest.mark.parametrize("kind", ["x", "v"])
def test_a_body_with_two_columns_of_a_kind_is_refused(kind):
    columns = {"x": X, kind: X, f"{kind}_second": X}
    with pytest.raises(SeparatrixError, match=f"columns {kind} and {kind}.second, allowed one of them"):
        prepare_sensors(record(**columns), Model.from_text(TWO))


def test_x_beside_a_named_place_is_tested_for_clipping():
    with pytest.raises(SeparatrixError, match="x stays at its largest value 0.8 m .* clipped"):
        make_record("record", {"t": T, "x.first": OTHER, "x": np.minimum(X, 0.8)}, {"units": "t s, x m"})
