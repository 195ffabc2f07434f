# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a figure is asked to look like: ranges, slices, units, colours, marks, shading, films."""

import importlib.machinery
import itertools
import sys
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import separatrix as sx
import xarray as xr
from figure_probes import V0, X0, colour_at, legend_texts
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from PIL import Image
from program import CASE
from sample_files import write_basin, write_sweep
from separatrix import cli, style
from separatrix.classes import classes
from separatrix.errors import SeparatrixError
from separatrix.figures import basin, section, sweep
from separatrix.figures import contact as contacts
from separatrix.figures.animation import animate, ffmpeg
from separatrix.figures.difference import differing
from separatrix.figures.look import Look
from separatrix.labels import symbol
from separatrix.open import open_result

RATIOS = np.array([1.1, 1.2, 1.3])
# Machado, Oliveira and Fernandes (2009) at full severity, on linear RGB
BLINDNESS = {
    "none": np.eye(3),
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}


def lab(colour: str, seen: str = "none") -> np.ndarray:
    """CIE L*a*b* of a colour as somebody sees it."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    linear = np.clip(np.array(BLINDNESS[seen]) @ linear, 0, 1)
    to_xyz = [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.119192, 0.9503041],
    ]
    xyz = np.array(to_xyz) @ linear / [0.95047, 1.0, 1.08883]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def test_colours_differ_in_grey_and_for_the_colour_blind() -> None:
    first = style.ATTRACTORS[:3]
    assert min(abs(lab(a)[0] - lab(b)[0]) for a, b in itertools.combinations(first, 2)) > 20
    regimes = [style.REGIMES[name] for name in ("non_impact", "impact", "mixed")]
    assert min(abs(lab(a)[0] - lab(b)[0]) for a, b in itertools.combinations(regimes, 2)) > 20
    for seen in BLINDNESS:
        pairs = itertools.combinations(style.ATTRACTORS, 2)
        assert min(np.linalg.norm(lab(a, seen) - lab(b, seen)) for a, b in pairs) > 20, seen


def stack(path: Path) -> tuple[Path, np.ndarray]:
    """A map over two starts and a ratio, of three attractors by chance."""
    attractor = np.random.default_rng(4).integers(1, 4, (7, 4, 3))
    axes = {"x0": X0, "v0": V0, "drive_ratio": RATIOS}
    return write_basin(path, axes, attractor, regime_of=(0, 1, 2, 3)), attractor


def drawn(path: Path, look: Look, field: str = "attractor") -> object:
    with style.context(), open_result(path) as result:
        return basin.basin_map(path, result, field, "title", look)


def test_the_first_figure_of_a_map_shows_its_attractors(tmp_path: Path) -> None:
    with open_result(stack(tmp_path / "b.h5")[0]) as result:
        assert list(basin.figures(None, result, None, "title")) == ["attractor", "regime"]


def test_ranges_slices_axes_and_units_show_the_same_points(tmp_path: Path) -> None:
    path, attractor = stack(tmp_path / "b.h5")
    look = Look(
        region={"x0": (-0.5, 0.6)}, slice={"drive.ratio": 1.22}, axes=("v0", "x0"), units=["mm", "cm/s"],
        colours=["#ff0000", "#00ff00", "#0000ff"],
    )  # fmt: skip
    figure = drawn(path, look)
    assert len(figure.axes) == 1
    assert "(mm)" in figure.axes[0].get_ylabel()
    assert "(cm/s)" in figure.axes[0].get_xlabel()
    inside = np.flatnonzero((X0 >= -0.5) & (X0 <= 0.6))
    for i in inside:
        for j, v in enumerate(V0):
            expected = np.eye(3)[attractor[i, j, 1] - 1]
            assert colour_at(figure, 100 * v, 1000 * X0[i]) == pytest.approx(expected, abs=0.01)
    low, high = figure.axes[0].get_ylim()
    assert (low, high) == pytest.approx((1000 * X0[inside[0]] - 150, 1000 * X0[inside[-1]] + 150))
    # shares are those of what is shown
    shown = attractor[inside, :, 1]
    share = f"({100 * np.mean(shown == 1):.1f}"
    assert legend_texts(figure)[0].split(": ")[1].find(share) > 0


def test_an_inset_shows_the_colours_of_the_map_beside_it(tmp_path: Path) -> None:
    path, attractor = stack(tmp_path / "b.h5")
    ranges = {"x0": (-0.5, 0.6), "v0": (-3.0, 3.0)}
    look = Look(slice={"drive.ratio": 1.2}, units=["mm"], inset=ranges, colours=["red", "lime", "blue"])
    figure = drawn(path, look)
    main, inset = figure.axes
    assert legend_texts(figure) == legend_texts(drawn(path, replace(look, inset={})))
    xs, vs = (
        axis[(axis >= low) & (axis <= high)]
        for axis, (low, high) in zip((X0, V0), ranges.values(), strict=True)
    )
    for x, v in itertools.product(xs, vs):
        expected = np.eye(3)[attractor[list(X0).index(x), list(V0).index(v), 1] - 1]
        assert colour_at(figure, 1000 * x, v, panel=1) == pytest.approx(expected, abs=0.01)
    half = 500 * (X0[1] - X0[0]), (V0[1] - V0[0]) / 2
    assert inset.get_xlim() == pytest.approx((1000 * xs[0] - half[0], 1000 * xs[-1] + half[0]))
    # the frame on the map is what the inset shows, which lies beside it
    (box,) = main.patches
    assert box.get_bbox().get_points() == pytest.approx(np.array([inset.get_xlim(), inset.get_ylim()]).T)
    assert main.get_tightbbox().x1 < inset.get_tightbbox().x0
    assert f"right: the part framed, {xs.size * vs.size} points" in figure.separatrix_caption


@pytest.mark.parametrize("field", ["attractor", "settle_time"])
def test_an_inset_has_the_shades_and_the_scale_of_its_map(tmp_path: Path, field: str) -> None:
    times = np.random.default_rng(2).random((7, 4))
    times[3, 1] = np.nan
    attractor = np.random.default_rng(3).integers(1, 3, (7, 4))
    path = write_basin(tmp_path / "b.h5", {"x0": X0, "v0": V0}, attractor, fields={"settle_time": times})
    ranges = {"x0": (-0.5, 0.6), "v0": (-3.0, 7.0)}
    figure = drawn(path, Look(shade=True, attractors=False, inset=ranges), field)
    for x, v in itertools.product(X0[(X0 >= -0.5) & (X0 <= 0.6)], V0[V0 >= -3]):
        assert colour_at(figure, x, v, panel=1) == pytest.approx(colour_at(figure, x, v), abs=0.01)


def test_shading_keeps_the_hue_and_gets_darker_with_time(tmp_path: Path) -> None:
    attractor = np.ones((7, 4), int)
    attractor[:, 2:] = 2
    times = np.arange(28.0).reshape(7, 4)
    path = write_basin(tmp_path / "b.h5", {"x0": X0, "v0": V0}, attractor, fields={"settle_time": times})
    figure = drawn(path, Look(shade=True, attractors=False))
    assert "light: settles early" in figure.separatrix_caption
    for columns in ((0, 1), (2, 3)):
        order = sorted((times[i, j], i, j) for i in range(7) for j in columns)
        lightness = [sum(colour_at(figure, X0[i], V0[j])) for _, i, j in order]
        assert lightness == sorted(lightness, reverse=True)
        assert lightness[0] > lightness[-1] + 0.5


def test_attractors_of_one_class_are_distinguished(library: Path) -> None:
    """By their event words where those differ, else by their amplitudes; others have neither."""
    attractors = {"attractor": [1, 2, 3], "period": [2, 2, 1], "event_word": [0o71, 0o711, 0o71]}
    result = sx.basin(sx.Case.from_text(CASE), x0=4, v0=4, progress=False)
    for words, expected in (
        ([0o711, 0o11, 0o7], ["impact, period 2, RR.", "impact, period 2, RR", "impact, period 1"]),
        (
            [0o711, 0o711, 0o711],
            ["impact, period 2, amplitude 0.1 m", "impact, period 2, amplitude 0.25 m", "impact, period 1"],
        ),
        ([0, 0, 0], ["impact, period 2, x = -1 m", "impact, period 2, x = 1 m", "impact, period 1"]),
    ):
        catalogue = {name: ("entry", np.array(values)) for name, values in attractors.items()}
        catalogue |= {
            "event_word": ("entry", np.array(words)),
            "regime": ("entry", np.full(3, 2)),
            "amplitude": ("entry", np.array([0.1, 0.25, 0.3]) * any(words), {"units": "m"}),
            "x": ("entry", np.array([-1.0, 1.0, 1.0]), {"units": "m"}),
        }
        plain = result.drop_vars([name for name in result.variables if str(name).startswith("catalogue_")])
        changed = plain.assign({f"catalogue_{name}": entry for name, entry in catalogue.items()})
        texts = [entry.text for entry in classes(changed, "attractor", dict.fromkeys((1, 2, 3), 1))]
        assert texts == [f"attractor {number}: {text}" for number, text in enumerate(expected, 1)]
    # of an angle, and what is 0 to rounding
    changed["catalogue_x"] = ("entry", np.array([-1e-16, 3.0, 1.0]), {"units": "m"})
    changed["amplitude"].attrs["units"] = "rad"
    texts = [entry.text for entry in classes(changed, "attractor", dict.fromkeys((1, 2, 3), 1))]
    assert [text.partition(", x ")[2] for text in texts] == ["= 0 rad", "= 3 rad", ""]


def longest(ax: Axes) -> Line2D:
    return max(ax.lines, key=lambda line: len(line.get_xdata()))


def test_figures_of_motions_points_and_branches_take_units(library: Path) -> None:
    """Lengths, speeds and times of axes, barriers, captions and contacts alike."""
    case = sx.Case.from_text(CASE).with_(
        contact={"law": "kelvin_voigt", "stiffness": 1e4, "damping": 5, "upper": 1.2}
    )
    motion = sx.trajectory(case, 0.5, 8.0, duration=20.0, samples=200)
    units = ["mm", "cm/s", "ms"]
    for name in ("history", "phase", "contact"):
        given, asked = (motion.separatrix.plot(name, units=wish) for wish in ([], units))
        for before, after in zip(given.axes, asked.axes, strict=True):
            for axis in ("x", "y"):
                label = getattr(after, f"get_{axis}label")()
                factor = next(
                    (f for unit, f in zip(units, (1e3, 1e2, 1e3), strict=True) if f"({unit})" in label), 1
                )
                assert factor > 1 or "(N)" in label
                data = [longest(ax).get_data()[axis == "y"] for ax in (before, after)]
                ends = [np.array([np.nanmin(values), np.nanmax(values)]) for values in data]
                assert ends[1] == pytest.approx(factor * ends[0], rel=1e-6)
    caption = motion.separatrix.plot("phase", units=units).separatrix_caption
    assert "$x_0$ = 500 mm, $v_0$ = 800 cm/s" in caption
    starts = sx.points(sx.Case.from_text(CASE), x0=[0.1, 0.2, 0.3], v0=[0.0, 1.0, 2.0], progress=False)
    drawn = starts.separatrix.plot(units=["mm"])
    assert "(mm)" in drawn.axes[0].get_xlabel()
    assert drawn.axes[0].collections[0].get_offsets()[:, 0].max() == pytest.approx(300.0)


def test_marks_lie_on_the_attractors(library: Path) -> None:
    """A point on the section comes back after its period, at any crank angle of the starts."""
    for angle in (0.0, 1.0, 6.0):
        case = sx.Case.from_text(CASE).with_(start__crank_angle=angle)
        result = sx.basin(case, x0=9, v0=9, progress=False)
        found = list(section.points(result, {}))
        assert len(found) == 2
        for identity, xs, vs in found:
            row = result.separatrix.attractors.loc[identity]
            assert len(xs) == row["period"]
            period = 2 * np.pi / case.model.drive_frequency({})
            motion = sx.trajectory(case, xs[-1], vs[-1], duration=period * row["period"], samples=50)
            end = float(motion.x[-1]), float(motion.v[-1])
            assert end == pytest.approx((xs[-1], vs[-1]), abs=1e-5)
            if angle == 0.0:
                assert (xs[0], vs[0]) == (row["x"], row["v"])


def test_attractors_of_several_bodies_are_not_marked(library: Path) -> None:
    """The plane of one body does not hold them: a mark would lie anywhere, also in another basin."""
    case = sx.Case.from_dict(
        {
            "body": {"a": {"mass": 1.0}, "b": {"mass": 1.0}},
            "spring": {
                "ground": {"between": ["a"], "stiffness": 1.0, "damping": 0.2},
                "link": {"between": ["a", "b"], "stiffness": 1.0, "damping": 0.2},
            },
            "drive": {"shaker": {"law": "force", "body": "a", "amplitude": 0.6, "frequency": 1.3}},
            "watch": {"body": "b"},
            "run": {"duration": 100.0},
        }
    )
    result = sx.basin(case, x0=(-1.0, 1.0, 4), v0=(-1.0, 1.0, 4))
    assert result.separatrix.attractors["period"].tolist() == [1]
    assert list(section.points(result, {})) == []
    figure = result.separatrix.plot("attractor", caption="full")
    assert all(line.get_markerfacecolor() != "white" for line in figure.axes[0].lines)
    assert "attractors are not marked" in figure.separatrix_caption


def test_marks_are_those_of_the_slice(library: Path) -> None:
    result = sx.basin(sx.Case.from_text(CASE), drive__ratio=[1.1, 1.2, 1.3], x0=9, v0=9, progress=False)
    one = sx.basin(sx.Case.from_text(CASE).with_(drive__ratio=1.2), x0=9, v0=9, progress=False)
    mine = np.concatenate([points[1:] for points in section.points(result, {"drive_ratio": 1})], axis=1)
    theirs = np.concatenate([points[1:] for points in section.points(one, {})], axis=1)
    np.testing.assert_allclose(mine[:, mine[0].argsort()], theirs[:, theirs[0].argsort()], atol=1e-6)
    figure = result.separatrix.plot("attractor", slice={"drive.ratio": 1.2}, units=["mm"])
    marks = [line for line in figure.axes[0].lines if line.get_markerfacecolor() == "white"]
    assert sorted(x for line in marks for x in line.get_xdata()) == pytest.approx(sorted(1000 * mine[0]))


def test_a_ratio_is_shown_as_a_frequency(library: Path) -> None:
    """Of a spring of c = 9 pi^2 N/m and a mass of 1 kg the ratio 1 is 1.5 Hz, 90 rpm and 3 pi rad/s."""
    case = sx.Case.from_text(CASE)
    result = sx.sweep(case, progress=False)
    brackets = result["limits_lower"].values
    for asked, worth in (("Hz", 1.5), ("rpm", 90.0), ("rad/s", 3 * np.pi)):
        ax = result.separatrix.plot("amplitude", units=asked).axes[0]
        assert ax.get_xlim() == pytest.approx((0.8 * worth, 1.4 * worth), abs=0.02 * worth)
        assert f"({asked})" in ax.get_xlabel() and "ratio" not in ax.get_xlabel()
        shown = Look(units=asked).selected(result)["limits_lower"].values
        np.testing.assert_allclose(shown, worth * brackets)
    ratios = sx.basin(case, drive__ratio=[1.1, 1.2], x0=4, v0=4, progress=False)
    assert [ax.get_title().split("\n")[0] for ax in ratios.separatrix.plot(units=["Hz"]).axes[:2]] == [
        "$f$ = 1.65 Hz",
        "$f$ = 1.8 Hz",
    ]
    varied = sx.basin(case, drive__ratio=[1.1, 1.2], body__mass=[0.9, 1.1], progress=False)
    with pytest.raises(SeparatrixError, match=r"no single natural frequency: body\.mass varies"):
        varied.separatrix.plot("regime", units=["Hz"])


def test_frequencies_are_not_angular_velocities() -> None:
    """Hz belongs to a frequency in rad/s, deg/s to the velocity of an angle, whatever their order."""
    data = {"v": ("drive_motor_frequency", [np.pi, 2 * np.pi], {"units": "rad/s", "long_name": "velocity"})}
    two = "[drive.motor]\nfrequency = 1.0\n[drive.shaker]\nfrequency = 2.0\n"
    frequency = (
        "drive_motor_frequency",
        [2 * np.pi, 4 * np.pi],
        {"units": "rad/s", "long_name": "angular frequency"},
    )
    result = xr.Dataset(data, {"drive_motor_frequency": frequency}, {"resolved_case": two})
    for units in (("Hz", "deg/s"), ("deg/s", "Hz")):
        shown = Look(units=units).selected(result)
        np.testing.assert_allclose(shown["drive_motor_frequency"], [1, 2])
        np.testing.assert_allclose(shown["v"], [180, 360])
        assert (shown["v"].units, shown["drive_motor_frequency"].long_name) == ("deg/s", "frequency")
        assert symbol(shown["drive_motor_frequency"]) == "frequency"
        single = Look(units=units).selected(result.assign_attrs(resolved_case="[drive.motor]\nfrequency = 1"))
        assert symbol(single["drive_motor_frequency"]) == "$f$"
    # what is no frequency keeps its size
    assert Look(units=("Hz", "rad/s")).factor("rad/s") == 1.0


def test_forces_of_contacts_have_units() -> None:
    motion = xr.Dataset({"contact_force": ("time", [2e3], {"units": "N"})})
    assert float(Look(units="kN").selected(motion)["contact_force"][0]) == 2.0


def test_shares_over_a_parameter_add_up(tmp_path: Path) -> None:
    path, attractor = stack(tmp_path / "b.h5")
    with open_result(path) as result:
        figure = basin.figures(None, result, "shares", "title")["shares"]
    figure.canvas.draw()
    ax = figure.axes[0]
    for k, ratio in enumerate(RATIOS):
        share = 100 * np.mean(attractor[..., k] == 1)
        inside = np.clip(ratio, RATIOS[0] + 0.01, RATIOS[-1] - 0.01)
        for height, identity in ((share - 3, 1), (share + 3, 2)):
            expected = to_rgb(style.ATTRACTORS[identity - 1])
            assert colour_at(figure, inside, height) == pytest.approx(expected, abs=0.02)
    assert ax.get_ylim() == (0, 100)


def test_a_film_has_a_frame_for_each_value(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, _ = stack(tmp_path / "b.h5")
    with open_result(path) as result:
        film = animate(result, "drive.ratio", tmp_path / "film.gif", "title", dpi=60)
        with Image.open(film) as image:
            assert image.n_frames == 3
        monkeypatch.setenv("PATH", "")
        with pytest.raises(SeparatrixError, match="needs ffmpeg"):
            animate(result, "drive.ratio", tmp_path / "film.mp4", "title")
        with pytest.raises(SeparatrixError, match="allowed are .gif and .mp4"):
            animate(result, "drive.ratio", tmp_path / "film.avi", "title")
        with pytest.raises(SeparatrixError, match="found the axes x0, v0, drive_ratio"):
            animate(result, "contact.upper", tmp_path / "film.gif", "title")


def test_runs_that_agree_are_drawn_as_one(tmp_path: Path) -> None:
    path = write_sweep(tmp_path / "s.h5", np.linspace(0.7, 1.8, 45))
    with style.context(), open_result(path) as result:
        figure = sweep.bifurcation_diagram(result, "title")
        drawn_points = sum(len(points.get_offsets()) for points in figure.axes[0].collections)
        section = result["section_x"].values
        agree = sweep._runs_agree(section)
    assert agree.any()
    assert not agree.all()
    assert drawn_points == section[0].size + section[0][~agree].size
    assert legend_texts(figure)[:3] == ["run-up", "run-down", "both alike"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--region", "x0=5:6"], "region x0: found 5 to 6, allowed -1 to 0.8"),
        (["--region", "x0=1:0"], "is not A:B"),
        (["--region", "y0=0:1"], "no axis 'y0'; there are x0, v0, drive_ratio"),
        (["--slice", "drive.ratio=a"], "is not NAME=VALUE"),
        (["--axes", "x0"], "is not two names"),
        (["--axes", "x0,x0"], "axes: found x0, x0"),
        (["--units", "inch"], "found 'inch', allowed a list out of mm"),
        (["--colours", "nocolour"], "which is no colour"),
        (["--colour-map", "none", "--field", "settle_time"], "which matplotlib does not have"),
        (["--size", "85"], "is not WxH"),
        (["--size", "5x5"], "allowed 10 to 1000 mm"),
        (["--style", "absent.mplstyle"], "no style of matplotlib"),
        (["--animate", "x1"], "found the axes"),
        (["--inset", "x0=-0.5:0.5,v0=-3:3"], "inset: found 3 maps in the figure, allowed one"),
        (
            ["--inset", "x0=-0.5:0.5", "--slice", "drive.ratio=1.2"],
            "inset: found x0, allowed the axes x0 and v0",
        ),
        (
            ["--inset", "x0=5:6,v0=-3:3", "--slice", "drive.ratio=1.2"],
            "inset x0: found 5 to 6, allowed -1 to 0.8",
        ),
        (["--inset", "x0=-0.01:0.01,v0=-3:3", "--slice", "drive.ratio=1.2"], "inset x0: found"),
        (["--inset", "x0=-1:1,v0=-3:3", "--field", "shares"], "inset: not served by the figure of shares"),
    ],
)
def test_wishes_that_make_no_sense_are_one_line(
    tmp_path: Path, options: list, message: str, capsys: pytest.CaptureFixture
) -> None:
    path, _ = stack(tmp_path / "b.h5")
    assert cli.main([str(path), "-o", str(tmp_path / "out"), *options]) == 64
    output = capsys.readouterr().err
    assert message in output
    assert output.count("\n") == 1
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


def test_a_style_file_and_svg_are_taken(tmp_path: Path) -> None:
    path, _ = stack(tmp_path / "b.h5")
    sheet = tmp_path / "mine.mplstyle"
    sheet.write_text("axes.edgecolor: 12ab34\n")
    options = ["--style", str(sheet), "--formats", "svg", "--field", "regime"]
    assert cli.main([str(path), "-o", str(tmp_path), *options]) == 0
    assert "#12ab34" in (tmp_path / "b_regime.svg").read_text()


def test_impacts_are_seen_at_their_phase(library: Path, source_dir: Path) -> None:
    """A cycle of three impacts in three periods: three points, of the speeds of the events."""
    case = sx.load(source_dir / "docs" / "gallery" / "petals.toml").with_({"start.crank_angle": 0.5})
    motion = sx.trajectory(case, -0.28, 0.087, 0.5, duration=400.0, samples=4)
    assert int(motion.attrs["period"]) in (1, 3)
    figure = motion.separatrix.plot("impacts")
    phase, speed = (np.asarray(values) for values in figure.axes[0].lines[0].get_data())
    late = motion.event_time.values >= 200.0
    struck = late & (motion.event_kind.values == 1)
    assert speed == pytest.approx(motion.event_v_before.values[struck])
    period = float(motion.attrs["drive_period"])
    assert phase == pytest.approx(
        np.degrees(0.5 + 2 * np.pi * motion.event_time.values[struck] / period) % 360
    )
    # settled: as many points as the cycle has impacts
    assert len(np.unique(phase.round(3))) == int(motion.attrs["period"])


def test_a_film_is_written_by_the_package_where_there_is_no_program(monkeypatch: pytest.MonkeyPatch) -> None:
    package = types.ModuleType("imageio_ffmpeg")
    package.get_ffmpeg_exe = lambda: "/there/ffmpeg"
    package.__spec__ = importlib.machinery.ModuleSpec("imageio_ffmpeg", None)
    monkeypatch.setenv("PATH", "")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", package)
    assert ffmpeg() == "/there/ffmpeg"


def test_two_maps_are_compared_point_by_point(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Black is where the motion differs, whatever the numbers of the attractors; other points are refused."""
    attractor = np.where(np.arange(X0.size)[:, None] < X0.size // 2, 1, 2) * np.ones((1, V0.size), int)
    changed = attractor.copy()
    changed[0, :] = 2
    one = write_basin(tmp_path / "one.h5", {"x0": X0, "v0": V0}, attractor)
    renumbered = write_basin(tmp_path / "two.h5", {"x0": X0, "v0": V0}, 3 - changed, regime_of=(0, 2, 1))
    with open_result(one) as first, open_result(renumbered) as second:
        mask = differing(first, second)
        assert mask.values[0].all()
        assert not mask.values[1:].any()
        figure = first.separatrix.difference(second)
        assert colour_at(figure, X0[0], V0[1]) == (0.0, 0.0, 0.0)
        assert colour_at(figure, X0[1], V0[1]) == pytest.approx(to_rgb(style.ATTRACTORS[0]), abs=0.02)
        assert legend_texts(figure)[-1] == f"another motion ({100 / X0.size:.3g} %)"
        with pytest.raises(SeparatrixError, match="the same points along x0"):
            first.separatrix.difference(second.isel(x0=slice(1, None)))
    assert cli.main([str(one), str(renumbered), "--difference", "--formats", "png", "--dpi", "60"]) == 0
    assert (tmp_path / "one_difference.png").is_file()
    assert cli.main([str(one), "--difference", "--formats", "png", "--dpi", "60"]) == 64
    assert "found 1 files, allowed 2" in capsys.readouterr().err


@pytest.mark.parametrize(("units", "force"), [(("m", "m/s"), "N"), (("rad", "rad/s"), "N m")])
def test_contacts_of_an_angle_have_its_units(units: tuple[str, str], force: str) -> None:
    """Penetration, speed and force as the file has them; those asked for replace their own kind."""
    t = np.arange(400) / 100
    values = {"x": (np.sin(9 * t), units[0]), "v": (9 * np.cos(9 * t), units[1])}
    values["contact_force"] = (-np.maximum(np.sin(9 * t) - 0.5, 0), force)
    motion = xr.Dataset(
        {name: ("time", column, {"units": unit}) for name, (column, unit) in values.items()},
        {"time": ("time", t, {"units": "s"})},
        {"barrier_upper": 0.5, "kind": "trajectory"},
    )
    figure = contacts.loops(motion, "loops", Look(units=("deg", "mm")))
    shown = {"m": "mm", "rad": "deg"}[units[0]]
    assert figure.axes[0].get_xlabel() == f"penetration ({shown})"
    assert figure.axes[0].get_ylabel() == f"force of the barrier ({force})"
    deepest = max(np.max(line.get_xdata()) for line in figure.axes[0].lines if len(line.get_xdata()) > 2)
    assert deepest == pytest.approx(0.5 * {"mm": 1e3, "deg": 180 / np.pi}[shown], rel=1e-2)
