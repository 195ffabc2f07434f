#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the published cases of examples/ and writes docs/published.md and docs/figures/.

A file in the output folder that is newer than the program and its case is kept, so an interrupted run
goes on where it was. The prose of the page is in published.md.in, its tables come from published_tables.py.
"""

import math
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import published_tables as tables
from evidence_rows import arguments, page, table, version_of
from published_tables import LAWS, MOTIONS, SOURCE, case_of, resolved, run_of
from separatrix import cli, open_result

LEVER = "trajectory_coulomb_crank_lever_rod"
COARSE = ("axis[1].count=50", "axis[2].count=50")


class Runner:
    """Runs the program where its output is older than the program or the case."""

    def __init__(self, build: Path, out: Path, ranks: int) -> None:
        self.program, self.out = build / "bin" / "separatrix", out
        self.version = version_of(self.program)
        self.start = [] if self.version["mpi"] == "none" else ["mpirun", "-n", str(ranks)]
        out.mkdir(parents=True, exist_ok=True)
        for line in (SOURCE / "scripts" / "environment.sh").read_text().splitlines():
            if line.startswith("export "):
                os.environ.setdefault(*line.removeprefix("export ").split("=", 1))

    def run(self, case: str, *settings: str, name: str = "") -> Path:
        """Return the result file of a case, computed with `--set` settings if there is none yet."""
        source, path = SOURCE / "examples" / f"{case}.toml", self.out / f"{name or case}.h5"
        newest = max(item.stat().st_mtime for item in (self.program, source))
        if path.is_file() and path.stat().st_mtime > newest:
            return path
        command = case.split("_")[0]
        print(f"published: {command} examples/{case}.toml {' '.join(settings)}", flush=True)
        words = [*([] if command == "trajectory" else self.start), self.program, command, source, "-o", path]
        for setting in settings:
            words += ["--set", setting]
        # an interrupted run of the same case goes on, anything else starts anew
        interrupted = path.with_name(f"{path.name}.part").is_file() and not path.is_file()
        if not interrupted or subprocess.run([*words, "--resume"]).returncode != 0:
            subprocess.run([*words, "--force"], check=True)
        return path


def run_all(runner: Runner) -> dict[str, Path]:
    """Return the files of all runs by name; a file has the name of its case unless settings change that."""
    files = {}

    def add(case: str, *settings: str, name: str = "") -> None:
        files[name or case] = runner.run(case, *settings, name=name)

    for motion in MOTIONS:
        for law in LAWS:
            add(f"trajectory_{law}_{motion}")
        start = case_of(f"trajectory_coulomb_{motion}")["start"]
        ratio = f"drive.ratio={motion.split('_')[0]}"
        add(LEVER, ratio, f'start.x0="{start["x0"]}"', name=f"lever_{motion}")
    for law in LAWS:
        add(f"basin_{law}", *COARSE, name=f"coarse_{law}")
        add(f"basin_{law}")
        add(f"sweep_{law}")
    add("basin_coulomb_crank_lever_rod", *COARSE, name="coarse_lever")
    add("basin_coulomb_crank_lever_rod")
    lever = ", ".join(f"{key}={toml(value)}" for key, value in case_of(LEVER)["drive"].items())
    add("sweep_coulomb", f"drive={{{lever}}}", "sweep.starts=[0, 0]", name="lever_sweep")
    return files


def toml(value: object) -> str:
    """Return a text or number as TOML."""
    return f'"{value}"' if isinstance(value, str) else str(value)


def starts() -> str:
    """Return the start of each motion as given in its cases."""
    texts = []
    for motion, text in MOTIONS.items():
        found = {str(case_of(f"trajectory_{law}_{motion}")["start"]) for law in LAWS}
        if len(found) > 1:
            sys.exit(f"published: the starts of {motion} differ between the friction laws")
        start = case_of(f"trajectory_coulomb_{motion}")["start"]
        texts.append(f"* ({start['x0']}, {start['v0']}) for {text}")
    return "\n".join(texts)


def axes(path: Path) -> str:
    """Return the ranges of the axes of a basin file."""
    with open_result(path) as result:
        ends = {name: result[name].values[[0, -1]] for name in ("x0", "v0")}
        return ", ".join(
            f"{name} from {low:g} to {high:g} {result[name].attrs['units']}"
            for name, (low, high) in ends.items()
        )


def pictures(stem: str, text: str, laws: Iterable[str] = LAWS) -> str:
    """Return the lines that show a figure for each friction law."""
    return "\n\n".join(f"![{text.format(LAWS[law])}](figures/{stem.format(law)}.png)" for law in laws)


def text_of(files: dict[str, Path], version: dict[str, str]) -> str:
    """Return the text of docs/published.md."""
    run = run_of(files["trajectory_coulomb_0.8"])
    rate = resolved(files["trajectory_viscous_0.8"])["friction"]["damping"] / 2
    rate /= resolved(files["trajectory_viscous_0.8"])["body"]["mass"]
    motions = [
        pictures("trajectory_{}_1.2_impact_" + kind, f"1.2 with impacts, {{}} friction, {kind}")
        for kind in ("history", "phase")
    ]
    motions += [
        pictures(f"trajectory_{{}}_{motion}_phase", f"{MOTIONS[motion]}, {{}} friction, phase", ["coulomb"])
        for motion in ("0.8", "1.05", "1.2_free")
    ]
    fields = {
        "version": version["separatrix"],
        "commit": version["commit"],
        "compiler": version["compiler"],
        "steady_bar": tables.STEADY_BAR,
        "limit_bar": tables.LIMIT_BAR,
        "stribeck_bar": tables.STRIBECK_BAR,
        "failures": tables.failures(files),
        "starts": starts(),
        "axes": axes(files["coarse_coulomb"]),
        "left_start": 100 * math.exp(-rate * (run["duration"] - run["window"])),
        "left_end": 100 * math.exp(-rate * run["duration"]),
        "lever_case": f"examples/{LEVER}.toml",
        "limit_figures": pictures("sweep_{}_amplitude", "Run-up and run-down, {} friction")
        + "\n\n"
        + pictures("sweep_{}_bifurcation", "Stroboscopic positions and impact speeds, {} friction"),
        "share_figures": pictures("basin_{}_regime", "Basins, {} friction"),
        "lever_figures": pictures("basin_{}_crank_lever_rod_regime", "Basins, lever geometry", ["coulomb"]),
        "motion_figures": "\n\n".join(motions),
    }
    for name, (head, make) in tables.TABLES.items():
        fields[name] = table(head.split(", "), make(files))
    return page("published", **fields, **run)


def main() -> int:
    """Run everything; return the exit code."""
    parser = arguments(__doc__, "published")
    parser.add_argument("--ranks", type=int, default=2, help="ranks under mpirun [2]")
    options = parser.parse_args()
    runner = Runner(options.build.resolve(), options.out.resolve(), options.ranks)
    files = run_all(runner)
    text = text_of(files, runner.version)
    (SOURCE / "docs" / "published.md").write_text(text)
    shown = SOURCE / "docs" / "figures"
    drawn = options.out / "figures"
    if cli.main([*map(str, files.values()), "-o", str(drawn), "--formats", "png", "--dpi", "200"]) != 0:
        return 1
    shown.mkdir(exist_ok=True)
    for name in re.findall(r"\(figures/(.*?)\)", text):
        shutil.copy(drawn / name, shown / name)
    print("published: wrote docs/published.md and docs/figures/", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
