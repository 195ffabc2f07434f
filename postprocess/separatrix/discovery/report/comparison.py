# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an added effect changes: sweeps and motions of the base and of the extended case, by the program."""

import csv
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from separatrix import style
from separatrix.discovery.fitting.machine import drive_amplitudes
from separatrix.discovery.report.figures import AFTER, BEFORE, MEASURED
from separatrix.discovery.report.pages import Picture, Section
from separatrix.discovery.wording import Units
from separatrix.errors import SeparatrixError
from separatrix.library import Model
from separatrix.open import open_result
from separatrix.program import program_path

_HOLDS = 81
_ROOM = 0.08
_SAMPLES = 16
_LIMIT = 300.0


@dataclass
class Start:
    """The record that a motion is compared with: its start, length and impact speeds."""

    record: str
    x: float
    v: float
    crank_angle: dict[str, float]
    duration: float
    speeds: np.ndarray


def compare(
    base: Path, extended: Path, verdict: dict, details: h5py.File, progress: Callable[[str, float], None]
) -> Section:
    """The section with both figures, or with the reason why they are missing."""
    section = Section("motion", "What it means for the motion")
    reason = _reason(verdict)
    try:
        program = program_path()
    except SeparatrixError:
        reason = reason or "the program separatrix was not found; SEPARATRIX_PROGRAM may name it"
    if reason:
        section.body = [f"No maps before and after: {reason}."]
        return section
    cases = {"before": base, "after": extended}
    try:
        with tempfile.TemporaryDirectory(prefix="separatrix-report-") as folder:
            _fill(section, program, cases, verdict, details, Path(folder), progress)
    except (SeparatrixError, OSError, subprocess.SubprocessError) as error:
        section.body.append(f"The program could not run these cases: {error}.")
    return section


def _reason(verdict: dict) -> str:
    if not (verdict["effects"] or verdict["added"]):
        return "no effect was added"
    if any(one["drive_frequency"] is None for one in verdict["records"]):
        return "the machine has no drive that turns"
    if any("sensors" in one for one in verdict["records"]):
        return "they are of one body; extended.toml is an ordinary case of all of them"
    return ""


def _fill(
    section: Section,
    program: Path,
    cases: dict[str, Path],
    verdict: dict,
    details: h5py.File,
    folder: Path,
    progress: Callable[[str, float], None],
) -> None:
    units = Units(**verdict["units"])
    # drive frequency at ratio 1, which the fitted stiffness changes
    unit = {stage: Model.read(case).drive_frequency({"drive.ratio": 1.0}) for stage, case in cases.items()}
    drives = [one["drive_frequency"] for one in verdict["records"]]
    span = (min(drives) * (1 - _ROOM), max(drives) * (1 + _ROOM))
    sweeps = {}
    for number, (stage, case) in enumerate(cases.items()):
        progress(f"sweeping the drive of the {_label(stage)}", 0.91 + 0.03 * number)
        sweeps[stage] = sweep(program, case, [one / unit[stage] for one in span], folder / f"{stage}.h5")
    held = [one["name"] for one in verdict["records"] if one["use"] == "held out"]
    marks = {one["name"]: one["drive_frequency"] for one in verdict["records"]}
    section.body += [
        "The same sweep of the drive frequency on the base case as it was given and on the extended case.",
        Picture(
            "bifurcation",
            bifurcation(sweeps, unit, marks, held, units),
            "Positions once per drive period (top) and mean impact speeds (bottom) after the transient, "
            "over the drive "
            "frequency, run up (circles) and run down (dots): a) the base case as it was given, b) the "
            "extended case. "
            "Vertical lines: records that were fitted (dotted) and held out (dashed).",
        ),
    ]
    start = start_of(details, held or list(marks))
    scale = next(one["drive_scale"] for one in verdict["records"] if one["name"] == start.record)
    speeds = {}
    for stage, case in cases.items():
        progress(f"a long motion of the {_label(stage)}", 0.97)
        ratio = marks[start.record] / unit[stage]
        scaled = case if scale == 1 else with_drive(case, scale, folder / f"{stage}.toml")
        speeds[stage] = impact_speeds(program, scaled, ratio, start, stage, folder)
    if start.speeds.size or any(one.size for one in speeds.values()):
        section.body.append(
            Picture(
                "impact-speeds",
                histogram(speeds, start, units),
                f"Impact speeds in record {start.record} ({start.speeds.size} impacts) and in motions of "
                "the same length "
                f"from the same start of the base case as it was given ({speeds['before'].size}) and of "
                "the extended case "
                f"({speeds['after'].size}).",
            )
        )
    else:
        section.body.append(f"Neither record {start.record} nor either machine has impacts.")


def _label(stage: str) -> str:
    return "base case" if stage == "before" else "extended case"


def _run(program: Path, *arguments: object) -> None:
    done = subprocess.run(
        [program, *map(str, arguments)], capture_output=True, text=True, timeout=_LIMIT, check=False
    )
    if done.returncode:
        raise SeparatrixError(
            (done.stderr or done.stdout).strip() or f"{program} ended with {done.returncode}"
        )


