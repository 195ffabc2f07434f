/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * SUNDIALS CVODE with its own rootfinding: Adams with fixed-point iteration, the choice for problems that are
 * not stiff, started anew after every event. */
#include "machine.h"

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <string.h>
#include <sundials/sundials_types.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

typedef struct {
  void *cvode;
  N_Vector y;
  phase_t phase;
} solver_t;

static int derivatives(realtype time, N_Vector y, N_Vector dydt, void *context) {
  rates(context, time, N_VGetArrayPointer(y), N_VGetArrayPointer(dydt));
  return 0;
}

static int roots(realtype time, N_Vector y, realtype *values, void *context) {
  int kinds[MOST_EVENTS], count = events_of(context, kinds), i;
  for (i = 0; i < MOST_EVENTS; i++)
    values[i] = i < count ? event(context, kinds[i], time, N_VGetArrayPointer(y)).value : 1;
  return 0;
}

/* Interpolates back from a turning point beyond the barrier to the impact that the sign tests stepped over.
 */
static double passage_before(solver_t *solver, int kind, double turning) {
  double *state = N_VGetArrayPointer(solver->y), current, last, low, high = turning;
  CVodeGetCurrentTime(solver->cvode, &current);
  CVodeGetLastStep(solver->cvode, &last);
  low = current - last;
  while (1) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high)
      break;
    CVodeGetDky(solver->cvode, middle, 0, solver->y);
    if (event(&solver->phase, kind, middle, state).value < 0)
      high = middle;
    else
      low = middle;
  }
  CVodeGetDky(solver->cvode, high, 0, solver->y);
  return high;
}

/* One phase, to its event or until the time is over. */
static int run_phase(solver_t *solver, double *time, outcome_t *outcome) {
  const double duration = solver->phase.machine->duration;
  double *state = N_VGetArrayPointer(solver->y);
  int found[MOST_EVENTS], kinds[MOST_EVENTS], count = events_of(&solver->phase, kinds), code, passed;
  CVodeReInit(solver->cvode, *time, solver->y);
  CVodeSetStopTime(solver->cvode, duration);
  code = CVode(solver->cvode, duration, solver->y, time, CV_NORMAL);
  if (code != CV_ROOT_RETURN)
    return code < 0;
  CVodeGetRootInfo(solver->cvode, found);
  passed = found[1] != 0;
  if (!passed && count > 1 && event(&solver->phase, kinds[1], *time, state).value < 0) {
    passed = 1;
    outcome->repaired += 1;
    *time = passage_before(solver, kinds[1], *time);
  }
  end_phase(&solver->phase, passed ? kinds[1] : TURNING, *time, state, outcome);
  return 0;
}

static int run_one(solver_t *solver, const double start[2], outcome_t *outcome) {
  const machine_t *machine = solver->phase.machine;
  double *state = N_VGetArrayPointer(solver->y), time = 0;
  memset(outcome, 0, sizeof *outcome);
  N_VConst(0, solver->y);
  memcpy(state, start, 2 * sizeof(double));
  solver->phase.pressed = 0;
  while (time < machine->duration) {
    begin_phase(&solver->phase, &time, state, outcome);
    if (time < machine->duration && run_phase(solver, &time, outcome) != 0)
      return 1;
  }
  outcome->x = state[0];
  outcome->v = state[1];
  return 0;
}

long run_trajectories(const machine_t *machine, double tolerance, long points, const double *starts,
                      outcome_t *outcomes) {
  int directions[MOST_EVENTS] = {-1, -1};
  SUNContext context;
  SUNNonlinearSolver iteration;
  solver_t solver;
  long i, failed = 0;
  SUNContext_Create(NULL, &context);
  solver.phase.machine = machine;
  solver.phase.direction = 1;
  solver.phase.pressed = 0;
  solver.y = N_VNew_Serial(dimension(machine), context);
  N_VConst(0, solver.y);
  solver.cvode = CVodeCreate(CV_ADAMS, context);
  iteration = SUNNonlinSol_FixedPoint(solver.y, 0, context);
  CVodeInit(solver.cvode, derivatives, 0, solver.y);
  CVodeSStolerances(solver.cvode, tolerance, tolerance);
  CVodeSetUserData(solver.cvode, &solver.phase);
  CVodeSetNonlinearSolver(solver.cvode, iteration);
  CVodeSetMaxNumSteps(solver.cvode, 100000);
  CVodeRootInit(solver.cvode, MOST_EVENTS, roots);
  CVodeSetRootDirection(solver.cvode, directions);
  CVodeSetNoInactiveRootWarn(solver.cvode);
  for (i = 0; i < points && failed == 0; i++)
    if (run_one(&solver, starts + 2 * i, outcomes + i) != 0)
      failed = i + 1;
  SUNNonlinSolFree(iteration);
  CVodeFree(&solver.cvode);
  N_VDestroy(solver.y);
  SUNContext_Free(&context);
  return failed;
}
