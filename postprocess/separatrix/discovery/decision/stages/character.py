# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of a gap that no effect of the catalogue closes: on what the missing force depends.

Hypotheses are fitted to what the base machine leaves over in training, linearised, together with the
parameters of the machine; then they predict the held-out records. No hypothesis is a name: nothing is added
to the machine.
"""

from dataclasses import dataclass, replace

import numpy as np

from separatrix.discovery.decision.rounds import SearchContext
from separatrix.discovery.decision.scoring import family_wise
from separatrix.discovery.decision.state import Decision, SearchState
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.hypotheses import Hypothesis, Motion
from separatrix.discovery.fitting.low_pass import LOW_PASS
from separatrix.discovery.fitting.normal_equations import inverse_scaled
from separatrix.discovery.policy import SEARCH


@dataclass
class Character:
    """One hypothesis: what it closes of the gap in training and on held-out records, and its evidence."""

    hypothesis: Hypothesis
    # of what is not linear, where it has that
    constant: float
    closed: float
    held_out_closed: float
    evidence: float
    p: float
    # coefficient of the law [SI units of the formula] and its standard error; None without a formula
    size: tuple[float, float] | None

    def text(self) -> str:
        """In words."""
        what = " and ".join(self.hypothesis.depends_on)
        law = f", {self.hypothesis.formula}" if self.hypothesis.formula else ""
        if self.hypothesis.constant is not None:
            name, unit = self.hypothesis.constant
            law += f", with a {name} of about {self.constant:.3g} {unit}"
        training, held_out = (100 * min(1, one) for one in (self.closed, self.held_out_closed))
        subject = f"a {what}" if what == LOW_PASS else f"a force that depends on {what}"
        return (
            f"{subject}{law}: it would close {training:.0f} % of the gap in training "
            f"and {held_out:.0f} % on held-out records (linearised)"
        )

    def as_dict(self) -> dict:
        """The entry of the verdict."""
        name, unit = self.hypothesis.constant or ("", "")
        value, error = self.size or (None, None)
        return {
            "depends_on": list(self.hypothesis.depends_on),
            "formula": self.hypothesis.formula,
            "constant": {"name": name, "value": self.constant, "unit": unit} if name else None,
            "size": None if value is None else {"value": value, "standard_error": error},
            "closed": {"training": self.closed, "held_out": self.held_out_closed},
            "text": self.text(),
        }


def has_gap(state: SearchState) -> bool:
    """Whether the base machine leaves a gap on held-out records."""
    predicted = state.decision.predicted
    return predicted is not None and predicted.fit.excess > 0


def character(state: SearchState) -> SearchState:
    """Add to the decision on what an unnamed gap depends."""
    return state.decided(characterised(state.context, state.decision))


def characterised(context: SearchContext, decision: Decision) -> Decision:
    """The decision with what is known of an unnamed gap; unchanged where nothing is certain."""
    base, predicted = decision.rounds[0].base, decision.predicted
    training, held_out = motions(context, base, predicted)
    found = [best_of_hypothesis(training, held_out, one) for one in base.problem.hypotheses(training)]
    best = max(found, key=lambda one: one.evidence)
    if not _known(best, context, base.problem.locates):
        return replace(decision, suspected=best if _likely(best, context) else None)
    others: dict[tuple[str, ...], Character] = {}
    for one in sorted(found, key=lambda one: -one.evidence):
        close = one.evidence > best.evidence - context.options.separation * _left(best, base.fit)
        if (close or _akin(one, best)) and one.hypothesis.depends_on != best.hypothesis.depends_on:
            others.setdefault(one.hypothesis.depends_on, one)
    return replace(decision, outcome="characterised", characters=[best, *others.values()])


def motions(context: SearchContext, base: Fitted, predicted: Prediction) -> tuple[Motion, Motion]:
    """The motion in training and on held-out records."""
    pairs = (base, context.training), (predicted, context.held_out)
    mass, natural = context.scales.mass, _natural_frequency(context)
    training, held_out = (one.problem.motion(one.fit, data, mass, natural) for one, data in pairs)
    return training, held_out


def _known(best: Character, context: SearchContext, located: bool) -> bool:
    """Whether a hypothesis closes most of the gap, in training and on held-out records, and not by chance."""
    options = context.options
    least = SEARCH.closed_at_location if located else options.characterised
    return best.p < options.detection_level and min(best.closed, best.held_out_closed) > least


def _likely(best: Character, context: SearchContext) -> bool:
    """Whether a fit may establish it: for a large gap the linearised share is unreliable."""
    return best.p < context.options.detection_level and best.closed > context.options.characterised


def _akin(one: Character, best: Character) -> bool:
    """Whether only the second variable differs, which is not determined while the best leaves a gap."""
    return (
        one.hypothesis.depends_on[0] == best.hypothesis.depends_on[0]
        and one.evidence > SEARCH.akin * best.evidence
        and min(best.closed, best.held_out_closed) < SEARCH.nearly_all
    )


def _left(one: Character, fit) -> float:
    """Reduced chi^2 of the samples that a hypothesis leaves in training, at least 1."""
    return max(1.0, 1 + (1 - one.closed) * fit.excess / max(1.0, fit.samples))


def best_of_hypothesis(training: Motion, held_out: Motion, hypothesis: Hypothesis) -> Character:
    """A hypothesis with its constant where it closes most, to a fraction of the distance of those tried."""
    values = hypothesis.values
    tried = {float(one): _gain(training, hypothesis, one) for one in values}
    best = max(tried, key=tried.get)
    if values.size > 1:
        index = int(np.searchsorted(values, best))
        step = np.diff(values)[max(0, min(index, values.size - 2))]
        for _ in range(SEARCH.constant_halvings):
            step /= 2
            tried |= {one: _gain(training, hypothesis, one) for one in (best - step, best + step)}
            best = max(tried, key=tried.get)
    found = _scored(training, held_out, hypothesis, best)
    if hypothesis.fades and best < SEARCH.faded * values[0]:
        found.evidence = -np.inf
    return found


def _gain(training: Motion, hypothesis: Hypothesis, constant: float) -> float:
    """Fall of chi^2 in training with a value of the constant, up to one number for all."""
    columns = _columns(hypothesis, training, constant)
    matrix, gradient = _normal(training, columns)
    p = training.fit.evaluation.by_parameter.shape[2]
    open_ = np.concatenate([_movable(training), np.ones(matrix.shape[0] - p, bool)])
    return _solved(training, matrix, gradient, open_)[1]


def _movable(motion: Motion) -> np.ndarray:
    """Parameters that may move beside a hypothesis.

    A bound that the machine ran into without it holds them, but where the force is compared: that is so
    nearly linear in them that they may come back from anywhere.
    """
    return ~motion.fit.at_bound | motion.problem.exact


def _scored(training: Motion, held_out: Motion, hypothesis: Hypothesis, constant: float) -> Character:
    """Fit a hypothesis to the training records and score it on the held-out ones."""
    columns = [_columns(hypothesis, one, constant) for one in (training, held_out)]
    count = columns[0][0].shape[2]
    fit, p = training.fit, training.fit.evaluation.by_parameter.shape[2]
    matrix, gradient = _normal(training, columns[0])
    open_ = np.concatenate([_movable(training), np.ones(matrix.shape[0] - p, bool)])
    _, before, first = _solved(training, matrix[:p, :p], gradient[:p], open_[:p])
    values, after, rank = _solved(training, matrix, gradient, open_)
    gain, rank = after - before, rank - first
    excess, excess_held = max(fit.excess, 1.0), max(held_out.fit.excess, 1.0)
    predicted = _predicted_fall(training, held_out, columns[1], values, count)
    closed, closed_held = (gain - rank) / excess, predicted / excess_held
    noise = max(1.0, 1 + (excess - gain) / max(1.0, fit.samples))
    evidence = (0.5 * gain + 0.5 * predicted) / noise - rank - np.log(hypothesis.values.size)
    size = None
    if hypothesis.formula and count:
        variance = noise * np.diag(inverse_scaled(matrix, np.diag(matrix) > 0, 1e-15))
        size = (float(values[p]), float(np.sqrt(variance[p])))
    chance = family_wise((gain + max(0.0, predicted)) / noise, max(1, rank), hypothesis.values.size)
    return Character(hypothesis, constant, closed, closed_held, evidence, chance, size)


def _columns(hypothesis: Hypothesis, motion: Motion, constant: float) -> tuple[np.ndarray, np.ndarray]:
    """Columns of the machine and those of the records' own."""
    shape = (motion.x.shape[0], motion.fit.evaluation.residual.shape[1], 0)
    common, own = hypothesis.columns(motion, constant)
    return np.zeros(shape) if common is None else common, np.zeros(shape) if own is None else own


