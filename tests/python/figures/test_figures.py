# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures: they show what the file states."""

import re
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from figure_probes import V0, X0, draw, drawn, legend_texts
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from sample_files import write_basin, write_points, write_sweep, write_trajectory
from separatrix import cli, style
from separatrix.figures import basin, points, sweep, trajectory
from separatrix.figures.look import Look
from separatrix.figures.regions import Boundary, boundaries, brackets, limit_texts, regions
from separatrix.open import open_result, table


def test_runs_and_branches_are_all_drawn(tmp_path: Path) -> None:
    ratios = np.linspace(0.7, 1.8, 45)
    path = write_sweep(tmp_path / "s.h5", ratios)
    figure = drawn(path, sweep.amplitude_diagram)
    with open_result(path) as result:
        expected = {tuple(result[key].values[k]) for key in ("x_max", "x_min") for k in (0, 1)}
        barrier = result.attrs["barrier_upper"]
    found = {tuple(line.get_ydata()) for line in figure.axes[0].lines if len(line.get_xdata()) == ratios.size}
    assert expected <= found
    assert any(
        set(line.get_ydata()) == {barrier} and line.get_color() == style.BARRIER
        for line in figure.axes[0].lines
    )
    assert "run-up" in legend_texts(figure)
    assert sum(len(points.get_offsets()) for points in figure.axes[0].collections) == 2 * 6 * ratios.size


@pytest.mark.parametrize("make", [sweep.amplitude_diagram, sweep.bifurcation_diagram])
def test_markers_at_the_ends_of_a_sweep_are_whole(tmp_path: Path, make) -> None:
    """The largest is 4 points wide with its edge."""
    ratios = np.linspace(0.7, 1.8, 23)
    for ax in drawn(write_sweep(tmp_path / "s.h5", ratios), make).axes:
        points = ax.transData.transform([(end, 0) for end in ratios[[0, -1]]])[:, 0] * 72 / ax.figure.dpi
        box = ax.get_window_extent()
        assert points[0] - box.x0 * 72 / ax.figure.dpi > 2 and box.x1 * 72 / ax.figure.dpi - points[1] > 2


def test_a_one_way_sweep_has_one_run(tmp_path: Path) -> None:
    path = write_sweep(tmp_path / "s.h5", np.linspace(0.7, 1.8, 23))
    with h5py.File(path, "r+") as file:
        for name in ("x_max", "x_min", "mean_impact_speed", "section_x"):
            file[name][1] = np.nan
    for make in (sweep.amplitude_diagram, sweep.bifurcation_diagram):
        texts = legend_texts(drawn(path, make))
        assert "run-up" in texts
        assert "run-down" not in texts


def test_regions_lie_between_the_limits(tmp_path: Path) -> None:
    path = write_sweep(tmp_path / "s.h5", np.arange(0.7, 1.8, 0.01))
    with open_result(path) as result:
        lines = boundaries(table(result, "limits"))
        found = regions(result, "drive_ratio", lines)
    # the limits near 0.87 of run-up and run-down overlap: one line
    assert [round(line.middle, 3) for line in lines] == [0.870, 1.121, 1.351]
    assert [region.text for region in found] == ["non-impact", "impact", "multiple solutions", "non-impact"]
    assert [region.upper for region in found[:-1]] == [region.lower for region in found[1:]]
    shown = {text.get_text() for text in drawn(path, sweep.amplitude_diagram).axes[0].texts}
    assert {"multiple solutions", "impact", "non-impact", "0.870", "1.121", "1.351"} <= shown


def test_a_sweep_without_limits_is_one_region(tmp_path: Path) -> None:
    path = write_sweep(tmp_path / "s.h5", np.linspace(1.4, 1.8, 9))
    with h5py.File(path, "r+") as file:
        del file["limits"]
    with open_result(path) as result:
        assert [region.text for region in regions(result, "drive_ratio", [])] == ["non-impact"]
    assert "limit of a region" not in legend_texts(drawn(path, sweep.amplitude_diagram))


