# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewer's requests and answers, without a browser (docs/viewer.md)."""

import re
import tomllib
from pathlib import Path

import h5py
import matplotlib
import numpy as np
import pytest
import separatrix as sx
from matplotlib.colors import to_hex, to_rgb
from program import CASE, succeed
from separatrix import palette, style
from separatrix.classes import classes
from separatrix.errors import SeparatrixError
from separatrix.simulate import LABEL_VARIABLES, StoppedError
from separatrix.view.files import ResultFile
from separatrix.view.packing import pack, unpack
from separatrix.view.protocol import REQUESTS, Desk, RefusedError
from separatrix.view.pyramid import Plane

pytestmark = pytest.mark.usefixtures("library")


def ask(
    desk: Desk, name: str, acting: bool = False, **parameters: object
) -> tuple[dict, dict[str, np.ndarray]]:
    """Ask as a page does, in texts."""
    texts = {key.rstrip("_"): str(value) for key, value in parameters.items()}
    return unpack(desk.answer(name, texts, acting))


def plane_of(file: int = 0, at: str = "0,0", across: int = 0, up: int = 1) -> dict:
    """The parameters of a plane."""
    return {"file": file, "across": across, "up": up, "at": at}


@pytest.fixture
def desk(results: dict[str, Path], tmp_path: Path) -> Desk:
    """A map, a stack of maps, one over parameters alone, a sweep, a trajectory, points."""
    kinds = ("map", "stack", "plane", "refined", "sweep", "trajectory", "points")
    desk = Desk([results[kind] for kind in kinds], tmp_path)
    yield desk
    desk.close()


def test_packs_and_unpacks() -> None:
    """Arrays of every kind, and numbers that JSON does not have."""
    arrays = {
        "a": np.arange(5, dtype=np.int16),
        "b": np.eye(3, dtype=np.float32),
        "c": np.array([], np.uint8),
    }
    header, found = unpack(pack({"x": np.nan, "y": np.float64(2), "z": [np.inf, b"text"]}, arrays))
    assert header == {"x": None, "y": 2.0, "z": [None, "text"]}
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)


def test_a_motion_with_a_motor_has_its_crank(source_dir: Path, tmp_path: Path) -> None:
    """The angle of the crank, which moves the foot, and the samples next to its passages."""
    case = sx.load(source_dir / "examples" / "motor_impact.toml").with_(
        {"run.duration": 4.0, "run.window": 1.0, "attractors.sample": 4}
    )
    axes = {"motor.crank_speed": (8, 14, 2), "x0": (-0.1, 0.1, 3)}
    sx.basin(case, axes, output=tmp_path / "map.h5").close()
    desk = Desk([tmp_path / "map.h5"], tmp_path)
    header, found = ask(desk, "motion", file=0, at="1,1", x=0.05, v=0, angle=0.5, samples=64)
    assert header["parameters"] == {"motor.crank_speed": 14.0}
    np.testing.assert_allclose(found["driver"], 0.03 * np.cos(found["crank"]), atol=1e-6)
    turns = np.floor(found["crank"] / (2 * np.pi))
    assert turns[-1] > 5
    np.testing.assert_array_equal(found["section"], np.flatnonzero(np.diff(turns, prepend=0.0) > 0))
    desk.close()


def test_describes_files(desk: Desk) -> None:
    """Kinds, axes, variables, attractors and parameters of every file."""
    described, _ = ask(desk, "describe")
    assert [one["kind"] for one in described["files"]] == ["basin"] * 4 + ["sweep", "trajectory", "points"]
    first = described["files"][0]
    assert [axis["path"] for axis in first["axes"]] == ["x0", "v0"]
    assert {one["name"] for one in first["variables"]} >= {"attractor", "regime", "settle_time", "event_word"}
    assert sum(one["count"] for one in first["catalogue"]) == first["points"] == 19 * 31
    assert first["parameters"]["drive.ratio"][0] == 1.2
    assert set(REQUESTS) >= {"describe", "tile", "points", "motion", "keep"}


