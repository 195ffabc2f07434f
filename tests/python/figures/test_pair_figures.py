# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of two bodies and of soft contacts, from files that the program wrote."""

import numpy as np
import pytest
from program import succeed
from separatrix import cli, style
from separatrix.figures import contact, energy, pair, pair_sweep, trajectory
from separatrix.open import open_result


def file_of(separatrix, source_dir, folder, example, *settings):
    words = [word for setting in settings for word in ("--set", setting)]
    case = source_dir / "examples" / f"{example}.toml"
    succeed(separatrix, "trajectory", case, "-o", folder / f"{example}.h5", *words, folder=folder)
    return folder / f"{example}.h5"


def test_modes_are_shaded(separatrix, source_dir, tmp_path):
    path = file_of(separatrix, source_dir, tmp_path, "pair_platform")
    with open_result(path) as result, style.context():
        ax = style.new_figure(100, 50).add_subplot()
        assert pair.shade_modes(ax, result) == {"stick", "upper_barrier"}
        bands = [patch.get_extents().get_points() for patch in ax.patches]
        assert len(bands) == 2
        figure = pair.history(result, "platform")
    apart = figure.axes[1].lines[0].get_ydata()
    assert apart[0] == 1
    assert apart[-1] == 0


def test_energy_adds_up(separatrix, source_dir, tmp_path):
    """The top of what is stacked is the line of what was put in."""
    path = file_of(separatrix, source_dir, tmp_path, "pair_free")
    with open_result(path) as result, style.context():
        figure = energy.decomposition(result, "free pair", [])
        top = max(
            (piece.get_paths()[0].vertices[:, 1].max() for piece in figure.axes[0].collections), default=0
        )
        assert top == pytest.approx(0.5, abs=1e-12)
        assert figure.axes[0].lines[0].get_ydata() == pytest.approx(0.5)


def test_contact_loops_close(separatrix, source_dir, tmp_path):
    path = file_of(separatrix, source_dir, tmp_path, "contact_hunt_crossley")
    with open_result(path) as result, style.context():
        found = contact.contacts(result)
        assert len(found) >= 2
        for _, speed, time, depth, force in found:
            assert speed > 0
            assert np.all(np.diff(time) > 0)
            # the force starts and ends at zero
            assert max(force[0], force[-1]) < 0.2 * force.max()
            assert min(depth) > 0
        speeds = [speed for _, speed, *_ in found]
        peaks = [force.max() for *_, force in found]
        assert np.argmax(speeds) == np.argmax(peaks)
        figure = trajectory.figures(result, "contact")["contact"]
    assert len(figure.axes[0].lines) == min(len(found), contact.MOST_LOOPS) + 1


def test_linear_damping_jumps_and_pulls(separatrix, source_dir, tmp_path):
    law = 'contact={law="kelvin_voigt_restitution", stiffness=1e5, restitution=0.5, upper=0}'
    path = file_of(separatrix, source_dir, tmp_path, "contact_hunt_crossley", law)
    with open_result(path) as result:
        _, _, _, _, force = contact.contacts(result)[0]
    assert force[0] > 0.2 * force.max()
    assert force[-1] < -0.02 * force.max()


def test_backlash_is_shown_relative_to_its_stops(separatrix, source_dir, tmp_path):
    """Between the stops in the phase portrait; impacts turn the relative velocity by the restitution."""
    path = file_of(separatrix, source_dir, tmp_path, "pair_backlash")
    with open_result(path) as result, style.context():
        seen = pair.relative_to_stop(result)
        assert np.abs(seen["x"]).max() <= 0.1 + 1e-12
        hits = np.abs(seen["event_x"].values) > 0.1 - 1e-9
        turned = seen["event_v_after"].values[hits] / seen["event_v_before"].values[hits]
        assert turned == pytest.approx(-0.85, abs=1e-12)
        ax = trajectory.figures(result, "backlash")["phase"].axes[0]
        assert ax.get_xlabel() == "relative position $x_2 - x_1$ (m)"
        assert np.nanmax(np.abs(ax.lines[0].get_xdata())) <= 0.1 + 1e-12


