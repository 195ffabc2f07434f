# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a figure is to look: what of the result it shows, in which units, colours and size."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import is_color_like

from separatrix.errors import USAGE, SeparatrixError
from separatrix.figures.frequencies import FREQUENCY, angular, renamed

# unit: SI unit, or frequency, and what one of it is in SI units
UNITS = {
    "mm": ("m", 1e-3), "um": ("m", 1e-6), "cm": ("m", 1e-2), "km": ("m", 1e3),
    "mm/s": ("m/s", 1e-3), "cm/s": ("m/s", 1e-2), "km/h": ("m/s", 1 / 3.6),
    "ms": ("s", 1e-3), "us": ("s", 1e-6), "min": ("s", 60.0), "deg": ("rad", np.pi / 180),
    "deg/s": ("rad/s", np.pi / 180), "g": ("kg", 1e-3), "mN": ("N", 1e-3), "kN": ("N", 1e3),
    "N/mm": ("N/m", 1e3), "kN/m": ("N/m", 1e3), "mJ": ("J", 1e-3), "kJ": ("J", 1e3),
    "Hz": (FREQUENCY, 2 * np.pi), "rpm": (FREQUENCY, np.pi / 30), "rad/s": (FREQUENCY, 1.0),
}  # fmt: skip
CAPTIONS = ("full", "short", "none")
_SERVED_BY_SOME = (
    "region", "slice", "inset", "axes", "units", "shade", "colours", "colour_map", "limits", "crank_angle",
    "transient",
)  # fmt: skip


@dataclass(frozen=True)
class Look:
    """Wishes for a figure; the defaults are those of `separatrix-figures`."""

    #: ranges of axes to show, by name
    region: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    #: values of axes to show, by name; the nearest of the result is taken
    slice: Mapping[str, float] = field(default_factory=dict)
    #: ranges of the two axes of a map that are drawn once more, larger, beside it
    inset: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    #: which axis is horizontal and which vertical
    axes: tuple[str, str] | None = None
    #: units instead of the SI units, each for all that has its SI unit; Hz, rpm and rad/s for frequencies,
    #: also for a ratio to the natural frequency
    units: str | Sequence[str] = ()
    #: the settling time as lightness under the colours of a map
    shade: bool = False
    #: the points of the attractors on the section, in a map over x0 and v0
    attractors: bool = True
    #: colours of the classes, in their order
    colours: Sequence[str] = ()
    #: colour map of a field that is a number, and its range
    colour_map: str | None = None
    limits: tuple[float, float] | None = None
    #: width of the page and height of the axes [mm]
    size: tuple[float, float] | None = None
    #: "short": friction, contact, drive and counts; "full": all that is needed to repeat the run; "none"
    caption: str = "short"
    #: crank angle of a section [rad], the nearest sampled one is taken; unless given that of the start
    crank_angle: float | None = None
    #: drive periods that are discarded before a section; unless given half of the motion
    transient: float | None = None
    #: the axes of matplotlib to draw into, as many as the figure has panels
    ax: Axes | Sequence[Axes] | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn."""
        if isinstance(self.units, str):
            object.__setattr__(self, "units", [self.units])
        kinds = dict.fromkeys(("units", "colours"), (Iterable, "a list"))
        kinds |= dict.fromkeys(("region", "slice", "inset"), (Mapping, "a mapping of names"))
        for name, (kind, allowed) in kinds.items():
            if not isinstance(getattr(self, name), kind):
                raise SeparatrixError(f"{name}: found {getattr(self, name)!r}, allowed {allowed}", USAGE)
        for unit in self.units:
            if unit not in UNITS:
                raise SeparatrixError(f"units: found '{unit}', allowed {', '.join(UNITS)}", USAGE)
        for colour in self.colours:
            if not is_color_like(colour):
                raise SeparatrixError(f"colours: found '{colour}', which is no colour", USAGE)
        if self.caption not in CAPTIONS:
            raise SeparatrixError(f"caption: found '{self.caption}', allowed {', '.join(CAPTIONS)}", USAGE)
        given = () if self.ax is None else np.asarray(self.ax, object).ravel()
        object.__setattr__(self, "ax", tuple(given))
        if not all(isinstance(one, Axes) for one in self.ax):
            raise SeparatrixError(f"ax: found {self.ax[0]!r}, allowed axes of matplotlib", USAGE)
        if self.ax and self.size is not None:
            raise SeparatrixError("size: the axes given by ax have one", USAGE)
        if self.size is not None and not all(10 <= length <= 1000 for length in self.size):
            raise SeparatrixError(f"size: found {self.size}, allowed 10 to 1000 mm", USAGE)

    @property
    def whole(self) -> bool:
        """Whether all of the result is shown, in SI units."""
        return not (self.region or self.slice or self.units)

    def require(self, kind: str, *served: str) -> None:
        """Refuse wishes that the figures of a kind do not serve."""
        for name in _SERVED_BY_SOME:
            wish = getattr(self, name)
            # A number may be 0.
            if (wish or isinstance(wish, float)) and name not in served:
                raise SeparatrixError(
                    f"{name.replace('_', ' ')}: not served by the figures of a {kind}", USAGE
                )

    def at(self, name: str, value: float) -> "Look":
        """Return this look at one value of an axis."""
        return replace(self, slice={**self.slice, name: value})

    def selected(self, result: xr.Dataset, wish: str = "region") -> xr.Dataset:
        """Return what is to be shown of a result, in the units asked for; `wish`: its name in errors."""
        ranges = {}
        for name, value in self.slice.items():
            dim = _axis(result, name)
            nearest = int(np.abs(result[dim].values - value).argmin())
            ranges[dim] = slice(nearest, nearest + 1)
        for name, (low, high) in self.region.items():
            dim = _axis(result, name)
            inside = np.flatnonzero((result[dim].values >= low) & (result[dim].values <= high))
            if inside.size == 0:
                ends = f"{result[dim].values.min():g} to {result[dim].values.max():g}"
                raise SeparatrixError(f"{wish} {name}: found {low:g} to {high:g}, allowed {ends}", USAGE)
            ranges[dim] = slice(int(inside[0]), int(inside[-1]) + 1)
        return self.in_units(result.isel(ranges))

    def factor(self, unit: str) -> float:
        """Return by what a number in an SI unit is multiplied."""
        found = (1 / UNITS[name][1] for name in self.units if UNITS[name][0] == unit)
        return 1.0 if unit == FREQUENCY else next(found, 1.0)

    def unit(self, si: str) -> str:
        """Return the unit that is used instead of an SI unit."""
        return next((name for name in self.units if UNITS[name][0] == si), si)

    def scale(self, result: xr.Dataset, key: str) -> tuple[float, str | None]:
        """Return by what a variable of a result in SI units is multiplied, and the unit that it then has."""
        si = result[key].attrs.get("units")
        mine = angular(result, key) if any(UNITS[name][0] == FREQUENCY for name in self.units) else None
        for name in self.units:
            kind, worth = UNITS[name]
            if kind == FREQUENCY and mine is not None:
                return mine / worth, name
            if kind == si and mine is None:
                return 1 / worth, name
        return 1.0, si

    def in_units(self, result: xr.Dataset) -> xr.Dataset:
        """Return a result in SI units in the units asked for."""
        changed = {}
        for key, variable in result.variables.items() if self.units else ():
            factor, name = self.scale(result, str(key))
            if name == variable.attrs.get("units") or str(key).startswith("catalogue_"):
                continue
            frequency = UNITS[name][0] == FREQUENCY
            about = renamed(result, str(key), name) if frequency else {**variable.attrs, "units": name}
            changed[key] = (variable.dims, variable.values * factor, about)
        return result.assign(changed)


def _axis(result: xr.Dataset, name: str) -> str:
    dim = name.replace(".", "_")
    dim = "drive_ratio" if dim == "ratio" else dim
    if dim not in result.dims:
        raise SeparatrixError(f"no axis '{name}'; there are {', '.join(map(str, result.dims))}", USAGE)
    return dim


DEFAULT = Look()
