# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of a discovery agrees with any verdict and has no empty figure."""

import base64
import io
import json
import re
import sys
import zlib
from html.parser import HTMLParser
from pathlib import Path

import h5py
import numpy as np
import pytest
from made_verdicts import make, verdict
from matplotlib.image import imread
from program import CASE
from separatrix.discovery.cli import summary
from separatrix.discovery.fitting.catalogue import STARTS
from separatrix.discovery.fitting.joint_effects import JOINT_EFFECTS
from separatrix.discovery.fitting.members import MEMBERS
from separatrix.discovery.fitting.motor_effects import MOTOR_EFFECTS
from separatrix.discovery.measured.records import make_record
from separatrix.discovery.options import Options
from separatrix.discovery.report import comparison
from separatrix.discovery.report.document import write_report
from separatrix.discovery.report.loop_figures import loops, periods_of
from separatrix.discovery.report.phrases import PHRASES, explained
from separatrix.discovery.report.verdict_sections import sections
from separatrix.discovery.workflow import investigate
from separatrix.library import Model

SECTIONS = [
    "verdict", "compared", "gap", "where", "missing", "confusable", "residuals", "impacts", "held-out",
    "parameters", "detectable", "next", "motion",
]  # fmt: skip
FIGURES = [
    "gap",
    "where-lines",
    "where-plane",
    "ranking",
    "confusability",
    "residual",
    "impact-map",
    "overlay",
]


