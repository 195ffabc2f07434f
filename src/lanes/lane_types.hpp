// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// What the kernel and its caller share. `lane_types.f90` mirrors these structures member by member.
#ifndef SEPARATRIX_LANE_TYPES_HPP
#define SEPARATRIX_LANE_TYPES_HPP

#include <cstdint>

enum {
  lanes = 16,
  most_harmonics = 64,
  layer_nodes = 10,
  most_regions = 64,
  lane_modes_count = 6,
  most_knots = 16,
  // Of the series of machines without a closed form.
  series_order = 18,
  // Tables of a force: over the extension, over the position, the factor of dry friction over the position,
  // friction over the speed upwards and downwards, free play over the extension.
  over_extension = 0,
  over_position = 1,
  factor_over_position = 2,
  over_speed = 3,
  over_speed_downwards = 4,
  over_play = 5,
  tables = 6
};

// A thin Stribeck layer: excess friction per mass E exp(-(w/v_s)^delta) [m/s^2]. No layer: excess 0.
struct lane_layer {
  double excess, thickness;
  // The edge, and a speed a little below: between both the excess friction is nil, too [m/s].
  double edge, level;
  // Error of the speed that is none [m/s], and the largest share of the excess friction in the acceleration.
  double precision, steepest;
  // Nodes over the speed, from rest to the edge: speed, excess friction, weight [m/s].
  double speed[layer_nodes], force[layer_nodes], weight[layer_nodes];
  // Integrals from rest, and from the edge, to a node (second index) of what has values at the nodes (first
  // index) [m/s].
  double from_rest[layer_nodes][layer_nodes], from_edge[layer_nodes][layer_nodes];
  // Those of e, and half of those of e^2, e = exp(-(w/v_s)^delta).
  double first_from_rest[layer_nodes], second_from_rest[layer_nodes];
  double first_from_edge[layer_nodes], second_from_edge[layer_nodes];
};

// A mode of slip of a machine that has several: number 2 pressed_on + (0 up, 1 down), pressed_on 0 = free, 1
// = pressed on the upper and 2 on the lower barrier. Positions are relative to `origin` [m].
struct lane_mode {
  double natural, damped, decay, origin, rest;
  // Where the flight ends unless it turns before, and the position that follows there; -1 = an impact. With a
  // `lead` [s] the end is where that time ahead the position would reach the barrier at the present speed.
  double barrier, leads_to, lead;
  // Duration at which the search for the end begins (0: that of the last flight), and as for the machine.
  double guess, close, stride;
  // Bounds on the seventh and the sixth derivative of the position.
  double bound_periodic, bound_free, sixth_periodic, sixth_free;
  double cosine[most_harmonics], sine[most_harmonics];
};

// A table by its pieces: piece 0 is the line before the first knot, the last one that behind the last knot.
// In each from `low` to `high`, which are a little beyond its knots: c0 + c1 u + c2 u^2 + c3 u^3, u the
// distance from `from`. No table: knots 0.
struct lane_table {
  double knots, from[most_knots + 1], low[most_knots + 1], high[most_knots + 1], c[most_knots + 1][4];
};

// The forces of a machine without a closed form, per unit of mass, and what its series needs; see
// `effect_law.f90`. A closed form: series 0.
struct lane_law {
  double series;
  double stiffness, pendulum, cubic, viscous, asymmetric_viscous, quadratic, cubic_damping, kinetic,
      asymmetric, offset;
  // Spring without extension where the foot is at its mean [m].
  double length;
  // Stribeck excesses, and the speed above which they are nil; all dry friction at rest.
  double excess[2], velocity[2], exponent[2], edge, rest_friction;
  // Dahl's sigma [N/m] and level up and down [N], where the other forces are per mass.
  double dahl_stiffness, dahl_level[2], inverse_mass;
  // Logarithm of the length to which errors are compared.
  double log_scale;
  // Coefficient k of a harmonic n + 1 of the drive is foot_rate[n][k] times the harmonic, or, where k is odd,
  // times what its sine and cosine make when turned on by a quarter.
  double foot_rate[most_harmonics][series_order];
  // Forces by tables, per mass; 1 if there are any. What friction over the speed is at rest, upwards and
  // downwards.
  double has_tables;
  lane_table table[tables];
  double change_at_rest[2];
};

// A soft barrier whose contacts are expanded in series: stiffness p^n (1 + damping p'), or stiffness p +
// damping p' if `linear`, per unit of mass. No such barrier: stiffness 0.
struct lane_contact {
  double stiffness, damping;
  // 2 n.
  double twice_exponent, linear;
  // Each impact has the damping divided by its speed.
  double by_impact;
  // Degree of the polynomial of the foot of the spring, and the time over which it holds [s].
  double foot_terms, foot_time;
  // Logarithms of the stiffness and of half of that time.
  double log_stiffness, log_foot_time;
};

// Change of the restitution over the speed, by knots; see `curve_law.f90`.
struct lane_curve {
  double count, at[most_knots], value[most_knots], slope[most_knots];
};

