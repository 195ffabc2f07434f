# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a gap is: the map over the variable of the missing force is reported, not correlated ones."""

import numpy as np
import pytest
from separatrix.discovery import Options
from separatrix.discovery.decision.where import Map, _at_rest, sentences, where_maps
from separatrix.discovery.fitting.base import fit_base
from separatrix.discovery.fitting.data import gather, scales_of
from separatrix.discovery.fitting.regions import Region
from separatrix.discovery.measured.preflight import prepare
from separatrix.discovery.measured.records import read_record
from separatrix.library import Model

pytestmark = pytest.mark.usefixtures("library")


def regions(folder, records, drawn, louder: float = 1.0) -> list[dict]:
    """Reported regions of the gap of a case of the generator, with stated noise that is `louder`."""
    case = folder / "case"
    records.write_case(case, folder / "truth.json", drawn)
    base = Model.read(case / records.BASE)
    prepared = [prepare(read_record(case / name), base) for name in records.TRAINING]
    for one in prepared if louder > 1 else ():
        # as if it was stated: what is measured would be the noise that there is
        one.sigma, one.velocity_sigma = louder * one.sigma, louder * one.velocity_sigma
        one.sigma_stated = one.velocity_sigma_stated = True
    data = gather(prepared, 1.0, None)
    mass = scales_of(data, base).mass
    return sentences(where_maps(fit_base(data, base, mass), mass, Options()))


def test_the_clearest_region_of_a_drag_is_one_of_the_speed(source_dir, tmp_path, monkeypatch):
    """A bin of slow speeds was the clearest one by itself, though these bins together explain less."""
    monkeypatch.syspath_prepend(str(source_dir / "tests" / "generator"))
    monkeypatch.syspath_prepend(str(source_dir / "scripts" / "evidence"))
    import records
    from design import draw

    found = regions(tmp_path, records, draw(5101, 25))
    assert {one["map"] for one in found} <= {"velocity", "position and velocity"}
    assert found


def test_a_loss_that_grows_with_the_speed_of_impacts_is_missing_at_impacts(source_dir, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(source_dir / "tests" / "generator"))
    monkeypatch.syspath_prepend(str(source_dir / "scripts" / "evidence"))
    import records
    from design import draw

    found = regions(tmp_path, records, draw(5202, 0))
    assert {one["map"] for one in found} == {"impact speed"}
    assert all(one["text"].startswith("a speed after impacts of") for one in found)


def test_nothing_is_reported_where_the_noise_explains_all(source_dir, tmp_path, monkeypatch):
    """No map explains more than its bins: the best of none was asked for."""
    monkeypatch.syspath_prepend(str(source_dir / "tests" / "generator"))
    monkeypatch.syspath_prepend(str(source_dir / "scripts" / "evidence"))
    import records
    from design import draw

    assert regions(tmp_path, records, draw(5101, 25), louder=1e4) == []


def test_a_region_beyond_a_barrier_that_yields_is_where_the_body_presses_on_it():
    """One that lies on both sides of it belongs to the side on which most of it is."""
    edges, flagged = np.array([-0.3, -0.1, 0.018, 0.03]), np.array([True, False, True])
    force = np.array([0.2, 0.0, 0.5])
    found = {
        name: sentences([Map(name, "m", "N", edges, None, force, 0.05 + 0 * force, flagged)], barriers)
        for name, barriers in (("position", {"upper": 0.022}), ("velocity", {"upper": 0.022, "lower": -0.1}))
    }
    assert [one["text"].partition("missing ")[2] for one in found["position"]] == [
        "at position 0.018 to 0.03 m, where the body presses on the upper barrier",
        "at position -0.3 to -0.1 m",
    ]
    assert not any("barrier" in one["text"] for one in found["velocity"])
    below = [Map("position", "m", "N", edges, None, force, 0.05 + 0 * force, flagged)]
    assert sentences(below, {"lower": -0.1})[1]["text"].endswith("presses on the lower barrier")
    assert not any("barrier" in one["text"] for one in sentences(below))


def test_no_force_is_missing_in_a_bin_of_speeds_at_rest():
    """What friction holds there is anything up to its level: a bin of -1.6 to 0 mm/s lacked -2.39 N."""

    def region(name, edges, other=None):
        count = (len(edges) - 1) * (1 if other is None else len(other) - 1)
        other = None if other is None else np.array(other)
        return Region(name, "", "N", np.array(edges), other, np.zeros((1, 1, count)))

    regions = [
        region("position", [-1e-3, 0.0, 1e-3]),
        region("velocity", [-0.1, -1.6e-3, 0.0, 0.2]),
        region("low speed", [-2e-2, -3e-3, 0.0, 1e-3]),
        region("position and velocity", [0.0, 1e-3, 1.0], [-1e-3, 1e-3, 0.2]),
    ]
    assert _at_rest(regions).astype(int).tolist() == [0, 0, 0, 1, 0, 0, 1, 1, 1, 0, 1, 0]
    assert not _at_rest(regions[:1]).any()