def test_brackets_that_touch_are_one_line_and_open_ones_none() -> None:
    limits = xr.Dataset(
        {"lower": ("limit", [2.0, 1.0, np.nan, 5.0]), "upper": ("limit", [3.0, 2.0, 4.0, 4.5])}
    )
    assert boundaries(limits) == [Boundary(1.0, 3.0), Boundary(4.5, 5.0)]


def test_a_limit_is_that_of_the_settled_motion_where_it_is_known() -> None:
    ends = {
        "lower": [1.0, np.nan],
        "upper": [1.5, np.nan],
        "observed_lower": [0.5, 3.0],
        "observed_upper": [0.6, 4.0],
    }
    limits = xr.Dataset({"name": ("limit", ["impacts_start_up", "impacts_stop_up"])})
    limits = limits.assign({name: ("limit", values) for name, values in ends.items()})
    assert boundaries(limits) == [Boundary(1.0, 1.5), Boundary(3.0, 4.0)]
    assert limit_texts(limits) == [
        "impacts start at 1 to 1.5 (run-up)",
        "impacts stop at 3 to 4 (run-up, observed in steps)",
    ]
    assert brackets(limits, in_steps=True).tolist() == [[0.5, 0.6], [3.0, 4.0]]
    assert limit_texts(xr.Dataset()) == []


def test_the_phase_portrait_jumps_at_each_impact_of_the_window(tmp_path: Path) -> None:
    path = write_trajectory(tmp_path / "t.h5", samples=1999)
    with open_result(path) as result:
        x, v, jumps = trajectory.steady_path(result, 16.5)
    assert len(jumps) == 3
    breaks = np.flatnonzero(np.isnan(x))
    assert len(breaks) == 3
    for index, (position, before, after) in zip(breaks, jumps, strict=True):
        assert (x[index - 1], v[index - 1]) == (position, before)
        assert (x[index + 1], v[index + 1]) == (position, after)
    # no piece of the path crosses from one side of an impact to the other
    assert np.nanmax(np.abs(np.diff(v))) < 0.1


def test_a_sample_at_the_instant_of_an_impact_draws_no_false_line(tmp_path: Path) -> None:
    with open_result(write_trajectory(tmp_path / "t.h5", samples=2001)) as result:
        _, v, _ = trajectory.steady_path(result, 16.5)
    assert np.nanmax(np.abs(np.diff(v))) < 0.1


def test_impacts_are_marked_and_named_only_where_there_are_any(tmp_path: Path) -> None:
    for impacting in (True, False):
        path = write_trajectory(tmp_path / f"{impacting}.h5", impacting=impacting)
        for make in (trajectory.time_history, trajectory.phase_portrait):
            assert ("impact" in legend_texts(drawn(path, make))) == impacting


def test_a_thinned_history_keeps_the_extremes(tmp_path: Path) -> None:
    path = write_trajectory(tmp_path / "t.h5", samples=200001)
    line = drawn(path, trajectory.time_history).axes[0].lines[0]
    with open_result(path) as result:
        assert line.get_ydata().max() == result.x.values.max()
        assert line.get_ydata().min() == result.x.values.min()
    assert line.get_xdata().size < 5000
    assert (np.diff(line.get_xdata()) > 0).all()


WRITERS = {
    "basin": lambda path: write_basin(path, {"x0": X0, "v0": V0}, np.ones((7, 4), int)),
    "sweep": lambda path: write_sweep(path, np.linspace(0.7, 1.8, 23)),
    "trajectory": write_trajectory,
    "points": write_points,
}
FIGURES = {
    "basin": ["attractor", "regime"],
    "sweep": ["amplitude", "bifurcation"],
    "trajectory": ["history", "phase"],
    "points": ["regime"],
}


