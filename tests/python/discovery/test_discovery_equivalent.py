# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of one motion: a set of them has the truth in it, though its fit has a law more or began badly."""

import numpy as np
import pytest

NAMES = ("offset_force", "asymmetric_friction", "sensor_bias", "sensor_gain")
# ratio, crank angle at the first sample [rad], x0 [m], v0 [m/s], settling periods
ASYMMETRIC = (
    (0.858, 2.933095, 0.371127, -1.141443, 12),
    (0.901, 3.952013, 0.550089, 1.716224, 12),
    (0.816, 3.957351, 0.322610, 1.679415, 0),
)
OFFSET = (
    (0.824, 0.702266, 0.661512, 1.831910, 12),
    (0.889, 2.406083, 0.322496, -1.033671, 0),
    (0.953, 0.601775, 0.657174, 1.727926, 12),
)


@pytest.fixture(scope="module")
def generator(source_dir):
    """The modules of tests/generator."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(source_dir / "tests" / "generator"))
        import effects
        import experiment
        import records
        from design import Case, Hidden

        yield effects, experiment, records, Case, Hidden


def case_of(generator, base: dict, name: str, size: float, rows: tuple, samples: int, **sensor):
    """A case of the regime `rough` with an effect of a known size."""
    effects, experiment, _, new_case, hidden = generator
    machine = experiment.REGIMES["rough"].machine().copy(**base)
    one = hidden(name, effects.CATALOGUE[name], {}, np.sign(size), abs(size))
    made = [
        experiment.Experiment(ratio, phase, x0, v0, settling, samples, 12)
        for ratio, phase, x0, v0, settling in rows
    ]
    return new_case(
        number=0, kind="single", regime="rough", base=machine, machine=one.on(machine), hidden=[one],
        training=made[:2], held_out=made[2], target=10.0, **sensor,
    )  # fmt: skip


def possible(generator, case, folder) -> set[str]:
    """All effects that the workflow considers possible."""
    from separatrix.discovery import Options, discover

    records = generator[2]
    records.write_case(folder / "case", folder / "truth.json", case)
    training = [folder / "case" / name for name in records.TRAINING]
    held_out = [folder / "case" / records.HELD_OUT]
    found = discover(folder / "case" / records.BASE, training, held_out, Options(seed=1, candidates=NAMES))
    assert found["outcome"] in ("named", "ambiguous")
    return {*found["effects"], *found["alternatives"]}


def test_an_asymmetry_of_dry_friction_needs_no_viscous_one(generator, tmp_path):
    """Fitted with both, what the viscous part has of chance predicted badly: the truth was left out."""
    base = {
        "stiffness": 89.8604,
        "coulomb": 0.4989,
        "restitution": 0.63796,
        "upper": 0.71283,
        "scale": 1.02508,
    }
    case = case_of(
        generator, base, "asymmetric_friction", -0.12104, ASYMMETRIC, 100, seed=[4211, 9, 0], level=0.01,
        colour="white", velocity=False, crank_angle=False, states_noise=True,
        phase_error=[-0.02128, 0.01617, -0.0194],
    )  # fmt: skip
    assert {"offset_force", "asymmetric_friction"} <= possible(generator, case, tmp_path)


def test_a_size_that_throws_a_fit_far_out_is_begun_from_zero(generator, tmp_path):
    """A linearised offset led segments over other impacts: given up, though the base lies in the machine."""
    base = {
        "stiffness": 88.489,
        "coulomb": 0.56259,
        "restitution": 0.69052,
        "upper": 0.70355,
        "scale": 1.02107,
    }
    case = case_of(
        generator, base, "offset_force", -0.0159245, OFFSET, 50, seed=[4211, 5, 0], level=0.005,
        colour="quantised", velocity=True, crank_angle=True, states_noise=True, phase_error=[0.0, 0.0, 0.0],
    )  # fmt: skip
    assert "offset_force" in possible(generator, case, tmp_path)


@pytest.mark.parametrize(("seed", "number", "hidden"), [
    pytest.param(3017, 557, "asymmetric_friction", marks=pytest.mark.long),
    pytest.param(3017, 1023, "asymmetric_friction", marks=pytest.mark.long),
    # only what its own machine has to be for the motion of the other name leads there
    (51239, 48, "sensor_bias"),
])  # fmt: skip
def test_names_of_one_motion_are_not_lost_in_other_minima(generator, tmp_path, seed, number, hidden):
    """One name found the motion, another ended in a local minimum or had a law more: the truth was out."""
    from design import draw

    case = draw(seed, number)
    assert [one.name for one in case.hidden] == [hidden]
    assert {"offset_force", hidden, "sensor_bias"} <= possible(generator, case, tmp_path)
