// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// What the kernel for multibody structures and its caller share beside `lane_types.hpp`.
// `structure_types.f90` mirrors these structures member by member.
#ifndef SEPARATRIX_STRUCTURE_TYPES_HPP
#define SEPARATRIX_STRUCTURE_TYPES_HPP

#include "lane_types.hpp"

enum {
  lanes_of_structures = 16,
  most_coordinates = 8,
  most_terms = 16,
  most_joints = 4,
  // Joints of dry friction and soft contacts, and the modes that they make: stuck, pressed or not.
  most_switches = 4,
  most_structure_modes = 16,
  // A function of each joint, and one more of a soft contact that never pulls.
  most_functions = 8,
  most_waves = 8,
  // Directions without a spring, and the powers of time that motions have along them.
  most_drifts = 4,
  most_powers = 4,
  panel_lengths = 4,
  most_section = 2 * most_coordinates,
  metric_numbers = most_section * (most_section + 1) / 2,
  most_structure_regions = 64
};

// One mode of a structure: which of its friction joints stick, which soft contacts are pressed. With E(k) =
// exp((-decay + i turn) t), complex amplitudes a(k), W(m) = exp(i m Omega t), positions b(d) and paces c(d)
// along the directions without a spring
//   q = sum still(p) t^p + sum drift (b + c t) + Re sum shape a E + Re sum wave W,
// and of every joint one function: its coordinate (a contact), its sliding speed, the force that holds it, or
// the force k s + c s' of a soft contact that never pulls,
//   f = sum level(p) t^p + Re sum part a E + Re sum amplitude W.
// After them those forces of contacts that are not pressed. `still` and `level` are sums over the directions
// of the sliding joints, the coordinates of those held, and the positions of the stops that are pressed.
struct structure_mode {
  // How many powers of time it has, 1 where nothing drifts; `idle`: nothing moves at all.
  double known, terms, drifts, powers, idle;
  double decay[most_terms], turn[most_terms];
  // Amplitudes from q - still - Re sum wave W and its rate.
  double from_position_re[most_coordinates][most_terms], from_position_im[most_coordinates][most_terms];
  double from_speed_re[most_coordinates][most_terms], from_speed_im[most_coordinates][most_terms];
  double shape_re[most_terms][most_coordinates], shape_im[most_terms][most_coordinates];
  double wave_re[most_waves][most_coordinates], wave_im[most_waves][most_coordinates];
  double still[most_powers][most_coordinates], still_by_joint[most_powers][most_joints][most_coordinates];
  // Along the directions without a spring: positions and paces from what amplitudes are made from, shapes,
  // and what positions and paces add to the levels.
  double position_from_position[most_coordinates][most_drifts],
      position_from_speed[most_coordinates][most_drifts], pace_from_speed[most_coordinates][most_drifts];
  double drift[most_drifts][most_coordinates];
  double level_by_position[most_drifts][most_functions], level_by_pace[2][most_drifts][most_functions];
  double part_re[most_terms][most_functions], part_im[most_terms][most_functions],
      part_size[most_terms][most_functions];
  double amplitude_re[most_waves][most_functions], amplitude_im[most_waves][most_functions];
  double level[most_powers][most_functions], level_by_joint[most_powers][most_functions][most_joints];
  // Bounds on what the waves have in the functions and their sixth derivatives.
  double steady[most_functions], steady_sixth[most_functions];
  // A step of the root search shorter than this [s] is the last.
  double close;
  // Lengths of panels, longest first [s]; how large the sixth derivative of a function may be, in its own
  // size [1/s^6]; the exponentials and the harmonics over them.
  double panel[panel_lengths], steepest[panel_lengths];
  double step_re[panel_lengths][most_terms], step_im[panel_lengths][most_terms];
  double step_cosine[panel_lengths][most_waves], step_sine[panel_lengths][most_waves];
  // Mass that a sliding joint feels with the others as they are [kg].
  double felt_mass[most_joints];
};

struct structure_joint {
  // 1: dry friction, 1: soft contact; none: rigid contact.
  double slides, soft;
  // A soft contact that may pull, or has no damper, ends where it began; else it ends where its force k s + c
  // s' falls below k [N/m] times the stop, function number `push` (1, ...) where it is not pressed.
  double pulls, stiffness, push;
  // Stops [m], or break-away level [N].
  double upper, lower;
  double has_upper, has_lower;
  double kinetic;
  // Room for rounding, in the unit of the limits.
  double tie;
  // Sliding takes no less force than holding.
  double even;
  // As `lane_machine` has them.
  double restitution, restitution_law, coefficients[2];
  lane_curve curve;
  double row[most_coordinates];
  // Change of the speeds, and of the sliding speeds of the joints, per impulse that changes its own speed by
  // 1 m/s.
  double kick[most_coordinates], cross[most_joints];
};

struct structure_machine {
  double coordinates, joints, pushes, waves;
  double drive_frequency, period, domain;
  // Sliding speeds below this are left to the scalar code [m/s].
  double slowest;
  // Share of the change of a gap's acceleration up to which its chatter is completed, and the longest end of
  // a chatter [s].
  double chatter_share, chatter_time;
  // A flight of this length [s] ends a burst of impacts; impacts after one shorter than `shortest` are left
  // to the scalar code.
  double burst_gap, shortest;
  // By how much stops are missed is noted.
  double misses;
  structure_joint joint[most_joints];
  structure_mode mode[most_structure_modes];
};

// One member per quantity: T is an array over lanes, or the part of it that is in a register.
template <class T> struct structure_fields {
  // The state that the scalar code would go on from; `left`: number of the joint whose guard has just been
  // zero there, with the sign of its side, 0 = none; `rising`: that of the joint that has just given way;
  // `burst`: impacts in a row with next to no time between them.
  T q[most_coordinates], v[most_coordinates], time, left, rising, burst;
  // Friction: direction of the slide, 0 = sticks. Soft contacts: 0 = open, the side on which they are pressed
  // (+1, -1) or without force but not yet free (+2, -2). Of rigid contacts 0.
  T phase[most_joints];
  // The flight: start [s after the section], amplitudes, coordinates of the joints held.
  T start, re[most_terms], im[most_terms], held[most_joints];
  // Positions and paces along the directions without a spring.
  T position[most_drifts], pace[most_drifts];
  // What ends it: 1 = found, 2 = the next stop, when, joint (1, ...; 0 = none, the flight goes on), side;
  // amplitudes then; functions of the joints and their rates then.
  T found, span, joint, side, end_re[most_terms], end_im[most_terms], end_f[most_functions],
      end_f1[most_functions];
  // Counted like those of `lane_fields`.
  T sticks;
};

// The neighbourhood of a point of an attractor on the section, in the coordinates q, v.
struct structure_region {
  double attractor, reach;
  double point[most_section], scaling[most_section], metric[metric_numbers];
};

struct structure_batch {
  structure_fields<double[lanes_of_structures]> fields;
  // Unless the regions are all, every lane stops at every section.
  int regions, complete;
  structure_region region[most_structure_regions];
};

#endif
