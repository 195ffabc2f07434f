# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of a discovery: report.html and report.pdf beside verdict.json, details.h5 and extended.toml."""

import json
from pathlib import Path

import h5py
from matplotlib.figure import Figure

from separatrix import style
from separatrix.discovery.options import Options
from separatrix.discovery.report import figures, where_figures
from separatrix.discovery.report.comparison import compare
from separatrix.discovery.report.loop_figures import loops
from separatrix.discovery.report.pages import Beside, Picture, Section, page_of, write_pdf
from separatrix.discovery.report.verdict_sections import cause, names, sections
from separatrix.open import reading


def write_report(folder: Path, base: Path, options: Options | None = None) -> tuple[Path, Path]:
    """Write both files from what separatrix-discover left in `folder`; `base` is the case that was compared.

    Quick options run no maps. If no PDF can be written, the progress reports the reason.
    """
    options = options or Options()
    options.progress("writing the report", 0.9)
    with reading(folder / "verdict.json"):
        verdict = json.loads((folder / "verdict.json").read_text(encoding="utf-8"))
    with style.context(), h5py.File(folder / "details.h5", "r") as details:
        parts = illustrated(verdict, details)
        if options.quick:
            motion = Section(
                "motion", "What it means for the motion", ["No maps before and after in a quick look."]
            )
        else:
            motion = compare(Path(base), folder / "extended.toml", verdict, details, options.progress)
        parts = [motion if section.key == "motion" else section for section in parts]
        title = f"Missing physics: {_title(verdict)}"
        made = folder / "report.html", folder / "report.pdf"
        page = page_of(title, parts)
        made[0].write_text(page, encoding="utf-8")
        lacking = write_pdf(made[1], page)
        if lacking:
            options.progress(lacking, 1.0)
        return made


def _title(verdict: dict) -> str:
    return {
        "named": names(verdict),
        "ambiguous": f"{names(verdict)}, not beyond doubt",
        "none": "none",
        "not-in-catalogue": "not in the catalogue",
        "characterised": f"not in the catalogue: {cause(verdict)}",
    }[verdict["outcome"]]


def illustrated(verdict: dict, details: h5py.File) -> list[Section]:
    """All sections with the figures that need no further run."""
    parts = sections(verdict)
    by_key = {section.key: section for section in parts}
    visible = Options().visible
    _first_page(by_key["verdict"], verdict)
    _show(
        by_key["gap"],
        "loops",
        loops(details),
        "Top: force over position in a period in which the base machine misses as much as it usually does: "
        "measured, of the base machine and of the machine of the verdict. The area of a loop is the energy "
        "that a cycle takes. Bottom: what both machines leave of the force.",
    )
    _show(
        by_key["where"],
        "where-lines",
        where_figures.where_lines(details),
        "The force that the base machine lacks in bins of equal numbers of samples; vertical bars are 95 % "
        "intervals, "
        "horizontal ones the bins. Filled: differs from zero by more than chance, given the number of bins.",
    )
    _show(
        by_key["where"],
        "where-plane",
        where_figures.where_plane(details),
        f"The force that the base machine lacks ({verdict['units']['force']}) by position and velocity; "
        "hatched: negative. A star marks what differs from zero by more than chance, given the number of "
        "bins.",
    )
    _show(
        by_key["missing"],
        "ranking",
        figures.ranking(verdict),
        f"a) Linearised size of each effect in standard errors, dark: in the verdict, dotted line: "
        f"{visible:g}. b) "
        "Log-likelihood gained over the base machine by the candidates that were fitted.",
    )
    _show(
        by_key["confusable"],
        "confusability",
        figures.confusability(verdict),
        "Cosine between what is left of the signatures of two effects when the base machine is refitted; "
        "at 1 these "
        "records do not distinguish the two.",
    )
    _show_fits(by_key, details)
    contacts = any(path.startswith("contact.") for path in verdict["parameters"])
    return [one for one in parts if one.key != "impacts" or contacts or _has_pictures(one)]


def _has_pictures(section: Section) -> bool:
    return any(isinstance(one, Picture) for one in section.body)


def _show_fits(by_key: dict[str, Section], details: h5py.File) -> None:
    """Figures of the fits of both machines."""
    _show(
        by_key["residuals"],
        "residual",
        figures.residuals(details),
        "Residuals in standard deviations of the noise over time, their root mean square by segment, and "
        "how often each size occurs, beside the normal "
        "distribution of noise alone. At most four records are shown. Large residuals are on a logarithmic "
        "scale beyond 5.",
    )
    _show(
        by_key["impacts"],
        "impact-map",
        figures.impact_map(details),
        "Speed after each impact over the speed before it: from the smoothed records (bars: standard "
        "errors) and of the "
        "fitted segments of both machines.",
        "There are no impacts in the records nor in the fitted motions.",
    )
    _show(
        by_key["held-out"],
        "overlay",
        figures.held_out(details),
        "A held-out record where the base machine misses it most, three segments: a) position, or "
        "the force where it is compared, b) "
        "residuals in standard "
        "deviations of the noise; grey: 95 % of noise.",
    )


def _first_page(section: Section, verdict: dict) -> None:
    """The gap before and after, and the effect as a function, below the verdict."""
    shown = [
        Picture(
            "gap",
            figures.gap(verdict),
            "Reduced chi^2 of the base machine, all its uncertain numbers refitted, and of the machine of "
            "the verdict; at the dotted line nothing but noise is left.",
        )
    ]
    if verdict["function"]:
        shown.append(
            Picture(
                "function",
                figures.function(verdict["function"]),
                "The effect as a function, estimated from the records, with its 95 % band, and the closed "
                "forms that fit. Dots: the table that the corrected case has, where it has one.",
            )
        )
    section.body.insert(1, Beside(shown))


def _show(section: Section, name: str, figure: Figure | None, caption: str, otherwise: str = "") -> None:
    if figure is not None:
        section.body.append(Picture(name, figure, caption))
    elif otherwise:
        section.body.append(otherwise)
