/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * An independent referee: forced machines of one degree of freedom, flown by Taylor series.
 *
 *   x'' = spring (rest - x) + cubic (rest + foot - x)^3 - pendulum sin x + drive(t) - damping x' - kinetic
 * sgn x'
 *
 * (all per unit mass; drive = spring foot), between rigid walls with a constant restitution or soft ones that
 * push with a linear spring. Nothing of src/ is used, and no method of it: the motion is a power series of
 * order 22 about the beginning of each step, and its events are the roots of polynomials, isolated by
 * bounding the series and its derivative on ever smaller intervals. Chatter is followed impact by impact
 * until what is left of it changes the pressing force by less than 1e-9 of itself, and then summed.
 */
#include "events.h"

enum { LONGEST = 512 };
static const double CHAOS = 1e-3; /* a larger Lyapunov exponent per drive period */

/* What a motion did over its cycle, or over the last periods if it has none. */
typedef struct {
  int period;          /* in drive periods, 0: none found */
  int turns;           /* of a pendulum per cycle */
  long settled;        /* drive periods until the cycle was found */
  int impacts;         /* per cycle, those of a completed chatter only as far as the rule above counts them */
  int simulated;       /* impacts that were followed */
  int chatters, stops; /* completed chatters, rests by friction */
  double exponent[2];  /* Lyapunov exponents per drive period; of a cycle ln|multiplier| / period */
  double trace, determinant; /* of the linearised map over the cycle */
  double slowest;            /* impact of the cycle: the smallest speed */
  double margin;             /* smallest gap to a wall at a turning point that missed it, over the cycle */
  double cycle[LONGEST][2];
  bool failed;
} outcome;

/* Sections of one motion: rows x, v, impacts so far, chatters so far, turned into doubles. */
void referee_sections(const machine *m, double x, double v, long periods, double *rows) {
  body b = started(m, x, v);
  for (long n = 0; n < periods; n++) {
    one_period(&b);
    const double row[4] = {(double)b.x, (double)b.v, (double)b.impacts, (double)b.chatters};
    memcpy(rows + 4 * n, row, sizeof row);
  }
}

static real apart(const machine *m, const real *a, const real *b, const real *scale) {
  real dx = a[0] - b[0];
  if (m->pendulum != 0)
    dx = R(remainder)(dx, 2 * (real)M_PI);
  const real p = R(fabs)(dx) / scale[0], q = R(fabs)(a[1] - b[1]) / scale[1];
  return p > q ? p : q;
}

/* Gram-Schmidt on the tangent; adds the logarithms of the lengths. */
static void orthonormal(body *b, real *sums) {
  for (int k = 0; k < 2; k++) {
    if (k == 1) {
      const real dot = b->tangent[0][0] * b->tangent[0][1] + b->tangent[1][0] * b->tangent[1][1];
      b->tangent[0][1] -= dot * b->tangent[0][0];
      b->tangent[1][1] -= dot * b->tangent[1][0];
    }
    const real length = R(hypot)(b->tangent[0][k], b->tangent[1][k]);
    sums[k] += R(log)(length);
    for (int i = 0; i < 2; i++)
      b->tangent[i][k] = length > 0 ? b->tangent[i][k] / length : 0;
  }
}

static void measure_cycle(body *b, outcome *o) {
  const real x = b->x;
  b->impacts = b->simulated = b->chatters = b->stops = 0;
  b->slowest = b->margin = INFINITY;
  b->linearised = true;
  memset(b->tangent, 0, sizeof b->tangent);
  b->tangent[0][0] = b->tangent[1][1] = 1;
  for (int n = 0; n < o->period; n++) {
    o->cycle[n][0] = (double)b->x;
    o->cycle[n][1] = (double)b->v;
    one_period(b);
  }
  o->turns = b->law->pendulum != 0 ? (int)R(round)((b->x - x) / (2 * (real)M_PI)) : 0;
  o->impacts = (int)b->impacts;
  o->simulated = (int)b->simulated;
  o->chatters = (int)b->chatters;
  o->stops = (int)b->stops;
  o->slowest = (double)b->slowest;
  o->margin = (double)b->margin;
  o->trace = (double)(b->tangent[0][0] + b->tangent[1][1]);
  o->determinant = (double)(b->tangent[0][0] * b->tangent[1][1] - b->tangent[0][1] * b->tangent[1][0]);
  const real root = (real)o->trace * o->trace / 4 - o->determinant;
  const real large =
      root < 0 ? R(sqrt)(R(fabs)((real)o->determinant)) : R(fabs)((real)o->trace) / 2 + R(sqrt)(root);
  o->exponent[0] = (double)(R(log)(large) / o->period);
  o->exponent[1] = (double)(R(log)(R(fabs)((real)o->determinant) / large) / o->period);
}

