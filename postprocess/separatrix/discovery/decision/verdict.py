# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The verdict as a dictionary: what is written to verdict.json."""

from dataclasses import asdict, dataclass, field

import numpy as np

from separatrix.discovery.decision.experiments import experiments
from separatrix.discovery.decision.limits import advice, detectable, equivalents
from separatrix.discovery.decision.memory import memory_of
from separatrix.discovery.decision.misfit import doubted_noise, too_quiet, unused
from separatrix.discovery.decision.negative_controls import negative_controls
from separatrix.discovery.decision.other_machine import other_drive, other_machine, other_phase, other_units
from separatrix.discovery.decision.remains import Remains, noise_and_signal, remains_of
from separatrix.discovery.decision.rounds import Round, SearchContext
from separatrix.discovery.decision.scoring import LARGER_NOISE, LITTLE, ScoredCandidate
from separatrix.discovery.decision.stages.rig_imperfections import in_words
from separatrix.discovery.decision.state import Decision, Step
from separatrix.discovery.decision.table_range import within_tables
from separatrix.discovery.decision.where import Map, sentences, where_maps
from separatrix.discovery.fitting.curves import table_of
from separatrix.discovery.fitting.data import Data
from separatrix.discovery.fitting.fitted import Fitted
from separatrix.discovery.fitting.function_part import Part
from separatrix.discovery.fitting.heldout import Prediction
from separatrix.discovery.fitting.joint_effects import effect_of
from separatrix.discovery.fitting.machine import SENSOR_BIAS
from separatrix.discovery.fitting.members import MEMBERS, friction_at
from separatrix.discovery.fitting.rig import with_imperfections
from separatrix.discovery.fitting.shapes import FORM_OF
from separatrix.discovery.fitting.smooth import Function
from separatrix.discovery.policy import FIT, SEARCH
from separatrix.discovery.wording import unit_of, units_of
from separatrix.version import __version__


@dataclass
class Findings:
    """Everything that was found, for the verdict, the files and the figures."""

    context: SearchContext
    base: Fitted
    decision: Decision
    held_out_chosen: str
    steps: tuple[Step, ...] = ()
    stopped: str = ""
    maps: list[Map] = field(default_factory=list)


# what a sensor of a kind shows, in the words of units; of a kind without a word there the unit itself
_SHOWN = {"x": "position", "v": "velocity", "F": "force"}
_UNITS = {"a": "m/s^2", "i": "A"}


def verdict_of(findings: Findings) -> dict:
    """Return the content of verdict.json."""
    decision, context = findings.decision, findings.context
    first = decision.rounds[0]
    best = decision.corrected
    final = best.fitted if best else findings.base
    named = list(final.names) if decision.accepted else []
    findings.maps = where_maps(findings.base, context.scales.mass, context.options, named)
    rivals = [one for one in decision.rivals if list(one.fitted.names) in decision.alternatives]
    return {
        "outcome": decision.outcome,
        "compared": context.options.compare,
        "complete": decision.complete,
        "effects": named,
        "added": list(final.names) if decision.added else [],
        "not_added": decision.not_added,
        "memory": memory_of(findings),
        "alternatives": ["+".join(names) for names in decision.alternatives],
        "equivalent": decision.equivalent,
        "in_families": decision.in_families,
        "equivalences": equivalents([*named, *[names[-1] for names in decision.alternatives]]),
        "parameters": _parameters(final),
        "base_parameters": _parameters(findings.base),
        "where": sentences(findings.maps, _soft_barriers(findings.base)),
        "gap": _gap(findings),
        "remains": [asdict(one) | {"text": one.text()} for one in _remaining(findings)],
        "locations": findings.base.problem.locations(
            [*named, *(name for names in decision.alternatives for name in names)]
        ),
        "families": [effect_of(name).family for name in final.names],
        "function": _function(decision.function, final),
        "character": [one.as_dict() for one in decision.characters],
        "gates": best.gates if best else {},
        "leaves": best.leaves if decision.accepted else "",
        "p_value": best.p if decision.accepted else None,
        "reasons": list(decision.reasons),
        "stopped_before": findings.stopped,
        "search": [one._asdict() for one in findings.steps],
        "asked_for": None if context.options.candidates is None else list(context.options.candidates),
        "units": asdict(units_of(findings.base.model.parameters)),
        "detectable": detectable(context, first),
        "confusability": {"names": first.screened.names, "matrix": first.screened.cosines},
        **_next(findings, final, [one.fitted for one in rivals]),
        "d_prime": d_prime(first),
        "negative_controls": negative_controls(first, context.options),
        "candidates": [_candidate(one) for one in first.scored],
        "ceiling": {
            one.name: {"gain": one.gain, "rank": one.rank, "p": one.p}
            for one in decision.base_ceiling.families
        },
        "not_tested": first.absent,
        "notes": _notes(findings),
        "records": _records(findings),
        "held_out_chosen": findings.held_out_chosen,
        "seed": context.options.seed,
        "version": __version__,
    }


