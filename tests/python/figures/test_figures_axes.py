# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures drawn into axes of the user, and the section of a motion."""

from collections.abc import Callable
from pathlib import Path

import h5py
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
import separatrix as sx
import xarray as xr
from figure_probes import V0, X0, legend_texts
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from program import CASE
from sample_files import write_basin, write_points, write_sweep, write_trajectory
from separatrix import cli, style
from separatrix.errors import SeparatrixError
from separatrix.figures import trajectory
from separatrix.figures.look import Look

# the machine of the petals, which is chaotic at this ratio
STRANGE = {"drive.ratio": 2.8}


def measures() -> xr.Dataset:
    """Two measures of two basins over a parameter."""
    shares = np.array([[0.2, 0.8], [0.4, 0.6], [0.0, 1.0]])
    names = {"global_integrity": shares, "convergence_time": 10 * shares}
    data = {
        f"{name}{end}": (("drive_ratio", "basin"), values + shift, {"units": "s" if "time" in name else "1"})
        for name, values in names.items()
        for end, shift in (("", 0.0), ("_lower", -0.1), ("_upper", 0.1))
    }
    data["exists"] = (("drive_ratio", "basin"), shares > 0)
    about = {"kind": "measures", "parameter": "drive_ratio", "starts_a_value": 100}
    return xr.Dataset(data, {"drive_ratio": [1.0, 1.1, 1.2], "basin": [1, 2]}, about)


def survival() -> xr.Dataset:
    """A share that falls, and the law beside it."""
    time = np.linspace(0, 10, 21)
    share = np.exp(-time / 5)
    data = {
        f"{name}{end}": ("time", share + shift)
        for name in ("survival", "law")
        for end, shift in (("", 0.0), ("_lower", -0.1), ("_upper", 0.1))
    }
    about = {"kind": "survival", "attractor": 1, "motions": 50, "rate": 1.0, "deviation": 0.1, "p": 0.2}
    return xr.Dataset(data, {"time": ("time", time, {"units": "s"})}, about)


def two_bodies(drive: str = "none") -> xr.Dataset:
    """A block that slides on another one."""
    body = {"law": "friction_pair", "mass": 1.0, "driven_mass": 0.5, "friction": 0.1, "driver_x0": 1.0}
    given = {"sine": {"amplitude": 1.0, "frequency": 1.0}, "none": {}}[drive]
    restoring = {"law": "linear", "stiffness": 1.0} if drive == "none" else {"law": "none"}
    parts = {
        "body": body,
        "restoring": restoring,
        "drive": {"law": drive, **given},
        "run": {"duration": 100.0},
    }
    return sx.trajectory(sx.Case.from_dict(parts))


def soft() -> xr.Dataset:
    """A motion that presses on a soft barrier."""
    contact = {"law": "hunt_crossley_exact", "stiffness": 1e5, "restitution": 0.5, "upper": 1.1}
    case = sx.Case.from_text(CASE).with_({"contact": contact})
    return sx.trajectory(case, duration=5.0, samples=2000)


def strange(source_dir: Path, periods: int, **options: float) -> xr.Dataset:
    """A chaotic motion of so many drive periods."""
    case = sx.load(source_dir / "docs" / "gallery" / "petals.toml").with_(STRANGE)
    period = 2 * np.pi / STRANGE["drive.ratio"]
    return sx.trajectory(case, -1.0, 0.3, duration=periods * period, **options)


def stack(path: Path) -> Path:
    """A map over two starts and three ratios."""
    attractor = np.random.default_rng(4).integers(1, 4, (7, 4, 3))
    axes = {"x0": X0, "v0": V0, "drive_ratio": np.array([1.1, 1.2, 1.3])}
    return write_basin(path, axes, attractor, regime_of=(0, 1, 2, 3))


