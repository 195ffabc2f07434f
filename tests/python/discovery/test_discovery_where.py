# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a gap is: the map over the variable of the missing force is reported, not correlated ones."""

import pytest
from separatrix.discovery import Options
from separatrix.discovery.decision.where import sentences, where_maps
from separatrix.discovery.fitting.base import fit_base
from separatrix.discovery.fitting.data import gather, scales_of
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
