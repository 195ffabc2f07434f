# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A case whose starts are moved between barriers, so that another barrier can be tried."""

import tomllib

import pytest
from program import CASE
from separatrix.discovery.fitting.catalogue import within_barriers
from separatrix.library import Model

pytestmark = pytest.mark.usefixtures("library")


def test_starts_lie_between_the_barriers_and_nothing_else_changes() -> None:
    model = Model.from_text(CASE)
    before, after = (tomllib.loads(one.to_text({})) for one in (model, within_barriers(model, 0.5, 0.9)))
    assert after["start"]["x0"] == 0.5
    axis = next(one for one in after["axis"] if one["name"] == "x0")
    assert (axis["from"], axis["to"]) == (0.5, 0.9)
    assert all(0.5 <= one <= 0.9 for one in after["sweep"]["x0"])
    for table in ("start", "sweep"):
        after[table]["x0"] = before[table]["x0"]
    old = next(one for one in before["axis"] if one["name"] == "x0")
    axis |= {"from": old["from"], "to": old["to"]}
    assert after == before


def test_starts_that_lie_between_the_barriers_stay() -> None:
    model = Model.from_text(CASE)
    assert within_barriers(model, -10.0, 10.0).to_text({}) == model.to_text({})