def _next(findings: Findings, final: Fitted, rivals: list[Fitted]) -> dict:
    """What to measure next where the name is in doubt: known advice, experiments by their d'."""
    if findings.decision.outcome != "ambiguous" or not final.problem.experiment:
        return {"separating_experiment": "", "experiments": []}
    others = rivals[: SEARCH.experiment_rivals] or [findings.base]
    name, *names = (" with ".join(one.names) or "the machine without it" for one in (final, *others))
    found = [one for one in experiments(final, others) if one.d_prime > 1][: SEARCH.experiments]
    # a name that no held-out record confirms needs one that does, also where it has rivals
    use = "training" if findings.decision.accepted[0].gates.get("hold-out", True) else "held out"
    texts = [f"{one.text(name, names)}{'; hold it out' if use == 'held out' else ''}" for one in found]
    proposals = [one for one in (advice(final, rivals), *texts[:1]) if one]
    return {
        "separating_experiment": "; or ".join(proposals),
        "experiments": [
            asdict(one) | {"rival": names[one.rival], "use": use, "text": text}
            for one, text in zip(found, texts, strict=True)
        ],
    }


def _remaining(findings: Findings) -> list[Remains]:
    """What the accepted effect leaves of the gap."""
    decision = findings.decision
    if decision.corrected is None:
        return []
    mass = findings.context.scales.mass
    return remains_of(findings.base, decision.predicted, decision.corrected, mass)


def _function(found: Function | None, final: Fitted) -> dict | None:
    """The function that the accepted effect is, with its 95 % band and the closed forms that fit it."""
    if found is None:
        return None
    member, parameters = found.member, final.model.parameters
    unit, quantity = (unit_of("", one, parameters) for one in (found.member.unit, found.member.quantity))
    table = table_of(final, member) or []
    if member.effect == "friction_curve":
        # the law of the machine is in the friction too
        table = [
            (at, friction_at(final, at, sign)) for (at, _), sign in zip(table, (1.0, -1.0), strict=False)
        ]
    fitting = [name for name, one in found.forms.items() if one["fits"]]
    shape = f", as {' or '.join(fitting)}" if fitting else ""
    refuted = found.forms.get(FORM_OF.get(final.names[-1], ""), {"fits": True})["fits"] is False
    if (table or refuted) and not fitting:
        shape = ", as no closed form that is known"
    return {
        "effect": member.effect,
        "variable": member.variable,
        "unit": unit,
        "quantity": quantity,
        "parts": [
            {
                "direction": one.name,
                "at": one.at,
                "value": one.value,
                "band_95": [one.value - 1.96 * one.error, one.value + 1.96 * one.error],
            }
            for one in found.parts
        ],
        "tables": [{"at": at, "value": value} for at, value in table],
        "closed_forms": found.forms,
        "text": "; ".join(
            f"{quantity}{f' {one.name}' if one.name else ''} {one.value[0]:.4g} at {one.at[0]:.3g} "
            f"{unit}{_hump(one, unit)} to {one.value[-1]:.4g} at {one.at[-1]:.3g} {unit}"
            for one in found.parts
        )
        + shape,
    }


def _hump(one: Part, unit: str) -> str:
    """The value that is farthest outside of those at the ends, in words, if it is outside by its error."""
    ends = sorted((one.value[0], one.value[-1]))
    outside = np.maximum(one.value - ends[1], ends[0] - one.value)
    knot = int(np.argmax(outside))
    if not outside[knot] > 2 * one.error[knot]:
        return ""
    return f" through {one.value[knot]:.4g} at {one.at[knot]:.3g} {unit}"


def d_prime(found: Round) -> dict[str, float]:
    """Linearised size of each effect over its standard error, in its direction of largest gain."""
    return {name: float(np.sqrt(max(0.0, 2 * found.screened.gain[name]))) for name in found.screened.names}


