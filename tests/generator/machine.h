/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later */

/* The simulator that hides an effect in a record. It shares neither code nor method with the program: it uses
 * fixed steps of the classical Runge-Kutta method and locates events by bisection of a step. */
#ifndef GENERATOR_MACHINE_H
#define GENERATOR_MACHINE_H

/* x, v, force of the presliding spring, x and v of a second mass, force of a Maxwell element. */
enum { X, V, Z, X2, V2, U, STATES };

enum { HARMONICS = 6 };

/* Shapes of a restitution that falls with the speed of impact. */
enum { LINEAR, POWER, SATURATING, STEP };

/* SI units; an effect that is not there is 0. */
struct machine {
  double mass, stiffness, free_length;
  /* The foot of the spring: mean + scale * (series in crank + angle), crank = frequency * t + phase. */
  double mean, cosine[HARMONICS], sine[HARMONICS], scale, angle, frequency, phase;
  double coulomb, viscous, restitution, upper;

  double quadratic, stribeck, stribeck_velocity, static_excess, dahl;
  double asymmetric_coulomb, asymmetric_viscous, friction_slope, cubic, offset;
  double restitution_slope, contact_stiffness, contact_damping, lower;
  double ripple_sine, ripple_cosine, ripple_harmonic;

  /* Shapes of these laws; 0 is that of the catalogue. Speeds are over 1 m/s, extensions and depths over
   * 1 m. */
  double quadratic_exponent, stribeck_exponent, cubic_exponent, contact_exponent;
  double restitution_shape, restitution_constant;
  double friction_wave, friction_wave_phase; /* of friction over position [1/m], at x = 0 [rad] */

  /* What the catalogue does not have. Drifts and waves are functions of the time since the record began. */
  double stiffness_wave, stiffness_wave_frequency;
  double friction_drift;
  double second_mass, second_stiffness, second_damping;
  double delayed_stiffness, delay;
  double restitution_wave, restitution_wave_frequency;
  double maxwell_stiffness, maxwell_time;

  /* x and v of the past at equal times, for the delayed force. */
  double *history;
  double history_first, history_step;
  long history_count;
};

long machine_size(void);

/* `count` states at equal intervals from the start at time `t0`, each interval in `substeps` steps, and the
 * number of impacts. Writes the history if there is room for it. Returns 0, or 1 if events piled up. */
int simulate(struct machine *machine, const double start[STATES], double t0, double interval, long count,
             long substeps, double (*states)[STATES], long *impacts);

/* The same for `n` pieces; samples first[i] to first[i + 1] - 1 belong to piece i and start with its start.
 * The history is only read. */
int simulate_pieces(struct machine *machine, long n, const double (*starts)[STATES], const double *t0,
                    const long *first, double interval, long substeps, double (*states)[STATES],
                    long *impacts);

#endif
