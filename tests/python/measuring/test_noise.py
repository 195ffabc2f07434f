# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions under noise beside closed forms: variances, exponential survival, restitution, random walks."""

import numpy as np
import pytest
import separatrix as sx
from scipy import stats
from separatrix.noise import wilson

pytestmark = pytest.mark.usefixtures("library")

MASS, STIFFNESS, DAMPING = 2.0, 50.0, 3.0
EXPRESSION = "contact = { law = 'expression', restitution = '1/(2 + speed)', upper = 0.2 }\n"
LINEAR = f"""
body.mass = {MASS}
restoring = {{ law = "linear", stiffness = {STIFFNESS} }}
friction = {{ law = "viscous", damping = {DAMPING} }}
run.duration = 10
"""
# so many standard errors; seeds are fixed, so a test that passes once always does
ERRORS = 4


def test_a_white_force_gives_the_variances_of_its_closed_form():
    """I/(2 c m) and I/(2 c k), which kicks at 64 a period have to within their step."""
    case, intensity, motions = sx.Case.from_text(LINEAR), 0.4, 2000
    ensemble = sx.noisy(case, 0.0, 0.0, force=intensity, motions=motions, samples=3)
    assert ensemble.x.sizes == {"motion": motions, "time": 3}
    error = ERRORS * np.sqrt(2 / (motions - 1))
    # four times m/c after the start what is left of it is exp(-15)
    last = ensemble.isel(time=-1)
    assert float(last.v.var(ddof=1)) == pytest.approx(intensity / (2 * DAMPING * MASS), rel=error + 0.02)
    assert float(last.x.var(ddof=1)) == pytest.approx(intensity / (2 * DAMPING * STIFFNESS), rel=error + 0.02)
    assert abs(float(last.x.mean())) < ERRORS * np.sqrt(intensity / (2 * DAMPING * STIFFNESS) / motions)
    assert abs(np.corrcoef(last.x, last.v)[0, 1]) < ERRORS / np.sqrt(motions) + 0.05


def test_survival_of_poisson_impulses_is_exponential():
    """Every impulse takes the body, which is at rest, beyond the bounds before the next step."""
    case, rate, motions = sx.Case.from_text(LINEAR), 0.5, 2000
    ensemble = sx.noisy(
        case, 0.0, 0.0, impulses=(rate, 100.0), leaves=(-1e-3, 1e-3), motions=motions, step=0.01, samples=11
    )
    wanted = np.exp(-rate * ensemble.time.values)
    inside = (ensemble.survival_lower <= wanted) & (wanted <= ensemble.survival_upper)
    # 95 % intervals at eleven times that hang together
    assert inside.sum() >= 9
    passage = ensemble.first_passage.dropna("motion").values
    # truncated at the duration; steps of 10 ms after the impulse
    law = stats.truncexpon(b=rate * 10, scale=1 / rate)
    assert stats.kstest(passage, law.cdf).pvalue > 0.01


def test_impulses_alone_have_the_variance_of_their_number():
    """Of a free body: rate t deviation^2."""
    free = sx.Case.from_text("body.mass = 1\nrun.duration = 8\n")
    ensemble = sx.noisy(free, 0.0, 0.0, impulses=(3.0, 0.2), motions=2000, samples=2)
    # the sum of so many normal numbers has a kurtosis of 3/(rate t)
    error = ERRORS * np.sqrt((2 + 3 / 24) / 2000)
    assert float(ensemble.v[:, -1].var()) == pytest.approx(24 * 0.2**2, rel=error)
    assert float(ensemble.x[:, -1].var()) == pytest.approx(3 * 0.2**2 * 8**3 / 3, rel=2 * error)


def test_restitution_is_drawn_for_each_impact():
    """A ball: the speeds after its first impact are normally distributed around e v."""
    case = sx.Case.from_text(
        'body.mass = 1\ncontact = { law = "newton", restitution = 0.5, upper = 1 }\nrun.duration = 1.5\n'
    )
    ensemble = sx.noisy(case, 0.0, 1.0, restitution=0.05, motions=1000, samples=2)
    after = -ensemble.v[:, -1].values
    assert after.mean() == pytest.approx(0.5, abs=ERRORS * 0.05 / np.sqrt(1000))
    assert after.std() == pytest.approx(0.05, rel=ERRORS / np.sqrt(2000))
    # it was at the stop after one second
    assert ensemble.x[:, -1].values == pytest.approx(1 - 0.5 * after, abs=1e-12)
    assert np.ptp(sx.noisy(case, 0.0, 1.0, motions=5, samples=2).v[:, -1].values) == 0


