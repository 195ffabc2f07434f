/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later */
#include "published_case.h"

#include <math.h>

double spring_acceleration(const machine_t *machine, double time, double x) {
  const double *a = machine->cosine, *b = machine->sine;
  const double tau = machine->frequency * time + machine->angle;
  const double c = cos(tau), s = sin(tau);
  /* one sine and cosine per call: the harmonics follow from the addition theorems */
  const double c2 = 2 * c * c - 1, s2 = 2 * s * c;
  const double c3 = c2 * c - s2 * s, s3 = s2 * c + c2 * s;
  const double drive = a[0] * c + b[0] * s + a[1] * c2 + b[1] * s2 + a[2] * c3 + b[2] * s3;
  return machine->stiffness * (machine->rest + drive - x);
}

int sliding_direction(const machine_t *machine, double time, double x) {
  const double spring = spring_acceleration(machine, time, x);
  if (fabs(spring) <= machine->friction)
    return 0;
  return spring > 0 ? 1 : -1;
}

double release_time(const machine_t *machine, double time, double x) {
  /* the third harmonic turns by 8 degrees in a step */
  const double step = 2 * M_PI / machine->frequency / 128;
  double held = time, free = time + step;
  while (sliding_direction(machine, free, x) == 0) {
    held = free;
    free += step;
    if (held >= machine->duration)
      return machine->duration;
  }
  while (1) {
    const double middle = 0.5 * (held + free);
    if (middle <= held || middle >= free)
      return free;
    if (sliding_direction(machine, middle, x) == 0)
      held = middle;
    else
      free = middle;
  }
}

int next_direction(const machine_t *machine, double *time, double x, double v, outcome_t *outcome) {
  int direction;
  if (v > 0)
    return 1;
  if (v < 0)
    return -1;
  direction = sliding_direction(machine, *time, x);
  if (direction == 0) {
    outcome->sticks += 1;
    *time = release_time(machine, *time, x);
    direction = sliding_direction(machine, *time, x);
  }
  return direction;
}

double impact(const machine_t *machine, double time, double v, outcome_t *outcome) {
  outcome->impacts += 1;
  if (time >= machine->duration - machine->window)
    outcome->window_impacts += 1;
  return -machine->restitution * v;
}
