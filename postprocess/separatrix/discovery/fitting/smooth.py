# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""An effect as a function, estimated from the records, with its band and the closed forms that fit it.

However it was fitted, the function is taken on many knots, with the prior of a smoothing spline, in a machine
that is refitted with it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from separatrix.discovery.fitting.curves import (
    begun_at,
    drawn,
    fits_machine,
    knots_over,
    member_of,
    table_of,
    with_table,
)
from separatrix.discovery.fitting.data import Data, polished
from separatrix.discovery.fitting.fit import Fit, minimise
from separatrix.discovery.fitting.fitted import Fitted, gain_over
from separatrix.discovery.fitting.function_part import Part, misfit_rows, series_part
from separatrix.discovery.fitting.members import Member, friction_at
from separatrix.discovery.fitting.normal_equations import inverse_scaled
from separatrix.discovery.fitting.shapes import FORM_OF, closed_forms
from separatrix.discovery.fitting.spline import roughness, smoothed
from separatrix.discovery.policy import FIT
from separatrix.errors import SeparatrixError
from separatrix.library import effects


@dataclass
class Function:
    """A function as estimated from the records, in one part or one for each direction, and what fits it."""

    member: Member
    parts: list[Part]
    forms: dict[str, dict]
    # squares by which it follows the records better than the effect
    gain: float = 0.0


def function_of(data: Data, base: Fitted, fitted: Fitted) -> Function | None:
    """The function of the last effect of a fitted machine, be it a table or a closed form; None without one.

    `base`: the machine without it.
    """
    member = member_of(fitted)
    if member is None or not fits_machine(member, base.model):
        return None
    if not member.knots:
        # a series is its own function
        return Function(member, [series_part(fitted, member)], {}) if member.effect in fitted.names else None
    if any(effects()[name].family == member.family for name in base.names):
        # another effect of the family contains a part of it
        return None
    seen = member.seen(fitted)
    if seen.size < 3 or not np.ptp(seen) > 0:
        return None
    knots = knots_over(member, seen, FIT.function_knots_zero if member.beside else FIT.function_knots)
    try:
        settled = _settled(data, base, fitted, member, knots)
    except (np.linalg.LinAlgError, SeparatrixError):
        # or an impossible machine on the way
        return None
    if settled is None:
        return None
    parts, gain, freedom = settled
    whole = [closed_forms(member.effect, one.at, one.value, *misfit_rows(one)) for one in parts]
    # with two directions a form must fit both; a constant beside an anchor is the machine without the effect
    forms = {
        name: one | {"fits": all(name in other and other[name]["fits"] for other in whole)}
        for name, one in whole[0].items()
        if name != "constant" or not member.anchor
    }
    own = forms.get(FORM_OF.get(fitted.names[-1], ""))
    if own is not None:
        _correct_for_knots(forms, own, gain, freedom)
    return Function(member, parts, forms, gain)


def _correct_for_knots(forms: dict[str, dict], own: dict, gain: float, freedom: float) -> None:
    """Correct the misfit of all forms by that of the effect's own form, whose fit to the records is known.

    A table is approximate between knots; the excess misfit of the own form is common to all of them.
    """
    bias = max(0.0, own["misfit"] - max(0.0, gain))
    for one in forms.values():
        one["p"] = max(one["p"], float(chi2.sf(max(0.0, one["misfit"] - bias), one["freedom"])))
    own["p"] = max(own["p"], float(chi2.sf(max(0.0, gain), freedom)))
    for one in forms.values():
        one["fits"] = one["fits"] or one["p"] > FIT.form_p


def _settled(
    data: Data, base: Fitted, fitted: Fitted, member: Member, knots: np.ndarray
) -> tuple[list[Part], float, float] | None:
    """The function on knots, and on knots that are denser where it bends, until it no longer changes.

    A last change beyond the errors is added to these. Also the squares by which it follows the records better
    than the effect, and the number of parameters that the records determine.
    """
    parts, curve = None, None
    for _ in range(FIT.knot_passes):
        last = parts
        at = knots if last is None else _closer(member, last)
        again = _Curve.begun(data, base, fitted if curve is None else curve.fitted, member, at)
        found = None if again is None else again.settle()
        if last is None and (found is None or again.far_from(fitted)):
            # the path from a jagged table to a smooth function may pass through motions with other impacts
            evened = _Curve.begun(data, base, fitted, member, at, evened=True)
            other = None if evened is None else evened.settle()
            if other is not None:
                again, found = evened, other
        if found is None:
            break
        parts, curve = found, again
        changed = [] if last is None else [
            (drawn(member, coarse.at, coarse.value, one.at) - one.value) ** 2
            for one, coarse in zip(parts, last, strict=True)
        ]  # fmt: skip
        if changed and all(np.all(one < part.error**2) for one, part in zip(changed, parts, strict=True)):
            break
    gain = None if curve is None else curve.gain(fitted)
    if gain is None or gain < -FIT.function_worse:
        # no function of its family reproduces this law
        return None
    freedom = sum(float(np.trace(part.information @ part.covariance)) for part in parts)
    for part, one in zip(parts, changed, strict=False):
        part.covariance = part.covariance + np.diag(np.maximum(0.0, one - part.error**2))
    return parts, gain, freedom


