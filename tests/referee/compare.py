#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares results of the program for the machines of cases/ with those of the independent referee.

For each case: the grid of starts (`basin`), the state of these motions after 40 drive periods (`points`),
both runs over the values of a parameter, and many starts at each value (`sweep`). The verdicts:

    agrees      same cycle, period and impacts per period; or no cycle for both
    not known   no label, or one of a motion that the program calls neither periodic nor chaotic: silence
    rounding    the referee ends on the program's motion too, in extended precision or 1e-12 beside the start
    unfounded   a cycle that the referee never finds, while its own answer hangs on the last digits
    wrong       anything else
"""

import argparse
import ctypes
import json
import math
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import referee  # noqa: E402
from comparison_report import disagreements, summary_table, wrong_in  # noqa: E402
from referee import Effort, Machine, Outcome  # noqa: E402

__all__ = ["Court", "compare", "disagreements", "kept_report", "summary_table", "wrong_in"]

CASES = HERE / "cases"
NAMES = tuple(sorted(path.stem for path in CASES.glob("*.toml")))
PARTS = ("basin", "points", "runs", "starts")
SAME = 1e-6  # of the size of a motion: section points of one cycle; slow motions come this near late
BESIDE = 1e-12  # how far beside a start the referee is asked again
CHAOTIC = 3  # the kind of an entry of the catalogue
COUNT = 1e-4  # impacts per drive period that differ by less are the same
PERIODS = 40  # of `points`
PATIENT = Effort(most=40000)  # where a motion had come to nothing


class Verdicts:
    """How many comparisons of a kind there were, how they ended, and those that did not agree."""

    def __init__(self) -> None:
        self.counts: Counter = Counter()
        self.listed: list[dict] = []

    def add(self, verdict: str, **what: object) -> None:
        """Count a comparison; keep what differs."""
        self.counts[verdict] += 1
        if verdict != "agrees":
            self.listed.append({"verdict": verdict, **what})

    def report(self) -> dict:
        """Numbers and list for a file."""
        return {"counts": dict(self.counts), "listed": self.listed}


@dataclass(frozen=True)
class Claim:
    """What the program states of a motion: its label (0 none), period (0 none), impacts per drive period.

    `aperiodic`: the label stands for a motion that has no period, which is more than not to know one;
    `rotation`: turns of a pendulum per drive period, where the program reports them.
    """

    label: int
    period: int
    impacts: float
    aperiodic: bool = False
    rotation: float | None = None

    def __str__(self) -> str:
        """In words."""
        name = f"label {self.label}" if self.label else "no label"
        kind = ", not periodic" if self.aperiodic else ""
        return f"{name}, period {self.period}{kind}, {self.impacts:.4f} impacts"


@dataclass
class Court:
    """The referee in double and in extended precision, the program, and where its files go."""

    double: ctypes.CDLL
    extended: ctypes.CDLL
    program: Path
    folder: Path
    effort: Effort

    @classmethod
    def of(cls, build: Path, folder: Path) -> "Court":
        """The court for a build of the program."""
        folder.mkdir(parents=True, exist_ok=True)
        libraries = referee.build(folder), referee.build(folder, long=True)
        return cls(*libraries, build / "bin" / "separatrix", folder, Effort())

    def run(self, command: str, case: Path, *settings: str, words: Iterable[object] = ()) -> Path:
        """Run the program on a case; return its file."""
        path = self.folder / f"{case.stem}_{command}.h5"
        line = [self.program, command, case, "-q", "--force", "-o", path, *words]
        for setting in settings:
            line += ["--set", setting]
        subprocess.run(line, check=True)
        return path

    def beside(self, machine: Machine, start: np.ndarray) -> list[Outcome]:
        """The referee's answers in more digits, and for starts a little beside."""
        starts = start + BESIDE * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
        return referee.outcomes(self.extended, machine, starts, self.effort)

    def assess(
        self,
        machine: Machine,
        start: np.ndarray,
        found: Outcome,
        claim: Claim,
        points: np.ndarray | None = None,
    ) -> str:
        """Hold a claim against the referee's outcome; `points` are the cycle that the program means."""
        verdict = verdict_on(machine, found, claim, points)
        if verdict == "wrong" and found.kind == "slow":
            (found,) = referee.outcomes(self.double, machine, start[None], PATIENT)
            verdict = verdict_on(machine, found, claim, points)
        if verdict != "wrong":
            return verdict
        others = self.beside(machine, start)
        if all(same_motion(machine, found, other) for other in others):
            return "wrong"
        met = any(verdict_on(machine, other, claim, points) == "agrees" for other in others)
        return "rounding" if met else "unfounded"


