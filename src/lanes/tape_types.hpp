// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// What the kernel for tapes and its caller share beside `lane_types.hpp`. `tape_types.f90` mirrors these
// structures member by member.
#ifndef SEPARATRIX_TAPE_TYPES_HPP
#define SEPARATRIX_TAPE_TYPES_HPP

#include "lane_types.hpp"

enum {
  tape_order = 18,
  most_tape_nodes = 192,
  most_tape_series = 64,
  most_tape_variables = 12,
  most_tape_switches = 8,
  most_tape_checks = 16,
  most_tape_terms = 256,
  tape_levels = 10,
  tape_speeds = 4,
  tape_boxes = tape_levels * tape_speeds,
  most_tape_section = 10,
  tape_metric_numbers = most_tape_section * (most_tape_section + 1) / 2,
  most_tape_regions = 64,
  tape_phase = 0,
  tape_speed = 1,
  tape_x = 2,
  tape_v = 3
};

// Operations as in `operations.f90`, and products and quotients with a factor that does not vary; a branch
// by the direction of slip.
enum {
  tape_constant = 1,
  tape_variable,
  tape_parameter,
  tape_add,
  tape_subtract,
  tape_multiply,
  tape_divide,
  tape_power,
  tape_negative = 10,
  tape_square,
  tape_sqrt,
  tape_exp,
  tape_log,
  tape_sin,
  tape_cos,
  tape_tan,
  tape_atan = 20,
  tape_sinh,
  tape_cosh,
  tape_tanh,
  tape_select,
  tape_scale,
  tape_divide_steady,
  tape_slip,
  tape_select_slip,
  // Of an argument that grows evenly in time.
  tape_sin_even,
  tape_cos_even,
  // Of terms from number `first` on, `second` of them, and the node `other` that does not vary (-1: none).
  tape_sum
};

// A node: numbers of its arguments, and where their series and its own are kept (-1: not). Of functions the
// first is the series of derivatives of the argument, the second that of the partner. Of a branch `value` is
// the number of the switching function, which `other` is the node of.
struct tape_node {
  int operation, first, second, first_series, second_series, series, slopes, other;
  double value;
};

// A node times one that does not vary.
struct tape_term {
  int node, factor;
};

// Where coefficient k of a node is in `tape_values`, in vectors: at `index`, or k further where `moves` is -1
// (0: it stays).
struct tape_operand {
  int index, moves;
};

// What is done with a node in every order: as `tape_node`, with the node that does not vary (of a branch the
// number of the switching function), or with `count` parts from number `first` on. `first`, `second` and
// `own` are numbers of series.
struct tape_operation {
  int operation, node, steady, first, second, own, slopes, count;
  tape_operand a, b, to;
};

// A node whose series follows from the state at once: a variable with the node `other` of its rate, a sum, or
// a sine and the series `other` of its cosine, of an argument with `slopes`.
struct tape_even {
  int operation, node, series, slopes, other, unused;
};

// How the coefficients of a variable follow: from a node times one that does not vary (-1: none); `index` is
// -1 where its rate does not vary.
struct tape_change {
  tape_operand from;
  int factor, slopes;
};

// A node that may change more than its series shows, with the series of its argument, of a quotient that of
// the divisor; its own series where it may be nearly constant (-1: its argument must not come near zero).
struct tape_check {
  int node, argument, own, unused;
};

struct tape_region {
  double attractor, point[most_tape_section], scaling[most_tape_section], metric[tape_metric_numbers], reach;
};

// The variables are the phase [rad], its speed, position and velocity of a body, and further states; with a
// `clock` the time [s] and the phase of a drive come first, and the section comes once in a `period` [s];
// with 2 the time goes on there. Nodes before `by_slip` are numbers, those from there to `varying` depend on
// the sign of slip alone.
struct tape_machine {
  int nodes, by_slip, varying, variables, clock, switches;
  // There are impacts or dry friction: what a step leaves out is proven, else `checks` serve. Forces do not
  // depend on the sign of the velocity, and there are no stops: turning points are no events. Forces repeat
  // after a period as they are: lanes pass its end within a step. Some branches are by the sign of the
  // velocity.
  int proves, turns_freely, passes, checks, terms, branches_by_slip;
  // Nodes of what acts on the body at rest, holds it there, and is thrown at an impact, and of the
  // restitution; -1: none, or a number.
  int hold, level, throws, bounce;
  int rate[most_tape_variables];
  // Switching functions: nodes and series.
  int decider[most_tape_switches], decider_series[most_tape_switches];
  tape_check check[most_tape_checks];
  tape_term term[most_tape_terms];
  tape_node node[most_tape_nodes];
  int operations, evens;
  tape_operation operation[most_tape_nodes];
  tape_operand part[most_tape_terms];
  tape_even even[most_tape_nodes];
  tape_change change[most_tape_variables];
  // The time is counted in this unit [s]. Sizes of the variables for the length of a step.
  double unit, tolerance, sizes[most_tape_variables];
  // Boxes of variables (the phase takes any value), of every speed of the phase at every level of the others:
  // half widths as shares of those of the first; longest step for which the remainder is proven, in units;
  // bounds of the remainders over that step.
  double box[most_tape_variables], speed[tape_speeds], level_size[tape_levels], longest[tape_boxes],
      remainder[tape_boxes][most_tape_variables];
  // Stops, what holds the body, kinetic friction, and what bounds the end of a chatter sequence.
  double upper, lower, restitution, hold_level, friction, damping, stiffness, mass, length, longest_rest;
  // Change of the speed of the phase per change of velocity and per `throws`.
  double throw_factor;
  double period, phase_speed, domain;
};

// Beside the variables: the time since the section, that of the section itself where nothing repeats, and the
// number of the switching function that crossed zero at the start, from 1, negative downwards; 0: none. What
// the last proof leaves of a step by the last coefficients.
template <class T> struct tape_fields {
  T z[most_tape_variables];
  T time, slip, since, phase_end, passed, lasted, limit, origin, crossed, proven;
};

struct tape_batch {
  int regions, complete;
  tape_region region[most_tape_regions];
  tape_fields<double[lanes]> fields;
};

#endif