RESULTS: dict[str, Callable[[Path, Path, dict], xr.Dataset]] = {
    "basin": lambda path, source, files: sx.open_result(stack(path)).isel(drive_ratio=[0]),
    "stack": lambda path, source, files: sx.open_result(stack(path)),
    "boundary": lambda path, source, files: sx.boundary(files["map"]),
    "sweep": lambda path, source, files: sx.open_result(write_sweep(path, np.linspace(0.7, 1.8, 45))),
    "trajectory": lambda path, source, files: sx.open_result(write_trajectory(path)),
    "points": lambda path, source, files: sx.open_result(write_points(path)),
    "branches": lambda path, source, files: sx.open_result(files["branches"]),
    "pair": lambda path, source, files: two_bodies(),
    "soft": lambda path, source, files: soft(),
    "strange": lambda path, source, files: strange(source, 450, samples=4),
    "measures": lambda path, source, files: measures(),
    "survival": lambda path, source, files: survival(),
}
# figure, result, panels
FIGURES = [
    ("attractor", "basin", 1), ("settle_time", "basin", 1), ("attractor", "stack", 3), ("shares", "stack", 1),
    ("boundary", "boundary", 1), ("amplitude", "sweep", 1), ("bifurcation", "sweep", 2),
    ("history", "trajectory", 2), ("phase", "trajectory", 1), ("section", "trajectory", 1),
    ("regime", "points", 1), ("branches", "branches", 1), ("history", "pair", 2), ("energy", "pair", 1),
    ("contact", "soft", 2), ("impacts", "strange", 1), ("section", "strange", 1), ("erosion", "measures", 2),
    ("survival", "survival", 1),
]  # fmt: skip


@pytest.fixture(scope="module")
def made(
    source_dir: Path, build_dir: Path, results: dict, branch_file: Path, tmp_path_factory: object
) -> Callable[[str], xr.Dataset]:
    """Each result, once."""
    known: dict[str, xr.Dataset] = {}
    folder = tmp_path_factory.mktemp("axes")
    files = {**results, "branches": branch_file}

    def make(name: str) -> xr.Dataset:
        if name not in known:
            with pytest.MonkeyPatch.context() as patch:
                patch.setenv("SEPARATRIX_LIBRARY", str(build_dir / "lib" / "libseparatrix.so"))
                known[name] = RESULTS[name](folder / f"{name}.h5", source_dir, files)
        return known[name]

    return make


def content(ax: Axes) -> dict[str, object]:
    """What is drawn in axes: the data of all its artists."""
    drawn = {
        "lines": [np.nan_to_num(line.get_xydata(), nan=-1e9).tolist() for line in ax.lines],
        "points": [np.asarray(one.get_offsets()).tolist() for one in ax.collections],
        "images": [np.ma.filled(one.get_array(), -1).tolist() for one in ax.images],
        "patches": [type(one).__name__ for one in ax.patches],
        "limits": np.round([ax.get_xlim(), ax.get_ylim()], 9).tolist(),
        "up": ax.get_ylabel(),
        "heading": ax.get_title(),
    }
    return drawn


@pytest.mark.parametrize(("name", "kind", "panels"), FIGURES)
def test_axes_of_the_user_contain_what_the_figure_contains(
    library: Path, made: Callable, monkeypatch: pytest.MonkeyPatch, name: str, kind: str, panels: int
) -> None:
    """And nothing else changes: no figure is opened, no setting, no title, no caption."""
    result = made(kind)
    own = result.separatrix.plot(name)
    with style.context():
        mine = plt.figure(figsize=(7, 5), layout="constrained")
        axes = mine.subplots(1, panels, squeeze=False).ravel()
    opened, settings = plt.get_fignums(), dict(matplotlib.rcParams)
    monkeypatch.setattr(style, "new_figure", lambda *size: pytest.fail("opened a figure"))
    monkeypatch.setattr(style, "context", lambda *sheet: pytest.fail("changed the style"))
    assert result.separatrix.plot(name, ax=axes[0] if panels == 1 else axes) is mine
    assert (plt.get_fignums(), dict(matplotlib.rcParams)) == (opened, settings)
    assert len(mine.axes) == len(own.axes)
    found, expected = [content(ax) for ax in axes], [content(ax) for ax in own.axes[:panels]]
    for one, other in zip(found, expected, strict=True):
        inner = ("up",) if not other["up"] else ()
        assert {k: v for k, v in one.items() if k not in inner} == {
            k: v for k, v in other.items() if k not in inner
        }
    assert axes[-1].get_xlabel() == own.axes[panels - 1].get_xlabel()
    assert all(ax.get_xlabel() for ax in axes)
    legends = [ax.get_legend() for ax in axes if ax.get_legend()]
    texts = [text.get_text() for legend in legends for text in legend.get_texts()]
    assert texts == (legend_texts(own) if own.legends else [])
    assert not mine.texts and not any(ax.get_title(loc="left") for ax in axes)
    plt.close(mine)