static void measure_exponents(body *b, outcome *o, long periods) {
  real sums[2] = {0, 0};
  b->linearised = true;
  b->impacts = b->simulated = b->chatters = b->stops = 0;
  b->slowest = b->margin = INFINITY;
  memset(b->tangent, 0, sizeof b->tangent);
  b->tangent[0][0] = b->tangent[1][1] = 1;
  for (long n = 0; n < periods && !b->failed; n++) {
    if (n >= periods - LONGEST) {
      o->cycle[n - (periods - LONGEST)][0] = (double)b->x;
      o->cycle[n - (periods - LONGEST)][1] = (double)b->v;
    }
    one_period(b);
    orthonormal(b, sums);
  }
  for (int k = 0; k < 2; k++)
    o->exponent[k] = (double)sums[k] / (double)periods;
  o->impacts = (int)b->impacts;
  o->simulated = (int)b->simulated;
  o->chatters = (int)b->chatters;
  o->stops = (int)b->stops;
}

/* The smallest number of periods after which the last points of the ring come back, 0 if there is none. */
static int return_time(const machine *m, real (*ring)[2], long n, int longest, double tolerance) {
  real low[2], high[2], scale[2];
  const int size = 2 * LONGEST;
  for (int i = 0; i < 2; i++) {
    low[i] = INFINITY;
    high[i] = -INFINITY;
    for (long k = n - longest; k < n; k++) {
      low[i] = R(fmin)(low[i], ring[k % size][i]);
      high[i] = R(fmax)(high[i], ring[k % size][i]);
    }
    scale[i] = R(fmax)(R(fmax)(R(fabs)(low[i]), R(fabs)(high[i])), 1e-3);
    if (m->pendulum != 0 && i == 0)
      scale[i] = 1;
  }
  for (int p = 1; p <= longest; p++) {
    bool back = true;
    const int looked = p > 8 ? p : 8;
    for (int k = 0; k < looked && back; k++)
      back = apart(m, ring[(n - 1 - k) % size], ring[(n - 1 - k - p) % size], scale) < tolerance;
    if (back)
      return p;
  }
  return 0;
}

/* Follows a motion up to `most` drive periods for a cycle of up to `longest`; its period, or 0. `n` counts
 * them. */
static int find_cycle(body *b, real (*ring)[2], long *n, long least, long most, int longest,
                      double tolerance) {
  const machine *m = b->law;
  while (*n < most && !b->failed) {
    for (int k = 0; k < 32; k++, (*n)++) {
      if (m->pendulum != 0)
        b->x = R(remainder)(b->x, 2 * (real)M_PI);
      ring[*n % (2 * LONGEST)][0] = b->x;
      ring[*n % (2 * LONGEST)][1] = b->v;
      one_period(b);
    }
    const int within = *n < 2 * longest + 16 ? (int)(*n - 16) / 2 : longest;
    if (*n < least || within < 1)
      continue;
    const int period = return_time(m, ring, *n, within, tolerance);
    /* a slow or decaying motion may come near itself after other periods than its own, for a while */
    if (period > 0 && return_time(m, ring, *n, within, 1e4 * tolerance) == period)
      return period;
  }
  return 0;
}

/* Where the motion from a start ends up: flown for `least` drive periods, and then until its section points
 * come back within `tolerance` of their size, for at most `most`. Where they do not, Lyapunov exponents over
 * `more` periods; where these show no chaos, ten times as long a search. */
void referee_outcome(const machine *m, double x, double v, int longest, long least, long most, long more,
                     double tolerance, outcome *o) {
  static _Thread_local real ring[2 * LONGEST][2];
  body b = started(m, x, v);
  memset(o, 0, sizeof *o);
  if (longest > LONGEST)
    longest = LONGEST;
  long n = 0;
  int period = find_cycle(&b, ring, &n, least, most, longest, tolerance);
  if (period == 0) {
    body other = b;
    measure_exponents(&other, o, more);
    if (!(o->exponent[0] > CHAOS))
      period = find_cycle(&b, ring, &n, least, 10 * most, longest, tolerance);
  }
  o->settled = n;
  if (period > 0) {
    o->period = period;
    measure_cycle(&b, o);
  }
  o->failed = b.failed;
}

/* The same for many starts. */
void referee_outcomes(const machine *m, int count, const double *starts, int longest, long least, long most,
                      long more, double tolerance, outcome *o) {
  for (int i = 0; i < count; i++)
    referee_outcome(m, starts[2 * i], starts[2 * i + 1], longest, least, most, more, tolerance, o + i);
}

int referee_size(void) { return (int)sizeof(outcome); }
