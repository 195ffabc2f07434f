/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * GSL odeiv2, Prince-Dormand 8(9). GSL locates no events: the sign of v and the barrier are tested after
 * every accepted step, and the event is found by steps of other lengths from the same beginning (safeguarded
 * Newton). */
#include "machine.h"

#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <math.h>
#include <string.h>

typedef struct {
  gsl_odeiv2_step *step;
  gsl_odeiv2_control *control;
  gsl_odeiv2_evolve *evolve;
  gsl_odeiv2_system system;
} solver_t;

static int derivatives(double time, const double y[], double dydt[], void *context) {
  rates(context, time, y, dydt);
  return GSL_SUCCESS;
}

/* One step of length h from (time, before), without error control: h is at most an accepted step. */
static void step_to(solver_t *solver, double time, const double before[], double h, double y[]) {
  double error[MOST_DIMENSIONS];
  memcpy(y, before, MOST_DIMENSIONS * sizeof(double));
  gsl_odeiv2_step_reset(solver->step);
  gsl_odeiv2_step_apply(solver->step, time, h, y, error, NULL, NULL, &solver->system);
}

/* Length of the step, at most h, at which the event happens; y becomes the state there. */
static double locate(solver_t *solver, int kind, double time, const double before[], double h, double y[]) {
  const phase_t *phase = solver->system.params;
  double low = 0, high = h, trial = h;
  int i;
  for (i = 0; i < 60; i++) {
    const event_t found = event(phase, kind, time + trial, y);
    double next;
    if (found.value < 0)
      high = trial;
    else
      low = trial;
    next = trial - found.value / found.rate;
    if (fabs(next - trial) <= 1e-14 * (1 + time))
      break;
    trial = next > low && next < high ? next : 0.5 * (low + high);
    step_to(solver, time, before, trial, y);
  }
  return trial;
}

/* One phase, to its event or until the time is over. */
static int run_phase(solver_t *solver, phase_t *phase, double *time, double *h, double y[],
                     outcome_t *outcome) {
  const double duration = phase->machine->duration;
  int kinds[MOST_EVENTS], count = events_of(phase, kinds);
  while (*time < duration) {
    const double start = *time;
    double length, before[MOST_DIMENSIONS];
    int turned, passed;
    memcpy(before, y, sizeof before);
    if (gsl_odeiv2_evolve_apply(solver->evolve, solver->control, solver->step, &solver->system, time,
                                duration, h, y) != GSL_SUCCESS)
      return 1;
    length = *time - start;
    turned = phase->direction * y[1] < 0;
    passed = count > 1 && event(phase, kinds[1], *time, y).value < 0;
    if (!turned && !passed)
      continue;
    if (turned) {
      const int seen = passed;
      length = locate(solver, TURNING, start, before, length, y);
      /* x is monotone up to here, so this is the test that misses no impact */
      passed = count > 1 && event(phase, kinds[1], start + length, y).value < 0;
      if (passed && !seen)
        outcome->repaired += 1;
    }
    if (passed)
      length = locate(solver, kinds[1], start, before, length, y);
    *time = start + length;
    end_phase(phase, passed ? kinds[1] : TURNING, *time, y, outcome);
    gsl_odeiv2_evolve_reset(solver->evolve);
    gsl_odeiv2_step_reset(solver->step);
    return 0;
  }
  return 0;
}

static int run_one(solver_t *solver, const machine_t *machine, const double start[2], outcome_t *outcome) {
  phase_t phase = {machine, 0, 0};
  double y[MOST_DIMENSIONS] = {start[0], start[1], 0}, time = 0, h = 1e-2;
  memset(outcome, 0, sizeof *outcome);
  solver->system.params = &phase;
  gsl_odeiv2_evolve_reset(solver->evolve);
  gsl_odeiv2_step_reset(solver->step);
  while (time < machine->duration) {
    begin_phase(&phase, &time, y, outcome);
    if (run_phase(solver, &phase, &time, &h, y, outcome) != 0)
      return 1;
  }
  outcome->x = y[0];
  outcome->v = y[1];
  return 0;
}

long run_trajectories(const machine_t *machine, double tolerance, long points, const double *starts,
                      outcome_t *outcomes) {
  const int size = dimension(machine);
  solver_t solver;
  long i, failed = 0;
  memset(&solver, 0, sizeof solver);
  solver.system.function = derivatives;
  solver.system.dimension = size;
  solver.step = gsl_odeiv2_step_alloc(gsl_odeiv2_step_rk8pd, size);
  solver.control = gsl_odeiv2_control_y_new(tolerance, tolerance);
  solver.evolve = gsl_odeiv2_evolve_alloc(size);
  for (i = 0; i < points && failed == 0; i++)
    if (run_one(&solver, machine, starts + 2 * i, outcomes + i) != 0)
      failed = i + 1;
  gsl_odeiv2_evolve_free(solver.evolve);
  gsl_odeiv2_control_free(solver.control);
  gsl_odeiv2_step_free(solver.step);
  return failed;
}