def _candidate(one: ScoredCandidate) -> dict:
    fit = one.fitted.fit
    return {
        "effect": one.name,
        "training": one.training,
        "held_out": one.held_out,
        # of imperfections of a rig beside it, where they were weighed
        "imperfections": None if one.imperfections is None else sum(one.imperfections),
        "evidence": one.evidence,
        "reduced_chi2": fit.sample_chi2,
        # a fit worse than the base has not found its minimum, which includes the effect of size zero
        "converged": fit.converged and one.training > -FIT.worse,
        "starts": one.fitted.tries,
        "values": {
            one.fitted.problem.free[i].path: one.fitted.problem.free[i].physical(fit.values[i])
            for i in one.fitted.added
        },
    }


def _notes(findings: Findings) -> list[str]:
    """Qualifications, what may make the verdict void first, how the records were read last."""
    context = findings.context
    fits = _final(findings)
    notes = [*other_units(context.training, findings.base.model)]
    if findings.base.problem.one_signal:
        notes += other_machine(context.training, fits[0][2], context.options)
    if findings.decision.outcome in ("not-in-catalogue", "characterised"):
        notes += other_drive(context.training, findings.base)
    for _, data, fitted in fits:
        notes += other_phase(data, fitted)
        if fitted.problem.one_signal:
            notes += doubted_noise(data, fitted.problem, fitted.fit, context.scales.mass)
    best = findings.decision.accepted
    notes += _of_accepted(best[0]) if best else []
    fit = findings.base.fit
    if not fit.converged:
        notes.append("the base machine did not converge")
    added = findings.decision.added
    if added is not None and not added.fitted.fit.converged:
        notes.append(f"the fit of effect.{added.name} did not converge")
    contact = any(path.startswith("contact.") for path in findings.base.model.parameters)
    for _, data, fitted in fits:
        notes += unused(data, fitted.fit, contact)
    positions = any(one.record.has_position for one in context.training.prepared)
    if contact and positions and not any(one.impacts.size for one in context.training.smoothed):
        hits = sum(len(one) for one in fit.evaluation.impacts if one is not None)
        why = (
            ": they do not stand out of the stated noise"
            if too_quiet(context.training, fits[0][2].fit)
            else ""
        )
        notes.append(f"no impacts are seen in the records{why}; the fitted machine has {hits}")
    return [*notes, *in_words(fits[0][2]), *_of_records(context)]


def _of_records(context: SearchContext) -> list[str]:
    """How the records were read."""
    return [
        f"{one.record.name}: {note}"
        for data in (context.training, context.held_out)
        for one in (data.prepared if data else ())
        for note in one.notes
    ]


def _of_accepted(best: ScoredCandidate) -> list[str]:
    """Qualifications of the numbers of an accepted effect."""
    notes = []
    if best.leaves == LITTLE:
        notes.append(
            f"what effect.{best.name} leaves is little of the gap and yet more than noise: its law is not "
            "quite this one, and errors of parameters count noise alone"
        )
    if best.leaves == LARGER_NOISE:
        size = best.ceiling.fit.sample_chi2
        notes.append(
            f"reduced chi^2 is {size:.3g} with effect.{best.name}, and no force explains more: the noise "
            f"is taken to be {np.sqrt(size):.3g} times as large as it was stated or measured to be"
        )
    beyond = 0 if best.prediction is None else int(np.count_nonzero(~within_tables(best.prediction)))
    if beyond:
        notes.append(
            f"{beyond} of {best.prediction.good.size} held-out segments reach values beyond the table of "
            f"effect.{best.name}, where it is not known: they do not count against it"
        )
    if best.prediction is not None and best.prediction.with_imperfections:
        notes.append(
            "held-out records and their gap are predicted with parameters that were fitted beside small "
            "imperfections of the rig; those of the verdict and of extended.toml are fitted without them"
        )
    return notes


def _final(findings: Findings) -> list[tuple[str, Data, Fitted | Prediction]]:
    """Use of records, the records, and the machine of the verdict on them."""
    context, decision = findings.context, findings.decision
    best = decision.corrected
    fits = [("training", context.training, best.fitted if best else findings.base)]
    if context.held_out is not None:
        fits.append(("held out", context.held_out, best.prediction if best else decision.predicted))
    return fits


