# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A time limit ends the discovery wherever it is: with the best verdict so far, or without one."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from program import CASE, succeed
from separatrix.discovery import Options, discover
from separatrix.discovery.fitting import time_limit
from separatrix.discovery.fitting.time_limit import OutOfTimeError, TimeLimit, kept, present_limit
from separatrix.errors import STOPPED, SeparatrixError

pytestmark = pytest.mark.usefixtures("library")


@pytest.fixture(scope="module")
def records(separatrix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with records of a machine with drag at two frequencies, and the case without it."""
    folder = tmp_path_factory.mktemp("records")
    (folder / "base.toml").write_text(CASE)
    (folder / "true.toml").write_text(CASE + "[effect.viscous]\ndamping = 0.4\n")
    for seed, (name, ratio) in enumerate({"first": 0.8, "held_out": 0.95}.items()):
        settings = (
            "run.duration=6",
            f'record={{rate=200, noise="1 mm", seed={seed}}}',
            f"drive.ratio={ratio}",
        )
        words = [word for setting in settings for word in ("--set", setting)]
        record = folder / f"{name}.csv"
        succeed(separatrix, "trajectory", "true.toml", "--force", "--record", record, *words, folder=folder)
    return folder


@pytest.fixture
def limited(records: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, int], dict]:
    """A discovery whose time is over when something was reported so many times; then it must end soon."""

    def run(text: str, times: int) -> dict:
        clock = SimpleNamespace(now=0.0)
        seen: list[str] = []

        def progress(what: str, _: float) -> None:
            assert clock.now == 0 or not what.startswith(text), "went on after the time limit"
            seen.append(what)
            if sum(one.startswith(text) for one in seen) == times:
                clock.now = 1e12

        monkeypatch.setattr(time_limit, "time", SimpleNamespace(monotonic=lambda: clock.now))
        options = Options(time_limit=60.0, quick=True, progress=progress)
        names = [records / "first.csv"], [records / "held_out.csv"]
        return discover(records / "base.toml", *names, options)

    return run


def test_no_effect_was_tried(limited: Callable[[str, int], dict]) -> None:
    with pytest.raises(
        SeparatrixError, match="while the machine of the case was fitted: no verdict"
    ) as raised:
        limited("fitting the base machine", 1)
    assert raised.value.code == STOPPED


def test_the_first_effect_is_given_up(limited: Callable[[str, int], dict]) -> None:
    with pytest.raises(SeparatrixError, match=r"limit of 60 s, before 'one effect': no verdict") as raised:
        limited("fitting ", 2)
    assert raised.value.code == STOPPED


def test_the_best_so_far_is_in_doubt(limited: Callable[[str, int], dict]) -> None:
    verdict = limited("fitting ", 4)
    assert (verdict["outcome"], verdict["effects"]) == ("ambiguous", ["viscous"])
    assert verdict["stopped_before"] == "name of one effect"
    assert any("time limit of 60 s" in one for one in verdict["reasons"])


def test_fits_end_as_they_stand_where_that_is_of_use() -> None:
    assert not present_limit().ends_fits()
    with kept(TimeLimit(end=0.0)) as limit:
        with pytest.raises(OutOfTimeError):
            present_limit().ends_fits()
        limit.work_counts = True
        assert present_limit().ends_fits()
    assert not present_limit().ends_fits()
