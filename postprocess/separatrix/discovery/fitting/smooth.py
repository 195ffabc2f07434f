# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The function that an effect is, as the records tell it, with its band and the closed forms that fit it.

Whatever it was fitted as, the function is taken on many knots. A Gaussian prior on its second derivative
stands for few of them: a smoothing spline. Over the size of that prior the posterior is averaged, each
size weighed by its evidence, so that the band has what the records do not tell of the shape. Such a band
holds a function on as much of its support as it says (G. Wahba, J. R. Stat. Soc. B 45 (1983) 133).
"""

from dataclasses import dataclass

import numpy as np

from separatrix.discovery.fitting.curves import knots_over, member_of, table_of, with_table
from separatrix.discovery.fitting.data import Data
from separatrix.discovery.fitting.fit import Fit, minimise
from separatrix.discovery.fitting.members import Member, friction_at
from separatrix.discovery.fitting.refit import Fitted
from separatrix.discovery.fitting.shapes import closed_forms, through
from separatrix.errors import SeparatrixError

_KNOTS = 16
# places at which a series is drawn
_TURN = 49
# how often the motion is linearised anew, how often a step is halved, steps of the starts after it
_ROUNDS, _HALVINGS, _FOLLOW = 4, 3, 6
# squares by which another step would change nothing that shows
_SETTLED = 0.1
# precisions of the prior over what the records know, from rough to straight, in decades
_DECADES = np.linspace(-6, 6, 49)
# share of the largest eigenvalue, in units of the diagonal, below which a direction is not known
_UNKNOWN = 1e-10


@dataclass
class Part:
    """A function by its values at knots, with their covariance, and what the records say alone.

    `information` and `pull` are of a quadratic misfit about `centre`: d^T information d - 2 d^T pull.
    """

    name: str
    at: np.ndarray
    value: np.ndarray
    covariance: np.ndarray
    information: np.ndarray
    pull: np.ndarray
    centre: np.ndarray

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the values."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0))


@dataclass
class Function:
    """A function as the records tell it, in one part or one for each direction, and what fits it."""

    member: Member
    parts: list[Part]
    forms: dict[str, dict]


def roughness(at: np.ndarray) -> np.ndarray:
    """Matrix of the integral of the squared second derivative of the natural cubic spline through values.

    P. J. Green and B. W. Silverman, Nonparametric Regression (1994), section 2.1.
    """
    h = np.diff(at)
    inner = at.size - 2
    slopes = np.zeros((at.size, inner))
    bends = np.zeros((inner, inner))
    for i in range(inner):
        slopes[i : i + 3, i] = 1 / h[i], -1 / h[i] - 1 / h[i + 1], 1 / h[i + 1]
        bends[i, i] = (h[i] + h[i + 1]) / 3
        if i + 1 < inner:
            bends[i, i + 1] = bends[i + 1, i] = h[i + 1] / 6
    return slopes @ np.linalg.solve(bends, slopes.T)


def smoothed(
    information: np.ndarray, pull: np.ndarray, centre: np.ndarray, penalty: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Mean and covariance of values whose misfit is d^T information d - 2 d^T pull about a centre.

    None where there are values that neither the records nor their being smooth tell of.
    """
    unit = np.trace(information) / np.trace(penalty)
    if not unit > 0:
        return None
    rank = np.linalg.matrix_rank(penalty)
    found = []
    for precision in unit * 10**_DECADES:
        matrix = information + precision * penalty
        size = np.sqrt(np.diag(matrix))
        scaled = matrix / np.outer(size, size)
        values, vectors = np.linalg.eigh(scaled)
        if not values[0] > 1e-14 * values[-1]:
            continue
        inverse = (vectors / values) @ vectors.T / np.outer(size, size)
        gradient = pull - precision * (penalty @ centre)
        step = inverse @ gradient
        evidence = 0.5 * (gradient @ step - precision * centre @ penalty @ centre + rank * np.log(precision))
        evidence -= 0.5 * np.sum(np.log(values)) + np.sum(np.log(size))
        found.append((evidence, centre + step, inverse))
    if not found:
        return None
    evidences = np.array([one[0] for one in found])
    weights = np.exp(evidences - evidences.max())
    weights /= weights.sum()
    mean = sum(w * one[1] for w, one in zip(weights, found, strict=True))
    covariance = sum(
        w * (one[2] + np.outer(one[1] - mean, one[1] - mean)) for w, one in zip(weights, found, strict=True)
    )
    return mean, covariance


