# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Boundaries of structures: slices through 2n dimensions, pieces of stable sets of saddles in all of them."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from program import succeed
from scipy.linalg import expm
from separatrix import style
from separatrix.figures import boundary
from separatrix.library import Model
from separatrix.open import decode_flags, decode_words, open_result, table
from separatrix.simulate import search_slices

FREQUENCY, LOSS = 1.14, 0.8
COUPLED = np.array([[2.0, -1.0], [-1.0, 1.0]])


@pytest.fixture(scope="module")
def closed_form(source_dir):
    """Section point and multipliers of the saddle with one impact a period, by its quadratic equation."""
    sys.path.insert(0, str(source_dir / "scripts" / "evidence"))
    orbits = importlib.import_module("validation_structures").orbits
    sys.path.remove(str(source_dir / "scripts" / "evidence"))
    damping, force = 0.04 * COUPLED, np.array([1.0, 0.0])
    speed, phase, position, velocity = min(
        orbits(FREQUENCY, np.eye(2), damping, COUPLED, force, [0, 1], 1, LOSS), key=lambda found: found[0]
    )
    system = np.block([[np.zeros((2, 2)), np.eye(2)], [-COUPLED, -damping]])
    response = np.linalg.solve(COUPLED - FREQUENCY**2 * np.eye(2) + 1j * FREQUENCY * damping, force)

    def steady(angle: float) -> np.ndarray:
        turned = response * np.exp(1j * angle)
        return np.concatenate([turned.real, (1j * FREQUENCY * turned).real])

    after = np.concatenate([position, velocity])
    left = (2 * np.pi - phase) / FREQUENCY
    point = steady(0) + expm(system * left) @ (after - steady(phase))
    # saltation: the impact comes later by dt = -dx/speed
    before = after + np.array([0, 0, 0, (1 + LOSS) * speed])
    jump = np.diag([1.0, 1.0, 1.0, -LOSS])
    push = np.array([np.cos(phase), 0.0])
    slopes = [system @ state + np.concatenate([[0, 0], push]) for state in (before, after)]
    saltation = jump + np.outer(slopes[1] - jump @ slopes[0], [0, 1, 0, 0]) / speed
    values = np.linalg.eigvals(expm(system * 2 * np.pi / FREQUENCY) @ saltation)
    return point, values[np.argsort(-abs(values))]


@pytest.fixture(scope="module")
def masses(separatrix, source_dir, tmp_path_factory) -> Path:
    """Map and boundary of two masses with a stop."""
    folder = tmp_path_factory.mktemp("masses")
    text = (source_dir / "examples" / "structure_two_masses.toml").read_text()
    (folder / "two.toml").write_text(text.replace("count = 61", "count = 21"))
    succeed(separatrix, "basin", "two.toml", "-o", "two.h5", folder=folder)
    succeed(separatrix, "boundary", "two.h5", "-o", "curves.h5", folder=folder)
    return folder


def test_the_boundary_of_two_masses_is_the_stable_set_of_the_saddle_of_the_closed_form(masses, closed_form):
    point, multipliers = closed_form
    with open_result(masses / "curves.h5") as result:
        assert result.sizes["point"] > 20
        assert set(decode_flags(result["piece_name"]).values) == {"stable_set"}
        saddles = table(result, "saddles")
        assert decode_words(saddles["event_word"]).values.tolist() == ["R."]
        assert saddles["boundary_points"].values.tolist() == [result.sizes["point"]]
        np.testing.assert_allclose(saddles["section"].values[0], point, atol=1e-9)
        assert saddles["x"].values[0] == pytest.approx(point[1], abs=1e-9)
        found = saddles["multipliers"].values[0] + 1j * saddles["multipliers_imag"].values[0]
        np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(multipliers), atol=1e-8)
        assert abs(found[0]) > 1 > abs(found[1:]).max()


def test_starts_beside_the_boundary_of_two_masses_have_the_labels_of_its_sides(masses):
    with open_result(masses / "curves.h5") as result:
        catalogue = search_slices(Model.from_text(result.attrs["resolved_case"]), [{}], ())[0]
        for sign, side in ((-1, "below"), (1, "above")):
            starts = np.zeros((result.sizes["point"], 3))
            for k, name in enumerate(("x0", "v0")):
                starts[:, k] = result[name].values + sign * 1e-8 * (result["across"].values == k)
            np.testing.assert_array_equal(catalogue.labels(starts)["attractor"], result[side].values)


def test_the_figure_does_not_mark_a_saddle_that_is_not_in_the_slice(masses):
    with open_result(masses / "curves.h5") as result, style.context():
        figure = boundary.figures(masses / "curves.h5", result, "title")["boundary"]
        texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert "boundary: stable set of saddle 1" in texts and "saddle" not in texts


def test_an_equilibrium_is_no_saddle(separatrix, source_dir, tmp_path):
    case = source_dir / "examples" / "validation" / "structures" / "belt_coulomb.toml"
    axes = (
        "axis=[{name='x0', from=-1, to=1, count=11}, {name='v0', from=-2, to=2, count=11}]",
        *("attractors.sample=16", "run.duration=60"),
    )
    settings = [word for item in axes for word in ("--set", item)]
    succeed(separatrix, "basin", case, *settings, "-o", "map.h5", folder=tmp_path)
    succeed(separatrix, "boundary", "map.h5", "-o", "curves.h5", folder=tmp_path)
    with open_result(tmp_path / "curves.h5") as result:
        assert table(result, "saddles").sizes["orbit"] == 0
        assert {"stick", "not_known"} >= set(decode_flags(result["piece_name"]).values)