def test_colours_are_those_of_the_figures(desk: Desk, results: dict[str, Path], source_dir: Path) -> None:
    """Of every attractor and regime in the legends; scripts have no colours of classes of their own."""
    described, _ = ask(desk, "describe")
    sent = described["palette"]
    for kind, file in zip(("map", "stack"), described["files"], strict=False):
        with sx.open_result(results[kind]) as result:
            counts = dict(
                zip(
                    *(part.tolist() for part in np.unique(result["attractor"], return_counts=True)),
                    strict=True,
                )
            )
            for one in classes(result, "attractor", counts):
                expected = sent["nothing"] if one.codes == (0,) else file["colours"][str(one.codes[0])]
                assert to_hex(one.colour) == to_hex(expected)
            for one in classes(result, "regime", dict.fromkeys(range(8), 1)):
                assert to_hex(sent["regimes"][one.codes[0]]) == to_hex(one.colour)
    assert (sent["up"], sent["down"]) == (style.RUN_UP, style.RUN_DOWN)
    static = source_dir / "postprocess" / "separatrix" / "view" / "static"
    scale = re.findall(r"#[0-9a-f]{6}", (static / "palette.js").read_text().lower())
    for value, colour in zip(np.linspace(0, 1, len(scale)), scale, strict=True):
        assert to_rgb(colour) == pytest.approx(matplotlib.colormaps[style.SCALAR_MAP](value)[:3], abs=0.02)
    fixed = {colour.lower() for colour in (*palette.ATTRACTORS, *palette.OKABE_ITO, *palette.TOL_MUTED)}
    for script in static.glob("*.js"):
        assert not fixed - {"#000000"} & set(re.findall(r"#[0-9a-f]{6}", script.read_text().lower())), (
            script.name
        )


def test_many_attractors_have_the_colours_of_their_legend() -> None:
    """Up to ten by number, of more the ten with the largest basins; the page distinguishes the others."""
    assert palette.of_attractors({1: 5, 3: 1}, 3) == {1: palette.ATTRACTORS[0], 3: palette.ATTRACTORS[2]}
    assert palette.of_attractors({1: 5, 9: 1}, 9) == {1: palette.TOL_MUTED[0], 9: palette.TOL_MUTED[8]}
    many = palette.of_attractors({number: number for number in range(1, 13)}, 12)
    assert many == {12 - index: palette.TOL_MUTED[index] for index in range(10)}


@pytest.mark.parametrize("variable", range(len(LABEL_VARIABLES)))
def test_fine_tiles_are_the_file(desk: Desk, results: dict[str, Path], variable: int) -> None:
    """Level 0, rows up and columns across, either way round."""
    name = desk.files[0].variables[variable]["name"]
    with h5py.File(results["map"]) as file:
        values = file[name][()]
    for across, up, expected in ((0, 1, values.T), (1, 0, values)):
        _, cells = ask(
            desk, "tile", **plane_of(across=across, up=up), variable=variable, level=0, row=0, column=0
        )
        if name == "event_word":
            names, _ = ask(desk, "classes", **plane_of(across=across, up=up), variable=variable)
            assert len(names["names"]) == len(np.unique(values))
            words = [np.unique(expected[cells["first"] == int(key)]) for key in names["names"]]
            assert all(len(one) == 1 for one in words)
        else:
            np.testing.assert_array_equal(cells["first"], expected)


def synthetic(folder: Path, results: dict[str, Path], shape: tuple[int, int]) -> tuple[Path, np.ndarray]:
    """A map of another size with made-up labels, from a real file's frame."""
    path = folder / "large.h5"
    chance = np.random.default_rng(3)
    i, j = np.ogrid[: shape[0], : shape[1]]
    labels = (1 + (np.sin(i / 40) * np.cos(j / 57) > 0.3) + (chance.random(shape) < 0.01)).astype(np.int32)
    times = (1 + (i + j) % 97).astype(np.float32)
    with h5py.File(results["map"]) as source, h5py.File(path, "w") as file:
        for key, value in source.attrs.items():
            file.attrs[key] = value
        source.copy("provenance", file)
        file["x0"], file["v0"] = np.linspace(0, 1.1, shape[0]), np.linspace(-6, 6, shape[1])
        file.create_dataset("attractor", data=labels, chunks=(256, 256), compression="gzip")
        file.create_dataset("settle_time", data=times, chunks=(256, 256), compression="gzip")
        file.create_dataset("grazing_margin", data=times, chunks=(256, 256), compression="gzip")
    return path, labels


