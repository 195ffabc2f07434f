/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * A machine and a body of the referee, and the power series of its motion.
 */
#include "polynomial.h"

enum { HARMONICS = 8 };

typedef struct {
  double spring, rest, cubic, pendulum, damping, kinetic, static_friction;
  double restitution, upper, lower, wall_stiffness; /* wall_stiffness > 0: soft walls */
  double frequency, cosine[HARMONICS], sine[HARMONICS];
  int samples; /* of a force in place of the harmonics, linear between them; the last ends the period */
  double interval, *force; /* their distance in time, and the force per unit mass */
  double longest_step;     /* radians of the fastest part of the motion in one step */
} machine;

typedef enum { FREE, STUCK, ON_UPPER, ON_LOWER } mode_of;

typedef struct {
  const machine *law;
  real time, x, v; /* time within the drive period */
  int sign;        /* of v, where friction is there */
  mode_of mode;
  int pressed; /* soft wall in contact: +1 upper, -1 lower */
  bool level;  /* the acceleration is zero: a release has just begun */
  bool silent; /* the chatter under way is no longer counted */
  bool linearised;
  real tangent[2][2]; /* columns: by x and by v of the start */
  long impacts, simulated, chatters, stops, events;
  real slowest, margin;
  bool failed;
} body;

/* The sample of the force at or before a time. */
static int sample_before(const machine *m, real time) {
  const int k = (int)R(floor)(time / m->interval + (real)1e-9);
  return k < m->samples - 1 ? k : m->samples - 2;
}

static void drive_series(const machine *m, real time, real *f) {
  memset(f, 0, (ORDER + 1) * sizeof *f);
  if (m->samples > 0) {
    const int k = sample_before(m, time);
    f[1] = ((real)m->force[k + 1] - m->force[k]) / m->interval;
    f[0] = m->force[k] + f[1] * (time - k * (real)m->interval);
    return;
  }
  for (int n = 1; n <= HARMONICS; n++) {
    if (m->cosine[n - 1] == 0 && m->sine[n - 1] == 0)
      continue;
    const real w = n * (real)m->frequency, c = R(cos)(w * time), s = R(sin)(w * time);
    const real term[2] = {m->cosine[n - 1] * c + m->sine[n - 1] * s,
                          m->sine[n - 1] * c - m->cosine[n - 1] * s};
    real factor = 1;
    for (int j = 0; j <= ORDER; j++) {
      f[j] += factor * term[j % 2] * (j % 4 < 2 ? 1 : -1);
      factor *= w / (j + 1);
    }
  }
}

static real product(const real *a, const real *b, int j) {
  real sum = 0;
  for (int i = 0; i <= j; i++)
    sum += a[i] * b[j - i];
  return sum;
}

/* Series of the motion, and of the linearised one, about the present time. */
static void series(const body *b, const real *f, real *x, real u[2][ORDER + 1]) {
  const machine *m = b->law;
  real extension[ORDER + 1], square[ORDER + 1], s[ORDER + 1], c[ORDER + 1];
  x[0] = b->x;
  x[1] = b->v;
  for (int k = 0; k < 2 && b->linearised; k++) {
    u[k][0] = b->tangent[0][k];
    u[k][1] = b->tangent[1][k];
  }
  for (int j = 0; j <= ORDER - 2; j++) {
    real a = f[j] - m->spring * x[j] - m->damping * (j + 1) * x[j + 1];
    if (j == 0)
      a += m->spring * m->rest - m->kinetic * b->sign;
    if (b->pressed)
      a -= m->wall_stiffness * (x[j] - (j == 0 ? (b->pressed > 0 ? m->upper : m->lower) : 0));
    if (m->cubic != 0) {
      extension[j] = (j == 0 ? m->rest : 0) + f[j] / m->spring - x[j];
      square[j] = product(extension, extension, j);
      a += m->cubic * product(extension, square, j);
    }
    if (m->pendulum != 0) {
      if (j == 0) {
        s[0] = R(sin)(x[0]);
        c[0] = R(cos)(x[0]);
      } else {
        s[j] = c[j] = 0;
        for (int i = 1; i <= j; i++) {
          s[j] += i * x[i] * c[j - i] / j;
          c[j] -= i * x[i] * s[j - i] / j;
        }
      }
      a -= m->pendulum * s[j];
    }
    x[j + 2] = a / ((j + 1) * (real)(j + 2));
    if (j == 0 && b->level)
      x[2] = 0;
    for (int k = 0; k < 2 && b->linearised; k++) {
      real w =
          -(m->spring + (b->pressed ? m->wall_stiffness : 0)) * u[k][j] - m->damping * (j + 1) * u[k][j + 1];
      if (m->cubic != 0)
        w -= 3 * m->cubic * product(square, u[k], j);
      if (m->pendulum != 0)
        w -= m->pendulum * product(c, u[k], j);
      u[k][j + 2] = w / ((j + 1) * (real)(j + 2));
    }
  }
}

/* Force on a body at rest at its position, as a series in time. */
static void holding(const body *b, const real *f, real *force) {
  const machine *m = b->law;
  real extension[ORDER + 1], square[ORDER + 1];
  for (int j = 0; j <= ORDER; j++) {
    force[j] = f[j] + (j == 0 ? m->spring * (m->rest - b->x) - m->pendulum * R(sin)(b->x) : 0);
    if (m->cubic != 0) {
      extension[j] = (j == 0 ? m->rest - b->x : 0) + f[j] / m->spring;
      square[j] = product(extension, extension, j);
      force[j] += m->cubic * product(extension, square, j);
    }
  }
}

/* By how much, at most, that force changes within a time, in either direction. */
static real change_within(const body *b, real left) {
  real f[ORDER + 1], force[ORDER + 1], sum = 0;
  if (left * b->law->frequency > 1)
    return INFINITY;
  drive_series(b->law, b->time, f);
  holding(b, f, force);
  for (int j = ORDER; j >= 1; j--)
    sum = (sum + R(fabs)(force[j])) * left;
  return sum;
}

static real force_at_rest(const body *b, real *rate) {
  real f[ORDER + 1], force[ORDER + 1];
  drive_series(b->law, b->time, f);
  holding(b, f, force);
  if (rate)
    *rate = force[1];
  return force[0];
}

/* By how much the force on a body at rest changes with its position. */
static real force_slope(const body *b) {
  const machine *m = b->law;
  real f[ORDER + 1];
  drive_series(m, b->time, f);
  const real extension = m->rest - b->x + (m->spring != 0 ? f[0] / m->spring : 0);
  return -m->spring - 3 * m->cubic * extension * extension - m->pendulum * R(cos)(b->x);
}