def test_panels_of_a_figure_lie_beside_each_other(made: Callable, library: Path) -> None:
    """Legends, colour bars, names of regions, titles: in a constrained layout none covers another panel."""
    with style.context():
        figure, axes = plt.subplots(2, 2, figsize=(7, 6), layout="constrained")
    made("basin").separatrix.plot(ax=axes[0, 0])
    made("sweep").separatrix.plot("amplitude", ax=axes[0, 1], title="A sweep")
    made("trajectory").separatrix.plot("phase", ax=axes[1, 0])
    made("basin").separatrix.plot("settle_time", ax=axes[1, 1])
    for letter, ax in zip("abcd", axes.flat, strict=True):
        ax.set_title(letter, loc="left")
    figure.canvas.draw()
    boxes = [ax.get_tightbbox() for ax in figure.axes]
    for index, box in enumerate(boxes):
        assert all(box.width * box.height > 0 and not box.overlaps(other) for other in boxes[:index])
        assert 0 <= box.x0 < box.x1 <= figure.bbox.x1 and 0 <= box.y0 < box.y1 <= figure.bbox.y1
    assert figure.axes[4].get_position().x0 > axes[1, 1].get_position().x1
    for ax in axes[0]:
        legend, label = ax.get_legend().get_window_extent(), ax.xaxis.label.get_window_extent()
        assert legend.y1 <= label.y0 + 1
    assert axes[0, 1].get_title() == "A sweep"
    title = axes[0, 1].title.get_window_extent()
    assert not any(text.get_window_extent().overlaps(title) for text in axes[0, 1].texts)
    plt.close(figure)


def test_parts_of_figures_and_lists_are_taken(made: Callable, library: Path) -> None:
    """The whole figure is returned; axes that share labels keep sharing them."""
    figure = Figure(figsize=(7, 5), layout="constrained")
    left, right = figure.subfigures(1, 2)
    assert made("trajectory").separatrix.plot("history", ax=list(left.subplots(2, 1))) is figure
    shared = right.subplots(2, 1, sharex=True)
    assert made("sweep").separatrix.plot("bifurcation", ax=shared) is figure
    assert not shared[0].get_xlabel() and shared[1].get_xlabel()
    assert made("points").separatrix.plot(ax=None).separatrix_caption


@pytest.mark.parametrize(
    ("kind", "name", "number", "more", "message"),
    [
        (
            "trajectory",
            "history",
            1,
            {},
            "ax: found 1 axes, this figure needs 2 in a sequence, one for each panel",
        ),
        ("trajectory", "phase", 2, {}, "ax: found 2 axes, this figure needs 1"),
        ("stack", "attractor", 2, {}, "ax: found 2 axes, this figure needs 3"),
        ("basin", "attractor", 1, {"inset": {"x0": (-0.5, 0.6), "v0": (-3, 3)}}, "this figure needs 2"),
        ("points", "regime", 1, {"size": (80, 60)}, "size: the axes given by ax have one"),
        ("points", "regime", 1, {"style_sheet": "ggplot"}, "style_sheet: the axes given by ax have their"),
        ("points", "history", 1, {}, "no figure 'history'; there are regime"),
        ("points", "regime", 0, {"ax": "axes"}, "ax: found 'axes', allowed axes of matplotlib"),
    ],
)
def test_a_wrong_request_draws_nothing(
    made: Callable, library: Path, kind: str, name: str, number: int, more: dict, message: str
) -> None:
    figure = Figure()
    axes = [figure.add_subplot(2, 2, k + 1) for k in range(number)]
    with pytest.raises(SeparatrixError) as raised:
        made(kind).separatrix.plot(name, **{"ax": axes, **more})
    assert message in str(raised.value)
    assert not any(ax.has_data() for ax in axes)
    assert len(figure.axes) == number


def test_one_axes_holds_the_section_of_a_sweep(made: Callable) -> None:
    result = made("sweep")
    upper = content(result.separatrix.plot("bifurcation").axes[0])
    ax = Figure().add_subplot()
    result.separatrix.plot("bifurcation", ax=ax)
    found = content(ax)
    assert {key: found[key] for key in ("lines", "points", "limits", "up")} == {
        key: upper[key] for key in ("lines", "points", "limits", "up")
    }
    assert ax.get_xlabel() == result.separatrix.plot("bifurcation").axes[1].get_xlabel()