def function_of(data: Data, base: Fitted, fitted: Fitted, member: Member | None = None) -> Function | None:
    """The function of a fitted effect, a table or a closed form of the `member`; None where there is none.

    `base`: the machine without it.
    """
    member = member or member_of(fitted)
    if member is None:
        return None
    if not member.knots:
        return Function(member, [_series(fitted, member)], {})
    seen = member.seen(fitted)
    if seen.size < 3 or not np.ptp(seen) > 0:
        return None
    curve = _Curve.begun(data, base, fitted, member, knots_over(member, seen, _KNOTS))
    found = None if curve is None else curve.settle()
    if found is None:
        return None
    parts = curve.parts(*found)
    whole = [closed_forms(member.effect, one.at, one.value, *_alone(one)) for one in parts]
    # with two directions a form must fit both; a constant beside an anchor is the machine without the effect
    forms = {
        name: one | {"fits": all(other[name]["fits"] for other in whole)}
        for name, one in whole[0].items()
        if name != "constant" or not member.anchor
    }
    return Function(member, parts, forms)


@dataclass
class _Curve:
    """A function on many knots in a machine that is refitted with it."""

    data: Data
    member: Member
    fitted: Fitted
    knots: np.ndarray
    alike: bool
    # places of its values among the free parameters: those of a part follow each other
    places: np.ndarray
    penalty: np.ndarray
    # what the machine without it has of the function already
    beside: np.ndarray

    @classmethod
    def begun(
        cls, data: Data, base: Fitted, fitted: Fitted, member: Member, knots: np.ndarray
    ) -> "_Curve | None":
        """The function as it was fitted, on these knots."""
        table = table_of(fitted)
        alike = len(member.values) > 1 and (table is None or len(table) == 1)
        if table is not None:
            begun = [_drawn(at, value, knots) for at, value in table]
            begun = begun * len(member.values) if alike else begun
        else:
            begun = member.known(fitted, base, knots)
        made = None if begun is None else with_table(data, base, member, fitted, knots, begun, alike)
        if made is None:
            return None
        model, problem, values = made
        paths = [one.path for one in problem.free]
        places = [
            paths.index(f"effect.{member.effect}.{key}[{i}]")
            for key in (member.values[:1] if alike else member.values)
            for i in range(2 if member.anchor else 1, knots.size + 1)
        ]
        if member.anchor:
            places.insert(0, paths.index(member.anchor))
        count = 1 if alike else len(member.values)
        penalty = np.kron(np.eye(count), roughness(knots))
        try:
            fit = minimise(problem, values, fitted.fit.starts, most=0)
        except SeparatrixError:
            # no such machine
            return None
        whole = Fitted((*base.names, member.effect), model, problem, fit, tuple(places))
        found = cls(data, member, whole, knots, alike, np.array(places), penalty, np.zeros(len(places)))
        if member.effect == "friction_curve":
            # the law of the machine is in the friction too
            signs = (1.0,) if alike else (1.0, -1.0)
            found.beside = np.concatenate([friction_at(whole, knots, sign) for sign in signs]) - found.values
        return found

    @property
    def values(self) -> np.ndarray:
        """The function at the knots."""
        found = self.fitted.fit.values[self.places]
        if self.member.by_share:
            return found[0] * np.append(1.0, 1 + found[1:])
        return np.append(found[0], found[0] + found[1:]) if self.member.anchor else found

    def _slopes(self) -> np.ndarray:
        """Derivatives of the function by the free parameters that it is in."""
        slopes = np.eye(self.places.size)
        if self.member.by_share:
            found = self.fitted.fit.values[self.places]
            slopes[1:] *= found[0]
            slopes[1:, 0] = 1 + found[1:]
        elif self.member.anchor:
            slopes[1:, 0] = 1
        return slopes

    def settle(self) -> tuple[np.ndarray, ...] | None:
        """Mean and covariance of the values; information and pull about a centre, linearised there."""
        for _ in range(_ROUNDS):
            known = self._known()
            if known is None:
                return None
            information, pull, others = known
            centre = self.values + self.beside
            found = smoothed(information, pull, centre, self.penalty)
            if found is None:
                return None
            mean, covariance = found
            inner = np.linalg.solve(self._slopes(), mean - centre)
            step = others(inner)
            step[self.places] = inner
            if not self._go(step):
                break
            moved = self.values + self.beside - centre
            if moved @ information @ moved < _SETTLED:
                break
        return mean, covariance, information, pull, centre

    def _known(self) -> tuple | None:
        """Information and pull of the values, all else free; and the step of all else after theirs."""
        fit = self.fitted.fit
        matrix = fit.reduced.matrix[fit.good].sum(axis=0) / max(1.0, fit.reduced_chi2)
        gradient = fit.reduced.gradient[fit.good].sum(axis=0) / max(1.0, fit.reduced_chi2)
        inside = np.zeros(gradient.size, bool)
        inside[self.places] = True
        open_ = np.flatnonzero(~inside & ~fit.at_bound & (np.diag(matrix) > 0))
        size = np.sqrt(np.diag(matrix)[open_])
        units = np.outer(size, size)
        inner = np.linalg.pinv(matrix[np.ix_(open_, open_)] / units, rcond=1e-10, hermitian=True) / units
        across = matrix[np.ix_(self.places, open_)]
        information = matrix[np.ix_(self.places, self.places)] - across @ inner @ across.T
        pull = gradient[self.places] - across @ inner @ gradient[open_]
        if not np.trace(information) > 0:
            return None

        def others(step: np.ndarray) -> np.ndarray:
            whole = np.zeros(gradient.size)
            whole[open_] = inner @ (gradient[open_] - across.T @ step)
            return whole

        back = np.linalg.inv(self._slopes())
        return back.T @ information @ back, back.T @ pull, others

    def _go(self, step: np.ndarray) -> bool:
        """Go as much of a step as lowers the misfit and the roughness together; false where none does."""
        problem, fit = self.fitted.problem, self.fitted.fit
        bounds = np.array([(one.lower, one.upper) for one in problem.free]).T
        fixed = np.ones(fit.values.size, bool)
        for halving in range(_HALVINGS):
            values = np.clip(fit.values + 0.5**halving * step, *bounds)
            try:
                tried = minimise(problem, values, fit.starts, most=_FOLLOW, fixed=fixed)
            except SeparatrixError:
                continue
            if self._lower(tried, fit):
                self.fitted.fit = tried
                return True
        return False

    def _lower(self, tried: Fit, fit: Fit) -> bool:
        """Whether a fit follows the same segments no worse."""
        both = tried.good & fit.good
        return both.sum() >= 0.98 * fit.good.sum() and tried.chi2[both].sum() < fit.chi2[both].sum() + 1.0

    def parts(
        self,
        mean: np.ndarray,
        covariance: np.ndarray,
        information: np.ndarray,
        pull: np.ndarray,
        centre: np.ndarray,
    ) -> list[Part]:
        """The function by direction."""
        names = [""] if self.alike or len(self.member.values) == 1 else self.member.values
        count = self.knots.size
        found = []
        for number, name in enumerate(names):
            here = np.arange(number * count, (number + 1) * count)
            there = np.setdiff1d(np.arange(mean.size), here)
            alone, force = information[np.ix_(here, here)], pull[here]
            if there.size:
                across = information[np.ix_(here, there)]
                inner = np.linalg.pinv(information[np.ix_(there, there)], rcond=1e-12, hermitian=True)
                alone, force = alone - across @ inner @ across.T, force - across @ inner @ pull[there]
            found.append(
                Part(name, self.knots, mean[here], covariance[np.ix_(here, here)], alone, force, centre[here])
            )
        return found


