# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`sx.branches` and `sx.stability` are the commands of these names, to the bit and to the word."""

import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import separatrix as sx
from program import succeed
from separatrix import runner
from test_python_api import assert_same


@pytest.fixture(autouse=True)
def tools(library: Path, separatrix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The program and the library of the build that is tested."""
    monkeypatch.setenv("SEPARATRIX_PROGRAM", str(separatrix))


@pytest.fixture
def grazing(source_dir: Path) -> sx.Case:
    """The oscillator whose free motion grazes at the amplitude 0.1."""
    return sx.load(source_dir / "examples" / "validation" / "impact_coco.toml")


def test_branches_are_those_of_the_program(grazing: sx.Case, separatrix: Path, tmp_path: Path) -> None:
    asked = ("--parameter", "drive.amplitude", "--from", "0.05", "--to", "0.3", "--searches", "3")
    succeed(separatrix, "branches", grazing.name, "-o", "theirs.h5", *asked, folder=tmp_path)
    reported: list[tuple] = []
    mine = sx.branches(
        grazing, "drive.amplitude", 0.05, 0.3, searches=3, progress=lambda *what: reported.append(what)
    )
    assert_same(mine, sx.open_result(tmp_path / "theirs.h5"))
    assert {things for things, _, _ in reported} == {"starts"}
    found = mine.separatrix.labelled_points.set_index("label")
    assert found.loc["GR-fold", "drive.amplitude"] == pytest.approx(0.1, abs=1e-11)
    assert found.loc["SN", "multiplier_1"] == pytest.approx(1.0, abs=1e-8)
    assert "none" not in found.index
    assert mine.separatrix.plot("branches") is not None
    # from starts of its own, into a file
    output = tmp_path / "mine.h5"
    near = {"searches": 2, "x0": (0.0, 0.2), "v0": (-0.1, 0.1), "output": output}
    kept = sx.branches(grazing, "drive.amplitude", 0.02, 0.05, **near)
    assert kept.separatrix.case.resolved["axis"][0]["to"] == 0.2
    assert set(kept.separatrix.decoded("event_word").values) == {"."}
    with pytest.raises(sx.SeparatrixError, match="exists; overwrite=True"):
        sx.branches(grazing, "drive.amplitude", 0.02, 0.05, **near)


def test_branches_that_make_no_sense_are_refused(grazing: sx.Case) -> None:
    for wrong, message in (
        (("drive.ration", 1, 2), "^parameter: found 'drive.ration', allowed body.mass"),
        (("body.mass",), "^start and stop are needed"),
        (("drive.amplitude", 2.0, 1.0), "^start, stop: found 2.0 and 1.0, allowed a range that rises"),
        (("contact.restitution", 0.5, 1.5), "^stop: found 1.5, allowed"),
    ):
        with pytest.raises(sx.CaseError, match=message):
            sx.branches(grazing, *wrong)
    with pytest.raises(sx.SeparatrixError, match="^x0: found"):
        sx.branches(grazing, "drive.amplitude", 1, 2, x0=(0, 1, 2))


@pytest.fixture(params=[signal.default_int_handler, signal.SIG_IGN], ids=["in front", "in the background"])
def interrupts(request: pytest.FixtureRequest) -> Iterator[None]:
    """How the programs that are started take an interrupt: a shell has those in the background ignore it."""
    before = signal.signal(signal.SIGINT, request.param)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interrupts")
def test_branches_end_at_an_interrupt(
    grazing: sx.Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By themselves. Nothing can be resumed, so that it is no `Interrupted`."""
    killed, kill = [], runner._kill
    monkeypatch.setattr(runner, "_GRACE", 6.0)
    monkeypatch.setattr(runner, "_kill", lambda running: killed.append(kill(running)))

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="branches was stopped; nothing of it is kept") as caught:
        sx.branches(
            grazing, "drive.amplitude", 0.05, 1.2, searches=5000, progress=stop, output=tmp_path / "out.h5"
        )
    assert not isinstance(caught.value, sx.Interrupted)
    assert killed == []
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_that_comes_too_late_reports_the_kept_result(grazing: sx.Case, tmp_path: Path) -> None:
    """The program may end before it gets the signal; then the message states what was kept."""

    def stop(*_: object) -> None:
        time.sleep(1.5)
        raise KeyboardInterrupt

    output = tmp_path / "out.h5"
    with pytest.raises(KeyboardInterrupt) as caught:
        sx.branches(grazing, "drive.amplitude", 0.05, 1.2, progress=stop, output=output)
    assert output.exists() == ("its result is kept" in str(caught.value))
    assert output.exists() == ("nothing of it is kept" not in str(caught.value))


def test_stability_is_that_of_the_program(source_dir: Path, separatrix: Path, tmp_path: Path) -> None:
    case = sx.load(source_dir / "examples" / "validation" / "budd_dux.toml")
    chaos = case.with_(contact__upper=0.0)
    found = sx.stability(chaos, x0=-0.3, periods=5000)
    settings = ("--set", "contact.upper=0.0", "--set", "start.x0=-0.3", "--periods", "5000")
    output = succeed(separatrix, "stability", case.name, *settings, folder=tmp_path).out
    assert str(found) == output.strip()
    assert (found.motion, found.periods) == ("chaotic", 5000)
    assert found.exponents[0] > 10 * found.errors[0] > 0 > found.exponents[1]
    assert sum(found.exponents) == pytest.approx(found.sum_found, abs=1e-12)
    assert found.sum_found == pytest.approx(found.sum_exact, abs=1e-8)
    assert found.zero_one > 0.9 and found.impacts > 5000
    assert sx.stability(case, x0=-1.0, periods=2000).motion == "periodic"
    with pytest.raises(sx.SeparatrixError, match="^periods: found 3, allowed"):
        sx.stability(case, periods=3)
    with pytest.raises(sx.CaseError, match=r"^start.x0=1.0: key 'start.x0': found"):
        sx.stability(case, x0=1.0)
    assert sx.stability(source_dir / "examples" / "pair_backlash.toml", periods=500).impacts > 0


def test_motions_of_a_map_without_a_period_have_a_kind(source_dir: Path, separatrix: Path) -> None:
    case = sx.load(source_dir / "examples" / "validation" / "budd_dux.toml").with_(contact__upper=0.0)
    small = {"x0": (-3, 0, 4), "v0": (-1, 1, 4)}
    found = sx.stability_of_map(sx.basin(case, **small, progress=False), periods=5000)
    assert [one.motion for one in found.values()] == ["chaotic"]
    (one,) = found.values()
    assert one.sum_found == pytest.approx(one.sum_exact, abs=1e-8)
    assert one.exponents[0] > 10 * one.errors[0]
    assert "attractor 1: chaotic" in str(one)
    periodic = sx.basin(
        source_dir / "examples" / "basin_coulomb.toml", x0=(0, 1, 3), v0=(-1, 1, 3), progress=False
    )
    assert sx.stability_of_map(periodic) == {}
    with pytest.raises(sx.SeparatrixError, match="^stability: found a branches, allowed a map"):
        sx.stability_of_map(sx.branches(case, "contact.upper", 0, 0.01, searches=1, progress=False))