def _records(findings: Findings) -> list[dict]:
    found = []
    for use, data, fitted in _final(findings):
        for index, one in enumerate(data.prepared):
            found.append(
                {
                    "name": one.record.name,
                    "use": use,
                    "samples": one.record.t.size,
                    "sigma": one.sigma,
                    "memory": one.memory,
                    "resolution": one.resolution,
                    "drive_frequency": one.frequency,
                    "drive_scale": one.drive_scale,
                    "phase_known": one.phase_known,
                    "sensor_bias": fitted.problem.machine_values(index, fitted.fit.values).get(SENSOR_BIAS),
                    **({"sensors": one.sensor_noise} if one.sensor_noise else {}),
                }
            )
            if findings.context.options.compare == "force":
                found[-1]["deviation"] = float(np.sqrt(np.mean(one.deviation(slice(None)) ** 2)))
    return found


def _parameters(fitted: Fitted) -> dict:
    # imperfections of the rig may have moved a value by more than the noise did
    errors = with_imperfections(fitted.problem, fitted.fit).errors
    found = {}
    for one, value, error, held in zip(
        fitted.problem.free, fitted.fit.values, errors, fitted.fit.at_bound, strict=True
    ):
        if one.is_imperfection or (one.is_nuisance and one.record is not None):
            continue
        parameter = fitted.model.parameters.get(one.path)
        known = error > 0 and not held
        low, high = (one.numbers(value + side * 1.96 * error) for side in (-1, 1))
        for path, number in one.numbers(value).items():
            found[path] = {
                "value": number,
                "standard_error": one.slope(value) * float(error) if known else None,
                "interval_95": sorted((low[path], high[path])) if known else None,
                "at": _knot_of(path, fitted),
                "note": "" if known else "at its bound" if held else "these records do not determine it",
                "unit": unit_of(one.path, parameter.unit, fitted.model.parameters) if parameter else "1",
            }
    return found


def _soft_barriers(base: Fitted) -> dict[str, float]:
    """Positions of barriers that yield, by side, as they were fitted."""
    if "contact.stiffness" not in base.model.parameters:
        return {}
    known = {path: one.value for path, one in base.model.parameters.items()}
    known |= base.problem.machine_values(0, base.fit.values)
    sides = {side: known.get(f"contact.{side}") for side in ("lower", "upper")}
    return {side: float(position) for side, position in sides.items() if position is not None}


def _knot_of(path: str, fitted: Fitted) -> str:
    """The knot of a tabulated value, in words; '' of other parameters."""
    table, bracket, index = path.partition("[")
    for member in MEMBERS if bracket else ():
        if member.knots and table in [f"effect.{member.effect}.{key}" for key in member.values]:
            knot = fitted.model.parameters[f"effect.{member.effect}.{member.knots}[{index}"]
            unit = unit_of("", member.unit, fitted.model.parameters)
            return f"{member.variable} {knot.value:.4g} {unit}"
    return ""


def _unit_of_misfit(findings: Findings) -> str:
    """The unit of what is compared first."""
    context = findings.context
    sensors = getattr(context.training.prepared[0], "sensors", None)
    kind = sensors[0].kind if sensors else {"motion": "x", "force": "F"}[context.options.compare]
    if kind in _UNITS:
        return _UNITS[kind]
    return getattr(units_of(findings.base.model.parameters), _SHOWN[kind])


def _gap(findings: Findings) -> dict:
    """Reduced chi^2 of both machines by use of the records, and what they miss beyond the noise."""
    decision, context = findings.decision, findings.context
    best = decision.corrected
    pairs = {"training": (context.training, findings.base.fit, best.fitted.fit if best else None)}
    if decision.predicted is not None:
        pairs["held_out"] = (context.held_out, decision.predicted, best.prediction if best else None)
    unit = _unit_of_misfit(findings)
    found = {}
    for use, (data, before, after) in pairs.items():
        sizes = {
            "before": before.sample_chi2,
            "after": (before if after is None else after).sample_chi2,
            "noise_floor": 1.0,
        }
        noise, signal = noise_and_signal(data)
        misses = {key: float(np.sqrt(max(0.0, sizes[key] - 1)) * noise) for key in ("before", "after")}
        found[use] = sizes | {
            "misfit": misses | {"unit": unit, "share": {key: one / signal for key, one in misses.items()}}
        }
    return found
