/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The machines and what the drivers of the peers share. One trajectory is a sequence of phases with a fixed
 * sign of the velocity, free or pressed on a soft barrier; a phase ends at a turning point or at the barrier.
 */
#ifndef MACHINE_H
#define MACHINE_H

enum { HARMONICS = 3, MOST_DIMENSIONS = 3, MOST_EVENTS = 2 };

/* Laws of restitution, and barriers that are soft. */
enum { CONSTANT, LINEAR, POWER, VISCOELASTIC };
enum { RIGID, KELVIN_VOIGT, KELVIN_VOIGT_CUT, HUNT_CROSSLEY };

/* Filled by machine.py. Accelerations are forces per mass. */
typedef struct {
  double stiffness; /* c/m [1/s^2] */
  double rest;      /* spring length at which the foot at x_A = 0 exerts no force, plus the mean of x_A [m] */
  double friction;  /* mu g [m/s^2] */
  double restitution;                        /* v+ = -k v- */
  double barrier;                            /* [m] */
  double frequency;                          /* of the drive [rad/s] */
  double angle;                              /* [rad] */
  double cosine[HARMONICS], sine[HARMONICS]; /* [m] */
  double duration, window;                   /* [s] */
  /* From here on 0 on the published machine; `further` is 1 if any is not. */
  double further;
  double ripple;                         /* crank angle phi + ripple sin(phi) [rad] */
  double cubic, quadratic, viscous;      /* of the extension and of the speed */
  double asymmetric, asymmetric_viscous; /* friction upwards above the mean of both directions */
  double slope;                          /* dry friction times 1 + slope x [1/m] */
  double excess, velocity;               /* friction at rest above that in motion, E exp(-(v/v_s)^2) */
  double dahl;                           /* sigma/m [1/s^2]; then z/m is the third component of the state */
  double restitution_law, coefficients[2];
  double barrier_law, barrier_stiffness, barrier_damping;
} machine_t;

/* Where a trajectory ended and what it met. `repaired`: impacts that the library's event location stepped
 * over. */
typedef struct {
  double x, v, impacts, window_impacts, sticks, repaired;
} outcome_t;

/* Sign of the velocity, 0 where the body sticks until the end; whether it presses on a soft barrier. */
typedef struct {
  const machine_t *machine;
  int direction, pressed;
} phase_t;

enum { TURNING, BARRIER, RELEASE };

/* What ends a phase: `value` falls through zero, at `rate` per second. */
typedef struct {
  double value, rate;
} event_t;

/* Components of the state: position, velocity, and Dahl's friction if there is one. */
int dimension(const machine_t *machine);

/* Rates of the state in a phase. */
void rates(const phase_t *phase, double time, const double y[], double dydt[]);

/* The kinds of event that may end a phase; returns how many. The first is TURNING. */
int events_of(const phase_t *phase, int kinds[MOST_EVENTS]);

event_t event(const phase_t *phase, int kind, double time, const double y[]);

/* The phase that begins at a start, a turning point, a barrier; waits where the body sticks. */
void begin_phase(phase_t *phase, double *time, const double y[], outcome_t *outcome);

/* What follows an event; counts the impacts. */
void end_phase(phase_t *phase, int kind, double time, double y[], outcome_t *outcome);

/* Runs `points` starts (x0, v0); returns 0, or the number of the trajectory that failed. */
long run_trajectories(const machine_t *machine, double tolerance, long points, const double *starts,
                      outcome_t *outcomes);

#endif
