# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""`result.separatrix`: what a result knows beyond its arrays, and its figures."""

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from separatrix.cases import Case
from separatrix.derived import at_points, derived_names, labels_of, slices_of
from separatrix.errors import USAGE, SeparatrixError
from separatrix.open import decode_flags, decode_words, flag_names, table
from separatrix.variables import KINDS, REGIMES

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from separatrix.figures.look import Look


@xr.register_dataset_accessor("separatrix")
class Accessor:
    """The result of `basin`, `boundary`, `sweep`, `points`, `branches`, `trajectory`, `measures_along`."""

    def __init__(self, result: xr.Dataset) -> None:
        """Take any Dataset; what is no result is refused when it is asked."""
        self._result = result

    @property
    def kind(self) -> str:
        """The kind of result: basin, boundary, sweep, points, branches, trajectory or measures."""
        kind = self._result.attrs.get("kind")
        if kind is None:
            raise SeparatrixError("this Dataset is no result of Separatrix (no attribute kind)", USAGE)
        return str(kind)

    @property
    def case(self) -> Case:
        """The resolved case that the result was computed from."""
        if "resolved_case" not in self._result.attrs:
            raise SeparatrixError("this Dataset does not contain the case that it was computed from", USAGE)
        return Case.from_text(str(self._result.attrs["resolved_case"]))

    @property
    def attractors(self) -> "pandas.DataFrame":
        """The attractors of a map, or of the many starts of a sweep.

        Their regime, period, word, fixed point, multiplier, share of the points, ...
        Of a motor `crank_speed` [rad/s], `torque` and `power` are means; `crank_outcome` is the
        side of the resonance.
        `grazing_margin` is NaN where no turning point missed a barrier.
        """
        self._require("basin", "sweep")
        catalogue = table(self._result, "catalogue")
        if "attractor" not in catalogue:
            lacks = "map has no catalogue: none of its axes is a start"
            if self.kind == "sweep":
                lacks = "sweep has no catalogue: it has no starts"
            raise SeparatrixError(f"this {lacks}", USAGE)
        # multipliers and section points have further dimensions
        frame = xr.Dataset({k: v for k, v in catalogue.items() if v.dims == ("entry",)}).to_dataframe()
        if "kind" in catalogue:
            frame["kind"] = [KINDS[code - 1] for code in catalogue["kind"].values]
        frame["regime"] = [REGIMES[code] for code in catalogue["regime"].values]
        frame["event_word"] = decode_words(catalogue["event_word"]).values
        if "crank_outcome" in catalogue:
            frame["crank_outcome"] = decode_flags(catalogue["crank_outcome"]).values
        # not a number where no turning point missed a barrier; files of version 1 have the largest number
        margins = frame["grazing_margin"]
        frame["grazing_margin"] = margins.where(margins < np.finfo(float).max)
        slices = np.unique(catalogue["slice"].values).size
        frame.insert(2, "share", frame["count"] * slices / labels_of(self._result).size)
        return frame.set_index(["slice", "attractor"] if slices > 1 else "attractor")

    def of_attractor(self, column: str) -> xr.DataArray:
        """Return a number of `attractors` at every point: that of its attractor, NaN without one."""
        values = self.attractors[column]
        if values.dtype.kind not in "fi":
            raise SeparatrixError(f"column '{column}' is no number", USAGE)
        labels = labels_of(self._result)
        keys = labels.values.ravel().tolist()
        if values.index.nlevels > 1:
            slices = np.broadcast_to(slices_of(labels), labels.shape)
            keys = list(zip(slices.ravel().tolist(), keys, strict=True))
        found = values.to_dict()
        numbers = np.array([found.get(key, np.nan) for key in keys], float).reshape(labels.shape)
        return xr.DataArray(numbers, labels.coords, labels.dims, column)

    @property
    def labelled_points(self) -> "pandas.DataFrame":
        """The labelled points of branches: folds, period doublings, grazes, ends of the range, ..."""
        self._require("branches")
        found = self._result
        if "label" not in found:
            raise SeparatrixError("no periodic orbits, only equilibria", USAGE)
        labels = self.decoded("label").values
        chosen = np.flatnonzero(labels != "none")
        columns = ("branch", "parameter", "period", "impacts", "x", "v", "x_min", "x_max")
        import pandas

        frame = pandas.DataFrame({name: found[name].values[chosen] for name in columns})
        frame.insert(1, "label", labels[chosen])
        frame["event_word"] = self.decoded("event_word").values[chosen]
        multipliers = np.empty(found["multiplier_real"].shape, complex)
        multipliers.real, multipliers.imag = found["multiplier_real"].values, found["multiplier_imag"].values
        for number, values in enumerate(multipliers[chosen].T, 1):
            frame[f"multiplier_{number}"] = values
        return frame.rename(columns={"parameter": str(found.attrs["parameter"])})

    def table(self, name: str | None = None) -> "pandas.DataFrame":
        """Return a table of this result: "attractors", "labelled_points", or that of a variable.

        With a variable of a map, or of the many starts of a sweep, it has their derived quantities too.

        The table of a variable has all variables over the same dimensions: of a trajectory those over time
        with "x", its events with "event_kind". Without a name it is the attractors of a map, the samples of
        a motion, else the table of `regime` or of the first variable. Codes and event words are texts;
        `attrs["units"]` has the unit of each column, but not of attractors and labelled points.
        """
        from separatrix.frames import frame_of

        if name == "attractors" or (name is None and self.kind == "basin" and self._has_catalogue()):
            return self.attractors
        if name == "labelled_points":
            return self.labelled_points
        return frame_of(self._result.assign(self.derived()) if self._has_catalogue() else self._result, name)

    def derived(self) -> dict[str, xr.DataArray]:
        """Return the derived quantities at points, by name; NaN without an attractor.

        Of a map they are called derived_NAME, of the many starts of a sweep branch_derived_NAME.
        """
        self._require("basin", "sweep")
        found = [at_points(self._result, name) for name in derived_names(self._result)]
        return {str(one.name): one for one in found}

    def save_table(self, path: str | Path, name: str | None = None, *, overwrite: bool = False) -> Path:
        """Write a `table` as .csv, at full precision, or with pyarrow as .parquet; return the path."""
        from separatrix.frames import write_frame

        return write_frame(self.table(name), path, overwrite)

    def _has_catalogue(self) -> bool:
        return "catalogue_attractor" in self._result

    def shares(self, field: str = "attractor") -> "pandas.Series":
        """Return the share of the points in each class: attractor, regime, reason, period."""
        if field not in self._result:
            raise SeparatrixError(f"no field '{field}'", USAGE)
        codes, counts = np.unique(self._result[field].values, return_counts=True)
        names = flag_names(self._result[field]) if "flag_values" in self._result[field].attrs else {}
        import pandas

        index = pandas.Index([names.get(int(code), int(code)) for code in codes], name=field)
        return pandas.Series(counts / counts.sum(), index, name="share")

    def decoded(self, field: str) -> xr.DataArray:
        """Return a coded field as text."""
        if field == "event_word":
            return decode_words(self._result[field])
        return decode_flags(self._result[field])

    def trajectory(
        self,
        x0: float | str | None = None,
        v0: float | str | None = None,
        crank_angle: float | str | None = None,
        *,
        duration: float | str | None = None,
        samples: int | None = None,
        **parameters: float | str,
    ) -> xr.Dataset:
        """Return the motion from a start; `drive__ratio=...` puts other values into the machine."""
        from separatrix.motions import trajectory

        case = self.case.with_(parameters) if not parameters else self.case.with_(**parameters)
        return trajectory(case, x0, v0, crank_angle, duration=duration, samples=samples)

    def plot(
        self,
        name: str | None = None,
        *,
        title: str | None = None,
        style_sheet: str | Path | None = None,
        over: xr.Dataset | None = None,
        **wishes: object,
    ) -> "Figure":
        """Return a figure of this result, the first if no `name` is given.

        Names are those of `separatrix-figures`: of a map its fields ("attractor", "regime",
        "settle_time", ...) and "shares", of a sweep "amplitude" and "bifurcation", of a trajectory "history",
        "phase", "section", "energy", "impacts" and "contact", of points "regime", of branches "branches" and
        "curves", of boundaries "boundary", of measures along a parameter "erosion", of survival "survival",
        of a section "section", of exponents "exponents", of maps and sweeps "derived_NAME".
        Notebooks show the figure; `savefig` writes it, `save` in several formats.

        `ax`: axes of matplotlib to draw into; a sequence of them for a figure of several panels. The figure
        that they belong to is returned. Its style is kept, there is no caption, and a title only if given.

        `over`: of boundaries, the map to draw them over.

        `wishes` are the fields of `separatrix.figures.look.Look`: ax=axes, region={"x0": (0, 1)},
        slice={"drive.ratio": 1.2}, inset={"x0": (0, 0.1), "v0": (-1, 1)}, axes=("v0", "x0"), units=["mm"],
        shade=True, attractors=False, colours=[...], colour_map, limits, size=(120, 90), caption="full",
        crank_angle=1.5 and transient=500 of a section.
        """
        from separatrix.figures import (
            basin,
            boundary,
            branches,
            erosion,
            exponents,
            motion_section,
            noise,
            points,
            survival,
            sweep,
            trajectory,
        )

        kind = self.kind
        look = _look(wishes)
        heading = self._heading(title, look)
        if over is not None and kind != "boundary":
            raise SeparatrixError(f"over: belongs to the figure of boundaries, this is a {kind}", USAGE)
        with _style(look, style_sheet):
            if kind == "basin":
                made = basin.figures(None, self._result, name, heading, look)
            elif kind == "boundary":
                made = boundary.figures(None, self._result, heading, look, over)
            else:
                modules = {
                    "sweep": sweep, "trajectory": trajectory, "points": points, "branches": branches,
                    "measures": erosion, "survival": survival, "section": motion_section,
                    "exponents": exponents, "noise": noise, "first_passage": noise,
                }  # fmt: skip
                made = modules[kind].figures(self._result, heading, look)
            return made[name or next(iter(made))]

    def difference(
        self, other: xr.Dataset, field: str | None = None, *, title: str | None = None, **wishes: object
    ) -> "Figure":
        """Return the map of this result with black where `other`, of the same points, has another motion.

        Compared are regime, period and event word. `field` (attractor) and `wishes` as for `plot`.
        """
        from separatrix.figures.difference import difference

        look = _look(wishes)
        with _style(look):
            return difference(self._result, other, field, self._heading(title, look), look)

    def save(
        self,
        stem: str | Path,
        name: str | None = None,
        *,
        formats: Sequence[str] = ("png", "pdf"),
        dpi: int = 300,
        **wishes: object,
    ) -> list[Path]:
        """Write a figure as STEM.png, STEM.pdf, ...; return the paths. `wishes` as for `plot`."""
        from separatrix import style
        from separatrix.save import save

        figure = self.plot(name, **wishes)
        with style.context():
            return save(figure, Path(stem), formats, dpi)

    def animate(
        self,
        parameter: str,
        path: str | Path,
        field: str = "attractor",
        *,
        title: str | None = None,
        frames_per_second: float = 5.0,
        dpi: int = 150,
        **wishes: object,
    ) -> Path:
        """Write a map moving through one of its parameters, as .gif or, with ffmpeg, as .mp4."""
        from separatrix.figures.animation import animate

        self._require("basin")
        look = _look(wishes)
        heading = self._heading(title, look)
        return animate(self._result, parameter, Path(path), heading, field, look, frames_per_second, dpi)

    def film(
        self,
        path: str | Path,
        *,
        begin: float | None = None,
        end: float | None = None,
        speed: float = 1.0,
        frames_per_second: float = 25.0,
        dpi: int = 100,
        title: str | None = None,
    ) -> Path:
        """Write a film of a motion, as .gif or, with ffmpeg, as .mp4; return the path.

        From `begin` to `end` [s], the last ten drive periods if not given. `speed`: seconds of the motion
        in a second of the film.
        """
        from separatrix.figures.film import film

        self._require("trajectory")
        return film(
            self._result,
            Path(path),
            self._heading(title, _look({})),
            begin,
            end,
            speed,
            frames_per_second,
            dpi,
        )

    def _heading(self, title: str | None, look: "Look") -> str:
        """Return the title of a figure: that of the result, but not above axes of the user."""
        from separatrix.labels import plain

        return plain(title or ("" if look.ax else str(self._result.attrs.get("title", ""))))

    def _require(self, *kinds: str) -> None:
        if self.kind not in kinds:
            raise SeparatrixError(f"this is a {self.kind}, not a {' or '.join(kinds)}", USAGE)


def _style(look: "Look", sheet: str | Path | None = None) -> AbstractContextManager:
    """Return the context to draw in; axes of the user keep the style of the user."""
    from separatrix import style

    if not look.ax:
        return style.context(sheet)
    if sheet is not None:
        raise SeparatrixError("style_sheet: the axes given by ax have their style", USAGE)
    return nullcontext()


def _look(wishes: dict[str, object]) -> "Look":
    """The wishes as a Look; unknown ones are named."""
    from dataclasses import fields

    from separatrix.figures.look import Look

    known = [one.name for one in fields(Look)]
    for name in wishes:
        if name not in known:
            raise SeparatrixError(f"found '{name}', allowed {', '.join(known)}", USAGE)
    return Look(**wishes)