def test_a_motion_is_the_same_for_any_number_of_motions():
    """And any times at which it is looked at; another seed is another motion."""
    case = sx.Case.from_text(LINEAR + 'contact = { law = "newton", restitution = 0.7, upper = "20 mm" }\n')
    noise = {"force": 0.1, "impulses": (1.0, 0.1), "restitution": 0.1, "duration": 3}
    few = sx.noisy(case, 0.0, 0.0, motions=3, samples=3, **noise)
    many = sx.noisy(case, 0.0, 0.0, motions=40, samples=3, **noise)
    assert np.array_equal(few.x, many.x[:3])
    few = sx.noisy(case, 0.0, 0.0, motions=10, samples=3, leaves=(-0.019, 0.019), **noise)
    many = sx.noisy(case, 0.0, 0.0, motions=40, samples=3, leaves=(-0.019, 0.019), **noise)
    assert np.array_equal(few.first_passage, many.first_passage[:10], equal_nan=True)
    few = sx.noisy(case, 0.0, 0.0, motions=3, samples=3, **noise)
    again = sx.noisy(case, 0.0, 0.0, motions=3, samples=3, **noise)
    assert np.array_equal(few.v, again.v)
    other = sx.noisy(case, 0.0, 0.0, motions=3, samples=3, seed=2, **noise)
    assert not np.any(few.x[:, -1] == other.x[:, -1])
    assert float(many.x.max()) <= 0.02 + 1e-12


def test_first_passage_over_starts():
    """Starts beyond the bounds have left at once; an undisturbed one never does; a map has its intervals."""
    case = sx.Case.from_text(LINEAR)
    found = sx.first_passage(
        case,
        [0.0, 0.2, 2.0],
        (0.0, 0.1, 2),
        leaves=(-1, 1),
        force=0.0,
        impulses=(0.3, 20.0),
        motions=200,
        duration=4.0,
    )
    assert found.survival.dims == ("x0", "v0") and found.survival.shape == (3, 2)
    assert (found.survival.sel(x0=2.0) == 0).all() and (found.passage_time.sel(x0=2.0) == 0).all()
    inner = found.sel(x0=[0.0, 0.2])
    # impulses of less than 5 m/s bring the body back before it is 1 m away
    assert ((inner.survival_lower < np.exp(-1.2) + 0.15) & (inner.survival_upper > np.exp(-1.2))).all()
    assert (inner.passage_time < 4).all() and (inner.passage_time > 2).all()
    calm = sx.first_passage(case, [0.5], [0.0], leaves=(-1, 1), motions=3, duration=4.0)
    assert calm.survival.item() == 1 and calm.passage_time.item() == 4
    assert calm.survival_lower.item() == pytest.approx(3 / (3 + stats.norm.ppf(0.975) ** 2))


def test_the_first_impact_is_a_first_passage():
    """A free body at constant speed is there after distance over speed."""
    case = sx.Case.from_text('body.mass = 1\ncontact = { law = "newton", restitution = 0.5, upper = 1 }\n')
    found = sx.noisy(case, 0.0, 0.8, leaves="impact", motions=2, duration=3, samples=4)
    assert found.first_passage.values == pytest.approx(1.25)
    assert found.survival.values.tolist() == [1, 1, 0, 0]


def test_the_interval_of_wilson():
    """The published one of 2 of 20, and that of none."""
    share, lower, upper = wilson(np.array([2, 0]), 20)
    assert share.tolist() == [0.1, 0.0]
    assert lower == pytest.approx([0.02786, 0.0], abs=1e-5)
    assert upper == pytest.approx([0.30103, 0.16113], abs=1e-5)


@pytest.mark.parametrize(
    "text, more, message",
    [
        (LINEAR, {"force": -1.0}, "values of 0 or more"),
        (LINEAR, {"force": np.nan}, "values of 0 or more"),
        (LINEAR, {"impulses": (1.0, np.inf)}, "values of 0 or more"),
        (LINEAR, {"impulses": (0.0, 1.0)}, "rate of impulses more than 0"),
        (LINEAR, {"restitution": 0.1}, "allowed newton"),
        (LINEAR, {"leaves": (1.0, -1.0)}, "lower < upper"),
        (LINEAR, {"leaves": "rest"}, 'allowed "impact"'),
        (LINEAR, {"leaves": "impact"}, "without a contact"),
        (LINEAR, {"motions": 0}, "motions from 1"),
        (f"{LINEAR}{EXPRESSION}", {"force": 0.1}, "trajectory, basin and sweep"),
        ('body.a.mass = 1\nspring.s = { between = ["a"], stiffness = 1 }\n', {}, "several bodies"),
        ('body.mass.mass = 1\nspring.s = { between = ["mass"], stiffness = 1 }\n', {}, "several bodies"),
    ],
)
def test_what_is_not_allowed_is_refused(text, more, message):
    with pytest.raises(sx.SeparatrixError, match=message):
        sx.noisy(sx.Case.from_text(text), 0.0, 0.0, duration=1, **more)
