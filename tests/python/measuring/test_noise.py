# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions under noise beside closed forms: covariances, exponential survival, restitution, random walks."""

import numpy as np
import pytest
import separatrix as sx
import xarray as xr
from scipy import linalg, stats
from separatrix import cli as figures_cli
from separatrix import kicked, noise, noise_cli
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
    ensemble = sx.noisy(case, 0.0, 0.0, intensity=intensity, motions=motions, samples=3)
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
    noise = {"intensity": 0.1, "impulses": (1.0, 0.1), "restitution": 0.1, "duration": 3}
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
        intensity=0.0,
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


TWO_MASSES = """
body.a.mass = 2
body.b.mass = 1
spring.s = { between = ["a"], stiffness = 50, damping = 1.5 }
spring.t = { between = ["a", "b"], stiffness = 30, damping = 1.0 }
watch.body = "a"
"""


def linear_system() -> tuple[np.ndarray, np.ndarray]:
    """Of the two masses x' = A x for positions, then velocities; and what a unit impulse on b adds."""
    mass = np.diag([2.0, 1.0])
    stiffness = np.array([[80.0, -30.0], [-30.0, 30.0]])
    damping = np.array([[2.5, -1.0], [-1.0, 1.0]])
    none = np.zeros((2, 2))
    system = np.block(
        [[none, np.eye(2)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]]
    )
    return system, np.array([0.0, 0.0, 0.0, 1.0])


def test_two_masses_have_the_covariance_of_lyapunovs_equation():
    """Motions are the recursion of their kicks, to rounding; its covariance is that of the white force."""
    case, intensity, step = sx.Case.from_text(TWO_MASSES), 0.4, 0.01
    found = sx.noisy(
        case, 0.02, 0.0, intensity=intensity, body="b", motions=3, samples=2, duration=1.0, step=step, seed=5
    )
    system, impulse = linear_system()
    flow = linalg.expm(step * system)
    random, state = kicked._Random(5, 0, 3), np.tile([0.02, 0.0, 0.0, 0.0], (3, 1))
    for number in range(100):
        drawn = random.take(kicked._FORCE, np.arange(3), np.full(3, number), number)
        state = state @ flow.T + np.sqrt(intensity * step) * np.outer(drawn, impulse)
    columns = np.column_stack([found[name][:, -1] for name in ("a_x", "b_x", "a_v", "b_v")])
    assert columns == pytest.approx(state, abs=1e-12)
    assert np.array_equal(found.x, found.a_x) and np.array_equal(found.v, found.a_v)
    strength = intensity * np.outer(impulse, impulse)
    wanted = linalg.solve_continuous_lyapunov(system, -strength)
    kicks = linalg.solve_discrete_lyapunov(flow, step * strength)
    scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    assert np.abs((kicks - wanted) / scale).max() < 0.06
    assert wanted[3, 3] > wanted[2, 2] > 0


def test_a_motor_without_noise_moves_as_in_the_case(source_dir):
    """And its first impacts are first passages; noise changes the motion and its crank."""
    case = sx.load(source_dir / "examples" / "motor_impact.toml")
    still = sx.noisy(case, motions=1, duration=2, samples=2)
    motion = sx.trajectory(case, duration=2)
    for name in ("x", "v", "crank_speed"):
        assert still[name].values[0, -1] == pytest.approx(float(motion[name][-1]), abs=1e-8), name
    noisy = sx.noisy(case, motions=3, duration=2, samples=2, intensity=0.5, leaves="impact")
    assert len(set(noisy.crank_speed.values[:, -1])) == 3
    longer = sx.trajectory(case, 0.0, 5.0, duration=1)
    first = longer.event_time.values[
        np.char.startswith(longer.separatrix.decoded("event_kind").values.astype(str), "impact")
    ]
    alone = sx.noisy(case, 0.0, 5.0, motions=1, duration=float(first[0]) + 0.1, samples=2, leaves="impact")
    assert float(alone.first_passage[0]) == pytest.approx(first[0], abs=1e-8)


def test_a_body_at_rest_on_a_stop_is_kicked_off_it():
    """Half of the kicks press it onto the floor, none of them through it."""
    case = sx.Case.from_text(
        "body.a = { mass = 1, load = -9.81 }\n"
        'contact.floor = { between = ["a"], law = "newton", restitution = 0.5, lower = 0 }\n'
    )
    found = sx.noisy(case, 0.0, 0.0, intensity=0.5, motions=4, duration=1, samples=50)
    assert float(found.x.min()) > -1e-12 and float(found.x.max()) > 1e-4


def test_threads_resume_and_file_keep_the_bits(tmp_path, monkeypatch):
    """Pieces are the same on any thread, and in a run that was stopped between them."""
    monkeypatch.setattr(noise, "PIECE", 16)
    case = sx.Case.from_text(LINEAR)
    given = {"leaves": (-0.1, 0.1), "intensity": 0.5, "motions": 12, "duration": 1.0}
    one = sx.first_passage(case, (-0.05, 0.05, 2), [0.0, 0.1], threads=1, **given)
    path = tmp_path / "starts.h5"
    flown = []

    def counted(*arguments):
        flown.append(arguments[-1])
        if len(flown) == 3:
            raise KeyboardInterrupt
        return kicked.fly(*arguments)

    monkeypatch.setattr(noise, "fly", counted)
    with pytest.raises(KeyboardInterrupt):
        sx.first_passage(case, (-0.05, 0.05, 2), [0.0, 0.1], threads=1, output=path, **given)
    with pytest.raises(sx.SeparatrixError, match="other noise"):
        sx.first_passage(
            case, (-0.05, 0.05, 2), [0.0, 0.1], output=path, resume=True, **(given | {"intensity": 0.4})
        )
    two = sx.first_passage(case, (-0.05, 0.05, 2), [0.0, 0.1], threads=2, output=path, resume=True, **given)
    # the third again
    assert len(flown) == 4 and sorted(flown[:2] + flown[3:]) == [0, 1, 2]
    xr.testing.assert_identical(one, two)
    with sx.open_result(path) as written:
        assert np.array_equal(written.survival, one.survival)
        assert written.separatrix.case == case
        assert 0 < float(written.survival.mean()) < 1
    with pytest.raises(sx.SeparatrixError, match="exists"):
        sx.noisy(case, motions=1, duration=1, output=path)