def verdict_on(machine: Machine, found: Outcome, claim: Claim, points: np.ndarray | None = None) -> str:
    """As `Court.assess`, without a second look."""
    if claim.period == 0:
        if found.period == 0:
            return "agrees"
        return "wrong" if claim.aperiodic else "not known"
    if found.period != claim.period:
        return "wrong"
    if points is not None and max(distance(machine, found.cycle, point) for point in points) > SAME:
        return "wrong"
    if claim.rotation is not None and abs(claim.rotation - found.turns / found.period) > COUNT:
        return "wrong"
    # how many impacts of a completed chatter count is a matter of convention
    same = found.chatters > 0 or abs(claim.impacts - found.impacts / found.period) <= COUNT
    return "agrees" if same else "wrong"


def size_of(cycle: np.ndarray) -> np.ndarray:
    """Size of a motion in position and velocity."""
    return np.maximum(np.abs(cycle).max(axis=0), 1e-3)


def distance(machine: Machine, points: np.ndarray, point: np.ndarray) -> float:
    """Distance of a point from the nearest of a cycle, over the size of the motion."""
    return float(np.min(np.max(apart(machine, points, point) / size_of(points), axis=1)))


def apart(machine: Machine, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Distances in position and velocity; the angle of a pendulum lies on a circle."""
    between = one - other
    if machine.pendulum:
        between[..., 0] = np.remainder(between[..., 0] + math.pi, 2 * math.pi) - math.pi
    return np.abs(between)


def same_motion(machine: Machine, one: Outcome, other: Outcome) -> bool:
    """Whether two outcomes are the same attractor; motions without a cycle are not distinguished."""
    if one.period != other.period:
        return False
    return one.period == 0 or distance(machine, one.cycle, other.cycle[0]) < SAME


def grid_of(case: dict) -> np.ndarray:
    """The starts of the axes of a case, in the order of the file."""
    axes = [np.linspace(axis["from"], axis["to"], axis["count"]) for axis in case["axis"]]
    return np.stack([item.ravel() for item in np.meshgrid(*axes, indexing="ij")], axis=1)


def described(outcome: Outcome) -> str:
    """An outcome in words."""
    if not outcome.period:
        return f"{outcome.kind}, exponent {outcome.exponents[0]:+.4f} per drive period"
    chatter = f", {outcome.chatters} chatters" if outcome.chatters else ""
    size = abs(outcome.multipliers[0])
    return f"{outcome.kind}, {outcome.impacts / outcome.period:.4f} impacts{chatter}, multiplier {size:.4f}"


def compare_basin(court: Court, path: Path, case: dict, kinds: Counter) -> Verdicts:
    """Labels of a map of starts."""
    machine, starts, verdicts = referee.machine_of(case), grid_of(case), Verdicts()
    with h5py.File(court.run("basin", path)) as file:
        columns = [file[key][()].ravel() for key in ("attractor", "period", "impacts_per_period")]
        catalogue = {key: item[()] for key, item in file["catalogue"].items()}
    names = catalogue["attractor"].tolist()
    kind = dict(zip(names, catalogue["kind"].tolist(), strict=True))
    rotation = dict(zip(names, catalogue.get("rotation_number", np.array([])).tolist(), strict=False))
    # a catalogue without cycles has no points
    owner = catalogue["attractor"][catalogue["point_entry"]] if "point" in catalogue else None
    for k, outcome in enumerate(referee.outcomes(court.double, machine, starts, court.effort)):
        label, period = int(columns[0][k]), int(columns[1][k])
        claim = Claim(label, period, float(columns[2][k]), kind.get(label) == CHAOTIC, rotation.get(label))
        points = catalogue["point"][owner == label] if label and period else None
        verdict = court.assess(machine, starts[k], outcome, claim, points)
        verdicts.add(verdict, start=starts[k].tolist(), ours=str(claim), referee=described(outcome))
        kinds[outcome.kind] += 1
    return verdicts


def compare_sweep(court: Court, path: Path, case: dict, kinds: Counter) -> tuple[Verdicts, Verdicts]:
    """Both runs of a sweep, whose last section points the referee goes on from, and its many starts."""
    name = case["sweep"]["parameter"]
    runs, many = Verdicts(), Verdicts()
    with h5py.File(court.run("sweep", path)) as file:
        values = file[name.replace(".", "_")][()]
        ends = np.stack([file["section_x"][:, :, -1], file["section_v"][:, :, -1]], axis=-1)
        held = [file[key][()] for key in ("period", "impacts_per_period")]
        starts = np.stack([file["start_x0"][()], file["start_v0"][()]], axis=1)
        found = [file[f"branch_{key}"][()] for key in ("attractor", "period", "impacts_per_period")]
    for k, value in enumerate(values.tolist()):
        machine = referee.machine_of(referee.with_value(case, name, value))
        begun = np.concatenate([ends[:, k], starts])
        outcomes = referee.outcomes(court.double, machine, begun, court.effort)
        claims = [Claim(0, int(held[0][i, k]), float(held[1][i, k])) for i in range(2)]
        claims += [
            Claim(int(found[0][k, i]), int(found[1][k, i]), float(found[2][k, i])) for i in range(len(starts))
        ]
        for i, (outcome, claim) in enumerate(zip(outcomes, claims, strict=True)):
            verdict = court.assess(machine, begun[i], outcome, claim)
            where = {"run": ("up", "down")[i]} if i < 2 else {"start": begun[i].tolist()}
            group = runs if i < 2 else many
            group.add(verdict, value=value, **where, ours=str(claim), referee=described(outcome))
            kinds[outcome.kind] += 1
    return runs, many


def compare_points(court: Court, path: Path, case: dict) -> tuple[Verdicts, float]:
    """States after 40 drive periods; returns also the largest difference over the size of the motion."""
    machine, starts, verdicts = referee.machine_of(case), grid_of(case), Verdicts()
    listed, ends = court.folder / f"{path.stem}.csv", court.folder / f"{path.stem}_ends.csv"
    listed.write_text("x0,v0\n" + "".join(f"{float(x)!r},{float(v)!r}\n" for x, v in starts))
    ends.unlink(missing_ok=True)
    court.run(
        "points", path, f"run.duration={PERIODS * machine.period!r}", words=("--list", listed, "--csv", ends)
    )
    ours = np.genfromtxt(ends, delimiter=",", names=True, dtype=None, encoding=None)
    ways = ((court.extended, 0.0), (court.double, 0.0), (court.extended, BESIDE))
    worst = 0.0
    for k, (x, v) in enumerate(starts):
        flown = [referee.sections(library, machine, x + aside, v, PERIODS)[-1] for library, aside in ways]
        scale = size_of(np.array([[x, v], flown[0][:2]]))
        # how far the last digits alone move the end
        noise = max(float(np.max(apart(machine, item[:2], flown[0][:2]) / scale)) for item in flown)
        end = np.array([ours["x"][k], ours["v"][k]])
        off = float(np.max(apart(machine, end, flown[0][:2]) / scale))
        counted = flown[0][3] > 0 or int(ours["impacts"][k]) == int(flown[0][2])
        verdict = "agrees" if off < 1e-7 + 100 * noise and (counted or noise > 1e-6) else "wrong"
        if noise < 1e-9:
            worst = max(worst, off)
        verdicts.add(
            verdict,
            start=[float(x), float(v)],
            ours=f"{int(ours['impacts'][k])} impacts",
            referee=f"{int(flown[0][2])} impacts, {off:.1e} apart",
        )
    return verdicts, worst


def compare(court: Court, path: Path) -> dict:
    """All comparisons of a case, for a file."""
    case, kinds = referee.read_case(path), Counter()
    basin = compare_basin(court, path, case, kinds)
    points, worst = compare_points(court, path, case)
    runs, starts = compare_sweep(court, path, case, kinds)
    parts = dict(zip(PARTS, (basin, points, runs, starts), strict=True))
    return {
        "title": case["title"],
        "worst": worst,
        "kinds": dict(kinds),
        **{name: item.report() for name, item in parts.items()},
    }


def kept_report(build: Path, folder: Path, names: Iterable[str] = NAMES) -> dict[str, dict]:
    """The reports of cases; one that is newer than program, referee and case is kept."""
    court = Court.of(build, folder)
    reports = {}
    for name in names:
        path, kept = CASES / f"{name}.toml", folder / f"{name}.json"
        sources = (court.program, path, *HERE.glob("*.[ch]"), HERE / "compare.py", HERE / "referee.py")
        if not kept.is_file() or kept.stat().st_mtime < max(item.stat().st_mtime for item in sources):
            print(f"referee: {name}", flush=True)
            kept.write_text(json.dumps(compare(court, path), indent=1))
        reports[name] = json.loads(kept.read_text())
    return reports


def main() -> int:
    """Compare the cases asked for; the exit code is 1 if anything is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("cases", nargs="*", default=NAMES, help="cases [all]")
    top = HERE.parents[1]
    parser.add_argument("--build", type=Path, default=top / "build", help="build folder [build]")
    parser.add_argument("--out", type=Path, default=top / "out" / "validation" / "referee", help="files")
    options = parser.parse_args()
    reports = kept_report(options.build.resolve(), options.out.resolve(), options.cases)
    print(summary_table(reports), disagreements(reports), sep="\n\n")
    return 1 if wrong_in(reports) else 0


if __name__ == "__main__":
    sys.exit(main())
