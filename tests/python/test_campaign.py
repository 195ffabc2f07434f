# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The discovery campaign: statistics, how verdicts are judged, command line, and that it can be killed."""

import hashlib
import json
import lzma
import math
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from types import SimpleNamespace

import pytest

CASES = 3
SEED = 3
# what discovery answers in the campaigns of these tests, which are about the campaign
STAND_IN = """\
import time

class Options:
    def __init__(self, seed): self.seed = seed

def discover(base, records, hold_out, options):
    time.sleep({pause})
    gap = {{"training": {{"before": 2.0, "after": 1.0}}, "held_out": {{"before": 3.0, "after": 1.2}}}}
    return {{"outcome": "named", "effects": ["cubic_spring"], "alternatives": [], "gap": gap, "version": "0",
            "parameters": {{}}, "records": [str(len(records) + len(hold_out))], "seed": options.seed}}
"""


@pytest.fixture(scope="module")
def campaign(source_dir):
    """The modules of scripts/campaign."""
    with pytest.MonkeyPatch.context() as patch:
        for folder in ("scripts/campaign", "scripts", "tests/generator", "postprocess"):
            patch.syspath_prepend(str(source_dir / folder))
        import bars
        import figure
        import rates
        import scoring

        yield rates, scoring, bars, figure