// The machine, per unit of mass where forces are meant, SI.
struct lane_machine {
  enum { modal = 0 };
  double natural, damped, decay, drive_frequency, period;
  // Equilibrium without friction, and how far sliding friction moves it [m].
  double rest, offset;
  // Sliding and break-away friction per mass [m/s^2].
  double kinetic, break_away;
  double upper, lower, restitution;
  // How the restitution depends on the impact speed, and the two numbers of that law.
  double restitution_law, coefficients[2];
  // Rebounds up to this speed [m/s] may belong to a chatter sequence: left to the scalar code.
  double slow;
  // |x| up to which a flight is kept [m].
  double domain;
  // Bound on |d7x/dt7|: of the periodic response, and per unit of |Z|.
  double bound_periodic, bound_free;
  // A step of the root search shorter than `close` [s] is the last; without a guide it strides on by `stride`
  // [s].
  double close, stride;
  // Periodic response x = sum cosine(n) cos(n phi) + sine(n) sin(n phi), n = 1 ... [m].
  int harmonics;
  double cosine[most_harmonics], sine[most_harmonics];
  lane_layer layer;
  // More than one linear equation: 1. Dry friction is in proportion to 1 + friction_slope x; bound on the
  // rate of the drive's force [m/s^3].
  double several_modes, friction_slope, force_rate;
  lane_mode mode[lane_modes_count];
  // Without a closed form, or with contacts in series; then `cosine` and `sine` are those of the foot of the
  // spring.
  lane_law law;
  lane_contact contact;
  lane_curve curve;
};

// Laws of restitution, by the numbers of `contact_law.f90`.
const double constant_restitution = 0, linear_restitution = 1, power_restitution = 2,
             viscoelastic_restitution = 3, curve_restitution = 6;

// What a lane is doing.
const double lane_idle = 0, lane_flying = 1, lane_stopped = 2, lane_left = 3, lane_fresh = 4;

// One member per quantity: T is an array over lanes, or the part of it that is in a register.
template <class T> struct lane_fields {
  T status;
  // Where the lane stops [s after the section].
  T until;
  // The state that the scalar code would go on from.
  T time, x, v;
  // The flight: start [s after the section, negative if before it], direction, velocity, acceleration and
  // its rate at the start, free part Z of the motion.
  T start, direction, start_v, start_a, start_j, z_re, z_im;
  // The last flight up and down: its duration, and whether it ended at a barrier. Where the next search
  // begins.
  T up_span, down_span, up_hits, down_hits;
  // The event found at the end of the flight: 1 = found, when, whether at a barrier, the motion just before
  // it.
  T found, span, hits, end_x, end_v, end_a, end_j, end_re, end_im;
  // Counts and extremes since the caller last took them away. A section ends a flight, too.
  T flights, impacts, speed_sum, last_speed, margin;
  // Sections that the lane passes before it stops at one; the flights after which it is left to the scalar
  // code; whether it stops where it has converged. Time since the start of the trajectory, the attractor to
  // which it has converged (0 = none), and since when (-1 = not).
  T sections, budget, leaves, elapsed, reached, settled;
  // From here on with several modes, or a Stribeck layer, only. Free, or pressed on the upper (1) or the
  // lower barrier (2).
  T pressed_on;
  // Speed of the impact that the contact began with [m/s], 0 if none did.
  T touch;
  // Dahl's friction [N].
  T z;
  // The time since the start of the flight at which the body leaves
  // the layer (`start_v`, ... are those then), and at which it enters it again or hits, with its motion.
  // Fourth derivative at the end of the flight.
  T skip, reach, reach_v, reach_a, reach_j, end_s;
};

// The neighbourhood of a point of an attractor on the section: its points, relative to that one and times
// `extension`, have a square below `reach` in the metric.
struct lane_region {
  double attractor, x, v, scaling_x, scaling_v, metric_xx, metric_xv, metric_vv, reach;
};

// What the lanes can converge to; a point in several belongs to the first. Unless these are all, every lane
// stops at every section.
struct lane_regions {
  int count, complete;
  lane_region region[most_regions];
};

struct lane_batch {
  lane_fields<double[lanes]> fields;
};

// What rides along with the bodies of a batch: two directions of change of the free part Z, the second at
// right angles to the first, and the product of a+/a- over the turning points. Their lengths grow and shrink
// with the motion; whoever reads them begins them anew.
template <class T> struct tangent_fields {
  T first_re, first_im, second_re, second_im, turns;
};

struct lane_tangents {
  tangent_fields<double[lanes]> fields;
};

// What is looked at on the way of the bodies of a batch: `count` samples of each lane, `most` from lane to
// lane, at ascending `times` [s, on the clock of `until`], of which `taken` are there; and impacts: time,
// speeds before and after [m/s] (not a number while a soft contact lasts), side. More than fit are counted
// only. A lane is left to the event loop after `most_steps`.
enum { most_impacts = 16, impact_rows = 4 };

struct lane_samples {
  int64_t most;
  const int64_t *count;
  const double *times;
  int64_t *taken;
  double *x, *v;
  int64_t *impacts;
  double *impact, most_steps, *steps;
};

// Bodies on a GPU, see `lane_gpu.hpp`: by CUDA, or on the host for tests. 0 = all went well, else `message`
// states what has failed.
struct lane_gpu {
  // Devices that can be used; where there are none, `message` may state why. The number that CUDA gives to
  // the one at `index` among them, from 0, which the others take.
  int (*count)(char *message, int size);
  int (*number)(int index);
  void (*name)(int device, char *text, int size);
  // Makes both halves on a device, of at most `wanted` batches each; `batches`: as many as there are.
  int (*open)(int device, int64_t wanted, lane_batch *halves[2], int64_t *batches, char *message, int size);
  // Sends the first `batches` of a half to fly; waits until they are back.
  int (*send)(int half, int64_t batches, const lane_machine *, const lane_regions *, char *message, int size);
  int (*wait)(int half, char *message, int size);
};

#endif