def _drawn(at: np.ndarray, value: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """The curve of a table at other knots."""
    return through(at, value)(np.clip(knots, at[0], at[-1]))


def _alone(part: Part) -> tuple[np.ndarray, np.ndarray]:
    """Rows of residuals whose squares are what a function misses of the records, and what they are 0 at.

    Directions that the records do not know are left out.
    """
    size = np.sqrt(np.maximum(np.diag(part.information), 1e-300))
    values, vectors = np.linalg.eigh(part.information / np.outer(size, size))
    kept = values > _UNKNOWN * values[-1]
    rows = (np.sqrt(values[kept])[:, None] * vectors[:, kept].T) * size
    offset = (vectors[:, kept].T @ (part.pull / size)) / np.sqrt(values[kept])
    return rows, rows @ part.centre + offset


def _series(fitted: Fitted, member: Member) -> Part:
    """A series of harmonics by its values over a turn."""
    at = np.linspace(0, 2 * np.pi, _TURN)
    paths = [one.path for one in fitted.problem.free]
    columns, places = [], []
    for key, wave in zip(member.values, (np.cos, np.sin), strict=True):
        for place, path in enumerate(paths):
            if path.startswith(f"effect.{member.effect}.{key}["):
                places.append(place)
                columns.append(wave(int(path.split("[")[1][:-1]) * at))
    basis = np.column_stack(columns)
    covariance = basis @ fitted.covariance[np.ix_(places, places)] @ basis.T
    none = np.zeros((at.size, at.size))
    return Part("", at, basis @ fitted.fit.values[places], covariance, none, none[0], 0 * at)