def sweep(program: Path, case: Path, ratios: list[float], output: Path) -> dict[str, np.ndarray]:
    """Run the drive ratio up and down; return ratios, stroboscopic positions and mean impact speeds."""
    step = (ratios[1] - ratios[0]) / (_HOLDS - 1)
    table = (
        f"sweep={{parameter='drive.ratio', from={ratios[0]!r}, to={ratios[1]!r}, step={step!r}, "
        f"directions='both', samples={_SAMPLES}, starts=[0, 0]}}"
    )
    _run(program, "sweep", case, "--set", table, "-o", output, "--force", "-q")
    with open_result(output) as result:
        name = next(one for one in result["x_max"].dims if one != "direction")
        return {
            "ratio": result[name].values,
            "section": result["section_x"].transpose("direction", name, "sample").values,
            "speed": result["mean_impact_speed"].transpose("direction", name).values,
        }


def bifurcation(
    sweeps: dict[str, dict[str, np.ndarray]],
    unit: dict[str, float],
    marks: dict[str, float],
    held: list[str],
    units: Units,
) -> Figure:
    """Stroboscopic positions and impact speeds over the drive frequency, base and extended side by side."""
    figure = style.new_figure(style.DOUBLE_COLUMN, 95.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey="row", height_ratios=(3, 2))
    handles = []
    for column, (stage, found) in enumerate(sweeps.items()):
        frequency = found["ratio"] * unit[stage] / (2 * np.pi)
        top, bottom = axes[:, column]
        colour = BEFORE if stage == "before" else AFTER
        for direction, size, face in ((0, 3.2, "none"), (1, 1.4, colour)):
            section = found["section"][direction]
            along = np.broadcast_to(frequency[:, None], section.shape)
            look = {
                "linestyle": "",
                "marker": "o",
                "markersize": size,
                "color": colour,
                "markerfacecolor": face,
            }
            look |= {"markeredgewidth": 0.4, "rasterized": True}
            top.plot(along.ravel(), section.ravel(), **look)
            bottom.plot(frequency, found["speed"][direction], **look)
        for ax in (top, bottom):
            for name, drive in marks.items():
                ax.axvline(
                    drive / (2 * np.pi),
                    color="black",
                    linestyle="--" if name in held else ":",
                    linewidth=0.6,
                    zorder=0,
                )
        top.set_title(f"{'ab'[column]}) {_label(stage)}", loc="left")
        bottom.set_xlabel("drive frequency (Hz)")
        handles.append(
            Line2D([], [], linestyle="", marker="o", color=colour, markersize=3, label=_label(stage))
        )
    axes[0, 0].set_ylabel(f"position $x$ ({units.position})\nonce per drive period")
    axes[1, 0].set_ylabel(f"mean impact\nspeed ({units.velocity})")
    axes[1, 0].set_ylim(bottom=min(0.0, axes[1, 0].get_ylim()[0]))
    figure.legend(handles=handles, loc="outside upper center", ncols=2)
    return figure


def start_of(details: h5py.File, names: list[str]) -> Start:
    """Start, length and impact speeds of the record, among `names`, with the most impacts."""
    name = max(names, key=lambda one: len(details["records"][one]["impacts"]))
    record = details["records"][name]
    t, state = record["t"][:], record["smoothed"][0]
    fits = details["held_out" if record.attrs["held_out"] else "training"][name]
    angles = {stage: float(fits[stage].attrs["crank_angle"]) for stage in fits}
    return Start(
        name, float(state[0]), float(state[1]), angles, float(t[-1] - t[0]), np.abs(record["impacts"][:, 2])
    )


def with_drive(case: Path, scale: float, target: Path) -> Path:
    """The case with `scale` times its drive, written to `target`."""
    model = Model.read(case)
    scaled = {path: scale * value for path, value in drive_amplitudes(model).items()}
    target.write_text(model.to_text(scaled), encoding="utf-8")
    return target


def impact_speeds(
    program: Path, case: Path, ratio: float, start: Start, stage: str, folder: Path
) -> np.ndarray:
    """Speeds of all impacts of the motion from the start of a record, as long as the record."""
    events = folder / f"{stage}.csv"
    settings = {
        "drive.ratio": ratio,
        "start.x0": start.x,
        "start.v0": start.v,
        "start.crank_angle": start.crank_angle.get(stage, 0.0),
        "run.duration": start.duration,
        "run.window": 0.25 * start.duration,
    }
    chosen = [word for key, value in settings.items() for word in ("--set", f"{key}={float(value)!r}")]
    _run(
        program,
        "trajectory",
        case,
        *chosen,
        "-o",
        folder / f"{stage}_motion.h5",
        "--csv",
        events,
        "--force",
        "-q",
    )
    with events.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["kind"].startswith("impact")]
    return np.abs(np.array([float(row["v_before"]) for row in rows]))


def histogram(speeds: dict[str, np.ndarray], start: Start, units: Units) -> Figure:
    """Impact speeds of the record and of both machines."""
    figure = style.new_figure(style.SINGLE_COLUMN, 62.0)
    figure.set_layout_engine("constrained")
    ax = figure.add_subplot()
    every = np.concatenate([start.speeds, *speeds.values()])
    edges = np.linspace(0, 1.05 * every.max(), 22)
    handles = []
    if start.speeds.size:
        count = np.histogram(start.speeds, edges)[0]
        handles.append(ax.stairs(count, edges, fill=True, color=MEASURED, alpha=0.35, label=start.record))
    for stage, dash in (("before", "--"), ("after", "-")):
        count = np.histogram(speeds[stage], edges)[0]
        handles.append(
            ax.stairs(
                count, edges, color=BEFORE if stage == "before" else AFTER, linestyle=dash, linewidth=1.2,
                label=_label(stage),
            )
        )  # fmt: skip
    ax.set_xlabel(f"impact speed ({units.velocity})")
    ax.set_ylabel("impacts")
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure
