# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""One experiment must separate a machine from all rivals; an effect that the base imitates has no size."""

from types import SimpleNamespace

import numpy as np
import pytest
from program import CASE
from separatrix.discovery.decision.experiments import d_primes, experiments
from separatrix.discovery.decision.limits import detectable
from separatrix.discovery.fitting.fit import minimise
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.machine import Free, base_parameters
from separatrix.discovery.fitting.one_body import BodyInMotion
from separatrix.discovery.measured.preflight import prepare
from separatrix.discovery.measured.records import make_record
from separatrix.discovery.measured.segments import padded
from separatrix.discovery.options import Options
from separatrix.library import Model

pytestmark = pytest.mark.usefixtures("library")

FREE = """\
[body]
mass = 1
[restoring]
law = "linear"
stiffness = 88
[friction]
law = "viscous"
damping = 0.3
[drive]
law = "none"
"""


class Spy:
    """A model that remembers what it was asked to fly."""

    def __init__(self, model: Model) -> None:
        self.model, self.asked = model, []

    def __getattr__(self, name: str) -> object:
        return getattr(self.model, name)

    def segments(self, active: list[str], values: np.ndarray, start: np.ndarray, *more, **options) -> object:
        self.asked.append((dict(zip(active, values, strict=True)), start))
        return self.model.segments(active, values, start, *more, **options)


def fitted(stiffness: float, case: str = CASE, begin: float = 0.0) -> Fitted:
    """The machine with another stiffness, on a record of half of its drive that begins at 0.7 rad."""
    t = np.arange(600) / 100
    head = {"drive_ratio": 1.2, "phase": 0.7, "drive_scale": 0.5, "sensor_noise_sigma_m": 1e-3}
    record = make_record("record", {"t": begin + t, "x": 0.7 + 0.2 * np.cos(11.3 * t)}, head)
    model = Spy(Model.from_text(case))
    free = base_parameters(model, measured_force=False)
    first = np.arange(0, 600, 50)
    problem = BodyInMotion(model, [prepare(record, model)], padded(0 * first, first, first + 50), free)
    values = np.array(
        [stiffness * one.value if one.path.endswith("stiffness") else one.value for one in free]
    )
    fit = minimise(problem, values, np.column_stack([record.x[first], 0 * first]), most=0)
    model.asked.clear()
    return Fitted((), model, problem, fit, ())


def test_both_machines_get_the_same_drive_from_the_same_states():
    one, other = fitted(1.0), fitted(1.04)
    assert d_primes(one, [one], 1.1, 1.6) == [pytest.approx(0, abs=1e-3)]
    one.model.asked.clear()
    assert d_primes(one, [other], 1.1, 1.6)[0] > 1
    # how it settles, and the periods that are compared
    (_, begun), (values, start) = one.model.asked
    (other_values, other_start) = other.model.asked[0]
    assert begun.shape == (1, 3)
    assert np.array_equal(start, other_start)
    frequency = one.model.drive_frequency({"drive.ratio": 1.1})
    assert one.model.drive_frequency(values) == pytest.approx(frequency)
    assert other.model.drive_frequency(other_values) == pytest.approx(frequency)
    amplitude = one.model.parameters["drive.cosine[1]"].value
    # 1.6 times the half drive of the record
    assert values["drive.cosine[1]"] == other_values["drive.cosine[1]"] == pytest.approx(0.8 * amplitude)


def test_of_several_rivals_the_nearest_counts():
    one, near, far = fitted(1.0), fitted(1.02), fitted(1.06)
    found = experiments(one, [far, near])
    sizes = [each.d_prime for each in found]
    assert sizes == sorted(sizes, reverse=True)
    best = found[0]
    apart = d_primes(one, [far, near], best.drive_ratio, best.scale)
    assert apart == [d_primes(one, [each], best.drive_ratio, best.scale)[0] for each in (far, near)]
    assert (best.d_prime, best.rival) == (min(apart), int(np.argmin(apart)))
    assert {each.rival for each in found} <= {0, 1}
    assert f"one and {'near' if best.rival else 'far'} would differ" in best.text("one", ["far", "near"])


def test_a_free_motion_lasts_as_long_as_the_record_whenever_that_began():
    at_0, later = (d_primes(fitted(1.0, FREE, t), [fitted(1.04, FREE, t)], None, 1.0) for t in (0.0, 1000.0))
    assert at_0[0] > 1
    assert later == [pytest.approx(at_0[0], rel=1e-6)]


def test_what_the_parameters_of_a_machine_can_be_is_not_apart():
    """A difference of a stiffness separates two machines only if the record determines the stiffness."""
    one, other = fitted(1.0), fitted(1.0002)
    free = d_primes(one, [other], 1.1, 1.0)[0]
    reduced = one.fit.reduced
    reduced.matrix[:] = 1e6 * reduced.matrix
    assert d_primes(one, [other], 1.1, 1.0)[0] > 3 * free


@pytest.mark.parametrize(
    ("seen", "error", "size"), [(True, 0.4, 1.0), (True, 1e9, None), (False, 1e-9, None)]
)
def test_an_effect_that_the_base_imitates_has_no_smallest_size(seen, error, size):
    path = "effect.coulomb.force"
    parameters = {path: SimpleNamespace(unit="N")}
    made = SimpleNamespace(
        free=[Free(path, 0.0, size=0.5)], added=(0,), model=SimpleNamespace(parameters=parameters)
    )
    screened = SimpleNamespace(
        names=["coulomb"], seen=lambda name: seen, live={"coulomb": np.array([True])},
        error={"coulomb": np.array([error])},
    )  # fmt: skip
    found = detectable(
        SimpleNamespace(options=Options(visible=5.0)),
        SimpleNamespace(candidates={"coulomb": made}, screened=screened, absent={"dahl": "no dry friction"}),
    )
    assert found["dahl"] == {"size": None, "path": None, "unit": None, "reason": "no dry friction"}
    found = found["coulomb"]
    assert found["size"] == (None if size is None else pytest.approx(size))
    assert ("imitate" in found["reason"]) == (size is None)