def test_films_have_no_axes(made: Callable, tmp_path: Path) -> None:
    with pytest.raises(SeparatrixError, match="ax: not served by films"):
        made("stack").separatrix.animate("drive.ratio", tmp_path / "film.gif", ax=Figure().add_subplot())


def section_of(motion: xr.Dataset, **wishes: float) -> np.ndarray:
    """The points of the section as the figure shows them."""
    (line,) = motion.separatrix.plot("section", **wishes).axes[0].lines
    return np.asarray(line.get_xydata())


def test_points_of_the_section_lie_on_the_motion(library: Path, source_dir: Path) -> None:
    """Each is reached from the one before in one drive period, half of the motion is transient."""
    motion = strange(source_dir, 60, samples=4)
    points, period = section_of(motion), float(motion.attrs["drive_period"])
    assert len(points) == 31
    case = motion.separatrix.case
    for (x, v), following in zip(points[:5], points[1:6], strict=True):
        one = sx.trajectory(case, x, v, duration=period, samples=4)
        assert (float(one.x[-1]), float(one.v[-1])) == pytest.approx(tuple(following), abs=1e-9)
    assert section_of(motion, transient=0)[0] == pytest.approx((-1.0, 0.3))
    assert len(section_of(motion, transient=0)) == 61
    assert section_of(motion, transient=55) == pytest.approx(points[-6:])


def test_a_section_is_at_the_nearest_sampled_phase(library: Path, source_dir: Path) -> None:
    """The phase is that of the drive, whatever the crank angle of the start; the caption names it."""
    motion = strange(source_dir, 60, samples=4)
    quarter = np.column_stack([motion.x, motion.v])[1::4]
    for angle in (1.5, 1.5 - 2 * np.pi, 1.4):
        assert section_of(motion, crank_angle=angle, transient=0) == pytest.approx(quarter[:60])
    caption = motion.separatrix.plot("section", crank_angle=1.5).separatrix_caption
    assert caption.startswith(
        "30 points, one in each drive period at crank angle 1.571 rad; without the first 30.25"
    )
    later = sx.trajectory(motion.separatrix.case, *quarter[0], np.pi / 2, duration=20.0, samples=4)
    assert section_of(later, transient=0)[0] == pytest.approx(quarter[0])
    assert "crank angle 1.571 rad" in later.separatrix.plot("section").separatrix_caption


def test_a_section_needs_a_drive_and_periods(library: Path, made: Callable, source_dir: Path) -> None:
    """Long motions have one without a request, short ones on request, undriven ones none."""
    with pytest.raises(SeparatrixError, match="no figure 'section'; there are history, energy, phase"):
        two_bodies().separatrix.plot("section")
    assert len(section_of(two_bodies("sine"))) == 8
    short = made("trajectory")
    assert "section" not in list(trajectory.figures(short, "")) and "section" in trajectory.figures(short, "")
    assert "section" in list(trajectory.figures(made("strange"), ""))
    with pytest.raises(
        SeparatrixError, match="found 20 drive periods, 30 of them transient; no sample is left"
    ):
        short.separatrix.plot("section", transient=30)
    with pytest.raises(SeparatrixError, match="crank angle: not served by the figures of a map"):
        made("basin").separatrix.plot(crank_angle=1.0)


def test_the_command_draws_sections_of_long_motions(tmp_path: Path) -> None:
    path = write_trajectory(tmp_path / "long.h5")
    assert cli.main([str(path), "--formats", "png", "--dpi", "60", "--transient", "3"]) == 0
    assert not (tmp_path / "long_section.png").exists()
    with h5py.File(path, "r+") as file:
        file.attrs["drive_period"] = 0.05
    assert cli.main([str(path), "--formats", "png", "--dpi", "60", "--crank-angle", "1.5"]) == 0
    assert (tmp_path / "long_section.png").is_file()


def test_limits_have_the_unit_of_their_axis() -> None:
    limits = xr.Dataset({"limits_lower": ("limit", [0.5], {"units": "m"})})
    changed = Look(units="mm").selected(limits)["limits_lower"]
    assert (float(changed[0]), changed.attrs["units"]) == (500.0, "mm")


@pytest.mark.parametrize("wish", [{"crank_angle": 0.0}, {"transient": 0.0}, {"units": ["mm"]}])
def test_what_a_kind_does_not_serve_is_refused_also_where_it_is_zero(wish):
    with pytest.raises(SeparatrixError, match="not served by the figures of a map"):
        Look(**wish).require("map", "region")
