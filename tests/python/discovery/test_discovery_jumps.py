# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A measured velocity is not compared next to an impact whose time is less certain than the sampling."""

import numpy as np
import pytest
from separatrix.discovery.fitting.base import fit_base
from separatrix.discovery.fitting.data import gather, scales_of
from separatrix.discovery.measured.preflight import prepare
from separatrix.discovery.measured.records import read_record
from separatrix.discovery.measured.signals import jumps
from separatrix.library import Model


def test_jumps_are_steps_beyond_the_noise_and_beyond_the_steps_beside_them():
    t = np.linspace(0, 4 * np.pi, 400)
    v = np.cos(t) + np.where(t > 5.0, -1.5, 0.0) + np.where(t > 9.0, 0.02, 0.0)
    noisy = v + 0.01 * np.random.default_rng(3).standard_normal(t.size)
    assert list(jumps(noisy, 0.01)) == [int(np.searchsorted(t, 5.0)) - 1]
    # a soft contact turns the body within several samples
    soft = np.cos(t) - 1.5 / (1 + np.exp(-(t - 5.0) / 0.1))
    assert jumps(soft, 0.01).size == 0


@pytest.mark.usefixtures("library")
def test_a_sample_on_the_wrong_side_of_an_impact_holds_no_fit(source_dir, tmp_path, monkeypatch):
    """In five of 54 segments one velocity before an impact was fitted by one after it: chi^2 of 6000 each."""
    monkeypatch.syspath_prepend(str(source_dir / "tests" / "generator"))
    monkeypatch.syspath_prepend(str(source_dir / "scripts" / "evidence"))
    import records
    from design import draw

    case = tmp_path / "case"
    records.write_case(case, tmp_path / "truth.json", draw(5202, 15))
    base = Model.read(case / records.BASE)
    data = gather([prepare(read_record(case / name), base) for name in records.TRAINING], 1.0, None)
    fitted = fit_base(data, base, scales_of(data, base).mass).fit
    assert fitted.converged
    assert fitted.sample_chi2 < 1.1
    assert np.max(fitted.chi2 / fitted.counts) < 1.5
    left_out = [int(one.samples.blind.sum()) for one in data.prepared]
    sizes = [one.record.t.size for one in data.prepared]
    assert all(0 < count < 0.02 * size for count, size in zip(left_out, sizes, strict=True))
