/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * GSL odeiv2, Prince-Dormand 8(9). GSL locates no events: the sign of v and the barrier are tested after
 * every accepted step, and the event is found by steps of other lengths from the same beginning (safeguarded
 * Newton). */
#include "published_case.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <math.h>
#include <string.h>

typedef struct {
  const machine_t *machine;
  int direction; /* sign of v in this phase */
} flow_t;

typedef struct {
  gsl_odeiv2_step *step;
  gsl_odeiv2_control *control;
  gsl_odeiv2_evolve *evolve;
  gsl_odeiv2_system system;
} solver_t;

/* Which component of the state passes through which value. */
typedef struct {
  int component;
  double value;
} event_t;

static int derivatives(double time, const double y[], double dydt[], void *context) {
  const flow_t *flow = context;
  dydt[0] = y[1];
  dydt[1] = spring_acceleration(flow->machine, time, y[0]) - flow->direction * flow->machine->friction;
  return GSL_SUCCESS;
}

/* One step of length h from (time, before), without error control: h is at most an accepted step. */
static void step_to(solver_t *solver, double time, const double before[2], double h, double y[2]) {
  double error[2];
  memcpy(y, before, 2 * sizeof(double));
  gsl_odeiv2_step_reset(solver->step);
  gsl_odeiv2_step_apply(solver->step, time, h, y, error, NULL, NULL, &solver->system);
}

/* Length of the step, at most h, at which the event happens; y becomes the state there. */
static double locate(solver_t *solver, event_t event, double time, const double before[2], double h,
                     double y[2]) {
  double low = 0, high = h, trial = h, slope[2];
  const double sign = y[event.component] > event.value ? 1 : -1;
  int i;
  for (i = 0; i < 60; i++) {
    const double distance = y[event.component] - event.value;
    double next;
    if (sign * distance > 0)
      high = trial;
    else
      low = trial;
    derivatives(time + trial, y, slope, solver->system.params);
    next = trial - distance / slope[event.component];
    if (fabs(next - trial) <= 1e-14 * (1 + time))
      break;
    trial = next > low && next < high ? next : 0.5 * (low + high);
    step_to(solver, time, before, trial, y);
  }
  return trial;
}

/* One phase: on return v = 0 at a turning point, v after the impact at the barrier, or the time is over. */
static int run_phase(solver_t *solver, const machine_t *machine, int direction, double *time, double *h,
                     double y[2], outcome_t *outcome) {
  const event_t turning = {1, 0}, barrier = {0, machine->barrier};
  while (*time < machine->duration) {
    const double start = *time, before[2] = {y[0], y[1]};
    double length;
    int turned, hit;
    if (gsl_odeiv2_evolve_apply(solver->evolve, solver->control, solver->step, &solver->system, time,
                                machine->duration, h, y) != GSL_SUCCESS)
      return 1;
    length = *time - start;
    turned = direction * y[1] < 0;
    hit = y[0] > machine->barrier;
    if (!turned && !hit)
      continue;
    if (turned) {
      const int seen = hit;
      length = locate(solver, turning, start, before, length, y);
      /* x is monotone up to here, so this is the test that misses no impact */
      hit = y[0] > machine->barrier;
      if (hit && !seen)
        outcome->repaired += 1;
    }
    if (hit)
      length = locate(solver, barrier, start, before, length, y);
    *time = start + length;
    y[1] = hit ? impact(machine, *time, y[1], outcome) : 0;
    if (hit)
      y[0] = machine->barrier;
    gsl_odeiv2_evolve_reset(solver->evolve);
    gsl_odeiv2_step_reset(solver->step);
    return 0;
  }
  return 0;
}

static int run_one(solver_t *solver, const machine_t *machine, const double start[2], outcome_t *outcome) {
  flow_t flow = {machine, 0};
  double y[2] = {start[0], start[1]}, time = 0, h = 1e-2;
  memset(outcome, 0, sizeof *outcome);
  solver->system.params = &flow;
  gsl_odeiv2_evolve_reset(solver->evolve);
  gsl_odeiv2_step_reset(solver->step);
  while (time < machine->duration) {
    flow.direction = next_direction(machine, &time, y[0], y[1], outcome);
    if (run_phase(solver, machine, flow.direction, &time, &h, y, outcome) != 0)
      return 1;
  }
  outcome->x = y[0];
  outcome->v = y[1];
  return 0;
}

long run_trajectories(const machine_t *machine, double tolerance, long points, const double *starts,
                      outcome_t *outcomes) {
  solver_t solver;
  long i, failed = 0;
  memset(&solver, 0, sizeof solver);
  solver.system.function = derivatives;
  solver.system.dimension = 2;
  solver.step = gsl_odeiv2_step_alloc(gsl_odeiv2_step_rk8pd, 2);
  solver.control = gsl_odeiv2_control_y_new(tolerance, tolerance);
  solver.evolve = gsl_odeiv2_evolve_alloc(2);
  for (i = 0; i < points && failed == 0; i++)
    if (run_one(&solver, machine, starts + 2 * i, outcomes + i) != 0)
      failed = i + 1;
  gsl_odeiv2_evolve_free(solver.evolve);
  gsl_odeiv2_control_free(solver.control);
  gsl_odeiv2_step_free(solver.step);
  return failed;
}