@pytest.mark.parametrize("kind", list(WRITERS))
def test_every_kind_gives_png_and_pdf(tmp_path: Path, kind: str, capsys: pytest.CaptureFixture) -> None:
    path = WRITERS[kind](tmp_path / f"{kind}.h5")
    folder = tmp_path / "new" / "figures"
    assert cli.main([str(path), "-o", str(folder)]) == 0
    expected = [folder / f"{kind}_{name}.{suffix}" for name in FIGURES[kind] for suffix in ("png", "pdf")]
    assert capsys.readouterr().out.split() == [str(name) for name in expected]
    assert sorted(folder.iterdir()) == sorted(expected)
    for name in expected:
        content = name.read_bytes()
        assert content.startswith(b"\x89PNG" if name.suffix == ".png" else b"%PDF")
        # journals refuse Type 3 fonts
        assert b"/Type3" not in content


@pytest.mark.parametrize("kind", list(WRITERS))
def test_figures_name_what_they_show(tmp_path: Path, kind: str) -> None:
    path = WRITERS[kind](tmp_path / f"{kind}.h5")
    with style.context(), open_result(path) as result:
        made = cli._figures(path, result, None, "The title", Look())
    for figure in made.values():
        assert figure.texts[0].get_text() == "The title"
        assert "Coulomb friction" in figure.separatrix_caption
        assert "Separatrix 0.1.0" in figure.separatrix_caption
        for ax in figure.axes:
            assert ax.get_ylabel()
            assert re.search(r"\((m|s|m/s)\)|omega", ax.get_xlabel() or "(m)")


def test_nothing_of_a_figure_lies_over_another(tmp_path: Path) -> None:
    path = WRITERS["basin"](tmp_path / "b.h5")
    with style.context(), open_result(path) as result:
        figure = basin.basin_map(path, result, "attractor", "A long title " * 12)
        figure.canvas.draw()
        head, foot = (text.get_window_extent() for text in figure.texts)
        legend = figure.legends[0].get_window_extent()
        axes = figure.axes[0].get_tightbbox()
    assert head.y0 >= axes.y1
    assert axes.y0 >= legend.y1
    assert legend.y0 >= foot.y1
    assert foot.y0 >= 0
    assert head.y1 <= figure.bbox.y1
    assert max(head.x1, foot.x1, axes.x1) <= figure.bbox.x1


def test_the_same_file_gives_the_same_bytes(tmp_path: Path) -> None:
    path = WRITERS["basin"](tmp_path / "b.h5")
    for folder in ("one", "two"):
        assert cli.main([str(path), "-o", str(tmp_path / folder)]) == 0
    for first in (tmp_path / "one").iterdir():
        assert first.read_bytes() == (tmp_path / "two" / first.name).read_bytes()