def test_the_command_writes_what_the_function_returns(tmp_path, capsys):
    """Over starts and from one; figures; codes and messages."""
    (tmp_path / "case.toml").write_text(LINEAR)
    path = tmp_path / "starts.h5"
    words = [tmp_path / "case.toml", "--set", "body.mass=3", "--intensity", "0.5", "--motions", "10"]
    words = [*map(str, words), "--duration", "1", "--seed", "4", "-o", str(path)]
    grid = ["--x0=-0.05,0.05,2", "--v0", "0,0.1,2"]
    assert noise_cli.main([*words, *grid, "--leaves=-0.1,0.1"]) == 0
    assert "4 starts, 10 motions of 1 s from each" in capsys.readouterr().out
    case = sx.Case.from_text(LINEAR.replace("mass = 2.0", "mass = 3"))
    wanted = sx.first_passage(
        case,
        (-0.05, 0.05, 2),
        (0.0, 0.1, 2),
        leaves=(-0.1, 0.1),
        intensity=0.5,
        motions=10,
        duration=1,
        seed=4,
    )
    with sx.open_result(path) as written:
        xr.testing.assert_equal(written.load(), wanted)
    assert noise_cli.main([*words, *grid, "--leaves=-0.1,0.1"]) == 73
    assert noise_cli.main([*words, "--x0", "0.1", "--force", "--impulses", "2,0.1"]) == 0
    assert "x at the end: mean" in capsys.readouterr().out
    assert figures_cli.main([str(path), "--formats", "png"]) == 0
    assert (tmp_path / "starts_motions.png").is_file()
    capsys.readouterr()
    for more, message in [
        (["--x0", "0,1,2"], "found one axis"),
        (grid, "--leaves: missing"),
        (["--resume"], "--resume: needs"),
        (["--leaves", "rest"], "allowed impact, or LOWER,UPPER"),
    ]:
        assert noise_cli.main([*words, "--force", *more]) == 64
        assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    "text, more, message",
    [
        (LINEAR, {"intensity": -1.0}, "intensity: found -1.0, allowed a number of 0 or more"),
        (LINEAR, {"intensity": np.nan}, "intensity: found nan"),
        (LINEAR, {"intensity": "1 N"}, "intensity: found '1 N', allowed a number"),
        (LINEAR, {"intensity": None}, "intensity: found None"),
        (LINEAR, {"intensity": {"a": 1.0}}, "intensity: found {'a': 1.0}"),
        (LINEAR, {"impulses": (1.0, np.inf)}, "impulses: deviation: found inf"),
        (LINEAR, {"impulses": (0.0, 1.0)}, "impulses: rate: found 0.0, allowed a number above 0"),
        (LINEAR, {"impulses": 1.0}, "impulses: found 1.0, allowed .rate"),
        (LINEAR, {"impulses": (1.0, "a")}, "impulses: found"),
        (LINEAR, {"leaves": (1.0,)}, "leaves: found"),
        (LINEAR, {"leaves": 1}, "leaves: found 1"),
        (LINEAR, {"step": "1 s"}, "step: found '1 s'"),
        (LINEAR, {"seed": 1.5}, "seed: found 1.5, allowed a whole number from 0 on"),
        (LINEAR, {"samples": 2.5}, "samples: found 2.5"),
        (LINEAR, {"threads": 0}, "threads: found 0"),
        (LINEAR, {"body": "a"}, "body: found 'a' of a machine of one body"),
        (TWO_MASSES, {"body": "c"}, "body: found 'c', allowed a, b"),
        (TWO_MASSES, {"restitution": 0.1}, "found several bodies or a motor"),
        (
            TWO_MASSES
            + 'friction.f = { between = ["a"], law = "elastic_coulomb", force = 1, stiffness = 9 }\n',
            {},
            "found elastic_coulomb",
        ),
        (LINEAR, {"restitution": 0.1}, "allowed one body with contact.law .newton."),
        (LINEAR, {"leaves": (1.0, -1.0)}, "lower < upper"),
        (LINEAR, {"leaves": "rest"}, 'allowed "impact"'),
        (LINEAR, {"leaves": "impact"}, "without a contact"),
        (LINEAR, {"motions": 0}, "motions: found 0, allowed a whole number from 1 on"),
        (f"{LINEAR}{EXPRESSION}", {"intensity": 0.1}, "trajectory, basin and sweep"),
    ],
)
def test_what_is_not_allowed_is_refused(text, more, message):
    with pytest.raises(sx.SeparatrixError, match=message):
        sx.noisy(sx.Case.from_text(text), 0.0, 0.0, **({"duration": 1} | more))
