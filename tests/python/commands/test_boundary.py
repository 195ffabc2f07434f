# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `boundary`: curves that part the labels, the same with any ranks, and what it refuses."""

import subprocess
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import separatrix as sx
from separatrix import style
from separatrix.figures import boundary
from separatrix.library import Model
from separatrix.open import decode_flags, decode_words, open_result, table
from separatrix.simulate import search_slices


@pytest.fixture(scope="module")
def run(separatrix: Path):
    """Runs the program; returns what ended."""

    def run_it(*arguments: object, ranks: int = 1) -> subprocess.CompletedProcess:
        launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        command = [*launcher, str(separatrix), *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    return run_it


@pytest.fixture(scope="module")
def coulomb(run, source_dir: Path, tmp_path_factory) -> Path:
    """A map of the Coulomb machine, 60 x 60."""
    path = tmp_path_factory.mktemp("boundary") / "coulomb.basin.h5"
    text = (source_dir / "examples" / "basin_coulomb.toml").read_text()
    case = path.with_name("coulomb.toml")
    case.write_text(text.replace("count = 400", "count = 60"))
    assert run("basin", case, "-o", path).returncode == 0
    return path


@pytest.fixture(scope="module")
def curves(run, coulomb: Path) -> Path:
    """The boundaries of that map."""
    out = coulomb.with_name("coulomb.boundary.h5")
    ended = run("boundary", coulomb, "-o", out)
    assert ended.returncode == 0, ended.stderr
    return out


def beside(result, sign: float, distance: float) -> np.ndarray:
    """Starts beside every boundary point."""
    starts = np.zeros((result.sizes["point"], 3))
    for k, name in enumerate(("x0", "v0")):
        starts[:, k] = result[name].values + sign * distance * (result["across"].values == k)
    return starts[result["across"].values >= 0]


def test_starts_at_1e_8_from_the_curve_have_the_labels_of_its_sides(coulomb, curves):
    with open_result(coulomb) as basins, open_result(curves) as result:
        catalogue = search_slices(Model.from_text(basins.attrs["resolved_case"]), [{}], ())[0]
        found = result["across"].values >= 0
        assert found.sum() > 100
        assert result["error"].values[found].max() <= 1e-10 * 12
        for sign, side in ((-1, "below"), (1, "above")):
            labels = catalogue.labels(beside(result, sign, 1e-8))["attractor"]
            np.testing.assert_array_equal(labels, result[side].values[found])


def test_every_crossed_edge_of_the_map_has_its_point(coulomb, curves):
    with open_result(coulomb) as basins, open_result(curves) as result:
        labels = basins["attractor"].transpose("x0", "v0").values
        crossed = (labels[1:] != labels[:-1]).sum(), (labels[:, 1:] != labels[:, :-1]).sum()
        across = result["across"].values
        assert ((across == 0).sum(), (across == 1).sum()) == crossed
        # a point along x0 lies on a line of v0, and the other way round
        assert np.isin(result["v0"].values[across == 0], basins["v0"].values).all()
        assert np.isin(result["x0"].values[across == 1], basins["x0"].values).all()
        for piece in range(result.sizes["piece"]):
            points = slice(int(result["first"][piece]), int(result["first"][piece] + result["points"][piece]))
            sides = {*result["below"].values[points].tolist(), *result["above"].values[points].tolist()}
            assert sides == {int(result["label_one"][piece]), int(result["label_two"][piece])}
            # neighbours on a piece are in one cell
            steps = np.abs(np.diff(result["x0"].values[points])), np.abs(np.diff(result["v0"].values[points]))
            assert steps[0].max() <= 1.1 / 59 * 1.0001 and steps[1].max() <= 12 / 59 * 1.0001


def test_two_ranks_write_the_same_curves(run, coulomb, curves, tmp_path):
    out = tmp_path / "two.h5"
    ended = run("boundary", coulomb, "-o", out, ranks=2)
    assert ended.returncode == 0, ended.stderr
    with h5py.File(out) as one, h5py.File(curves) as other:
        names = [name for name in one if isinstance(one[name], h5py.Dataset)]
        assert {"x0", "v0", "across", "below", "above", "error", "first", "points"} <= set(names)
        names += [f"saddles/{name}" for name in one["saddles"]] + [f"sets/{name}" for name in one["sets"]]
        for name in names:
            np.testing.assert_array_equal(one[name][()], other[name][()])


def same_content(one: Path, other: Path) -> bool:
    """Whether two files have the same bits but for who made them."""
    with h5py.File(one) as first, h5py.File(other) as second:
        found = []
        first.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
        found = [name for name in found if not name.startswith("provenance")]
        return all(np.array_equal(first[name][()], second[name][()]) for name in found)


def test_a_stopped_run_goes_on_to_the_same_curves_with_any_ranks(run, coulomb, curves, tmp_path):
    out = tmp_path / "stopped.h5"
    part = out.with_name("stopped.h5.part")
    # a time limit that is over at once leaves one part each time
    ended = run("boundary", coulomb, "-o", out, "--time-limit", 1e-3)
    assert ended.returncode == 75 and "--resume goes on" in ended.stderr
    assert part.exists() and not out.exists()
    assert run("boundary", coulomb, "-o", out).returncode == 73
    other = run("boundary", coulomb, "-o", out, "--resume", "--grow", 2)
    assert other.returncode == 76 and "belongs to another map" in other.stderr
    # the same labels, on a grid that is a little narrower: points on its edges are others
    narrow = coulomb.with_name("narrow.h5")
    case = coulomb.with_name("coulomb.toml")
    assert run("basin", case, "-o", narrow, "--set", "axis[1].to=1.099999").returncode == 0
    other = run("boundary", narrow, "-o", out, "--resume")
    assert other.returncode == 76 and "belongs to another map" in other.stderr
    size = part.stat().st_size
    for ranks in (2, 1):
        ended = run("boundary", coulomb, "-o", out, "--resume", "--time-limit", 1e-3, ranks=ranks)
        assert ended.returncode == 75, ended.stderr
        assert part.stat().st_size > size
        size = part.stat().st_size
    # what a kill may leave: half a record; and a flipped bit
    damaged = bytearray(part.read_bytes()[:-5])
    damaged[-40] ^= 1
    part.write_bytes(damaged)
    ended = run("boundary", coulomb, "-o", out, "--resume")
    assert ended.returncode == 0, ended.stderr
    assert "2 parts of the work were done before" in ended.stdout
    assert "is damaged behind 2 sound parts: what follows is computed again" in ended.stdout
    assert same_content(out, curves)
    assert [path.name for path in tmp_path.iterdir()] == ["stopped.h5"]


def test_a_refined_map_has_the_same_boundary_as_a_full_one(run, source_dir, coulomb, curves, tmp_path):
    case, basins, out = (tmp_path / name for name in ("refined.toml", "refined.h5", "out.h5"))
    case.write_text(coulomb.with_name("coulomb.toml").read_text() + "\n[refine]\n")
    assert run("basin", case, "-o", basins).returncode == 0
    assert run("boundary", basins, "-o", out).returncode == 0
    with open_result(out) as one, open_result(curves) as other:
        assert {*one["x0"].values.tolist()} == {*other["x0"].values.tolist()}


def test_the_figure_shows_map_and_curves(curves):
    with open_result(curves) as result, style.context():
        figure = boundary.figures(curves, result, "title")["boundary"]
        texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert any(text.startswith("attractor 1") for text in texts)
        assert len(figure.axes[0].images) == 1 and len(figure.axes[0].lines) > 2
        alone = boundary.figures(None, result, "title")["boundary"]
        assert not alone.axes[0].images and len(alone.axes[0].lines) >= 2


def test_from_python_also_of_a_map_in_memory(coulomb, curves):
    with open_result(curves) as stored:
        for basins in (coulomb, sx.basin(coulomb.with_name("coulomb.toml"))):
            found = sx.boundary(basins)
            assert found.separatrix.kind == "boundary"
            np.testing.assert_array_equal(found["x0"].values, stored["x0"].values)
            np.testing.assert_array_equal(found["v0"].values, stored["v0"].values)


def test_a_stack_of_maps_has_the_curves_of_every_slice(run, coulomb, tmp_path):
    case, basins, out = (tmp_path / name for name in ("stack.toml", "stack.h5", "out.h5"))
    text = coulomb.with_name("coulomb.toml").read_text().replace("count = 60", "count = 20")
    case.write_text(text + '\n[[axis]]\nname = "drive.ratio"\nfrom = 1.15\nto = 1.2\ncount = 2\n')
    assert run("basin", case, "-o", basins).returncode == 0
    assert run("boundary", basins, "-o", out).returncode == 0
    with open_result(out) as result, open_result(basins) as full:
        assert {*result["piece_drive_ratio"].values.tolist()} == {1.15, 1.2}
        with style.context():
            figure = boundary.figures(None, result, "title", over=full)["boundary"]
        assert all(len(ax.lines) > 1 for ax in figure.axes[:2])


def test_the_boundary_of_the_coulomb_machine_is_the_stable_set_of_one_saddle(coulomb, curves):
    with open_result(curves) as result:
        assert set(decode_flags(result["piece_name"]).values) == {"stable_set"}
        assert set(result["saddle"].values) == {1} and set(result["piece_saddle"].values) == {1}
        saddles = table(result, "saddles")
        assert saddles["boundary_points"].values.tolist() == [result.sizes["point"]]
        assert decode_words(saddles["event_word"]).values.tolist() == ["R."]
        unstable, stable = saddles["multipliers"].values[0]
        assert abs(unstable) > 1 > abs(stable)
        x, v = saddles["x"].values[0], saddles["v"].values[0]
        case = result.separatrix.case
        period = sx.trajectory(case, x, v, samples=4).attrs["drive_period"]
        once = sx.trajectory(case.with_({"run.duration": period, "run.window": period}), x, v, samples=4)
        assert once["x"].values[-1] == pytest.approx(x, abs=1e-10)
        assert once["v"].values[-1] == pytest.approx(v, abs=1e-9)


def test_the_stable_set_is_the_boundary_and_the_unstable_set_leads_to_the_attractors(coulomb, curves):
    with open_result(coulomb) as basins, open_result(curves) as result:
        catalogue = search_slices(Model.from_text(basins.attrs["resolved_case"]), [{}], ())[0]
        sets = table(result, "sets")
        x, v, curve = (sets[name].values for name in ("x", "v", "curve"))
        stable = sets["stable"].values[curve] == 1
        # labels on both sides of points of the stable set, across its chord
        pieces = np.stack([curve, sets["part"].values])
        inner = np.flatnonzero(stable & (x > 0.1) & (x < 1.0))[1:-1]
        inner = inner[(pieces[:, inner - 1] == pieces[:, inner + 1]).all(axis=0)]
        assert inner.size > 100
        chord = np.stack([x[inner + 1] - x[inner - 1], (v[inner + 1] - v[inner - 1]) / 10])
        normal = np.stack([-chord[1], chord[0] * 10]) / np.hypot(*chord)
        sides = []
        for sign in (-1, 1):
            starts = np.zeros((inner.size, 3))
            starts[:, 0], starts[:, 1] = (
                x[inner] + sign * 1e-8 * normal[0],
                v[inner] + sign * 1e-8 * normal[1],
            )
            sides.append(catalogue.labels(starts)["attractor"])
        assert (sides[0] != sides[1]).all()
        ends = decode_flags(sets["ending"]).values
        assert set(ends[sets["stable"].values == 0]) == {"converged"}


def test_sets_are_grown_as_far_as_asked(run, coulomb, tmp_path):
    sizes = []
    for factor in (0, 1, 2):
        out = tmp_path / f"{factor}.h5"
        assert run("boundary", coulomb, "-o", out, "--grow", factor).returncode == 0
        with open_result(out) as result:
            sizes.append(result.sizes["set_point"])
            inside = np.abs(result["sets_v"].values) <= 6 * factor
            assert inside.all()
    assert sizes[0] == 0 < sizes[1] < sizes[2]
    assert run("info", coulomb, "--grow", 2).returncode == 64


def test_a_map_of_one_attractor_has_no_boundary(run, source_dir, tmp_path):
    basins, out = tmp_path / "one.h5", tmp_path / "out.h5"
    case = source_dir / "examples" / "validation" / "budd_dux.toml"
    assert run("basin", case, "-o", basins).returncode == 0
    ended = run("boundary", basins, "-o", out)
    assert ended.returncode == 0
    assert "no boundary: all points of the map have the same label" in ended.stdout
    with open_result(out) as result, style.context():
        assert result.sizes["point"] == 0
        # Budd and Dux at sigma = -0.4: within the one basin lies a saddle
        saddles = table(result, "saddles")
        assert saddles["boundary_points"].values.tolist() == [0]
        assert saddles["multipliers"].values[0] == pytest.approx([4.16349147, 0.15371714], abs=1e-8)
        boundary.figures(out, result, "title")


def test_what_has_no_planes_of_starts_is_refused(run, source_dir, tmp_path):
    case, basins = tmp_path / "ratio.toml", tmp_path / "ratio.h5"
    text = (source_dir / "examples" / "basin_coulomb.toml").read_text().split("[[axis]]")[0]
    axis = '[[axis]]\nname = "{}"\nfrom = {}\nto = {}\ncount = 4\n'
    case.write_text(text + axis.format("drive.ratio", 1.1, 1.2) + axis.format("x0", 0, 1))
    assert run("basin", case, "-o", basins).returncode == 0
    ended = run("boundary", basins, "-o", tmp_path / "out.h5")
    assert ended.returncode == 65
    assert "found the axes drive.ratio and x0, allowed are two axes of starts" in ended.stderr
    assert not (tmp_path / "out.h5").exists()


@pytest.mark.parametrize(
    ("how", "code", "message"),
    [
        ("damaged", 74, "is damaged"),
        ("missing", 66, "there is no file"),
        ("other", 65, "found a file of the kind 'boundary', allowed a map that basin wrote"),
        ("case", 65, "is a text"),
    ],
)
def test_what_is_no_sound_map_is_refused(run, coulomb, curves, tmp_path, how, code, message):
    path = tmp_path / "map.h5"
    if how == "damaged":
        path.write_bytes(coulomb.read_bytes())
        with h5py.File(path, "r+") as file:
            file["attractor"][3, 4] = 7 - file["attractor"][3, 4]
        message = "attractor"
    elif how == "other":
        path = curves
    elif how == "case":
        path = coulomb.with_name("coulomb.toml")
    ended = run("boundary", path, "-o", tmp_path / "out.h5")
    assert ended.returncode == code, ended.stderr
    assert message in ended.stderr
    assert not (tmp_path / "out.h5").exists()


def test_a_run_begun_with_force_ends_after_resume(run, coulomb, curves, tmp_path):
    out = tmp_path / "there.h5"
    part = out.with_name("there.h5.part")
    out.write_bytes(b"an older result")
    assert run("boundary", coulomb, "-o", out, "--force", "--time-limit", 1e-3).returncode == 75
    sound = part.read_bytes()
    # without a working file to go on with nothing allows to replace what is there
    part.write_bytes(b"damaged" + sound[7:])
    ended = run("boundary", coulomb, "-o", out, "--resume")
    assert ended.returncode == 73 and "exists" in ended.stderr
    assert "is damaged from its beginning" in ended.stdout and "boundary points" not in ended.stdout
    assert out.read_bytes() == b"an older result"
    part.write_bytes(sound)
    assert run("boundary", coulomb, "-o", out, "--resume").returncode == 0
    assert same_content(out, curves) and not part.exists()


def test_nothing_is_replaced_without_force(run, coulomb, curves):
    before = curves.read_bytes()
    ended = run("boundary", coulomb, "-o", curves)
    assert ended.returncode == 73 and "exists" in ended.stderr
    assert curves.read_bytes() == before
    ended = run("boundary", coulomb, "-o", coulomb)
    assert ended.returncode == 64
    ended = run("boundary", coulomb, "--set", "drive.ratio=1.1")
    assert ended.returncode == 64 and "--set belongs" in ended.stderr


def test_verify_runs_starts_on_both_sides_again(run, curves):
    ended = run("verify", curves, "--sample", 40)
    assert ended.returncode == 0, ended.stderr
    assert "40 points run again: 0 differ from the file" in ended.stdout
    assert "against quadruple precision: 0 label flips\n" in ended.stdout


@pytest.mark.parametrize(
    ("name", "index", "value", "message"),
    [
        ("x0", 20, 0.9, "points rerun differ from the file"),
        ("label_one", 0, 7, "point 0: has not the labels of its piece"),
        ("first", 1, 3, "piece 1: does not begin where the one before ends"),
        ("saddle", 5, 0, "point 5: is part of the stable set of no saddle"),
        ("saddles/multipliers", (0, 1), 1.5, "saddle 1: its multipliers are not those of a saddle"),
    ],
)
def test_verify_reports_what_is_wrong_in_a_boundary(run, curves, tmp_path, name, index, value, message):
    path = tmp_path / "wrong.h5"
    path.write_bytes(curves.read_bytes())
    with h5py.File(path, "r+") as file:
        file[name][index] = value
        file[name].attrs.modify("checksum", np.uint32(zlib.crc32(file[name][()].tobytes())))
    ended = run("verify", path)
    assert ended.returncode == 74
    assert message in ended.stderr