def test_soft_backlash_has_loops(separatrix, source_dir, tmp_path):
    law = 'contact={law="hunt_crossley_exact", stiffness=1e5, restitution=0.85, upper=0.1, lower=-0.1}'
    path = file_of(separatrix, source_dir, tmp_path, "pair_backlash", law)
    with open_result(path) as result, style.context():
        found = contact.contacts(pair.relative_to_stop(result))
        assert len(found) > 5
        for _, speed, _, depth, force in found:
            assert speed > 0
            assert min(depth.min(), force.min()) > 0
        assert len(trajectory.figures(result, "b")["contact"].axes[0].lines) > 5


@pytest.mark.long
def test_contacts_beside_one_another(separatrix, source_dir, tmp_path):
    files = [
        file_of(separatrix, source_dir, tmp_path, f"contact_{law}")
        for law in ("hunt_crossley", "kelvin_voigt")
    ]
    words = [*map(str, files), "--beside", "-o", str(tmp_path / "out"), "--formats", "png", "--dpi", "50"]
    assert cli.main(words) == 0
    assert (tmp_path / "out" / "contact_hunt_crossley_beside.png").is_file()
    other = file_of(separatrix, source_dir, tmp_path, "pair_free")
    assert cli.main([str(other), "--beside", "-o", str(tmp_path / "out")]) == 64


def test_a_motion_at_rest_is_shown_from_its_start(separatrix, source_dir, tmp_path):
    path = file_of(separatrix, source_dir, tmp_path, "hammer")
    with open_result(path) as result, style.context():
        ax = trajectory.figures(result, "hammer")["phase"].axes[0]
        assert np.nanmax(ax.lines[0].get_ydata()) == pytest.approx(2, abs=1e-3)


def test_books_of_one_body_close_at_every_sample(separatrix, source_dir, tmp_path):
    examples = ("contact_hunt_crossley", "trajectory_coulomb_1.05", "trajectory_stribeck_1.2_impact")
    for example in examples:
        with open_result(file_of(separatrix, source_dir, tmp_path, example)) as result:
            spent = result["friction_loss"] + result["damping_loss"] + result["contact_loss"]
            missing = result.attrs["energy_start"] + result["drive_work"] - spent - result["energy"]
            assert np.abs(missing).max() < 1e-10 * float(result.attrs["energy_start"] + spent[-1])
            np.testing.assert_allclose(result["kinetic_energy"], 0.5 * result["v"] ** 2, rtol=1e-14)


def test_regimes_along_a_sweep(separatrix, source_dir, tmp_path):
    """Stick and slip begins at kappa = 2/sqrt(4 + pi^2), stick for ever at 1, to four digits and more."""
    path = tmp_path / "kappa.h5"
    succeed(separatrix, "sweep", source_dir / "examples/sweep_pair_kappa.toml", "-o", path, folder=tmp_path)
    with open_result(path) as result, style.context():
        spans = pair_sweep.spans(result, "body_friction")
        pair_sweep.regimes(result, "body_friction", "kappa")
    assert [regime for _, _, regime in spans] == ["non_impact", "sticking", "stuck"]
    assert spans[0][1] == pytest.approx(2 / np.sqrt(4 + np.pi**2), abs=2e-6)
    assert spans[1][1] == pytest.approx(1, abs=2e-6)


@pytest.mark.parametrize(
    ("example", "names"),
    [
        ("pair_free", ["history", "energy", "phase"]),
        pytest.param(
            "contact_hunt_crossley", ["history", "energy", "contact", "phase"], marks=pytest.mark.long
        ),
    ],
)
def test_figures_are_written(separatrix, source_dir, tmp_path, example, names):
    path = file_of(separatrix, source_dir, tmp_path, example)
    assert cli.main([str(path), "-o", str(tmp_path / "out")]) == 0
    made = {item.name for item in (tmp_path / "out").iterdir()}
    assert made == {f"{example}_{name}.{suffix}" for name in names for suffix in ("png", "pdf")}
