# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`discover`: what `separatrix-discover` does, from Python."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from separatrix.cases import Case, as_case
from separatrix.discovery.cli import summary
from separatrix.discovery.options import Options
from separatrix.discovery.report.document import write_report
from separatrix.discovery.results import FILES, extended_case, replacing, require_writable, write_results
from separatrix.discovery.workflow import investigate
from separatrix.progress import Progress, Report


@dataclass(frozen=True)
class Discovery:
    """The verdict on records of a machine.

    `outcome` is "named", "ambiguous", "none", "characterised" or "not-in-catalogue"; `effects` are the names;
    `verdict` is all of it, as in verdict.json (docs/discovery-guide.md). `case` is the case with the effects
    found or the table of a force without a name, None without any; `files` are what was written.
    """

    verdict: dict
    case: Case | None
    files: dict[str, Path]

    @property
    def outcome(self) -> str:
        """What was found: named, ambiguous, none, characterised, not-in-catalogue."""
        return str(self.verdict["outcome"])

    @property
    def effects(self) -> tuple[str, ...]:
        """The missing effects by name."""
        return tuple(self.verdict["effects"])

    def __str__(self) -> str:
        """The summary that the command prints."""
        return "\n".join(summary(self.verdict))


def discover(
    case: Case | str | Path,
    records: str | Path | Sequence[str | Path],
    *,
    hold_out: str | Path | Sequence[str | Path] = (),
    rest: str | Path | None = None,
    out: str | Path | None = None,
    effects: str | Sequence[str] | None = None,
    compare: str = "motion",
    partial: bool = False,
    quick: bool = False,
    seed: int = 1,
    time_limit: float | None = None,
    workers: int = 1,
    progress: bool | Report | None = None,
) -> Discovery:
    """Find where records and a case disagree, name the missing effect or abstain, and add it to the case.

    Parameters
    ----------
    case
        The machine as it is believed to be.
    records, hold_out, rest
        Files of records to fit (CSV, HDF5, .mat, .npz, UFF 58 or TDMS), of those that no fit sees, and of one
        at rest, for the noise.
    out
        Folder of the results: verdict, extended case, details, report. Without one nothing is written.
    effects
        Only these effects of the catalogue.
    compare
        What of the records: "motion", or "force" that drives a joint along its known motion.
    partial
        Name effects that help though more is missing.
    quick
        A first look: fewer starts and candidates.
    seed
        Of all random choices.
    time_limit
        Seconds after which the search ends with the best verdict so far, which is not tested to the end. An
        error where nothing may be named yet.
    workers
        Threads that share the segments, which do not change the verdict.
    progress
        As for `basin`; what is counted are thousandths of the work.

    Examples
    --------
    A machine with a cubic spring is recorded at 180 samples a second; the case does not have that spring.

    >>> import numpy as np
    >>> case = sx.load("examples/basin_coulomb.toml").with_(axis=[])
    >>> machine = case.with_(effect__cubic_spring__stiffness=20.0)
    >>> motion = sx.trajectory(machine, 0.8, 0.0, duration=6, samples=100)
    >>> noise = np.random.default_rng(1).normal(0, 8e-6, motion.time.size)
    >>> angle = 2 * np.pi / motion.drive_period * motion.time
    >>> columns = np.column_stack([motion.time, motion.x + noise, angle])
    >>> np.savetxt("record.csv", columns, delimiter=",", header="t,x,phi", comments="")
    >>> found = sx.discover(case, "record.csv", effects=["cubic_spring"], quick=True)
    >>> found.effects
    ('cubic_spring',)
    >>> round(found.case.parameters["effect.cubic_spring.stiffness"].value, 1)
    20.0
    """
    case = as_case(case)
    effects = [effects] if isinstance(effects, str) else effects
    with Progress(progress) as report:
        options = Options(
            seed=seed, quick=quick, partial=partial, candidates=tuple(effects) if effects else None,
            compare=compare, time_limit=time_limit, workers=workers,
            progress=lambda stage, done: report("steps", round(1000 * done), 1000),
        )  # fmt: skip
        if out is not None:
            require_writable(Path(out))
        still = None if rest is None else Path(rest)
        verdict, findings = investigate(case.model, _paths(records), _paths(hold_out), options, still)
        text = extended_case(verdict, findings) if findings.decision.corrected is not None else None
        files = {} if out is None else _write(Path(out), case, verdict, findings, options)
        report("steps", 1000, 1000)
    return Discovery(verdict, None if text is None else Case.from_text(text, case.directory), files)


def _write(out: Path, case: Case, verdict: dict, findings: object, options: Options) -> dict[str, Path]:
    with tempfile.TemporaryDirectory(prefix="separatrix-") as folder, replacing(out) as draft:
        base = Path(folder) / "base.toml"
        base.write_text(case.to_toml())
        write_results(draft, verdict, findings)
        write_report(draft, base, options)
    return {name: out / name for name in FILES if (out / name).exists()}


def _paths(given: str | Path | Sequence[str | Path]) -> list[Path]:
    return [Path(given)] if isinstance(given, str | Path) else [Path(one) for one in given]