# R. G. Newcombe, Statistics in Medicine 17 (1998), table I, method 3
@pytest.mark.parametrize(
    ("hits", "cases", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_intervals_as_published(campaign, hits, cases, low, high):
    found = campaign[0].Rate(hits, cases).interval
    assert found == pytest.approx((low, high), abs=5e-5)


# R. G. Newcombe, Statistics in Medicine 17 (1998) 873, table II, method 10
@pytest.mark.parametrize(
    ("one", "other", "low", "high"),
    [
        ((56, 70), (48, 80), 0.0524, 0.3339),
        ((9, 10), (3, 10), 0.1705, 0.8090),
        ((10, 10), (0, 20), 0.6791, 1),
    ],
)
def test_intervals_of_differences_as_published(campaign, one, other, low, high):
    rates = campaign[0]
    assert rates.difference(rates.Rate(*one), rates.Rate(*other)) == pytest.approx((low, high), abs=5e-5)


@pytest.mark.parametrize(
    ("hits", "cases", "lowest", "highest", "said"),
    [
        (0, 0, 0.9, 1, "undecided"),
        (96, 100, 0.95, 1, "undecided"),
        (990, 1000, 0.95, 1, "yes"),
        (80, 100, 0.95, 1, "**no**"),
        (0, 10, 0, 0.03, "undecided"),
        (0, 500, 0, 0.03, "yes"),
        (20, 100, 0, 0.03, "**no**"),
        (950, 1000, 0.9, 0.98, "yes"),
        (999, 1000, 0.9, 0.98, "**no**"),
    ],
)
def test_a_bar_is_met_where_the_whole_interval_is(campaign, hits, cases, lowest, highest, said):
    assert campaign[2].met(campaign[0].Rate(hits, cases), lowest, highest) == said


def truth(names: list[str], kind: str = "single", number: int = 0, **more) -> dict:
    """A truth as the generator seals it."""
    return {
        "number": number,
        "kind": kind,
        "names": names,
        "parameters": {},
        "d_prime": {name: 12.0 for name in names},
        "beyond": {name: {"d_prime": 6.0, "besides": "viscous"} for name in names},
        "regime": "published",
        "noise": 0.01,
        "colour": "white",
        "samples_per_period": 50,
        "velocity": False,
        "crank_angle": False,
    } | more


def verdict(outcome: str, effects: list[str] = (), alternatives: list[str] = (), **more) -> dict:
    """A verdict as the workflow gives it, with its time."""
    said = {"outcome": outcome, "effects": list(effects), "alternatives": list(alternatives)}
    return {"verdict": said | more, "seconds": 1.0}


# truth, verdict, (decided, right, contains, wrong name), column
JUDGED = [
    (truth(["viscous"]), verdict("named", ["viscous"]), (True, True, True, False), "right name"),
    (truth(["viscous"]), verdict("named", ["stribeck"]), (True, False, False, True), "stribeck"),
    (
        truth(["viscous"]),
        verdict("ambiguous", ["stribeck"], ["viscous"]),
        (False, False, True, False),
        "set with the truth",
    ),
    (
        truth(["viscous"]),
        verdict("ambiguous", ["stribeck"], ["dahl"]),
        (False, False, False, False),
        "set without the truth",
    ),
    (
        truth(["sensor_bias"]),
        verdict("ambiguous", ["offset_force"], ["sensor_bias"]),
        (True, True, True, False),
        "equivalent set",
    ),
    (truth(["sensor_bias"]), verdict("named", ["offset_force"]), (True, False, False, True), "offset_force"),
    (
        truth(["viscous"]),
        verdict("ambiguous", ["offset_force"], ["sensor_bias"]),
        (True, False, False, True),
        "set without the truth",
    ),
    (
        truth(["viscous"]),
        verdict("ambiguous", ["quadratic_drag"], ["viscous"], in_families=["friction over speed"]),
        (True, True, True, False),
        "equivalent set",
    ),
    (
        truth(["dahl"]),
        verdict("ambiguous", ["quadratic_drag"], ["viscous"], in_families=["friction over speed"]),
        (True, False, False, True),
        "set without the truth",
    ),
    (
        truth(["viscous", "offset_force"], "pair"),
        verdict("ambiguous", ["quadratic_drag"], ["viscous"], in_families=["friction over speed"]),
        (True, False, False, False),
        "set without the truth",
    ),
    # that the verdict calls them one family is not enough
    (
        truth(["viscous"]),
        verdict("ambiguous", ["viscous"], ["dahl"], in_families=["friction"]),
        (False, False, True, False),
        "set with the truth",
    ),
    (truth(["viscous"]), verdict("none"), (False, False, False, False), "none"),
    (truth(["viscous"]), verdict("failed"), (False, False, False, False), "no verdict"),
    (truth([], "none"), verdict("none"), (False, True, False, False), "none"),
    (truth([], "none"), verdict("named", ["dahl"]), (True, False, False, True), "dahl"),
    (
        truth(["second_mode"], "outside"),
        verdict("not-in-catalogue"),
        (False, True, False, False),
        "not-in-catalogue",
    ),
    (
        truth(["second_mode"], "outside"),
        verdict("characterised"),
        (False, True, False, False),
        "not-in-catalogue",
    ),
    (truth(["second_mode"], "outside"), verdict("named", ["dahl"]), (True, False, False, True), "dahl"),
    (
        truth(["viscous", "offset_force"], "pair"),
        verdict("named", ["offset_force", "viscous"]),
        (True, True, True, False),
        "right name",
    ),
    (
        truth(["viscous", "offset_force"], "pair"),
        verdict("ambiguous", ["viscous", "offset_force"], ["viscous+sensor_bias"]),
        (True, True, True, False),
        "equivalent set",
    ),
    (
        truth(["viscous", "offset_force"], "pair"),
        verdict("named", ["viscous"]),
        (True, False, False, False),
        "one of the pair",
    ),
    (truth([], "none"), verdict("ambiguous", ["dahl"]), (False, False, False, True), "dahl"),
    (truth([], "none"), verdict("not-in-catalogue"), (False, False, False, False), "not-in-catalogue"),
    (truth(["viscous"]), verdict("ambiguous", ["dahl"]), (False, False, False, True), "dahl"),
    (
        truth(["viscous"]),
        verdict("ambiguous", ["viscous"]),
        (False, False, True, False),
        "set with the truth",
    ),
    (
        truth(["viscous", "offset_force"], "pair"),
        verdict("ambiguous", ["viscous"]),
        (False, False, False, False),
        "one of the pair",
    ),
    (truth(["stribeck"]), verdict("named", ["friction_curve"]), (True, True, True, False), "right name"),
    (truth(["stribeck"]), verdict("named", ["quadratic_drag"]), (True, False, False, True), "quadratic_drag"),
    (
        truth(["quadratic_drag"], shapes={"quadratic_drag": {"exponent": 1.5}}),
        verdict("named", ["viscous"]),
        (True, True, True, False),
        "right name",
    ),
    (
        truth(["stribeck"], shapes={"stribeck": {"stribeck_exponent": 0.7}}),
        verdict("named", ["stribeck"]),
        (True, True, True, False),
        "right name",
    ),
    (
        truth(["stribeck"], shapes={"stribeck": {"stribeck_exponent": 0.7}}),
        verdict("named", ["friction_curve"]),
        (True, True, True, False),
        "right name",
    ),
    *(
        (
            truth(["stribeck"], shapes={"stribeck": {"stribeck_exponent": 0.7}}),
            verdict("named", [name]),
            (True, False, False, True),
            name,
        )
        for name in ("coulomb", "viscous", "quadratic_drag")
    ),
    (
        truth(["compliant_contact"], shapes={"compliant_contact": {"exponent": 2.0}}),
        verdict("named", ["kelvin_voigt_contact"]),
        (True, False, False, True),
        "kelvin_voigt_contact",
    ),
    (
        truth(["cubic_spring"], shapes={"cubic_spring": {"cubic_exponent": 2.0}}),
        verdict("named", ["friction_curve"]),
        (True, False, False, True),
        "friction_curve",
    ),
    (
        truth(["stribeck"], shapes={"stribeck": {"stribeck_exponent": 0.7}}),
        verdict("ambiguous", ["stribeck"], ["friction_curve"]),
        (False, False, True, False),
        "set with the truth",
    ),
    (
        truth(["viscous"]),
        verdict("named", ["viscous", "dahl"]),
        (True, False, False, True),
        "dahl+viscous",
    ),
]


@pytest.mark.parametrize(("hidden", "said", "flags", "column"), JUDGED)
def test_verdicts_are_judged(campaign, hidden, said, flags, column):
    found = campaign[1].score(hidden, said)
    assert (found.decided, found.right, found.contains, found.wrong_name) == flags
    assert found.column == column
    assert found.by_family == (
        found.right
        and said["verdict"]["effects"] in (["friction_curve"], ["viscous"])
        and hidden["names"] != ["viscous"]
    )


def test_parameters_are_judged_by_their_intervals(campaign):
    hidden = truth(["viscous"], parameters={"effect.viscous.damping": 2.0})
    for value, inside in ((2.1, True), (2.5, False)):
        found = {"value": value, "standard_error": 0.1, "interval_95": [value - 0.2, value + 0.2]}
        said = verdict("named", ["viscous"], parameters={"effect.viscous.damping": found})
        one = campaign[1].score(hidden, said)
        assert one.errors == pytest.approx((value / 2 - 1,))
        assert one.covered == (inside,)


def test_a_parameter_at_its_bound_is_not_covered(campaign):
    hidden = truth(["stribeck"], parameters={"effect.stribeck.excess": 2.0, "effect.stribeck.velocity": 0.1})
    found = {
        "effect.stribeck.excess": {"value": 2.0, "standard_error": 0.1, "interval_95": [1.8, 2.2]},
        "effect.stribeck.velocity": {"value": 0.2, "standard_error": None, "interval_95": None},
    }
    one = campaign[1].score(hidden, verdict("named", ["stribeck"], parameters=found))
    assert one.covered == (True, False)
    assert one.errors == pytest.approx((0, 1))


def test_the_clearest_region_is_judged(campaign):
    where = [
        {"map": "drive phase", "force": 0.5, "error": 0.2},
        {"map": "time since the last impact", "force": -3.0, "error": 0.1},
    ]
    region = campaign[1].region
    assert region(["restitution_slope"], where) is True
    assert region(["drive_ripple"], where) is False
    assert region(["sensor_bias"], where) is None
    assert region(["restitution_slope"], []) is None


def test_a_decoy_that_could_be_named_counts(campaign):
    said = verdict("none", decoys={"tested": 9, "accepted": True})
    assert campaign[1].score(truth([], "none"), said).decoy
    assert not campaign[1].score(truth([], "none"), verdict("none")).decoy


def test_removed_excess(campaign):
    assert campaign[1].removed({"before": 3.0, "after": 1.5}) == pytest.approx(0.75)
    assert campaign[1].removed({"before": 3.0, "after": 0.9}) == 1
    assert math.isnan(campaign[1].removed({"before": 1.05, "after": 1.0}))


def test_the_confusion_matrix_has_every_case_once(campaign):
    _, scoring, bars, figure = campaign
    found = [scoring.score({**hidden, "number": i}, said) for i, (hidden, said, _, _) in enumerate(JUDGED)]
    rows = sorted({one.truth for one in found})
    counts, columns = figure.confusion_counts(found, rows)
    assert counts.sum() == len(JUDGED)
    assert counts[:, columns.index("right")].sum() == sum(flags[1] for _, _, flags, _ in JUDGED)
    assert sum(one.alarm for one in found if one.kind == "none") == 3
    wrong = {row[0]: row[2] for row in bars.bars(found)}["wrong name, all cases"]
    assert f"({sum(flags[3] for _, _, flags, _ in JUDGED)} of {len(JUDGED)};" in wrong


@pytest.mark.parametrize(("name", "size"), [("none", 0.0), ("quadratic_drag", 0.3), ("cubic_spring", 40.0)])
def test_the_baselines_name_what_is_large(campaign, tmp_path, name, size):
    pytest.importorskip("pysindy")
    import baselines
    import design
    import effects
    import records

    # the filter rounds the jump of dry friction and raises a false alarm, not in a viscous machine
    regime = "damped" if size > 0 else "viscous"
    drawn = (design.draw(SEED, n) for n in range(400) if design.plan(SEED, n)[0] == "none")
    case = next(one for one in drawn if one.regime == regime)
    case.level, case.colour, case.velocity, case.crank_angle = 1e-4 if size > 0 else 1e-2, "white", True, True
    for experiment in (*case.training, case.held_out):
        experiment.samples_per_period = 400
    if size > 0:
        case.hidden = [design.Hidden(name, effects.CATALOGUE[name], {}, 1.0, size)]
        case.machine = case.hidden[0].on(case.base)
    records.write_case(tmp_path, tmp_path / "truth.json", case)
    training = [tmp_path / name for name in records.TRAINING]
    known = set(baselines.terms(tomllib.loads((tmp_path / records.BASE).read_text()), training).names)
    # a constant stands for the sensor; the friction that the base machine has is none of the terms
    others = {"sensor_bias", "sensor_gain", "viscous", "coulomb"}
    assert known - others == campaign[1].HAVE_A_TERM - others
    found = baselines.verdicts(tmp_path / records.BASE, training, 1)
    assert set(found) == {"STLSQ", "ensemble SINDy"}
    assert set(found.values()) == {name}


@pytest.mark.parametrize(("option", "code"), [("--help", 0), ("--many", 64), ("--cases", 64)])
def test_the_command_line(source_dir, option, code):
    command = [source_dir / "scripts" / "discovery_campaign", option]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == code
    assert (option in result.stderr) == (code != 0)


def test_the_page_says_which_source_and_library_gave_the_verdicts(campaign, tmp_path, monkeypatch):
    import campaign as program
    import report

    library = tmp_path / "libseparatrix.so"
    library.write_bytes(b"a library")
    monkeypatch.setenv("SEPARATRIX_LIBRARY", str(library))
    for command in ("init -q", "add .", "-c user.name=a -c user.email=b commit -q -m one"):
        (tmp_path / "source").mkdir(exist_ok=True)
        (tmp_path / "source" / "file").write_text("as committed")
        subprocess.run(["git", "-C", tmp_path / "source", *command.split()], check=True)
    monkeypatch.setattr(program, "SOURCE", tmp_path / "source")
    program.commit.cache_clear()
    program.library.cache_clear()
    clean = program.commit()
    (tmp_path / "source" / "file").write_text("changed")
    program.commit.cache_clear()
    assert program.commit() == f"{clean}-dirty"
    folders = program.Folders(tmp_path)
    folders.make()
    folders.result(3).write_text(json.dumps({"commit": program.commit(), "library": program.library()}))
    said = report.versions(folders, [campaign[1].score(truth(["viscous"], number=3), verdict("none"))])
    digest = hashlib.sha256(b"a library").hexdigest()
    assert said == f"{clean}-dirty with library {digest[:12]} (1)"
    program.commit.cache_clear()
    program.library.cache_clear()


def start(source_dir, folder, pause: float, *more: str) -> subprocess.Popen:
    """A campaign with an answer that is always the same."""
    package = folder / "stand_in" / "separatrix"
    (package / "discovery").mkdir(parents=True, exist_ok=True)
    (package / "discovery" / "__init__.py").write_text(STAND_IN.format(pause=pause))
    for name in ("errors", "style"):
        (package / f"{name}.py").write_text(
            (source_dir / "postprocess" / "separatrix" / f"{name}.py").read_text()
        )
    (package / "__init__.py").write_text("")
    (folder / "stand_in" / "pysindy.py").write_text("STLSQ = None\n")
    (folder / "stand_in" / "baselines.py").write_text(
        "verdicts = lambda *_: {'STLSQ': 'none', 'ensemble SINDy': 'none'}\n"
    )
    program = source_dir / "scripts" / "campaign" / "campaign.py"
    # the finder of an editable installation comes before the path
    code = "import sys, runpy, importlib.machinery as m; sys.meta_path.insert(0, m.PathFinder); "
    code += f"sys.path.insert(0, {str(folder / 'stand_in')!r}); import baselines; "
    code += (
        f"sys.path.insert(1, {str(program.parent)!r}); runpy.run_path({str(program)!r}, run_name='__main__')"
    )
    words = [
        "--cases",
        str(CASES),
        "--seed",
        str(SEED),
        "--out",
        folder / "out",
        "--output",
        folder / "page.md",
        *more,
    ]
    environment = {**os.environ, "PYTHONPATH": str(folder / "stand_in"), "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen([sys.executable, "-c", code, *words], env=environment, stdout=subprocess.DEVNULL)


def test_a_killed_campaign_goes_on_and_gives_the_same_page(source_dir, tmp_path):
    results = {}
    for name in ("whole", "killed"):
        folder = tmp_path / name
        if name == "killed":
            first = start(source_dir, folder, 0.5)
            done = folder / "out" / f"seed_{SEED}" / "results" / "0000.json"
            deadline = time.monotonic() + 120
            while not done.is_file() and time.monotonic() < deadline:
                time.sleep(0.05)
            first.send_signal(signal.SIGKILL)
            first.wait()
            assert done.is_file()
            assert not (folder / "page.md").is_file()
        assert start(source_dir, folder, 0.0).wait(timeout=300) == 0
        results[name] = (folder / "page.md").read_text()
        found = sorted((folder / "out" / f"seed_{SEED}" / "results").glob("*.json"))
        assert all(json.loads(path.read_text())["verdict"]["effects"] == ["cubic_spring"] for path in found)
        assert [json.loads(path.read_text())["number"] for path in found] == list(range(CASES))
        assert (folder / "figures" / "discovery_confusion.png").is_file()
    # one sentence tells a measured time
    measured = re.compile(r"median [0-9]+ s(?= of\s+processor time)")
    assert all(len(measured.findall(page)) == 1 for page in results.values())
    untimed = {name: measured.sub("", page) for name, page in results.items()}
    assert untimed["whole"] == untimed["killed"]


def test_the_archive_and_the_page_name_no_folder_of_the_machine(campaign, tmp_path):
    import archive
    import report
    from campaign import Folders

    folders = Folders(tmp_path / "seed")
    folders.make()
    said = f"{folders.cases}/0000/base.toml:3: key 'body.mass': missing"
    folders.result(0).write_text(json.dumps({"number": 0, "verdict": {"reasons": [said]}}))
    kept = tmp_path / "archive.jsonl.xz"
    assert archive.pack(kept, folders, [0, 1]) == 1
    text = lzma.open(kept, "rt").read()
    assert "0000/base.toml:3: key" in text
    assert str(tmp_path) not in text
    # nor does the page
    strong = SimpleNamespace(strong=True, decided=False, number=0, column="no verdict")
    assert report.undecided(folders, [strong]) == [
        ["no verdict", "0000/base.toml:3: key 'body.mass': missing", "1"]
    ]


def test_the_page_can_be_written_again_from_the_archive_alone(source_dir, tmp_path):
    archive = tmp_path / "archive.jsonl.xz"
    whole, again = tmp_path / "whole", tmp_path / "again"
    assert start(source_dir, whole, 0.0, "--archive", str(archive)).wait(timeout=300) == 0
    kept = archive.read_bytes()
    assert start(source_dir, again, 0.0, "--summary", "--archive", str(archive)).wait(timeout=300) == 0
    assert (again / "page.md").read_text() == (whole / "page.md").read_text()
    assert archive.read_bytes() == kept
    assert not any((again / "out" / f"seed_{SEED}" / "cases").iterdir())


def test_another_truth_than_the_sealed_one_is_noticed(campaign, source_dir, tmp_path):
    assert start(source_dir, tmp_path, 0.0).wait(timeout=300) == 0
    sealed = tmp_path / "out" / f"seed_{SEED}" / "sealed" / "0001.json"
    sealed.write_text(sealed.read_text().replace('"kind"', '"kind" '))
    (tmp_path / "page.md").unlink()
    assert start(source_dir, tmp_path, 0.0).wait(timeout=300) != 0
    assert not (tmp_path / "page.md").is_file()
