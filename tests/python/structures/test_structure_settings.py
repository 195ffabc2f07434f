# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings on top of a structure out of a file: the library takes what the program takes."""

import h5py
import pytest
from program import run
from separatrix.errors import CaseError
from separatrix.library import Model

CASE = """\
{structure}
[contact.stop]
between = ["beam.tip"]
law = "newton"
restitution = 0.8
upper = 0.5
[drive.force]
law = "force"
body = "beam.tip"
amplitude = 0.05
frequency = 0.9
[start]
x0 = 0
v0 = 0
[run]
duration = 14
window = 7
"""

# the table of the structure in the case, settings on top, whether that is a case
SETTINGS = [
    ('[structure.beam]\nfile = "beam.h5"', (), True),
    ('[structure.beam]\nfile = "beam.h5"', ("structure.beam.mass=[[1.0]]",), False),
    ('[structure.beam]\nfile = "beam.h5"', ("structure.beam.frequency=[1.0, 2.0]",), False),
    ('[structure.beam]\nfile = "beam.h5"', ("structure.beam.point.tip=[1.0, 2.0]",), False),
    ('[structure.beam]\nfile = "beam.h5"\npoint.tip = 1', (), False),
    ('[structure.beam]\nfile = "beam.h5"\npoint = 3', (), False),
    ('[structure.beam]\nfile = "other.h5"', ('structure.beam.point.tip="tip_y"',), True),
    ('[structure.beam]\nfile = "other.h5"', ('structure.beam.point.tip="tip_z"',), False),
    ('[structure.beam]\nfile = "other.h5"\npoint.tip = "tip_y"', ("structure.beam.x0=[0.1, 0.0]",), True),
    ('[structure.beam]\nfile = "other.h5"\npoint.tip = 1', ("structure.beam.modes=1",), True),
    ('[structure.beam]\nfile = "none.h5"', ('structure.beam.file="beam.h5"',), True),
    ('[structure.beam]\nfile = "none.h5"', ('structure.beam={file = "beam.h5"}',), True),
    ('[structure.beam]\nfile = "beam.h5"', ("structure.beam.file=3",), False),
    ('[structure.beam]\nx0 = [0.0, 0.0]\nfile = "beam.h5"', ("structure.beam.x0[1]=0.2",), True),
    ("", ('structure.beam.file="beam.h5"',), True),
    ("structure = 1", (), False),
    ("structure = 1", ('structure.beam.file="beam.h5"',), True),
    ('[[structure]]\nfile = "beam.h5"', (), False),
    ('[[structure]]\nfile = "beam.h5"', ('structure.beam.file="beam.h5"',), False),
    ("[structure]\nbeam = 1", (), False),
]


@pytest.mark.parametrize(("table", "settings", "allowed"), SETTINGS)
def test_the_library_takes_the_structures_that_the_program_takes(
    separatrix, library, tmp_path, table, settings, allowed
):
    for name, point in (("beam", "tip"), ("other", "tip_y")):
        with h5py.File(tmp_path / f"{name}.h5", "w") as file:
            group = file.create_group("structure")
            group["frequency"] = [1.0, 6.3]
            group["frequency"].attrs["units"] = "rad/s"
            group[f"point/{point}"] = [2.0, -2.0]
    text = CASE.format(structure=table)
    (tmp_path / "case.toml").write_text(text)
    words = [word for setting in settings for word in ("--set", setting)]
    ended = run(separatrix, "trajectory", tmp_path / "case.toml", "--validate", *words, folder=tmp_path)
    assert ended.code == (0 if allowed else 65), ended
    if allowed:
        Model.from_settings(text, tmp_path / "case.toml", settings)
    else:
        with pytest.raises(CaseError):
            Model.from_settings(text, tmp_path / "case.toml", settings)