class Page(HTMLParser):
    """Sections, tables (by their first head cell), pictures and text of a report."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.sections: list[str] = []
        self.tables: dict[str, list[list[str]]] = {}
        self.pictures: list[tuple[str, np.ndarray]] = []
        self.sources: list[str] = []
        self.text = ""
        self._rows: list[list[str]] = []
        self._figure = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list) -> None:
        found = dict(attrs)
        if tag == "section":
            self.sections.append(found["id"])
        elif tag == "table":
            self._rows = []
        elif tag == "tr":
            self._rows.append([])
        elif tag in ("th", "td"):
            self._rows[-1].append("")
        elif tag == "figure":
            self._figure = found["id"]
        elif tag == "img":
            self.sources.append(found["src"])
            data = base64.b64decode(found["src"].removeprefix("data:image/png;base64,"))
            self.pictures.append((self._figure, imread(io.BytesIO(data))))

    def handle_endtag(self, tag: str) -> None:
        if tag == "table":
            self.tables[self._rows[0][0]] = self._rows[1:]
            self._rows = []

    def handle_data(self, data: str) -> None:
        self.text += data + " "
        if self._rows and self._rows[-1]:
            self._rows[-1][-1] += data


@pytest.fixture(scope="module", params=["named", "ambiguous", "none", "not-in-catalogue", "characterised"])
def report(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[dict, Page, bytes]:
    """The verdict, the page and the PDF of each outcome."""
    folder = tmp_path_factory.mktemp(request.param)
    made = make(folder, request.param)
    html, pdf = write_report(folder, folder / "base.toml", Options(quick=True))
    return made, Page(html.read_text()), pdf.read_bytes()


def same(cell: str, value: float | None) -> bool:
    """Whether a cell prints a number to the digits that it shows."""
    return cell == "unknown" if value is None else float(cell) == pytest.approx(value, rel=6e-3)


def test_every_section_is_there(report: tuple) -> None:
    assert report[1].sections == SECTIONS


def test_numbers_are_those_of_the_verdict(report: tuple) -> None:
    reported, page, _ = report
    for row, gap in zip(page.tables["records"], reported["gap"].values(), strict=True):
        assert all(
            same(cell, gap[key])
            for cell, key in zip(row[1:4], ("before", "after", "noise_floor"), strict=True)
        )
    for row, (path, one) in zip(page.tables["parameter"], reported["parameters"].items(), strict=True):
        assert row[0] == path
        assert row[4] == one["unit"]
        if one["interval_95"] is None:
            assert same(row[1], one["value"])
            assert row[2:4] == ["-", "at its bound"]
            continue
        numbers = [*row[1:3], *row[3].split(" to ")]
        wanted = [one["value"], one["standard_error"], *one["interval_95"]]
        assert all(same(cell, value) for cell, value in zip(numbers, wanted, strict=True))
    assert page.tables["gate" if reported["gates"] else "effect"]
    for row, (gate, passed) in zip(page.tables.get("gate", []), reported["gates"].items(), strict=True):
        assert (row[0], row[2]) == (gate, "passed" if passed else "failed")
    for row, one in zip(page.tables["effect"], reported["detectable"].values(), strict=True):
        assert row[1] == (one["path"] or "-")
        assert same(row[2].split(" ")[0], one["size"])
        assert row[3] == one["reason"]


def test_where_nothing_is_missing_no_region_misses_a_force(report: tuple) -> None:
    reported, page, _ = report
    nothing = reported["outcome"] == "none"
    assert ("what follows is what noise and small imperfections of a rig leave" in page.text) == nothing
    assert any(line.startswith("  where:") for line in summary(reported)) != nothing


def test_a_value_of_a_table_is_reported_with_its_knot() -> None:
    reported = verdict("named")
    path = "effect.cubic_spring.stiffness"
    reported["parameters"][path]["at"] = "extension 0.2 m"
    assert any(line.startswith(f"  {path} at extension 0.2 m = ") for line in summary(reported))
    assert any(line.startswith(f"{path} at extension 0.2 m = ") for line in sections(reported)[0].body[1])


def test_a_motion_that_is_to_be_driven_faster_has_its_factor() -> None:
    reported = verdict("ambiguous")
    reported["experiments"] = [{"drive_ratio": None, "scale": 2.0, "rate": 4.0, "d_prime": 9.0, "text": ""}]
    table = next(one for one in sections(reported) if one.key == "next").body[1]
    assert (table.head[0], table.rows) == ("times as fast", [["4", "2", "9"]])


def test_the_verdicts_here_have_the_keys_of_those_of_the_workflow(library: Path) -> None:
    base = Model.from_text(CASE)
    true = base.with_effect("viscous", {"damping": 0.5})
    t, records = np.arange(600) / 100, []
    for number, ratio in enumerate((0.8, 1.25, 0.95)):
        motion = true.segments(
            ["drive.ratio"], np.array([ratio]), np.array([(0.6, 0.5, 0.4)]), [0, t.size], t, derivatives=False
        )
        x = motion.x + 1e-3 * np.random.default_rng(number).standard_normal(t.size)
        records.append(make_record(f"r{number}", {"t": t, "x": x}, {"drive_ratio": ratio, "phase": 0.4}))
    options = Options(quick=True, candidates=("viscous",))
    real, _ = investigate(base, records[:2], records[2:], options)
    assert real["outcome"] == "named"
    ours = verdict("named")
    assert ours.keys() <= real.keys()
    for key in ("gap", "records", "candidates", "parameters"):
        one, other = (
            reported[key] if isinstance(reported[key], list) else [*reported[key].values()]
            for reported in (ours, real)
        )
        assert one[0].keys() <= other[0].keys(), key


def test_the_excess_that_was_removed(report: tuple) -> None:
    reported, page, _ = report
    gap = reported["gap"]["held_out"]
    removed = (gap["before"] - gap["after"]) / (gap["before"] - 1)
    cell = page.tables["records"][1][4]
    assert (
        cell == "-"
        if removed == 0
        else float(cell.removesuffix(" %")) == pytest.approx(100 * removed, abs=0.06)
    )


def test_a_verdict_in_part_reports_the_remaining_gap() -> None:
    for complete in (True, False):
        summary = sections(verdict("named") | {"complete": complete})[0].body[0]
        assert ("a gap remains" in summary) != complete
        assert ("All gates are passed" in summary) == complete


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({}, "but offset force, offset force with sensor bias would do about as well."),
        ({"alternatives": [], "gates": {"detect": True, "stable": False}}, "gate is passed: stable."),
        ({"alternatives": [], "stopped_before": "another effect"}, "ended before 'another effect'."),
        ({"alternatives": [], "stopped_before": ""}, "but it is in doubt for the reason below."),
    ],
)
def test_a_doubt_is_reported_with_its_cause(changes, wanted) -> None:
    found = verdict("ambiguous") | {"gates": {"detect": True, "stable": True}} | changes
    assert sections(found)[0].body[0].endswith(wanted)


def test_the_words_fit_the_outcome(report: tuple) -> None:
    reported, page, _ = report
    expected = {
        "named": "The base machine lacks: cubic spring",
        "ambiguous": "but offset force, offset force with sensor bias would do about as well",
        "none": "No effect is missing that these records could show",
        "not-in-catalogue": "no effect of the catalogue explains it.",
        "characterised": "it looks like a force that depends on memory, or speed and position.",
    }
    present = [outcome for outcome, text in expected.items() if text in page.text]
    assert present == [reported["outcome"]]
    assert ("measure the barrier" in page.text) == (reported["outcome"] == "ambiguous")
    for text in (*reported["reasons"], *reported["notes"], reported["where"][0]["text"]):
        assert text in page.text


def test_no_figure_is_empty(report: tuple) -> None:
    assert [name for name, _ in report[1].pictures] == FIGURES
    for name, image in report[1].pictures:
        inked = np.any(image[:, :, :3] < 0.9, axis=2).mean()
        coloured = (np.ptp(image[:, :, :3], axis=2) > 0.2).mean()
        assert inked > 0.005, name
        assert coloured > 0.0005, name


def test_nothing_is_loaded_from_elsewhere(report: tuple) -> None:
    assert all(source.startswith("data:image/png;base64,") for source in report[1].sources)


def test_the_pdf_is_the_page_printed(report: tuple) -> None:
    """Its text, every figure, and the verdict on the first page by itself."""
    assert len([one for one in streams(report[2]) if b"BT" in one]) > 3
    assert len(re.findall(rb"/Subtype ?/Image\b", report[2])) >= len(FIGURES)


def streams(pdf: bytes) -> list[bytes]:
    """What is drawn, unpacked."""
    found = []
    for part in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", pdf, re.S):
        try:
            found.append(zlib.decompress(part))
        except zlib.error:
            found.append(part)
    return found


def test_without_the_engine_there_is_a_page_and_no_pdf(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "weasyprint", None)
    make(tmp_path, "none")
    stages = []
    html, pdf = write_report(
        tmp_path, tmp_path / "base.toml", Options(quick=True, progress=lambda *one: stages.append(one[0]))
    )
    assert html.is_file()
    assert not pdf.exists()
    assert any("separatrix[report]" in one for one in stages)


def test_a_function_is_drawn_on_the_first_page_with_its_band(tmp_path: Path) -> None:
    reported = make(tmp_path, "named")
    at = np.array([0.0, 1.0, 2.0])
    reported["function"] = {
        "effect": "friction_curve", "variable": "speed", "unit": "m/s", "quantity": "friction (N)",
        "text": "friction (N) 1 at 0 m/s to 2 at 2 m/s",
        "parts": [
            {
                "direction": name, "at": list(at), "value": list(1 + at),
                "band_95": [list(0.9 + at), list(1.1 + at)],
            }
            for name in ("upwards", "downwards")
        ],
        "tables": [{"at": list(at), "value": list(1 + at)}],
        "closed_forms": {"linear": {"fits": True, "at": list(at), "curve": list(1 + at)}},
    }  # fmt: skip
    (tmp_path / "verdict.json").write_text(json.dumps(reported))
    html, _ = write_report(tmp_path, tmp_path / "base.toml", Options(quick=True))
    text = html.read_text()
    first = text[: text.index('<section id="compared">')]
    assert [name for name, _ in Page(first).pictures] == ["gap", "function"]
    assert "friction (N) 1 at 0 m/s to 2 at 2 m/s" in first


def test_an_effect_that_passes_all_gates_but_one_is_reported_with_them() -> None:
    reason = "dahl passes every gate but the adequacy"
    missing = {section.key: section for section in sections(verdict("not-in-catalogue"))}["missing"]
    assert "or none passed them" in missing.body[0]
    changed = verdict("not-in-catalogue") | {"reasons": [reason]}
    missing = {section.key: section for section in sections(changed)}["missing"]
    assert reason in missing.body[0]
    assert "none passed" not in missing.body[0]


def test_a_low_pass_of_the_sensor_is_no_force() -> None:
    found = [{"depends_on": ["low pass of the sensor"], "text": "a low pass of the sensor"}]
    summary = sections(verdict("characterised") | {"character": found})[0].body[0]
    assert "it looks like a low pass of the sensor" in summary
    assert "force" not in summary


@pytest.mark.parametrize("contacts", [True, False])
def test_impacts_are_a_section_of_machines_that_have_contacts(tmp_path: Path, contacts: bool) -> None:
    made = make(tmp_path, "named")
    _without_impacts(tmp_path)
    if not contacts:
        made["parameters"] = {k: v for k, v in made["parameters"].items() if not k.startswith("contact.")}
    (tmp_path / "verdict.json").write_text(json.dumps(made))
    html, _ = write_report(tmp_path, tmp_path / "base.toml", Options(quick=True))
    page = Page(html.read_text())
    assert "impact-map" not in [name for name, _ in page.pictures]
    assert ("There are no impacts" in page.text) == contacts


def _without_impacts(folder: Path) -> None:
    with h5py.File(folder / "details.h5", "a") as file:
        empty = {"impacts": np.zeros((0, 6))}
        for group in (*file["records"].values(), file["training/f0/before"], file["training/f0/after"],
                      file["held_out/f1/before"], file["held_out/f1/after"]):  # fmt: skip
            del group["impacts"]
            group["impacts"] = empty["impacts"]


def test_maps_before_and_after(
    separatrix: Path, library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SEPARATRIX_PROGRAM", str(separatrix))
    make(tmp_path, "named")
    (tmp_path / "base.toml").write_text(CASE)
    (tmp_path / "extended.toml").write_text(CASE + "[effect.restitution_slope]\nslope = 0.06\n")
    flown, fly = [], comparison.impact_speeds

    def kept(program: Path, case: Path, *more: object) -> np.ndarray:
        flown.append(Model.read(case).parameters["drive.cosine[1]"].value)
        return fly(program, case, *more)

    monkeypatch.setattr(comparison, "impact_speeds", kept)
    html, _ = write_report(tmp_path, tmp_path / "base.toml")
    # half of the drive, as the record states
    assert flown == pytest.approx(2 * [0.5 * Model.from_text(CASE).parameters["drive.cosine[1]"].value])
    page = Page(html.read_text())
    assert {"bifurcation", "impact-speeds"} <= {name for name, _ in page.pictures}


def test_a_missing_program_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SEPARATRIX_PROGRAM", str(tmp_path / "absent"))
    make(tmp_path, "named")
    html, _ = write_report(tmp_path, tmp_path / "base.toml")
    assert "No maps before and after: the program separatrix was not found" in html.read_text()


def test_the_first_page_states_what_is_missed_in_its_unit_and_what_to_measure_next() -> None:
    lines = sections(verdict("ambiguous"))[0].body[1]
    assert (
        "On the records that were fitted the base machine missed 0.0025 m (5 %) of the signal beyond the "
        "noise, the extended machine misses 0.000114 m (0.23 %) of the signal (reduced chi^2 7.25 and 1.013, "
        "1 of noise alone); 99.8 % of the gap is closed; what remains is below the noise."
    ) in lines
    assert "To measure next: measure the barrier." in lines
    lines = sections(verdict("not-in-catalogue"))[0].body[1]
    assert any(
        "the base machine misses 0.0025 m (5 %) of the signal beyond the noise (reduced chi^2 7.25" in one
        for one in lines
    )
    assert "To measure next: the maps above show where to look for a law that the catalogue lacks." in lines


def test_the_first_page_states_what_an_effect_is_and_how_sure_it_is() -> None:
    body = sections(verdict("named"))[0].body
    assert "lacks: cubic spring (a spring force that grows with the cube of the extension)." in body[0]
    assert any("gain so much with a probability of 5.8e-74." in line for line in body[1])
    assert "To measure next: nothing stays ambiguous." in body[1]
    in_part = sections(verdict("named") | {"complete": False})[0].body[1]
    assert "To measure next: no record is asked for: the figure of what is left over" in " ".join(in_part)
    certain = sections(verdict("named") | {"p_value": 0.0})[0].body[1]
    assert any(line.endswith("with a probability below 1e-300.") for line in certain)
    assert not any("probability" in line for line in sections(verdict("none"))[0].body[1])
    nothing = verdict("named")
    nothing["gap"]["held_out"]["misfit"]["after"] = 0.0
    lines = sections(nothing)[0].body[1]
    assert any("the extended machine misses nothing (reduced chi^2" in line for line in lines)


def test_every_effect_has_a_phrase() -> None:
    functions = {member.effect for member in MEMBERS}
    assert {*STARTS, *JOINT_EFFECTS, *MOTOR_EFFECTS, *functions} - {*PHRASES} == set()
    assert explained("coulomb@second") == "coulomb@second (dry friction)"


def test_the_first_notes_are_on_the_first_page_and_the_others_below() -> None:
    notes = [f"note {number}" for number in range(5)]
    summary, compared = sections(verdict("named") | {"notes": notes})[:2]
    assert notes[:3] in summary.body
    assert "(2 more below.)" in summary.body
    assert notes[3:] in compared.body
    assert verdict("named")["notes"] in sections(verdict("named"))[0].body


def test_a_named_effect_is_not_among_those_that_were_not_tested() -> None:
    """Dahl's friction alone changes nothing without dry friction, which was named beside it."""
    reported = verdict("named") | {"effects": ["cubic_spring", "static_excess"]}
    by_key = {one.key: one for one in sections(reported)}
    assert "Not tested:" not in by_key["missing"].body
    assert "static excess" not in [row[0] for row in by_key["detectable"].body[1].rows]


