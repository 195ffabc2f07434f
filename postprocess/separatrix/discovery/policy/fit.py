# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Thresholds and sizes of fits, tables, functions, noise and instrument imperfections."""

from dataclasses import dataclass

from separatrix.discovery.policy.row import row


# fmt: off
@dataclass(frozen=True)
class Fit:
    """Thresholds and sizes of fits, tables, functions, noise and instrument imperfections."""

    # fitting/base.py
    phases: int = row(12, "1", "effort", "phases of the drive that are tried")
    noise_renewed: float = row(0.03, "1", "test", "relative change of the noise that counts")
    memory_renewed: float = row(0.06, "1", "test", "change of its memory that counts")
    misfit_of_memory: float = row(1.5, "1", "test",
        "reduced chi^2 above which correlated residuals are due to the machine")
    hardly_any: float = row(0.1, "1", "campaign", "share of segments that is hardly any")
    same_sensor: float = row(1.5, "1", "rig",
        "ratio of held-out noise to that of the same sensor in training")
    # fitting/catalogue.py
    far_start: float = row(20.0, "1", "campaign", "factor of a usual size up to which a size is fitted")
    # fitting/ceiling.py
    pieces: int = row(5, "1", "campaign", "pieces of a record with free forces of their own")
    usable: float = row(1e-6, "1", "rounding", "least usable eigenvalue of scaled equations of free forces")
    mostly: float = row(0.5, "1", "campaign",
        "share of the gain of free forces at which one variable closes most")
    # fitting/coordinates.py
    tolerance_of_bodies: float = row(1e-10, "1", "rounding", "tolerance of the motion of several bodies")
    tolerance_of_cranks: float = row(1e-8, "1", "rounding", "tolerance of the motion of body and crank")
    slope_share: float = row(0.25, "1", "rounding",
        "share of an interval over which an acceleration is a slope")
    slope_angle: float = row(1e-3, "rad", "rounding", "the same of the drive")
    joint_step: float = row(1e-6, "1", "rounding", "relative step of a parameter of a joint")
    # fitting/crank_data.py
    zero_step: float = row(0.05, "rad", "effort",
        "step to which the zero of pulses is tried out before it is fitted")
    # fitting/curves.py
    knots: tuple = row((3, 5, 8, 12), "1", "campaign", "numbers of knots of a table that are tried")
    impacts_per_knot: int = row(3, "1", "test", "impacts per knot")
    narrow: float = row(0.05, "1", "campaign", "least range of a variable over its largest value")
    even_knots: float = row(0.5, "1", "campaign", "weight of even knots beside quantiles of the motion")
    # fitting/data.py
    stage_lengths: tuple = row((0.2, 0.5, 1.0), "1", "campaign",
        "lengths of segments in the stages of a fit, over the longest")
    fewest_segments: int = row(10, "1", "test", "least number of segments of a stage")
    few_wrong: float = row(0.25, "1", "campaign",
        "share of wrong segments up to which the others determine the machine")
    most_natural_periods: float = row(1.5, "period", "campaign",
        "natural periods of a segment where the drive is slow")
    squares_behind: float = row(60.0, "1", "campaign", "chi^2 by which a fit is far behind another")
    impact_time_errors: float = row(3.0, "1", "test", "standard errors of the time of an impact")
    beside_impact: float = row(0.03, "1", "campaign",
        "share of the time between impacts that is not compared")
    at_rest_errors: float = row(3.0, "1", "test",
        "standard errors of the speed within which a body may be at rest")
    rest_margin: float = row(4.0, "interval", "test",
        "distance from the ends of a rest up to which friction may jump, in intervals of the smoother")
    # fitting/fit.py
    huber: float = row(1.5, "1", "test", "residual over its noise from which Huber's loss is linear")
    fit_tolerance: float = row(0.02, "1", "campaign", "decrement at which a fit ends")
    fit_near: float = row(0.25, "1", "campaign", "decrement at which a fit has converged")
    fit_kink: float = row(4.0, "1", "campaign", "the same where no step gains it: chi^2 has kinks")
    fit_strongest: float = row(1e8, "1", "rounding", "strongest damping of a step")
    like_noise: float = row(0.03, "1", "test", "excess of reduced chi^2 that is noise")
    fit_mild: float = row(1e-4, "1", "campaign", "damping of the first step")
    fit_little: float = row(0.1, "1", "campaign", "gain of a step that is negligible")
    fit_little_share: float = row(3e-5, "1", "campaign", "the same as a share of chi^2")
    fit_without_gain: int = row(2, "1", "effort", "negligible steps in a row that end a fit")
    fit_patience: int = row(4, "1", "effort", "the same of a patient fit")
    fit_share: float = row(1e-5, "1", "campaign", "decrement over the loss at which a fit ends")
    fit_rough_share: float = row(2e-3, "1", "campaign",
        "the same of a fit by Huber's loss, whose weights converge slowly and which only starts another")
    fit_rough: float = row(0.5, "1", "campaign", "decrement at which a fit ends that only starts another")
    fit_as_promised: float = row(0.25, "1", "campaign",
        "error of a promised gain up to which derivatives are kept")
    fit_falls: float = row(10.0, "1", "campaign", "fall of the decrement for that")
    fit_creeps: int = row(12, "1", "campaign",
        "steps after which a fit looks at bounds in advance and follows bent valleys")
    fit_bends: float = row(0.5, "1", "campaign",
        "share of its promise up to which a step is tried along a curve too")
    fit_curve_share: float = row(0.1, "1", "rounding",
        "share of a step after which the second derivative along it is taken")
    fit_curved_most: float = row(1.5, "1", "campaign", "acceleration of such a curve over its step")
    fit_fewest: int = row(3, "1", "effort", "iterations before a fit may be abandoned")
    fit_lost: float = row(100.0, "1", "campaign", "chi^2 by which an abandoned fit is behind")
    fit_over: float = row(5.0, "1", "campaign", "the same in decrements")
    fit_spared: int = row(3, "1", "campaign", "worst segments that are not counted for that")
    # fitting/forces.py
    instant: float = row(1e-7, "s", "rounding", "time of a flight over which a force is measured")
    instant_share: float = row(1e-2, "1", "rounding",
        "share of the time in which the usual force would stop the body")
    force_tolerance: float = row(1e-12, "1", "rounding", "tolerance of such a flight")
    # fitting/halves.py
    doubtful_law: float = row(1.96, "1", "test",
        "standard errors from zero within which a law of two is doubtful")
    worth_halving: float = row(1.0, "log-likelihood", "test",
        "gain of an effect for its laws to be tried alone")
    # fitting/heldout.py
    misfit_of_errors: float = row(1.5, "1", "test",
        "reduced chi^2 above which errors of the machine exceed the noise")
    # fitting/joint_effects.py
    far_joint_start: float = row(20.0, "1", "campaign",
        "the same of an effect of a joint")
    yields: float = row(0.5, "1", "campaign", "share of the usual impact speed above which a stop yields")
    # fitting/joint_forces.py
    free_knots: int = row(6, "1", "campaign", "knots of a free force")
    free_harmonics: int = row(3, "1", "campaign", "harmonics of a free force over phase")
    imperfect_harmonics_of_bodies: int = row(6, "1", "rig",
        "harmonics of an imperfect drive of several bodies")
    impacts_of_kicks: int = row(4, "1", "test", "impacts of a contact from which on its kicks are tried")
    kick_powers: int = row(4, "1", "campaign", "powers of the speed of a free kick")
    imperfection_size: float = row(5e-4, "1", "rig", "usual size of an imperfection over the signal")
    # fitting/late.py
    late_share: float = row(1e-3, "1", "rounding",
        "share of the time of a first sample over which its acceleration is taken")
    # fitting/locations.py
    still: float = row(1e-9, "1", "rounding",
        "motion over the largest at any location below which there is none")
    lost_friction: float = row(0.1, "1", "campaign",
        "share of the friction of the case below which its size is not known")
    # fitting/machine.py
    mass_factor: float = row(5.0, "1", "rig",
        "factor by which the mass may differ where the force is compared")
    lost_memory: float = row(1e-9, "1", "rounding", "determinant below which a body has lost its memory")
    # fitting/members.py
    dying_bounce: float = row(0.03, "1", "campaign", "share of the largest speed below which bounces die out")
    force_time: float = row(1e-5, "period", "rounding", "time over which a force of a law is measured")
    # fitting/motions.py
    slack_time: float = row(1e-5, "period", "rounding", "the same of a slack spring")
    # fitting/noise.py
    noise_pieces: int = row(4, "1", "test", "pieces of a segment over which residuals are compared")
    noise_samples: int = row(16, "1", "test", "samples of a piece of a measured force")
    noise_powers: int = row(3, "1", "test", "powers of time that are taken from it")
    least_memory: float = row(0.04, "1", "test", "memory of noise below which it is white")
    noise_segments: int = row(4, "1", "test", "segments that determine the size of the noise")
    most_memory: float = row(0.8, "1", "rig", "memory of a force beyond which it is not that of a sensor")
    memory_sure: float = row(3.5, "1", "test", "standard errors of a memory that is no chance")
    noise_outlier: float = row(2.5, "1", "test",
        "ratio of a segment's noise to the usual one that is an outlier")
    # fitting/problem.py
    tolerance: float = row(1e-8, "1", "rounding", "tolerance of an adaptive flight over the position")
    tolerance_share: float = row(0.01, "1", "rounding", "share of the noise that its error may be")
    tolerance_least: float = row(1e-14, "1", "rounding", "least tolerance")
    force_step: float = row(1e-5, "1", "rounding", "relative step of a parameter in force")
    # fitting/refit.py
    delivered: float = row(0.8, "1", "campaign", "share of its promise that makes other starts needless")
    bad_screen: float = row(1.3, "1", "campaign",
        "reduced chi^2 of the base beyond which a screen promises nothing")
    hopeless: float = row(4.0, "1", "campaign", "ratio to the reduced chi^2 of the base that is hopeless")
    beaten: float = row(15.0, "log-likelihood", "campaign", "distance at which a candidate is far behind")
    spared: int = row(3, "1", "campaign", "segments that may be in a wrong minimum")
    followed_more: float = row(0.1, "1", "campaign",
        "share of segments that one fit may follow more than another")
    imitated_behind: float = row(6.0, "log-likelihood", "campaign",
        "distance of a name from another of the same motion")
    imitated_share: float = row(0.1, "1", "campaign",
        "share of its size from which the own size is extrapolated")
    worse: float = row(1.0, "log-likelihood", "test",
        "distance by which a machine that contains the base may be worse")
    same_minimum: float = row(1e-3, "1", "campaign", "share of chi^2 by which two fits of one minimum differ")
    alike_behind: float = row(0.05, "1", "campaign", "the same of two fits far behind")
    alike_near: float = row(0.02, "1", "campaign", "the same of two fits of the base that are nearer")
    near_base: float = row(10.0, "1", "campaign",
        "reduced chi^2 of the base up to which a start from it is trusted")
    hardly_closed: float = row(0.1, "1", "campaign",
        "share of the gap of a base farther off than that below which a start closes nothing")
    nearly_noise: float = row(4.0, "1", "test",
        "standard deviations of chi^2 within which a machine nearly leaves noise")
    nothing_left: float = row(1e-3, "1", "campaign", "share of a gap that is next to nothing of it")
    most_closed: float = row(0.5, "1", "campaign",
        "share of the gap closed by a rival for one start to be enough; by a fit to be carried on at once")
    fit_on: int = row(40, "1", "effort", "iterations of such a fit")
    farthest: float = row(25.0, "1", "campaign",
        "usual sizes beyond which a linearised estimate is not believed")
    # fitting/rescue.py
    suspect: float = row(1.7, "1", "campaign",
        "ratio to the median reduced chi^2 of a segment in a wrong minimum")
    most_rescued: int = row(12, "1", "effort", "segments that are started again")
    rescue_iterations: int = row(15, "1", "effort", "iterations of a start")
    rescue_followed: int = row(2, "1", "effort", "starts that are followed for each number of impacts")
    rescue_numbers: int = row(4, "1", "effort", "such numbers of impacts")
    rescue_gain: float = row(0.01, "1", "campaign", "decrement at which a start ends")
    rescue_strongest: float = row(1e3, "1", "rounding", "strongest damping of its step")
    rescue_alone: tuple = row((-4.0, -2.0, 2.0, 4.0), "1", "effort",
        "errors of one coordinate of a start that are tried")
    # fitting/rig.py
    imperfect_powers: tuple = row((2, 3), "1", "rig", "powers of the position in the curve of a sensor")
    imperfect_harmonics: int = row(6, "1", "rig", "harmonics of an imperfect drive")
    imperfection_largest: float = row(3.0, "1", "rig", "largest imperfection in standard deviations")
    imperfection_narrower: float = row(4.0, "1", "rounding", "factor by which its prior is narrowed for that")
    imperfection_narrowest: float = row(1e15, "1", "rounding", "largest of these factors")
    imperfection_sizes: tuple = row((1.0, 4.0, 16.0), "1", "rig",
        "precisions over that of the prior that are equally likely")
    imperfection_shown: float = row(1e-11, "1", "rounding", "least usable eigenvalue of scaled equations")
    # fitting/screen.py
    screen_seed: int = row(22, "1", "effort", "seed of the bootstrap of the null")
    screen_draws: int = row(4000, "1", "effort", "its draws")
    screen_tail: float = row(0.05, "1", "test", "level at which independent tests are counted")
    screen_same: float = row(1e-3, "noise", "rounding", "difference below which two machines are the same")
    screen_rounding: float = row(1e-100, "1", "rounding", "size of a signature that is rounding")
    screen_nothing: float = row(1e-7, "1", "rounding",
        "share of a signature below which nothing is left of it")
    # fitting/sensed.py
    unseen_periods: float = row(2.0, "period", "campaign",
        "periods that determine coordinates without a sensor")
    corrections: int = row(10, "1/period", "campaign", "corrections of an observer by the measurement")
    chained_stage: int = row(1, "1", "campaign", "stage whose segments are followed one after the other")
    chain_lost: float = row(5.0, "1", "campaign", "cost over the usual one of a segment that is lost")
    chain_neighbours: int = row(6, "1", "effort", "neighbours whose starts are tried then")
    guessed: float = row(0.1, "1", "campaign", "standard error of what was guessed over its size")
    misfit_of_sensors: float = row(1.5, "1", "test",
        "reduced chi^2 above which residuals of sensors are due to the machine")
    least_of_joint: float = row(1e-3, "1", "campaign",
        "least share of a stiffness, mass, friction or restitution")
    # fitting/shapes.py
    form_p: float = row(0.01, "1", "test", "p value from which on a closed form fits")
    form_close: float = row(2e-3, "1", "campaign",
        "largest deviation over the largest value at which it fits")
    # fitting/smooth.py
    function_knots: int = row(16, "1", "campaign", "knots of the function of an effect")
    function_knots_zero: int = row(15, "1", "campaign", "the same where zero is implied")
    series_points: int = row(49, "1", "effort", "points at which a series is drawn")
    knot_passes: int = row(3, "1", "effort", "passes of the choice of knots")
    knot_bend: float = row(0.4, "1", "campaign",
        "power of the second derivative that the density of knots follows")
    function_followed: float = row(0.98, "1", "campaign", "share of the segments that a step must follow")
    function_rounds: int = row(6, "1", "effort", "linearisations of the motion")
    function_halvings: int = row(3, "1", "effort", "halvings of a step")
    function_starts: int = row(6, "1", "effort", "steps of the starts after it")
    function_settled: float = row(0.1, "1", "campaign", "change of chi^2 that is negligible")
    function_near: float = row(1.0, "1", "campaign", "chi^2 per value by which the end may miss")
    function_evened: int = row(3, "1", "campaign", "degree of the start of a jagged table")
    function_trapped: float = row(2.0, "1", "campaign", "ratio of chi^2 to the fit from which it is used")
    function_worse: float = row(10.0, "1", "campaign",
        "chi^2 by which a function may be worse than the effect")
    function_as_promised: float = row(0.3, "1", "campaign",
        "share of a promised change by which a step may miss it")
    function_unknown: float = row(1e-10, "1", "rounding",
        "share of the largest eigenvalue below which a direction is not known")
# fmt: on


FIT = Fit()
