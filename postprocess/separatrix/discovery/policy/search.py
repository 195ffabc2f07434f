# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Thresholds of the search: what is fitted, compared, named and reported."""

from dataclasses import dataclass

from separatrix.discovery.policy.row import row


# fmt: off
@dataclass(frozen=True)
class Search:
    """Thresholds of the search: what is fitted, compared, named and reported."""

    # decision/experiments.py
    drive_ratios: tuple = row((0.6, 1.5, 13), "1", "effort",
        "drive ratios of experiments: lowest, highest, number")
    drive_scales: tuple = row((0.6, 1.0, 1.6), "1", "effort",
        "drives that an experiment may have, over that of the records")
    joint_amplitudes: tuple = row((0.25, 0.5, 1.0, 2.0), "1", "effort",
        "amplitudes of a joint in experiments, over that of the records")
    joint_rates: tuple = row((0.1, 0.3, 1.0, 2.0, 4.0), "1", "effort",
        "how many times as fast a joint may be moved in experiments")
    settling_periods: int = row(12, "period", "effort", "periods before a proposed experiment is looked at")
    compared_periods: int = row(12, "period", "effort", "periods over which experiments are compared")
    compared_steps: int = row(40, "1/period", "effort", "samples of each of these periods")
    # decision/flexible.py
    family_promise: float = row(0.3, "1", "campaign",
        "least share of the best evidence, or of free forces, for a family to be tried")
    knots_pointless: float = row(0.8, "1", "campaign",
        "share of a gap that more knots must leave for still more to be tried")
    knots_pointless_behind: float = row(0.5, "1", "campaign", "the same for a table far behind a closed form")
    table_leaves: float = row(0.5, "1", "campaign", "share of a gap left by a table that is not fitted again")
    table_far_behind: float = row(30.0, "log-likelihood", "campaign",
        "distance at which a table is far behind a closed form")
    # decision/stages/lagging_force.py
    lag_sure: float = row(3.0, "standard error", "test", "fall of friction over speed that is no chance")
    lag_curved: float = row(0.1, "1", "campaign",
        "share of the gain up to which a falling friction is proportional to the speed")
    # decision/table_range.py
    beyond_knots: float = row(0.005, "1", "test",
        "distance beyond the knots of a table, over their range, up to which it is known")
    # decision/gates.py
    weighed_share: float = row(0.2, "1", "campaign",
        "least share of the best evidence for imperfections to be weighed")
    weighed: int = row(8, "1", "effort", "number of candidates beside which imperfections are weighed")
    linear_error: float = row(0.1, "1", "rig", "relative error of what linearised imperfections explain")
    # fitting/hypotheses.py
    coherent_periods: int = row(12, "period", "rig",
        "periods over which an oscillation of a parameter keeps its phase")
    waves: tuple = row((0.3, 4.0), "1", "campaign",
        "frequencies of an oscillation over the natural one: stiffness, friction, force")
    slow_waves: tuple = row((0.08, 0.6), "1", "campaign", "the same of restitution")
    relaxations: tuple = row((0.02, 1.5), "1", "campaign",
        "time constants of a hidden state over the natural period")
    delays: tuple = row((0.05, 0.6), "1", "campaign", "delays of a force over the natural period")
    attached: tuple = row((1.6, 7.0), "1", "campaign", "frequencies of an attached mass over the natural one")
    hidden_grid: int = row(20, "1", "effort", "values of a constant of a hidden state that are tried")
    attached_dampings: tuple = row((0.005, 0.02, 0.08), "1", "campaign",
        "damping ratios of an attached mass that are tried")
    beginnings: int = row(4, "1", "effort", "parts of a delay at the beginning of a record")
    low_pass_steps: int = row(20, "1", "rounding", "steps in the time constant of a low pass of a sensor")
    hidden_steps: int = row(100, "1/period", "rounding",
        "integration steps of a hidden state per natural period")
    impacts_of_hypothesis: int = row(4, "1", "test", "least number of impacts for a hypothesis about them")
    samples_after_impacts: int = row(100, "1", "test",
        "least number of samples after impacts for one about their time")
    shortest_way: float = row(2e-3, "1", "campaign", "shortest way after a turning point over the longest")
    way_knots: int = row(12, "1", "campaign", "knots of a function of that way")
    # fitting/joint_hypotheses.py
    joint_knots: int = row(8, "1", "campaign", "knots of a force of one joint")
    joint_knots_of_two: int = row(4, "1", "campaign", "knots in each variable of a force of two")
    joint_harmonics: int = row(3, "1", "campaign", "harmonics of the drive phase of such a force")
    # decision/limits.py
    believed_sizes: float = row(100.0, "1", "campaign",
        "usual sizes up to which a linearised detectable size is reported")
    # decision/misfit.py
    too_quiet: float = row(0.5, "1", "test",
        "reduced chi^2 below which the noise must be smaller than stated")
    freedom_of_doubt: int = row(50, "1", "test", "least degrees of freedom for that")
    noise_disagreement: float = row(1.3, "1", "test",
        "ratio of the scatter to the stated noise that is reported")
    noise_larger: float = row(2.0, "1", "test",
        "ratio of measured noise to the scatter of the samples that is reported")
    rounding_share: float = row(0.2, "1", "test",
        "share of the noise that is rounding from which its size is unknown")
    most_in_local_minimum: int = row(3, "1", "campaign", "segments that may be in a wrong minimum")
    chi2_chance: float = row(4.0, "1", "test",
        "standard deviations by which chi^2 may be too large by chance")
    # decision/other_machine.py
    other_factor: float = row(3.0, "1", "test",
        "ratio of a known parameter to that of the case that is reported")
    force_alike: float = row(0.8, "1", "test",
        "correlation of a measured force and that of the case that shows a factor")
    unit_factor: float = row(5.0, "1", "test", "factor from which units are its likely reason")
    mass_known: float = row(0.1, "1", "test", "relative standard error with which a mass is known")
    force_missed: float = row(0.1, "1", "test",
        "share of a force that may be missed where the mass determines its unit")
    drive_missed: float = row(10.0, "1", "test", "reduced chi^2 of a record that a wrong drive would leave")
    another_phase: float = row(0.3, "rad", "rig", "distance from a stated phase that is no error of reading")
    drive_orders: tuple = row((1, 2, 3), "1", "test",
        "orders of harmonics and subharmonics that a motion may follow")
    clear_line: float = row(0.5, "1", "test", "share of the power of x that a clear line has")
    line_error: float = row(0.02, "1", "test", "error of a spectral line over its frequency")
    line_bin: float = row(0.5, "1", "test", "the same over the distance of two bins")
    finer_bins: int = row(8, "1", "rounding", "points of the spectrum between two bins")
    # decision/remains.py
    worth_words: float = row(0.2, "1", "campaign",
        "remainder over the noise of a sample from which its dependence is reported")
    # decision/rounds.py
    certain_refits: int = row(5, "1", "effort", "leading effects of the screen that are fitted")
    related: float = row(0.7, "1", "campaign",
        "cosine with one of the first three from which an effect is fitted too")
    worth_a_refit: float = row(1.0, "log-likelihood", "campaign", "promise of an effect that is worth a fit")
    fewest_refits: int = row(2, "1", "effort", "effects that are fitted whatever they promise")
    bad_base: float = row(1.3, "1", "campaign",
        "reduced chi^2 of the base above which every effect is fitted")
    crossed: int = row(4, "1", "effort", "leading candidates that are tried again from the best")
    worth_crossing: float = row(5.0, "log-likelihood", "campaign", "least gain of the best for that")
    crossed_share: float = row(0.3, "1", "campaign", "least share of the best evidence for that")
    curved_share: float = row(0.05, "1", "campaign",
        "share of the best promise from which an effect absent at no size is tried")
    near: float = row(3.0, "separation", "campaign",
        "distance from the best up to which a candidate is fitted to convergence")
    # decision/scoring.py
    bootstrap_block: int = row(2, "segment", "test", "length of a block of the bootstrap")
    few_segments: int = row(5, "1", "test", "fewer segments have no distribution to draw from")
    silent_segment: float = row(0.01, "1", "test",
        "share of the mean information below which a segment has none")
    doubtless: float = row(10.0, "log-likelihood", "test",
        "gain in training that no held-out record need confirm")
    better_segments_p: float = row(0.05, "1", "test",
        "p value of the number of segments that are predicted better")
    not_linear: float = row(0.2, "1", "rig", "share of what imperfections do that is not linear")
    kink_share: float = row(0.01, "1", "campaign", "share of a gain that a fit at a kink may still promise")
    # decision/several.py
    pairs: int = row(6, "1", "effort", "pairs of effects that the screen finds and that are fitted")
    closes_of_rest: float = row(0.5, "1", "campaign",
        "share of the remaining gap that an effect must close for another to follow")
    swapped_share: float = row(0.3, "1", "campaign",
        "share of the evidence of an effect from which one of its family replaces it")
    # decision/stages/character.py
    usable_motion: float = row(1e-6, "1", "rounding",
        "least usable eigenvalue of scaled equations of motions")
    usable_force: float = row(1e-11, "1", "rounding", "the same of forces, which are exact")
    constant_halvings: int = row(3, "1", "effort", "halvings of the distance of the values of a constant")
    faded: float = row(1.3, "1", "campaign",
        "factor of the lowest constant below which a hidden state is none")
    akin: float = row(0.4, "1", "campaign",
        "share of the best evidence at which a variable of the same kind may be right")
    nearly_all: float = row(0.9, "1", "campaign", "share of the gap that the best must close to exclude it")
    closed_at_location: float = row(0.95, "1", "campaign",
        "share of the gap that a force of one joint must close")
    # decision/stages/in_part.py
    pairs_in_part: int = row(12, "1", "effort", "pairs of effects that are fitted for names in part")
    hardly_apart: float = row(0.98, "1", "test",
        "correlation of the estimates of two effects from which they are known as a pair only")
    leaders_in_part: int = row(2, "1", "effort",
        "leading effects to which another is added for names in part")
    closes_in_part: float = row(0.1, "1", "campaign",
        "share of the held-out gap that is worth a name in part")
    # decision/stages/one_effect.py
    renewals: int = row(3, "1", "effort", "refits of the base machine")
    renewing_leaders: int = row(3, "1", "effort", "leading candidates whose minima the base is fitted from")
    lower_base: float = row(1.0, "1", "test", "fall of chi^2 from which the base is renewed")
    lower_base_share: float = row(0.01, "1", "test", "the same over the gain of the best candidate")
    # decision/stages/rig_imperfections.py
    hiding: float = row(10.0, "log-likelihood", "campaign",
        "what imperfections must explain to hide an effect")
    hiding_share: float = row(0.3, "1", "campaign", "the same over the gap")
    imperfect_rounds: int = row(2, "1", "effort", "iterations of the motion along which imperfections act")
    # decision/memory.py
    memory_gap: float = row(2.0, "1", "test", "chi^2 of a sample above which memory is looked for")
    memory_closed: float = row(0.5, "1", "test", "share of a gap that a law with memory must close")
    memory_odds: float = row(3.0, "1", "test", "difference of two laws, stroke by stroke, over its error")
    memory_alike: float = row(1.1, "1", "test", "ratio of what two laws leave that does not distinguish them")
    memory_knots: int = row(12, "1", "campaign", "knots of a force without memory, over speed and position")
    memory_ridge: float = row(1e-7, "1", "rounding", "least weight of an unknown that no sample determines")
    # decision/stages/several_effects.py
    closes_held_out: float = row(0.5, "1", "campaign",
        "share of a held-out gap that another effect must close")
    # decision/verdict.py
    experiments: int = row(5, "1", "effort", "experiments that are reported")
    experiment_rivals: int = row(4, "1", "effort", "rivals that they should separate")
    # decision/where.py
    impact_bins: int = row(4, "1", "test", "bins of the impact speed")
    impacts_per_bin: int = row(3, "1", "test", "least impacts of a bin")
    flag_level: float = row(0.01, "1", "test", "false discovery rate of flagged bins")
    map_block: int = row(2, "segment", "test", "length of a block of the bootstrap of maps")
    map_nearly: float = row(0.9, "1", "campaign",
        "share of what the best map explains at which a simpler one is as good")
    map_of_name: float = row(0.75, "1", "campaign", "the same for the map of a named effect")
    at_rest: float = row(0.02, "1", "test",
        "share of the largest speed within which a bin of speeds is at rest, where no force is known")
# fmt: on


SEARCH = Search()
