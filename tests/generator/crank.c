/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A body on a spring whose foot a motor moves through a scotch yoke, by fixed steps of the classical
 * Runge-Kutta method; events are located by bisection of a step. It shares neither code nor method with the
 * program. */
#include <math.h>
#include <stdlib.h>

/* Crank angle and speed, x, v, current, force of a Maxwell element. */
enum { PHI, W, X, V, I, U, STATES };

/* SI units; what is not there is 0. */
struct crank_machine {
  double mass, stiffness, damping, coulomb, stribeck, stribeck_velocity, upper, restitution, offset;
  double amplitude, second_harmonic, inertia, bearing_damping, bearing_friction;
  /* The torque k i of a current L i' = U - R i - k w; without an inductance it follows at once. */
  double voltage, torque_constant, resistance, inductance;
  /* What no base machine has: a spring in series with a damper beside the spring; a wave of the inertia. */
  double maxwell_stiffness, maxwell_time, inertia_wave;
};

long crank_size(void) { return (long)sizeof(struct crank_machine); }

static double current_of(const struct crank_machine *m, const double *s) {
  return m->inductance > 0 ? s[I] : (m->voltage - m->torque_constant * s[W]) / m->resistance;
}

static double foot(const struct crank_machine *m, double phi) {
  return m->amplitude * cos(phi) + m->second_harmonic * cos(2 * phi);
}

/* Force on the body without dry friction. */
static double force(const struct crank_machine *m, const double *s) {
  return m->stiffness * (foot(m, s[PHI]) - s[X]) - m->damping * s[V] - s[U] + m->offset;
}

/* `slip` is the direction in which the body slips, 0 if friction holds it. */
static void rates(const struct crank_machine *m, int slip, const double *s, double *r) {
  const double slope = -m->amplitude * sin(s[PHI]) - 2 * m->second_harmonic * sin(2 * s[PHI]);
  const double load = m->stiffness * (foot(m, s[PHI]) - s[X]) * slope;
  const double wave = m->inertia_wave * cos(s[PHI]), by_angle = -m->inertia_wave * sin(s[PHI]);
  const double torque = m->torque_constant * current_of(m, s) - m->bearing_damping * s[W] -
                        (s[W] > 0 ? m->bearing_friction : 0) - load - by_angle * s[W] * s[W] / 2;
  const double over = m->stribeck > 0 ? s[V] / m->stribeck_velocity : 0;
  r[PHI] = s[W];
  r[W] = torque / (m->inertia + wave);
  r[X] = slip ? s[V] : 0;
  r[V] = slip ? (force(m, s) - slip * (m->coulomb + m->stribeck * exp(-over * over))) / m->mass : 0;
  r[I] =
      m->inductance > 0 ? (m->voltage - m->resistance * s[I] - m->torque_constant * s[W]) / m->inductance : 0;
  r[U] = m->maxwell_time > 0 ? m->maxwell_stiffness * r[X] - s[U] / m->maxwell_time : 0;
}

static void step(const struct crank_machine *m, int slip, const double *s, double h, double *next) {
  double k[4][STATES], at[STATES];
  rates(m, slip, s, k[0]);
  for (int j = 1; j < 4; j++) {
    for (int i = 0; i < STATES; i++)
      at[i] = s[i] + (j == 3 ? h : h / 2) * k[j - 1][i];
    rates(m, slip, at, k[j]);
  }
  for (int i = 0; i < STATES; i++)
    next[i] = s[i] + h / 6 * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
}

/* Whether a mode has ended: beyond the stop, slipped through rest, or held by more than friction can. */
static int ended(const struct crank_machine *m, int slip, const double *s) {
  if (slip == 0)
    return fabs(force(m, s)) > m->coulomb + m->stribeck;
  return slip * s[V] < 0 || (s[X] > m->upper && s[V] > 0);
}

/* The mode after an event; a body that arrives at the stop rebounds. */
static int next_mode(const struct crank_machine *m, int slip, double *s) {
  if (slip != 0 && s[X] > m->upper - 1e-12 && s[V] > 0) {
    s[X] = m->upper;
    s[V] = -m->restitution * s[V];
    return -1;
  }
  const double push = force(m, s);
  s[V] = 0;
  if (fabs(push) <= m->coulomb + m->stribeck)
    return 0;
  return push > 0 ? 1 : -1;
}

/* States at equal intervals, each in `substeps` steps; 1 if events piled up. */
int fly_crank(const struct crank_machine *m, const double *start, double interval, long count, long substeps,
              double (*states)[STATES]) {
  double s[STATES], next[STATES];
  for (int i = 0; i < STATES; i++)
    s[i] = start[i];
  int slip = s[V] < 0 ? -1 : 1;
  for (long n = 0; n < count; n++) {
    for (int i = 0; i < STATES; i++)
      states[n][i] = s[i];
    for (long part = 0; part < substeps; part++) {
      double left = interval / (double)substeps;
      for (int events = 0; left > 0; events++) {
        if (events > 100)
          return 1;
        step(m, slip, s, left, next);
        if (!ended(m, slip, next)) {
          for (int i = 0; i < STATES; i++)
            s[i] = next[i];
          break;
        }
        double low = 0, high = left;
        for (int i = 0; i < 60; i++) {
          const double middle = (low + high) / 2;
          step(m, slip, s, middle, next);
          if (ended(m, slip, next))
            high = middle;
          else
            low = middle;
        }
        step(m, slip, s, high, next);
        for (int i = 0; i < STATES; i++)
          s[i] = next[i];
        left -= high;
        slip = next_mode(m, slip, s);
      }
    }
  }
  return 0;
}
