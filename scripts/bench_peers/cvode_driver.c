/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * SUNDIALS CVODE with its own rootfinding: Adams with fixed-point iteration, the choice for problems that are
 * not stiff, started anew after every event. */
#include "published_case.h"

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <string.h>
#include <sundials/sundials_types.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

typedef struct {
  const machine_t *machine;
  int direction; /* sign of v in this phase */
} flow_t;

typedef struct {
  void *cvode;
  N_Vector y;
  flow_t flow;
} solver_t;

static int derivatives(realtype time, N_Vector y, N_Vector dydt, void *context) {
  const flow_t *flow = context;
  const double *state = N_VGetArrayPointer(y);
  double *rate = N_VGetArrayPointer(dydt);
  rate[0] = state[1];
  rate[1] = spring_acceleration(flow->machine, time, state[0]) - flow->direction * flow->machine->friction;
  return 0;
}

static int events(realtype time, N_Vector y, realtype *values, void *context) {
  const flow_t *flow = context;
  const double *state = N_VGetArrayPointer(y);
  (void)time;
  values[0] = flow->direction * state[1];
  values[1] = state[0] - flow->machine->barrier;
  return 0;
}

/* Interpolates back from a turning point beyond the barrier to the impact that the sign tests stepped over.
 */
static double impact_before(solver_t *solver, double turning) {
  const double barrier = solver->flow.machine->barrier;
  double *state = N_VGetArrayPointer(solver->y), current, last, low, high = turning;
  CVodeGetCurrentTime(solver->cvode, &current);
  CVodeGetLastStep(solver->cvode, &last);
  low = current - last;
  while (1) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high)
      break;
    CVodeGetDky(solver->cvode, middle, 0, solver->y);
    if (state[0] > barrier)
      high = middle;
    else
      low = middle;
  }
  CVodeGetDky(solver->cvode, high, 0, solver->y);
  return high;
}

/* One phase: on return v = 0 at a turning point, v after the impact at the barrier, or the time is over. */
static int run_phase(solver_t *solver, double *time, outcome_t *outcome) {
  const machine_t *machine = solver->flow.machine;
  double *state = N_VGetArrayPointer(solver->y);
  int found[2], code, hit;
  CVodeReInit(solver->cvode, *time, solver->y);
  CVodeSetStopTime(solver->cvode, machine->duration);
  code = CVode(solver->cvode, machine->duration, solver->y, time, CV_NORMAL);
  if (code != CV_ROOT_RETURN)
    return code < 0;
  CVodeGetRootInfo(solver->cvode, found);
  hit = found[1] != 0;
  if (!hit && state[0] > machine->barrier) {
    hit = 1;
    outcome->repaired += 1;
    *time = impact_before(solver, *time);
  }
  state[1] = hit ? impact(machine, *time, state[1], outcome) : 0;
  if (hit)
    state[0] = machine->barrier;
  return 0;
}

static int run_one(solver_t *solver, const double start[2], outcome_t *outcome) {
  const machine_t *machine = solver->flow.machine;
  double *state = N_VGetArrayPointer(solver->y), time = 0;
  memset(outcome, 0, sizeof *outcome);
  memcpy(state, start, 2 * sizeof(double));
  while (time < machine->duration) {
    solver->flow.direction = next_direction(machine, &time, state[0], state[1], outcome);
    if (time < machine->duration && run_phase(solver, &time, outcome) != 0)
      return 1;
  }
  outcome->x = state[0];
  outcome->v = state[1];
  return 0;
}

long run_trajectories(const machine_t *machine, double tolerance, long points, const double *starts,
                      outcome_t *outcomes) {
  int directions[2] = {-1, 1};
  SUNContext context;
  SUNNonlinearSolver iteration;
  solver_t solver;
  long i, failed = 0;
  SUNContext_Create(NULL, &context);
  solver.flow.machine = machine;
  solver.flow.direction = 0;
  solver.y = N_VNew_Serial(2, context);
  N_VConst(0, solver.y);
  solver.cvode = CVodeCreate(CV_ADAMS, context);
  iteration = SUNNonlinSol_FixedPoint(solver.y, 0, context);
  CVodeInit(solver.cvode, derivatives, 0, solver.y);
  CVodeSStolerances(solver.cvode, tolerance, tolerance);
  CVodeSetUserData(solver.cvode, &solver.flow);
  CVodeSetNonlinearSolver(solver.cvode, iteration);
  CVodeSetMaxNumSteps(solver.cvode, 100000);
  CVodeRootInit(solver.cvode, 2, events);
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
