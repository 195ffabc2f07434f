# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sketch of a machine, --draw."""

from xml.etree import ElementTree

import pytest
from program import run, succeed

SVG = "{http://www.w3.org/2000/svg}"


def _draw(separatrix, case, folder):
    output = folder / "machine.svg"
    succeed(separatrix, "trajectory", case, "--draw", output, "--force", folder=folder)
    return ElementTree.parse(output).getroot()


@pytest.mark.parametrize(
    "case", ["structure_capsule", "structure_beam", "basin_pair_backlash", "hammer", "basin_effects"]
)
def test_every_text_is_inside(separatrix, source_dir, tmp_path, case):
    """Well-formed, with nothing beyond the edges, whatever the machine."""
    root = _draw(separatrix, source_dir / "examples" / f"{case}.toml", tmp_path)
    width, height = float(root.get("width")), float(root.get("height"))
    for text in root.iter(f"{SVG}text"):
        wide = 0.62 * float(text.get("font-size")) * len(text.text or "")
        left = float(text.get("x")) - (wide / 2 if text.get("text-anchor") == "middle" else 0)
        assert left > 0
        assert left + wide < width
        assert 0 < float(text.get("y")) < height


def test_what_is_between_what(separatrix, source_dir, tmp_path):
    """Rows run between the columns of their ends, and show the numbers of the case."""
    root = _draw(separatrix, source_dir / "examples" / "structure_blocks_on_a_belt.toml", tmp_path)
    texts = {text.text: float(text.get("x")) for text in root.iter(f"{SVG}text")}
    ground, first, second = (texts[name] for name in ("ground", "first", "second"))
    assert "coupling: linear, stiffness 1.2 N/m" in texts
    assert "second: coulomb, force 0.78 N, static_force 1.3 N, velocity 0.2 m/s" in texts
    dots = {}
    for dot in root.iter(f"{SVG}circle"):
        dots.setdefault(dot.get("cy"), []).append(float(dot.get("cx")))
    assert sorted(map(sorted, dots.values())) == sorted(
        [[ground, first], [ground, second], [first, second], [ground, first], [ground, second]]
    )


def test_what_is_refused(separatrix, source_dir, tmp_path):
    """Nothing is replaced without --force, and info draws nothing."""
    case = source_dir / "examples" / "hammer.toml"
    (tmp_path / "there.svg").write_text("mine")
    outcome = run(separatrix, "basin", case, "--draw", tmp_path / "there.svg", folder=tmp_path)
    assert outcome.code == 73
    assert (tmp_path / "there.svg").read_text() == "mine"
    assert run(separatrix, "info", case, "--draw", "x.svg", folder=tmp_path).code == 64
    assert run(separatrix, "trajectory", case, "--draw", case, folder=tmp_path).code == 64