def test_no_more_than_the_whole_excess_is_removed() -> None:
    reported = verdict("named")
    reported["gap"]["training"]["after"] = 0.73
    assert {one.key: one for one in sections(reported)}["gap"].body[1].rows[0][4] == "100.0 %"


def test_numbers_of_the_rig_have_no_key() -> None:
    reported = verdict("none")
    reported["parameters"] = {"nuisance:drive_scale": reported["parameters"]["restoring.stiffness"]}
    table = next(one for one in sections(reported) if one.key == "parameters").body[0]
    assert table.rows[0][0] == "drive scale (of the rig, no key of the case)"


def test_records_of_a_force_have_their_loops(tmp_path: Path) -> None:
    """One period each, and what the machines leave of the force in it."""
    make(tmp_path, "named")
    with h5py.File(tmp_path / "details.h5", "a") as file:
        assert loops(file) is None
        file.attrs["compared"], file.attrs["force_unit"] = "force", "N"
        shown = [file[f"{use}/{name}"] for use, name in (("training", "f0"), ("held_out", "f1"))]
        for group in (*file["records"].values(), *(one[stage] for one in shown for stage in one)):
            t, x = group["t"][:], np.cos(12 * group["t"][:])
            group["x"][:] = x
            group["force"] = 3 * x + np.sin(12 * t)
        for group in shown:
            group["before/force"][:] += 0.5
        axes = loops(file).axes
        assert [ax.get_title(loc="left").rpartition(",")[0] for ax in axes[:2]] == [
            "f0, training", "f1, held out",
        ]  # fmt: skip
        for top, bottom in zip(axes[:2], axes[2:], strict=True):
            x, force = top.lines[0].get_data()
            # a loop from the middle, three of four samples of which are far from where it began
            assert 10 < x.size < 100
            assert np.ptp(x) > 1.9
            assert np.ptp(force) > 5.9
            missed = [line.get_ydata() for line in bottom.lines[:2]]
            assert missed[0] == pytest.approx(-0.5, abs=0.02)
            assert missed[1] == pytest.approx(0, abs=0.02)


def test_periods_of_a_motion_are_between_its_turns() -> None:
    """Noise about the middle is no passage; a motion without two is one piece."""
    t = np.linspace(0, 10, 5001)
    x = 0.3 + np.sin(2 * np.pi * t) + 0.05 * np.random.default_rng(1).normal(size=t.size)
    found = np.array(periods_of(t, x))
    assert len(found) == 8
    assert np.diff(found, axis=1) == pytest.approx(1, abs=0.05)
    assert periods_of(t, t) == [(0, 10)]


def test_noise_of_a_force_is_of_its_sensor_and_of_mass_times_acceleration() -> None:
    reported = verdict("named")
    for one in reported["records"]:
        one["deviation"] = 0.0375
    table = next(one for one in sections(reported) if one.key == "compared").body[1]
    at = table.head.index(next(name for name in table.head if name.startswith("with that of mass")))
    assert [row[at] for row in table.rows] == ["0.0375"] * len(reported["records"])
    assert len(table.head) == len(table.rows[0])