def test_coarse_tiles_have_the_commonest_classes(results: dict[str, Path], tmp_path: Path) -> None:
    """Shares of cells are those of the points in them, at the ragged edge too."""
    path, labels = synthetic(tmp_path, results, (700, 531))
    source = ResultFile(path)
    numbers = {one["name"]: i for i, one in enumerate(source.variables)}
    for most in (16_000_000, 2000):
        plane = Plane(source, numbers["attractor"], 0, 1, (0, 0))
        while most < 1e5 and np.prod([-(-n >> plane.first) for n in plane.shape]) > most:
            plane.first += 1
        for level in range(1, plane.top + 1):
            rows, columns = plane.tiles(level)
            whole = np.vstack(
                [np.hstack([plane.tile(level, r, c)["first"] for c in range(columns)]) for r in range(rows)]
            )
            share = np.vstack(
                [np.hstack([plane.tile(level, r, c)["share"] for c in range(columns)]) for r in range(rows)]
            )
            size = 2**level
            for r, c in np.random.default_rng(level).integers(0, whole.shape, (40, 2)):
                cell = labels.T[r * size : (r + 1) * size, c * size : (c + 1) * size]
                counts = np.bincount(cell.ravel())
                assert counts[whole[r, c]] == counts.max()
                assert abs(share[r, c] / 255 - counts.max() / cell.size) < 0.5 / 255 + 1e-9
        plane.close()


def test_coarse_tiles_of_numbers(results: dict[str, Path], tmp_path: Path) -> None:
    """The mean; of the grazing margin the smallest."""
    path, _ = synthetic(tmp_path, results, (300, 270))
    source = ResultFile(path)
    numbers = {one["name"]: i for i, one in enumerate(source.variables)}
    with h5py.File(path) as file:
        times = file["settle_time"][()].T
    for name, reduce in (("settle_time", np.mean), ("grazing_margin", np.min)):
        cells = Plane(source, numbers[name], 0, 1, (0, 0)).tile(3, 0, 0)["first"]
        for r, c in ((0, 0), (7, 11), (33, 37)):
            expected = reduce(times[8 * r : 8 * r + 8, 8 * c : 8 * c + 8])
            assert cells[r, c] == pytest.approx(expected, rel=1e-6)


def test_branches_as_a_page_asks_for_them(branch_file: Path) -> None:
    """Every array of the file, with the names of the labels and the parameter."""
    desk = Desk([branch_file])
    described, _ = ask(desk, "describe")
    assert described["files"][0]["kind"] == "branches"
    assert described["files"][0]["attributes"]["parameter"] == "drive.ratio"
    header, arrays = ask(desk, "series", file=0)
    with h5py.File(branch_file) as file:
        for name in ("parameter", "x", "v", "stable", "label", "multiplier_real"):
            np.testing.assert_array_equal(arrays[name], file[name][()])
    assert "SN" in header["variables"]["label"]["codes"].values()
    desk.close()


def test_values_and_slices(desk: Desk, results: dict[str, Path]) -> None:
    """All variables of a point of a stack, in words; tiles of each slice."""
    answer, _ = ask(desk, "values", file=1, at="2,3,5")
    with h5py.File(results["stack"]) as file:
        assert answer["coordinates"] == [
            file[key][i] for key, i in (("drive_ratio", 2), ("x0", 3), ("v0", 5))
        ]
        assert answer["values"]["attractor"] == file["attractor"][2, 3, 5]
        slices = file["attractor"][()]
    for i in range(3):
        _, cells = ask(desk, "tile", **plane_of(1, f"{i},0,0", 1, 2), variable=0, level=0, row=0, column=0)
        np.testing.assert_array_equal(cells["first"], slices[i].T)


