# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""An effect of two laws is fitted with each alone where one is doubtful or it is asked for."""

from types import SimpleNamespace

import numpy as np
import pytest
from separatrix.discovery.fitting import halves as halves_module
from separatrix.discovery.fitting.catalogue import Candidate
from separatrix.discovery.fitting.halves import halves
from separatrix.discovery.fitting.machine import Free

NAME = "asymmetric_friction"
COULOMB, VISCOUS = (f"effect.{NAME}.{key}" for key in ("coulomb", "viscous"))


@pytest.mark.parametrize(("errors", "gained", "converged", "doubtful", "split"), [
    ((0.1, 0.5), 10.0, True, True, True),
    ((0.5, 0.1), 10.0, True, True, True),
    # both are sure, and wanted all the same
    ((0.1, 0.1), 10.0, True, False, True),
    # both are sure; nothing was gained; the whole is not at its end
    ((0.1, 0.1), 10.0, True, True, False),
    ((0.1, 0.5), 0.5, True, True, False),
    ((0.1, 0.5), 10.0, False, True, False),
])  # fmt: skip
def test_a_doubtful_law_is_left_out(library, monkeypatch, errors, gained, converged, doubtful, split):
    added = []
    written = {COULOMB: SimpleNamespace(value=0.2), VISCOUS: SimpleNamespace(value=0.1)}
    model = SimpleNamespace(
        with_effect=lambda name, values: added.append((name, values)) or added[-1], parameters=written
    )
    free = [Free("restoring.stiffness", 80.0), Free(COULOMB, 0.0), Free(VISCOUS, 0.0)]
    one = Candidate((NAME,), model, free, (1, 2), [], [], np.ones(2, bool))
    fit = SimpleNamespace(values=np.array([81.0, 0.7, 0.6]), starts=np.zeros((1, 2)), converged=converged)
    covariance = np.diag([1.0, *np.square(errors)])
    whole = SimpleNamespace(fit=fit, added=(1, 2), covariance=covariance, tries=3)
    base = SimpleNamespace(model=model)
    begun = []

    def minimise(problem, values, starts):
        begun.append(values)
        return SimpleNamespace(values=values, converged=True)

    monkeypatch.setattr(halves_module, "gain_over", lambda one, other: (gained, None))
    monkeypatch.setattr(halves_module, "minimise", minimise)
    monkeypatch.setattr(halves_module, "polished", lambda data, problem, fit, *rest, **more: fit)
    data = SimpleNamespace(last=0, problem=lambda model, stage, free: free)
    found = list(halves(data, base, one, whole, doubtful))
    if not split:
        assert not found
        return
    # each law begins where the whole ended, beside the same machine, and without the other; the case is
    # written with a value that it allows, though the fit may need other friction for its own
    assert [[free.path for free in part.free] for part, _ in found] == [
        ["restoring.stiffness", COULOMB],
        ["restoring.stiffness", VISCOUS],
    ]
    assert added == [(NAME, {"coulomb": 0.2}), (NAME, {"viscous": 0.1})]
    np.testing.assert_array_equal(begun, [[81.0, 0.7], [81.0, 0.6]])
    for part, fitted in found:
        assert part.added == fitted.added == (1,)
        assert fitted.names == (NAME,)