def _closer(member: Member, parts: list[Part]) -> np.ndarray:
    """As many knots over the same range, half of them where the function bends."""
    at = np.append(0.0, parts[0].at) if member.beside else parts[0].at
    bend = np.zeros(at.size)
    for part in parts:
        value = np.append(0.0, part.value) if member.beside else part.value
        bend[1:-1] += np.abs(np.diff(np.diff(value) / np.diff(at)) / (at[2:] - at[:-2]))
    bend[[0, -1]] = bend[[1, -2]]
    density = bend**FIT.knot_bend
    density = (density[1:] + density[:-1]) / 2 * np.diff(at)
    if not density.sum() > 0:
        return parts[0].at
    share = np.append(0.0, np.cumsum(density)) / density.sum()
    share = 0.5 * share + 0.5 * np.linspace(0, 1, at.size)
    found = np.interp(np.linspace(0, 1, at.size), share, at)
    return found[1:] if member.beside else found


@dataclass
class _Curve:
    """A function on many knots in a machine that is refitted with it."""

    data: Data
    member: Member
    fitted: Fitted
    knots: np.ndarray
    alike: bool
    # indices of its values among the free parameters: those of a part are consecutive
    indices: np.ndarray
    penalty: np.ndarray
    # contribution of the machine without it to the function
    beside: np.ndarray
    # the fit that it began from
    begun_from: Fit

    @classmethod
    def begun(
        cls,
        data: Data,
        base: Fitted,
        fitted: Fitted,
        member: Member,
        knots: np.ndarray,
        evened: bool = False,
    ) -> "_Curve | None":
        """The function as it was fitted, on these knots; `evened`: the cubic nearest to it, if there is."""
        table = table_of(fitted, member)
        if evened:
            if table is None or table[0][0].size < FIT.function_evened + 2:
                return None
            table = [(at, np.polyval(np.polyfit(at, value, FIT.function_evened), at)) for at, value in table]
        alike = len(member.values) > 1 and (table is None or len(table) == 1)
        begun = begun_at(member, fitted, base, knots, table)
        made = None if begun is None else with_table(data, base, member, fitted, knots, begun, alike)
        if made is None:
            return None
        model, problem, values = made
        paths = [one.path for one in problem.free]
        indices = [
            paths.index(f"effect.{member.effect}.{key}[{i}]")
            for key in (member.values[:1] if alike else member.values)
            for i in range(2 if member.anchor else 1, knots.size + 1)
        ]
        if member.anchor:
            indices.insert(0, paths.index(member.anchor))
        count = 1 if alike else len(member.values)
        penalty = np.kron(np.eye(count), roughness(knots))
        try:
            fit = minimise(problem, values, fitted.fit.starts, most=0)
        except SeparatrixError:
            # no such machine
            return None
        whole = Fitted((*base.names, member.effect), model, problem, fit, tuple(indices))
        none = np.zeros(len(indices))
        found = cls(data, member, whole, knots, alike, np.array(indices), penalty, none, fitted.fit)
        if member.effect == "friction_curve":
            # the law of the machine is in the friction too
            signs = (1.0,) if alike else (1.0, -1.0)
            found.beside = np.concatenate([friction_at(whole, knots, sign) for sign in signs]) - found.values
        return found

    @property
    def values(self) -> np.ndarray:
        """The function at the knots."""
        found = self.fitted.fit.values[self.indices]
        if self.member.by_share:
            return found[0] * np.append(1.0, 1 + found[1:])
        return np.append(found[0], found[0] + found[1:]) if self.member.anchor else found

    def _slopes(self) -> np.ndarray:
        """Derivatives of the function by the free parameters that it is in."""
        slopes = np.eye(self.indices.size)
        if self.member.by_share:
            found = self.fitted.fit.values[self.indices]
            slopes[1:] *= found[0]
            slopes[1:, 0] = 1 + found[1:]
        elif self.member.anchor:
            slopes[1:, 0] = 1
        return slopes

    def settle(self) -> list[Part] | None:
        """The function by direction, the motion linearised about it; None where it is not reached."""
        for _ in range(FIT.function_rounds):
            known = self._known()
            # a closed form may begin elsewhere
            freed = self._known(origin=True) if self.member.origin else known
            centre = self.values + self.beside
            found = smoothed(known.information, known.gradient, centre, self.penalty)
            if found is None:
                return None
            inner = np.linalg.solve(self._slopes(), found[0] - centre)
            step = known.others(inner)
            step[self.indices] = inner
            if not self._go(step, known.promised(found[0] - centre)):
                break
            moved = self.values + self.beside - centre
            if moved @ known.information @ moved < FIT.function_settled:
                break
        left = found[0] - self.values - self.beside
        if left @ known.information @ left > FIT.function_near * left.size:
            return None
        return self._parts(*found, freed, centre)

    def far_from(self, fitted: Fitted) -> bool:
        """Whether the misfit exceeds that of a fitted machine so far that segments are in a local minimum."""
        return self.fitted.fit.total > FIT.function_trapped * fitted.fit.total

    def gain(self, fitted: Fitted) -> float:
        """Squares over the misfit by which the function follows the records better than a fitted machine."""
        return 2 * float(gain_over(self.fitted, fitted)[0]) / max(1.0, fitted.fit.reduced_chi2)

    def _known(self, origin: bool = False) -> "_Known":
        """Information of records on the values, all else free, the `origin` of their variable on request."""
        fit = self.fitted.fit
        scale = max(1.0, fit.reduced_chi2)
        matrix, gradient = (
            one / scale
            for one in (fit.reduced.matrix[fit.good].sum(axis=0), fit.reduced.gradient[fit.good].sum(axis=0))
        )
        inside = np.zeros(gradient.size, bool)
        inside[self.indices] = True
        if not origin:
            inside |= [one.path in self.member.origin for one in self.fitted.problem.free]
        open_ = np.flatnonzero(~inside & ~fit.at_bound & (np.diag(matrix) > 0))
        inner = inverse_scaled(matrix, open_)[np.ix_(open_, open_)]
        across = matrix[np.ix_(self.indices, open_)]
        back = np.linalg.inv(self._slopes())
        alone = matrix[np.ix_(self.indices, self.indices)] - across @ inner @ across.T
        slope = gradient[self.indices] - across @ inner @ gradient[open_]
        promised = float(gradient[open_] @ inner @ gradient[open_])
        return _Known(
            back.T @ alone @ back,
            back.T @ slope,
            open_,
            inner,
            across,
            gradient[open_],
            gradient.size,
            promised,
        )

    def _go(self, step: np.ndarray, promised: float) -> bool:
        """Go as much of a step as changes the squares as `promised`; false where none does."""
        problem, fit = self.fitted.problem, self.fitted.fit
        bounds = np.array([(one.lower, one.upper) for one in problem.free]).T
        fixed = np.ones(fit.values.size, bool)
        most = max(1.0, fit.reduced_chi2) * (
            max(0.0, promised) + 1 + FIT.function_as_promised * abs(promised)
        )
        for halving in range(FIT.function_halvings):
            values = np.clip(fit.values + 0.5**halving * step, *bounds)
            try:
                tried = minimise(problem, values, fit.starts, most=FIT.function_starts, fixed=fixed)
                # a distant function leaves segments in wrong minima
                tried = polished(
                    self.data,
                    problem,
                    tried,
                    self.data.last,
                    FIT.function_starts,
                    fixed,
                    rival=self.begun_from,
                )
            except SeparatrixError:
                continue
            both = tried.good & fit.good
            followed = both.sum() >= FIT.function_followed * fit.good.sum()
            if followed and tried.chi2[both].sum() < fit.chi2[both].sum() + most:
                self.fitted.fit = tried
                return True
        return False

    def _parts(
        self, mean: np.ndarray, covariance: np.ndarray, known: "_Known", centre: np.ndarray
    ) -> list[Part]:
        """The function by direction."""
        names = [""] if self.alike or len(self.member.values) == 1 else self.member.values
        count = self.knots.size
        found = []
        for number, name in enumerate(names):
            here = np.arange(number * count, (number + 1) * count)
            there = np.setdiff1d(np.arange(mean.size), here)
            alone, slope = known.information[np.ix_(here, here)], known.gradient[here]
            if there.size:
                across = known.information[np.ix_(here, there)]
                inner = np.linalg.pinv(known.information[np.ix_(there, there)], rcond=1e-12, hermitian=True)
                alone = alone - across @ inner @ across.T
                slope = slope - across @ inner @ known.gradient[there]
            found.append(
                Part(name, self.knots, mean[here], covariance[np.ix_(here, here)], alone, slope, centre[here])
            )
        return found


@dataclass
class _Known:
    """Information and gradient of the values of a function, all else free, and the step of all else then."""

    information: np.ndarray
    gradient: np.ndarray
    open_: np.ndarray
    inner: np.ndarray
    across: np.ndarray
    beside: np.ndarray
    count: int
    # fall of the squares where all else alone goes to its minimum
    alone: float

    def others(self, step: np.ndarray) -> np.ndarray:
        """The step of all else after one of the values."""
        whole = np.zeros(self.count)
        whole[self.open_] = self.inner @ (self.beside - self.across.T @ step)
        return whole

    def promised(self, moved: np.ndarray) -> float:
        """Change of the squares where the function moves by so much."""
        return float(moved @ self.information @ moved - 2 * moved @ self.gradient) - self.alone