def test_live_points_have_the_labels_of_the_file(desk: Desk, results: dict[str, Path]) -> None:
    """On the points of the file: of a map, of every slice of a stack, of a map over parameters."""
    lattice = {"a": 0, "da": 1, "b": 0, "db": 1, "page": 1, "view": 1}
    with h5py.File(results["map"]) as file:
        _, found = ask(desk, "points", **plane_of(), **lattice, columns=19, rows=31)
        for name in LABEL_VARIABLES:
            np.testing.assert_array_equal(found[name].reshape(31, 19).T, file[name][()], err_msg=name)
    with h5py.File(results["stack"]) as file:
        for i in range(3):
            _, found = ask(desk, "points", **plane_of(1, f"{i},0,0", 1, 2), **lattice, columns=7, rows=11)
            np.testing.assert_array_equal(found["attractor"].reshape(11, 7).T, file["attractor"][i])
    with h5py.File(results["plane"]) as file:
        _, found = ask(desk, "points", **plane_of(2), **lattice, columns=3, rows=3)
        np.testing.assert_array_equal(found["regime"].reshape(3, 3).T, file["regime"][:3, :3])
        np.testing.assert_array_equal(found["period"].reshape(3, 3).T, file["period"][:3, :3])


def test_refinement_of_live_points_is_whole(desk: Desk) -> None:
    """What `skip` leaves out is what the coarser pass had."""
    lattice = {"a": 3.25, "b": 4.5, "page": 1, "view": 1}
    _, fine = ask(desk, "points", **plane_of(), **lattice, da=0.1, db=0.2, columns=8, rows=6)
    _, coarse = ask(desk, "points", **plane_of(), **lattice, da=0.2, db=0.4, columns=4, rows=3)
    _, rest = ask(desk, "points", **plane_of(), **lattice, da=0.1, db=0.2, columns=8, rows=6, skip=1)
    whole = fine["settle_time"].reshape(6, 8)
    np.testing.assert_array_equal(whole[::2, ::2].ravel(), coarse["settle_time"])
    left = np.ones((6, 8), bool)
    left[::2, ::2] = False
    np.testing.assert_array_equal(whole[left], rest["settle_time"])


def test_a_newer_view_ends_an_older(desk: Desk) -> None:
    """Work for a view that nobody looks at is refused or stopped."""
    lattice = {"a": 0, "da": 1, "b": 0, "db": 1, "columns": 3, "rows": 3}
    flag = desk.views.enter(5, 3)
    ask(desk, "points", **plane_of(), **lattice, page=5, view=4)
    assert flag.is_set()
    with pytest.raises(StoppedError):
        ask(desk, "points", **plane_of(), **lattice, page=5, view=3)
    ask(desk, "stop", acting=True, page=5, view=4)
    with pytest.raises(StoppedError):
        ask(desk, "points", **plane_of(), **lattice, page=5, view=4)
    ask(desk, "points", **plane_of(), **lattice, page=6, view=1)


