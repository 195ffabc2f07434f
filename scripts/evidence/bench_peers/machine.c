/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later */
#include "machine.h"

#include <math.h>

int dimension(const machine_t *machine) { return machine->dahl > 0 ? 3 : 2; }

/* Extension of the spring [m]. */
static double extension_at(const machine_t *machine, double time, double x) {
  const double *a = machine->cosine, *b = machine->sine;
  const double phi = machine->frequency * time;
  const double tau = phi + machine->angle + (machine->ripple != 0 ? machine->ripple * sin(phi) : 0);
  const double c = cos(tau), s = sin(tau);
  /* one sine and cosine per call: the harmonics follow from the addition theorems */
  const double c2 = 2 * c * c - 1, s2 = 2 * s * c;
  const double c3 = c2 * c - s2 * s, s3 = s2 * c + c2 * s;
  const double drive = a[0] * c + b[0] * s + a[1] * c2 + b[1] * s2 + a[2] * c3 + b[2] * s3;
  return machine->rest + drive - x;
}

/* Acceleration by everything but dry friction and a soft barrier, at a velocity of the sign `direction`. */
static double smooth_acceleration(const machine_t *machine, double time, double x, double v, int direction) {
  const double extension = extension_at(machine, time, x);
  double a = machine->stiffness * extension;
  if (machine->further == 0)
    return a;
  return a + machine->cubic * extension * extension * extension -
         (machine->viscous + direction * (machine->asymmetric_viscous + machine->quadratic * v)) * v;
}

/* By the soft barrier, away from it. */
static double barrier_acceleration(const machine_t *machine, double x, double v) {
  const double p = x - machine->barrier;
  if (machine->barrier_law == HUNT_CROSSLEY)
    return machine->barrier_stiffness * p * sqrt(fabs(p)) * (1 + machine->barrier_damping * v);
  return machine->barrier_stiffness * p + machine->barrier_damping * v;
}

static double factor_at(const machine_t *machine, double x) {
  const double factor = 1 + machine->slope * x;
  return factor > 0 ? factor : 0;
}

void rates(const phase_t *phase, double time, const double y[], double dydt[]) {
  const machine_t *machine = phase->machine;
  const int d = phase->direction;
  double a = smooth_acceleration(machine, time, y[0], y[1], d), dry = d * machine->friction;
  dydt[0] = y[1];
  if (machine->further != 0) {
    dry += machine->asymmetric;
    if (machine->excess > 0)
      dry += d * machine->excess * exp(-(y[1] / machine->velocity) * (y[1] / machine->velocity));
    dry *= factor_at(machine, y[0]);
    if (machine->dahl > 0) {
      dry = y[2];
      dydt[2] = machine->dahl * (1 - y[2] * d / machine->friction) * y[1];
    }
    if (phase->pressed)
      a -= barrier_acceleration(machine, y[0], y[1]);
  }
  dydt[1] = a - dry;
}

int events_of(const phase_t *phase, int kinds[MOST_EVENTS]) {
  kinds[0] = TURNING;
  kinds[1] = phase->pressed ? RELEASE : BARRIER;
  /* upwards to the barrier, downwards from it */
  return phase->pressed != (phase->direction > 0) ? 2 : 1;
}

event_t event(const phase_t *phase, int kind, double time, const double y[]) {
  const machine_t *machine = phase->machine;
  double slope[MOST_DIMENSIONS];
  event_t found = {machine->barrier - y[0], -y[1]};
  if (kind == BARRIER)
    return found;
  rates(phase, time, y, slope);
  if (kind == TURNING) {
    found.value = phase->direction * y[1];
    found.rate = phase->direction * slope[1];
  } else if (machine->barrier_law == KELVIN_VOIGT_CUT) {
    found.value = barrier_acceleration(machine, y[0], y[1]);
    found.rate = machine->barrier_stiffness * y[1] + machine->barrier_damping * slope[1];
  } else {
    found.value = -found.value;
    found.rate = -found.rate;
  }
  return found;
}

/* A body at rest: +1 or -1 if it starts to slide that way, 0 if friction holds it. */
static int sliding_direction(const phase_t *phase, double time, const double y[]) {
  const machine_t *machine = phase->machine;
  double a = smooth_acceleration(machine, time, y[0], 0, 0), up = machine->friction, down = up;
  if (machine->further != 0) {
    const double factor = factor_at(machine, y[0]), hold = machine->friction + machine->excess;
    if (phase->pressed)
      a -= barrier_acceleration(machine, y[0], 0);
    up = factor * (hold + machine->asymmetric);
    down = factor * (hold - machine->asymmetric);
    if (machine->dahl > 0)
      return a > y[2] ? 1 : -1;
  }
  return a > up ? 1 : a < -down ? -1 : 0;
}

/* When a body that is held is let go, at most the duration. */
static double release_time(const phase_t *phase, double time, const double y[]) {
  /* the third harmonic turns by 8 degrees in a step */
  const machine_t *machine = phase->machine;
  const double step = 2 * M_PI / machine->frequency / 128;
  double held = time, free = time + step;
  while (sliding_direction(phase, free, y) == 0) {
    held = free;
    free += step;
    if (held >= machine->duration)
      return machine->duration;
  }
  while (1) {
    const double middle = 0.5 * (held + free);
    if (middle <= held || middle >= free)
      return free;
    if (sliding_direction(phase, middle, y) == 0)
      held = middle;
    else
      free = middle;
  }
}

void begin_phase(phase_t *phase, double *time, const double y[], outcome_t *outcome) {
  phase->direction = y[1] > 0 ? 1 : -1;
  if (y[1] != 0)
    return;
  /* at rest: beyond the surface of a soft barrier the body presses on it */
  phase->pressed = phase->machine->barrier_law != RIGID && y[0] > phase->machine->barrier;
  phase->direction = sliding_direction(phase, *time, y);
  if (phase->direction == 0) {
    outcome->sticks += 1;
    *time = release_time(phase, *time, y);
    phase->direction = sliding_direction(phase, *time, y);
  }
}

static double restitution_at(const machine_t *machine, double speed) {
  double k = machine->restitution, root;
  switch ((int)machine->restitution_law) {
  case LINEAR:
    return fmax(0, k - machine->coefficients[0] * speed);
  case POWER:
    return speed > machine->coefficients[0]
               ? k * pow(speed / machine->coefficients[0], -machine->coefficients[1])
               : k;
  case VISCOELASTIC:
    root = pow(speed, 0.2);
    return fmin(1, fmax(0, 1 - machine->coefficients[0] * root + machine->coefficients[1] * root * root));
  default:
    return k;
  }
}

void end_phase(phase_t *phase, int kind, double time, double y[], outcome_t *outcome) {
  const machine_t *machine = phase->machine;
  if (kind == TURNING)
    y[1] = 0;
  if (kind == RELEASE)
    phase->pressed = 0;
  if (kind != BARRIER)
    return;
  y[0] = machine->barrier;
  outcome->impacts += 1;
  if (time >= machine->duration - machine->window)
    outcome->window_impacts += 1;
  if (machine->barrier_law == RIGID)
    y[1] *= -restitution_at(machine, y[1]);
  else
    phase->pressed = 1;
}
