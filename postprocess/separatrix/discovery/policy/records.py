# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Thresholds of records: what is refused, reported, cut and condensed."""

from dataclasses import dataclass

from separatrix.discovery.policy.row import row


# fmt: off
@dataclass(frozen=True)
class Records:
    """Thresholds of records: what is refused, reported, cut and condensed."""

    # measured/arrays.py
    channels_apart: float = row(0.01, "interval", "rig", "difference of the times of two channels")
    # measured/clock.py
    gap: float = row(1.5, "interval", "rig", "time step that is a gap")
    fewest_in_piece: int = row(12, "sample", "test", "shortest piece without gaps that is fitted")
    uneven: float = row(0.01, "interval", "rig", "usual deviation of time steps of uneven stamps")
    around_step: int = row(7, "sample", "rig", "rows beside an uneven step that distinguish loss from delay")
    late: float = row(1.25, "interval", "rig", "step of a late stamp")
    lost: float = row(2.0, "interval", "rig", "step of a lost sample")
    # measured/condense.py
    condensed_from: float = row(450.0, "1/period", "effort",
        "samples per period above which a record is condensed")
    condensed_to: float = row(200.0, "1/period", "effort", "samples per period that are smoothed then")
    never_condensed: int = row(10_000, "sample", "effort", "length of a record that is fitted as it is")
    block_values: int = row(4, "1", "campaign", "values that replace a block")
    shortest_block: int = row(16, "sample", "campaign", "shortest block")
    longest_block: float = row(1 / 16, "period", "campaign", "longest block")
    block_chi2: float = row(9.2, "1", "test",
        "chi^2 of two terms that noise exceeds in one of a hundred blocks")
    jump_shift: float = row(0.1, "1", "test",
        "share of the noise by which a jump of the acceleration may shift values")
    jump_hidden: float = row(0.004, "1", "test", "share of such a jump in the terms that a block leaves out")
    condensed_memory: float = row(0.9, "1", "test", "memory of noise above which a record is not condensed")
    memory_block: int = row(32, "sample", "test", "blocks in which that memory is measured")
    most_rows: int = row(200_000, "sample", "effort", "longest record that is fitted")
    # measured/driven.py
    driven_rest: float = row(3.0, "1", "test",
        "standard errors of the speed within which a body may be at rest")
    driven_rest_share: float = row(1e-4, "1", "test", "share of the usual speed where errors are 0")
    driven_errors: float = row(2.0, "1", "test", "factor for correlated errors of neighbouring accelerations")
    driven_beginning: float = row(0.1, "1", "campaign",
        "share of the way on which friction may depend on earlier motion")
    # measured/in_force.py
    most_in_force: int = row(40_000, "sample", "effort", "longest record that is compared in force")
    exact_force: float = row(5e-4, "1", "rig", "least noise of a force over its scatter")
    # measured/preflight.py
    samples_per_period: int = row(12, "1/period", "test", "least samples per drive period")
    fewest_periods: float = row(2.0, "period", "test", "least drive periods of a record")
    frequency_off: float = row(0.01, "1", "rig",
        "difference of a stated drive frequency from that of the crank angle")
    uneven_pieces: float = row(1e-2, "interval", "rig",
        "difference of the intervals of two pieces with a measured force")
    size_ratio: float = row(50.0, "1", "test",
        "ratio of a record to what its drive lets the machine do that is an error of units")
    holding: float = row(0.25, "1", "rig",
        "dry friction of the case over the force of the drive from which it may hold the body")
    moving: float = row(5.0, "1", "test", "scatter of a motion over that of noise")
    slow_blocks: int = row(64, "1", "test", "blocks whose means show a slow motion below the noise")
    speed_ratio: float = row(2.0, "1", "test",
        "ratio of the velocity to the slope of the position that is one")
    most_lag: int = row(4, "sample", "rig", "samples by which x may lag behind v")
    speed_alike: float = row(0.9, "1", "test", "correlation of both above which no blocks are needed")
    speed_blocks: int = row(400, "1", "test", "least number of blocks")
    angle_rounding: float = row(1e-9, "rad", "rounding", "error of a crank angle that is rounding")
    angle_disagreement: float = row(1.5, "1", "test",
        "ratio of its scatter to its stated noise that is reported")
    # measured/records.py
    fewest_samples: int = row(60, "sample", "test", "shortest record")
    largest_value: float = row(1e100, "SI", "rounding", "largest value: squares of larger ones overflow")
    # measured/segments.py
    segment_samples: int = row(6, "sample", "test", "shortest segment")
    impact_margin: int = row(2, "sample", "campaign", "samples between a start and an impact")
    slow_start: float = row(0.3, "1", "campaign", "share of the usual speed below which no segment starts")
    # measured/sensor_imperfections.py
    stray: tuple = row((20.0, 5.0, 3.0), "1", "test",
        "stray sample over the noise, over the grid, over changes of steps beside it")
    stray_rows: int = row(5, "sample", "test", "rows beside it")
    most_stray: int = row(3, "sample", "test", "most stray samples of a record")
    held: tuple = row((20.0, 3.0, 2.0), "1", "test",
        "jump after a held value over the noise, the grid, the usual steps")
    shortest_held: int = row(3, "sample", "test", "shortest held value")
    slow_sensor: float = row(3.0, "1", "test", "usual jump of a slow sensor over the distance of its values")
    clipped_run: int = row(5, "sample", "test", "shortest run at a limit that is clipping")
    clipped_share: float = row(0.02, "1", "test", "share of samples at a limit from which it is clipping")
    abrupt: tuple = row((1.5, 0.05), "1", "test",
        "step to a clipped value over the grid and over the usual step")
    grid_of_noise: float = row(0.5, "1", "test", "noise over the grid that never repeats a number by chance")
    fewest_inside: int = row(20, "sample", "test", "samples inside the limits of a force")
    # measured/sensors.py
    most_of_bodies: int = row(50_000, "sample", "effort", "longest record of several bodies")
    # measured/cranks.py
    steady_voltage: float = row(0.01, "1", "rig", "slow change of a voltage over its mean in one record")
    fewest_pulses: int = row(4, "1", "test", "least pulses of the crank in a record")
    # measured/signals.py
    clipped_noise: float = row(3.0, "1", "test",
        "standard deviations within which fourth differences are noise")
    in_motion: float = row(0.9, "1", "campaign", "quantile of accelerations that motion reaches")
    moving_share: float = row(0.3, "1", "campaign",
        "share of this quantile that is their usual size where a body mostly rests")
    quiet: float = row(1e-6, "1", "rounding", "noise that is assumed where none is found, over the scatter")
    off_grid: float = row(0.05, "1", "rounding",
        "deviation of a multiple of the step of a grid from a whole number")
    jump: float = row(4.0, "1", "test", "jump over the noise")
    sudden: float = row(3.0, "1", "test", "jump over the excess of the steps beside it")
    beside_jump: int = row(7, "sample", "test", "steps beside it")
    fine_grid: float = row(0.3, "1", "rounding", "grid over the noise that is that of the digits in a file")
    # measured/smoother.py
    tuned_samples: int = row(600, "sample", "effort", "samples that tune the smoother")
    impact_sigmas: float = row(6.0, "1", "test", "jump of the velocity at an impact over its error")
    impact_medians: float = row(4.0, "1", "test", "the same over the usual jump")
    fewest_still: int = row(4, "sample", "test", "shortest stick")
    # measured/tables.py
    most_samples: int = row(10_000_000, "sample", "effort", "longest record that is read")
    most_header: int = row(1000, "line", "effort", "longest header")
    chunk: int = row(1_000_000, "byte", "effort", "bytes that are looked at together")
    # measured/tdms.py
    beside_burst: float = row(0.5, "interval", "rig", "distance of a burst from the end of the last one")
    # measured/thinned_record.py
    thinned_rows: int = row(4000, "1", "effort", "rows to which a record of several bodies is thinned")
    rough: float = row(5.0, "1", "test", "fourth difference of means over its noise that is rough")
    white: float = row(1.2, "1", "test", "noise of means over that of white noise that is white")
    most_rough: float = row(0.1, "1", "test", "share of rows that may be rough")
    # workflow.py
    held_out_end: float = row(0.3, "1", "campaign", "share of an only record that is held out")
    held_out_periods: float = row(2.05, "period", "campaign", "drive periods that it has at least")
# fmt: on


RECORDS = Records()
