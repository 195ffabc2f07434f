/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * The published machine and what the drivers of the peers share. One trajectory is a sequence of phases with
 * a fixed sign of the velocity; a phase ends at a turning point or at the barrier. */
#ifndef PUBLISHED_CASE_H
#define PUBLISHED_CASE_H

enum { HARMONICS = 3 };

/* Filled by published_case.py. Accelerations are forces per mass. */
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
} machine_t;

/* Where a trajectory ended and what it met. `repaired`: impacts that the library's event location stepped
 * over. */
typedef struct {
  double x, v, impacts, window_impacts, sticks, repaired;
} outcome_t;

/* Acceleration by the spring alone. */
double spring_acceleration(const machine_t *machine, double time, double x);

/* A body at rest: +1 or -1 if it starts to slide that way, 0 if friction holds it. */
int sliding_direction(const machine_t *machine, double time, double x);

/* When a body that is held at x is let go, at most the duration. */
double release_time(const machine_t *machine, double time, double x);

/* Sign of the velocity of the next phase, from a start or a turning point; waits where the body sticks. */
int next_direction(const machine_t *machine, double *time, double x, double v, outcome_t *outcome);

/* Reverses the velocity and counts the impact. */
double impact(const machine_t *machine, double time, double v, outcome_t *outcome);

/* Runs `points` starts (x0, v0); returns 0, or the number of the trajectory that failed. */
long run_trajectories(const machine_t *machine, double tolerance, long points, const double *starts,
                      outcome_t *outcomes);

#endif
