# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a gap is: the map of what the missing force depends on is told, not those that go along with it."""

import pytest
from separatrix.discovery import Options
from separatrix.discovery.decision.where import sentences, where_maps
from separatrix.discovery.fitting.base import fit_base
from separatrix.discovery.fitting.data import gather, scales_of
from separatrix.discovery.measured.preflight import prepare
from separatrix.discovery.measured.records import read_record
from separatrix.library import Model

pytestmark = pytest.mark.usefixtures("library")


def test_the_clearest_region_of_a_drag_is_one_of_the_speed(source_dir, tmp_path, monkeypatch):
    """A bin of slow speeds was the clearest one by itself, though these bins together explain less."""
    monkeypatch.syspath_prepend(str(source_dir / "tests" / "generator"))
    monkeypatch.syspath_prepend(str(source_dir / "scripts"))
    import records
    from design import draw

    case = tmp_path / "case"
    records.write_case(case, tmp_path / "truth.json", draw(5101, 25))
    base = Model.read(case / records.BASE)
    data = gather([prepare(read_record(case / name), base) for name in records.TRAINING], 1.0, None)
    mass = scales_of(data, base).mass
    told = sentences(where_maps(fit_base(data, base, mass), mass, Options()))
    clearest = max(told, key=lambda one: abs(one["force"] / one["error"]))
    assert clearest["map"] in ("velocity", "position and velocity")
    assert not any(one["map"].startswith("time in") for one in told)