def _normal(motion: Motion, columns: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Normal equations of the parameters and the columns, starts eliminated."""
    return motion.fit.normal_equations(motion.fit.evaluation.by_parameter, *columns).total()


def _solved(
    motion: Motion, matrix: np.ndarray, gradient: np.ndarray, open_: np.ndarray
) -> tuple[np.ndarray, float, int]:
    """Solution (0 where closed), the decrease of chi^2, and the rank."""
    scaled, size = _scaled(matrix[np.ix_(open_, open_)])
    values, vectors = np.linalg.eigh(scaled)
    usable = values > (SEARCH.usable_force if motion.problem.exact else SEARCH.usable_motion)
    parts = vectors[:, usable].T @ (gradient[open_] / size)
    found = np.zeros(open_.size)
    found[open_] = vectors[:, usable] @ (parts / values[usable]) / size
    return found, float(np.sum(parts**2 / values[usable])), int(usable.sum())


def _scaled(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return matrix / np.outer(size, size), size


def _predicted_fall(
    training: Motion, held_out: Motion, columns: tuple[np.ndarray, np.ndarray], values: np.ndarray, count: int
) -> float:
    """Fall of chi^2 on held-out records, less what their own coefficients gain by chance."""
    matrix, gradient = _normal(held_out, columns)
    free = held_out.problem.free
    p = len(free)
    shared, own = (
        [i for i, one in enumerate(free) if (one.record is None) == which] for which in (True, False)
    )
    known = [i for i, one in enumerate(training.problem.free) if one.record is None]
    first = training.fit.evaluation.by_parameter.shape[2]
    fixed = np.array([*shared, *range(p, p + count)], int)
    given = np.concatenate([values[known], values[first : first + count]])
    movable = np.array([*own, *range(p + count, matrix.shape[0])], int)
    open_ = np.ones(movable.size, bool)
    _, before, rank_before = _solved(held_out, matrix[np.ix_(own, own)], gradient[own], open_[: len(own)])
    fall = 2 * given @ gradient[fixed] - given @ matrix[np.ix_(fixed, fixed)] @ given
    left = gradient[movable] - matrix[np.ix_(movable, fixed)] @ given
    _, after, rank = _solved(held_out, matrix[np.ix_(movable, movable)], left, open_)
    return float(fall + after - before) - (rank - rank_before)


def _natural_frequency(context: SearchContext) -> float:
    """That of the machine of the case [rad/s], or where it has none, of its motion in the records."""
    stated = next((one.natural for one in context.training.prepared if one.natural), None)
    return stated or context.scales.frequency