def test_a_field_a_title_and_formats_are_taken(tmp_path: Path) -> None:
    path = WRITERS["basin"](tmp_path / "b.h5")
    arguments = [
        str(path),
        "--field",
        "settle_time",
        "--formats",
        "svg",
        "--title",
        r"50 $ \alpha",
        "--dpi",
        "60",
    ]
    assert cli.main(arguments) == 0
    assert (tmp_path / "b_settle_time.svg").stat().st_size > 0
    assert not list(tmp_path.glob("*.png"))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_field_without_finite_values_is_drawn(tmp_path: Path, value: float) -> None:
    fields = {"grazing_margin": np.full((7, 4), value)}
    path = write_basin(tmp_path / "b.h5", {"x0": X0, "v0": V0}, np.ones((7, 4), int), fields=fields)
    assert cli.main([str(path), "--field", "grazing_margin", "--formats", "png"]) == 0


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["absent.h5"], 66, "no such file"),
        (["text.h5"], 65, "cannot be read as HDF5"),
        (["b.h5", "--field", "colour"], 64, "no field 'colour'; known fields: amplitude, attractor"),
        (["p.h5", "--field", "regime"], 64, "--field is for basin files"),
        (["b.h5", "--formats", "gif"], 64, "found 'gif', allowed a list out of png, pdf, svg"),
        (["b.h5", "--dpi", "0"], 64, "from 50 to 2400"),
        (["b.h5", "-o", "text.h5"], 73, "cannot be written"),
        ([], 64, "required"),
    ],
)
def test_errors_are_one_line_and_a_code(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
    arguments: list,
    code: int,
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("text.h5").write_text("text")
    WRITERS["basin"](Path("b.h5"))
    WRITERS["points"](Path("p.h5"))
    assert cli.main(arguments) == code
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.count("\n") == 1
    assert message in output.err


def test_a_file_without_what_a_figure_needs_is_named(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    sweep_file, motion_file = WRITERS["sweep"](tmp_path / "s.h5"), WRITERS["trajectory"](tmp_path / "t.h5")
    with h5py.File(sweep_file, "r+") as file:
        del file["section_x"]
    with h5py.File(motion_file, "r+") as file:
        del file.attrs["window"]
    assert cli.main([str(sweep_file), str(motion_file)]) == 65
    assert capsys.readouterr().err.count("\n") == 2


def test_a_damaged_chunk_is_an_error_not_a_figure(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path = write_basin(tmp_path / "b.h5", {"x0": X0, "v0": V0}, np.ones((7, 4), int), chunks=(7, 4))
    with h5py.File(path, "r") as file:
        chunk = file["regime"].id.get_chunk_info(0)
    with path.open("r+b") as raw:
        raw.seek(chunk.byte_offset)
        raw.write(b"\xff" * chunk.size)
    assert cli.main([str(path)]) == 65
    assert "is damaged" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [path]


def test_a_bad_file_does_not_keep_the_others_from_their_figures(tmp_path: Path) -> None:
    path = WRITERS["points"](tmp_path / "p.h5")
    assert cli.main([str(tmp_path / "absent.h5"), str(path)]) == 66
    assert (tmp_path / "p_regime.pdf").is_file()


def test_a_failed_write_leaves_the_old_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = WRITERS["points"](tmp_path / "p.h5")
    old = tmp_path / "p_regime.png"
    old.write_text("old")

    def fail(self: Figure, target: Path, **options: object) -> None:
        Path(target).write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", fail)
    assert cli.main([str(path)]) == 73
    assert old.read_text() == "old"
    assert sorted(tmp_path.iterdir()) == [path, old]


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_help_and_version(option: str, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main([option])
    assert caught.value.code == 0
    assert "separatrix-figures" in capsys.readouterr().out


def test_the_start_in_the_caption_is_that_of_the_case(tmp_path):
    path = write_trajectory(tmp_path / "trajectory.h5")
    with h5py.File(path, "r+") as file:
        file["v"][0] = 1.4e-17
        file["provenance"].attrs["resolved_case"] += "\n[start]\nx0 = 0.4\nv0 = 0.0\n"
    figure = drawn(path, trajectory.phase_portrait)
    assert "$x_0$ = 0.4 m, $v_0$ = 0 m/s" in figure.separatrix_caption


@pytest.mark.parametrize("change", ["catalogue", "label"])
def test_without_labels_there_is_no_figure_of_attractors(tmp_path: Path, change: str) -> None:
    path = write_basin(tmp_path / "b.h5", {"x0": X0, "v0": V0}, np.zeros((7, 4), int))
    with h5py.File(path, "r+") as file:
        if change == "catalogue":
            del file["catalogue"]
        else:
            file["catalogue/count"][...] = 0
    assert cli.main([str(path), "--formats", "png"]) == 0
    assert [figure.name for figure in tmp_path.glob("*.png")] == ["b_regime.png"]
    assert cli.main([str(path), "--formats", "png", "--field", "attractor"]) == 0


def add_to_case(path: Path, more: str) -> None:
    """Put tables at the end of the resolved case of a file."""
    with h5py.File(path, "r+") as file:
        file["provenance"].attrs["resolved_case"] += more


@pytest.mark.parametrize(
    ("axes", "angle", "text"),
    [
        ({"x0": X0, "v0": V0}, 0.0, ""),
        ({"x0": X0, "v0": V0}, 1.5, r"; $\varphi_0$ = 1.5 rad;"),
        ({"x0": X0, "crank_angle": V0}, 1.5, "; $v_0$ = -1 m/s;"),
        ({"drive_ratio": V0, "friction_kinetic_coefficient": X0}, 0.0, "; $x_0$ = 0.4 m, $v_0$ = -1 m/s;"),
    ],
)
def test_the_caption_of_a_map_has_the_start_values_that_are_no_axes(
    tmp_path: Path, axes: dict, angle: float, text: str
) -> None:
    path = write_basin(tmp_path / "b.h5", axes, np.ones([len(p) for p in axes.values()], int))
    add_to_case(path, f"\n[start]\nx0 = 0.4\nv0 = -1.0\ncrank_angle = {angle}\n")
    caption = draw(path, "regime").separatrix_caption
    assert text in caption
    assert sum(caption.count(symbol) for symbol in ("$x_0$", "$v_0$", "varphi")) == text.count("_0$")
    assert ("omega" in caption) == ("drive_ratio" not in axes)


def test_points_at_several_ratios_have_none_in_the_caption(tmp_path: Path) -> None:
    path = write_points(tmp_path / "p.h5")
    with open_result(path) as result:
        assert "omega" in points.scatter(result, "title").separatrix_caption
    with h5py.File(path, "r+") as file:
        file["ratio"][0] = 1.1
    with open_result(path) as result:
        assert "omega" not in points.scatter(result, "title").separatrix_caption


def test_holds_that_failed_are_not_drawn(tmp_path: Path) -> None:
    path = write_sweep(tmp_path / "s.h5", np.linspace(0.7, 1.8, 23))
    with h5py.File(path, "r+") as file:
        for name in ("x_max", "x_min", "mean_impact_speed", "section_x"):
            file[name][0, 5] = np.nan
        file["reason"][0, 5] = 5
    figure = drawn(path, sweep.amplitude_diagram)
    ups = [line for line in figure.axes[0].lines if line.get_markeredgecolor() == style.RUN_UP]
    assert [int(np.isfinite(line.get_ydata()).sum()) for line in ups] == [22, 22]
    figure = drawn(path, sweep.bifurcation_diagram)
    offsets = {to_hex(one.get_facecolor()[0]): one.get_offsets() for one in figure.axes[0].collections}
    ups = np.concatenate(
        [offsets[colour.lower()].filled(np.nan) for colour in (style.RUN_UP, style.BOTH_RUNS)]
    )
    assert np.isfinite(ups).all(axis=1).sum() == 22 * 8


@pytest.mark.parametrize(("duration", "end"), [(20.0, 20.0), (20.004, 20.004), (40.0, 20.0)])
def test_the_time_axis_ends_at_the_duration(tmp_path: Path, duration: float, end: float) -> None:
    path = write_trajectory(tmp_path / "t.h5")
    add_to_case(path, f"\n[run]\nduration = {duration}\n")
    figure = drawn(path, trajectory.time_history)
    assert [ax.get_xlim()[1] for ax in figure.axes] == [end, end]
    for ax in figure.axes:
        assert (end in ax.get_xticks()) == (end == 20.0)


def test_values_of_close_limits_do_not_lie_on_each_other():
    with style.context():
        figure = style.new_figure(style.DOUBLE_COLUMN, 85.0)
        ax = figure.add_subplot()
        ax.set_xlim(0.7, 1.8)
        for middle, gap in ((0.8622, 0.0125 / 1.1), (0.8747, -0.0125 / 1.1)):
            sweep._name_limit(ax, Boundary(middle - 3e-4, middle + 3e-4), gap)
        figure.canvas.draw()
        left, right = (text.get_window_extent() for text in ax.texts)
        # turned by 60 degrees: their distance across the writing is more than the height of a line
        across = (right.x0 - left.x0) * np.sin(np.radians(60))
        assert across > 6.0 / 72 * figure.dpi
