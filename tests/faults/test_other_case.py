# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""A run goes on only with its own case: another key is refused by name, what does not matter is allowed."""

import re
import shutil
import tomllib

import h5py
import life
import numpy as np
import pytest

PART = f"{life.NAME}.part"
# What a map does not depend on.
COSMETIC = {"title", "trajectory", "sweep", "record"}


@pytest.fixture(scope="module")
def stopped(separatrix, tmp_path_factory):
    """A folder with a run that was stopped half-way."""
    folder = tmp_path_factory.mktemp("stopped")
    life.write_case(folder)
    life.stop_half_way(separatrix, folder)
    return folder


@pytest.fixture
def folder(stopped, tmp_path):
    """A copy of it."""
    shutil.copytree(stopped, tmp_path / "copy")
    return tmp_path / "copy"


def other(value):
    """A value of the same type that is allowed almost everywhere."""
    if isinstance(value, list):
        return [*value[:-1], other(value[-1])]
    if isinstance(value, int):
        return value + 1
    return value * 0.97 + 0.001


def changes(case: dict, prefix: str = "") -> list[tuple[str, str]]:
    """Every key of a resolved case with another value."""
    found = []
    for key, value in case.items():
        if isinstance(value, dict):
            found += changes(value, f"{prefix}{key}.")
        elif key == "axis":
            for number, axis in enumerate(value, 1):
                found += changes(axis, f"axis[{number}].")
        elif not isinstance(value, str):
            found.append((f"{prefix}{key}", OTHERS.get(f"{prefix}{key}", str(other(value)))))
    return found


WORDS = [
    ("run.stop", '"captured"'),
    ("friction.law", '"none"'),
    ("friction.law", '"coulomb_viscous", damping=0.0, kinetic_coefficient=0.2'),
    ("contact.law", '"none"'),
    ("integrator.flight", '"adaptive"'),
    ("axis[1].name", '"crank_angle"'),
]
# Where a little more or less is not allowed.
OTHERS = {"friction.static_coefficient": "0.3", "contact.upper": "1.25", "integrator.tolerance": "1e-9"}


def test_every_key(separatrix, folder, figures):
    before = (folder / PART).read_bytes()
    with h5py.File(folder / PART) as file:
        case = tomllib.loads(file["provenance"].attrs["resolved_case"])
    refused, allowed, impossible = [], [], []
    for key, value in changes(case) + WORDS:
        if key.split(".")[0] in COSMETIC:
            allowed.append(key)
            continue
        setting = f"{key}={value}"
        if key.endswith(".law"):
            setting = f"{key.removesuffix('.law')}={{law={value}}}"
        command = [*life.RUN, "--set", setting, "--resume"]
        outcome = life.run(separatrix, *command, folder=folder)
        if outcome.code == 65:
            impossible.append(key)
            continue
        assert outcome.code == 76, (key, value, outcome)
        # The tiles are not part of the case, but of the layout.
        named = (
            "tile_shape"
            if key == "grid.tile"
            else key.split(".")[0]
            if ".law" in key or ".name" in key
            else key
        )
        assert named in outcome.messages[0], (key, outcome.messages)
        assert (folder / PART).read_bytes() == before
        refused.append(key)
    assert len(refused) > 25
    assert len(impossible) < 3, impossible
    figures.update(refused=len(refused), not_a_valid_case=impossible)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        (["title='New'"], "title"),
        (["trajectory.samples_per_period=17"], "trajectory.samples_per_period"),
        (["sweep.step=0.05", "sweep.samples=9"], "sweep.samples"),
    ],
)
def test_what_does_not_matter_is_allowed_and_named(separatrix, folder, reference, settings, named):
    command = [*life.RUN, *(word for setting in settings for word in ("--set", setting)), "--resume"]
    outcome = life.succeed(separatrix, *command, folder=folder)
    assert re.search(f"differs in what does not matter: .*{re.escape(named)}", outcome.out)
    assert set(life.differences(reference, folder / life.NAME)) <= {"@title"}


def test_order_comments_and_units_do_not_matter(separatrix, folder, reference):
    text = (folder / "case.toml").read_text()
    title, *tables = re.split(r"\n(?=\[)", text)
    axes = [table for table in tables if table.startswith("[[")]
    others = [table for table in tables if not table.startswith("[[")]
    shuffled = "\n".join([title, *reversed(others), *axes]).replace('"1.1 m"', '"1100 mm" # in other words')
    life.write_case(folder, f"# a comment\n{shuffled}\n")
    assert shuffled not in text
    outcome = life.succeed(separatrix, *life.RUN, "--json", "--resume", folder=folder)
    assert "tiles were done before" in outcome.out
    assert life.differences(reference, folder / life.NAME) == []


def test_other_commands_and_output_options_do_not_matter(separatrix, folder, reference):
    outcome = life.succeed(separatrix, *life.RUN, "--resume", "--quiet", "--time-limit", 1000, folder=folder)
    assert outcome.out == ""
    assert life.differences(reference, folder / life.NAME) == []


def set_attribute(path, name, text):
    """Change an attribute of the provenance."""
    with h5py.File(path, "r+") as file:
        file["provenance"].attrs[name] = text


def test_another_version_is_refused(separatrix, folder):
    set_attribute(folder / PART, "version", "0.0.7")
    before = (folder / PART).read_bytes()
    outcome = life.run(separatrix, *life.RUN, "--resume", folder=folder)
    assert outcome.code == 76
    assert "0.0.7" in outcome.messages[0]
    assert (folder / PART).read_bytes() == before


def test_a_file_without_records_is_refused(separatrix, folder):
    with h5py.File(folder / PART, "r+") as file:
        del file["tiles/record"]
    outcome = life.run(separatrix, *life.RUN, "--resume", folder=folder)
    assert outcome.code == 76
    assert "the program that began it finishes it" in outcome.messages[0]


def test_another_layout_is_refused(separatrix, folder):
    with h5py.File(folder / PART, "r+") as file:
        records = file["tiles/record"]
        shape, fields = records.shape, records.dtype.fields
        other = {
            "names": [name.replace("settle_time", "time_to_settle") for name in fields],
            "formats": [field[0] for field in fields.values()],
            "offsets": [field[1] for field in fields.values()],
            "itemsize": records.dtype.itemsize,
        }
        del file["tiles/record"]
        file.create_dataset("tiles/record", shape, dtype=np.dtype(other))
    outcome = life.run(separatrix, *life.RUN, "--resume", folder=folder)
    assert outcome.code == 76
    assert "/tiles/record" in outcome.messages[0]


def test_another_build_is_reported_and_both_are_kept(separatrix, folder, reference):
    set_attribute(folder / PART, "commit", "0123456789ab")
    outcome = life.succeed(separatrix, *life.RUN, "--resume", folder=folder)
    assert "begun by another build: commit 0123456789ab" in outcome.out
    assert life.differences(reference, folder / life.NAME) == []
    with h5py.File(folder / life.NAME) as file:
        record = file["provenance"].attrs
        assert record["begun_commit"] == "0123456789ab"
        assert record["commit"] != record["begun_commit"]
        assert "--resume" in record["command_line"]
        assert "--resume" not in record["begun_command_line"]
        assert file.attrs["history"].count("\n") == 1
    life.sound(separatrix, folder)
