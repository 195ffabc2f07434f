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
  most_tape_variables = 8,
  tape_levels = 10,
  tape_speeds = 4,
  tape_boxes = tape_levels * tape_speeds,
  most_tape_section = 4,
  tape_metric_numbers = most_tape_section * (most_tape_section + 1) / 2,
  most_tape_regions = 64,
  tape_phase = 0,
  tape_speed = 1,
  tape_x = 2,
  tape_v = 3
};

// Operations as in `operations.f90`, and products and quotients with a factor that does not vary.
enum {
  tape_constant = 1,
  tape_variable,
  tape_parameter,
  tape_add,
  tape_subtract,
  tape_multiply,
  tape_divide,
  tape_negative = 10,
  tape_square,
  tape_sqrt,
  tape_exp,
  tape_log,
  tape_sin,
  tape_cos,
  tape_scale = 25,
  tape_divide_steady,
  tape_slip
};

// A node: numbers of its arguments, and where their series and its own are kept (-1: not). Of exp, sin and
// cos the first is the series of derivatives of the argument, the second that of the partner.
struct tape_node {
  int operation, first, second, first_series, second_series, series, slopes, unused;
  double value;
};

struct tape_region {
  double attractor, point[most_tape_section], scaling[most_tape_section], metric[tape_metric_numbers], reach;
};

// The variables are the phase [rad], its speed, position and velocity of a body, and further states. Nodes
// before `by_slip` are numbers, those from there to `varying` depend on the sign of slip alone.
struct tape_machine {
  int nodes, by_slip, varying, variables, hold, throws;
  int rate[most_tape_variables];
  tape_node node[most_tape_nodes];
  // The time is counted in this unit [s]. Sizes of the variables for the length of a step.
  double unit, tolerance, sizes[most_tape_variables];
  // Boxes of variables (the phase takes any value), of every speed of the phase at every level of the others:
  // half widths as shares of those of the first; longest step for which the remainder is proven, in units;
  // bounds of the remainders over that step.
  double box[most_tape_variables], speed[tape_speeds], level_size[tape_levels], longest[tape_boxes],
      remainder[tape_boxes][most_tape_variables];
  // Stops, what holds the body, kinetic friction, and what bounds the end of a chatter sequence.
  double upper, lower, restitution, hold_level, friction, damping, stiffness, mass, length;
  // Change of the speed of the phase per change of velocity and per `throws`.
  double throw_factor;
};

template <class T> struct tape_fields {
  T z[most_tape_variables];
  T time, slip, since, phase_end, passed, lasted, limit;
};

struct tape_batch {
  int regions, complete;
  tape_region region[most_tape_regions];
  tape_fields<double[lanes]> fields;
};

#endif