def test_a_motion_ends_as_in_points(desk: Desk, separatrix: Path, tmp_path: Path) -> None:
    """The numbers of a click, with another ratio too; its tables; its case flies the same."""
    (tmp_path / "case.toml").write_text(CASE)
    (tmp_path / "starts.csv").write_text("x0,v0,ratio\n0.31,-1.7,1.2\n0.31,-1.7,1.07\n")
    succeed(separatrix, "points", "case.toml", "--list", "starts.csv", "-o", "ends.h5", folder=tmp_path)
    start = {"file": 0, "at": "0,0", "x": 0.31, "v": -1.7, "angle": 0}
    with h5py.File(tmp_path / "ends.h5") as file:
        for i, other in enumerate(({}, {"with": "drive.ratio:1.07"})):
            answer, arrays = ask(
                desk, "motion", **start, **{f"{key}_": value for key, value in other.items()}
            )
            assert [answer["summary"][key] for key in ("x", "v")] == [file["x"][i], file["v"][i]]
            assert len(arrays["x"]) == len(arrays["time"]) > 1000
    text = ask(desk, "download", **start, what="case")[0]["text"]
    assert tomllib.loads(text)["start"] == {"x0": 0.31, "v0": -1.7, "crank_angle": 0.0}
    (tmp_path / "again.toml").write_text(text)
    succeed(separatrix, "trajectory", "again.toml", "--csv", "events.csv", "-o", "again.h5", folder=tmp_path)
    events = ask(desk, "download", **start, what="events")[0]["text"]
    assert events == (tmp_path / "events.csv").read_text()
    samples = ask(desk, "download", **start, what="samples")[0]["text"].splitlines()
    with h5py.File(tmp_path / "again.h5") as file:
        rows = np.array([line.split(",")[:3] for line in samples[1:]], float)
        np.testing.assert_array_equal(rows, np.column_stack([file[key][()] for key in ("time", "x", "v")]))


def test_keeps_a_view(desk: Desk, tmp_path: Path, results: dict[str, Path]) -> None:
    """A file of its own, never an existing one, that the viewer and the figures open."""
    lattice = {"a": 2, "da": 0.5, "b": 4, "db": 0.25, "columns": 9, "rows": 12, "page": 1, "view": 1}
    names = [ask(desk, "keep", acting=True, **plane_of(), **lattice)[0]["written"] for _ in range(2)]
    assert names == ["map_view_1.h5", "map_view_2.h5"]
    kept = ResultFile(tmp_path / names[0])
    assert kept.shape == (9, 12)
    with h5py.File(results["map"]) as file:
        np.testing.assert_array_equal(kept.file["attractor"][::2, ::4], file["attractor"][2:7, 4:7])
        np.testing.assert_array_equal(kept.file["settle_time"][::2, ::4], file["settle_time"][2:7, 4:7])
    assert sum(kept.tables["catalogue"]["count"]) == 9 * 12
    with Desk_of(tmp_path / names[0]) as again:
        one = {"a": 0, "da": 1, "b": 0, "db": 1, "columns": 9, "rows": 12, "page": 1, "view": 1}
        _, found = ask(again, "points", **plane_of(), **one)
        np.testing.assert_array_equal(found["settle_time"].reshape(12, 9).T, kept.file["settle_time"][()])
    with pytest.raises(RefusedError, match="act"):
        ask(desk, "keep", **plane_of(), **lattice)


class Desk_of:  # noqa: N801
    """A desk with one file."""

    def __init__(self, path: Path) -> None:
        self.desk = Desk([path])

    def __enter__(self) -> Desk:
        return self.desk

    def __exit__(self, *_: object) -> None:
        self.desk.close()


BAD = [
    ("tile", {"level": -1}), ("tile", {"level": 99}), ("tile", {"row": 1}), ("tile", {"row": "1e1"}),
    ("tile", {"column": "9" * 400}), ("tile", {"variable": 400}),
    ("tile", {"file": 4}), ("tile", {"file": 99}),
    ("tile", {"at": "0"}), ("tile", {"at": "0,0,0"}), ("tile", {"at": "../.."}), ("tile", {"across": 1}),
    ("tile", {"extra": 1}), ("tile", {"row": "0\x00"}), ("tile", {"level": "\u0661"}),
    ("motion", {"x": "nan"}), ("motion", {"x": "inf"}), ("motion", {"v": "1e999"}), ("motion", {"x": ""}),
    ("motion", {"periods": 10**7}),
    ("motion", {"periods": 99999, "samples": 2000}), ("motion", {"samples": -1}),
    ("motion", {"with": "drive.ratio:nan"}), ("motion", {"with": ";" * 50}), ("motion", {"x": "1" * 5000}),
    ("points", {"columns": 0}), ("points", {"columns": 8192, "rows": 8192}), ("points", {"da": "nan"}),
    ("points", {"page": -1}), ("download", {"what": "/etc/passwd"}),
    ("series", {"file": 0}), ("values", {"at": "19,0"}),
    ("nothing", {}), ("__class__", {}), ("stop", {"page": 1, "view": 1}),
]  # fmt: skip
GOOD = {
    "tile": plane_of() | {"variable": 0, "level": 0, "row": 0, "column": 0},
    "motion": {"file": 0, "at": "0,0", "x": 0.3, "v": 0, "angle": 0},
    "download": {"file": 0, "at": "0,0", "x": 0.3, "v": 0, "angle": 0, "what": "case"},
    "points": plane_of() | {"a": 0, "da": 1, "columns": 2, "b": 0, "db": 1, "rows": 2, "page": 1, "view": 1},
    "values": {"file": 0, "at": "0,0"},
}


@pytest.mark.parametrize(("name", "change"), BAD)
def test_refuses_what_is_out_of_range(desk: Desk, name: str, change: dict) -> None:
    """Huge, negative, not finite, unknown: refused in words before anything is done."""
    texts = {key: str(value) for key, value in (GOOD.get(name, {}) | change).items()}
    with pytest.raises(RefusedError):
        desk.answer(name, texts)


def test_reports_what_the_library_refuses(desk: Desk) -> None:
    """A start beyond the barrier, a parameter that is not there or out of bounds."""
    for change, words in (
        ({"x": 3}, "contact.upper"),
        ({"with": "drive.ration:1"}, "drive.ratio"),
        ({"with": "contact.restitution:2"}, "allowed"),
    ):
        texts = {key: str(value) for key, value in (GOOD["motion"] | change).items()}
        with pytest.raises(SeparatrixError, match=words):
            desk.answer("motion", texts)


def test_damaged_files_are_a_message(results: dict[str, Path], tmp_path: Path) -> None:
    """Foreign, cut, and flipped bytes: refused at the start or at the request, in one line."""
    case = tmp_path / "case.toml"
    case.write_text("[body]\nmass = 1\n")
    with pytest.raises(SeparatrixError, match="found a case"):
        ResultFile(case)
    path = tmp_path / "damaged.h5"
    whole = results["map"].read_bytes()
    cases = [b"", b"text", whole[:1000], whole[: len(whole) // 2]]
    chance = np.random.default_rng(11)
    for _ in range(25):
        changed = bytearray(whole)
        for offset in chance.integers(0, len(whole), 40):
            changed[offset] ^= 1 << int(chance.integers(8))
        cases.append(bytes(changed))
    refused = 0
    for case in cases:
        path.write_bytes(case)
        try:
            desk = Desk([path])
        except SeparatrixError as error:
            refused += 1
            assert "\n" not in str(error)
            continue
        for name in ("describe", "tile", "values"):
            texts = {key: str(value) for key, value in GOOD.get(name, {}).items()}
            try:
                desk.answer(name, texts)
            except SeparatrixError as error:
                refused += 1
                assert "\n" not in str(error)
        desk.close()
    assert refused >= 4
    whole_map, _ = synthetic(tmp_path, results, (700, 531))
    with h5py.File(whole_map) as file:
        offset = file["attractor"].id.get_chunk_info_by_coord((256, 256)).byte_offset
    with whole_map.open("r+b") as handle:
        handle.seek(offset)
        handle.write(b"\0" * 100)
    desk = Desk([whole_map])
    texts = {key: str(value) for key, value in GOOD["tile"].items()}
    assert unpack(desk.answer("tile", texts))[1]["first"].shape == (256, 256)
    for change in ({"row": "1", "column": "1"}, {"level": "2"}):
        with pytest.raises(SeparatrixError, match="cannot be read"):
            desk.answer("tile", texts | change)
    with pytest.raises(SeparatrixError, match="no such file"):
        Desk([tmp_path / "nothing.h5"])
