/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * An independent referee: forced machines of one degree of freedom, flown by Taylor series.
 *
 *   x'' = spring (rest - x) + cubic (rest + foot - x)^3 - pendulum sin x + drive(t) - damping x' - kinetic sgn x'
 *
 * (all per unit mass; drive = spring foot), between rigid walls with a constant restitution or soft ones that push
 * with a linear spring. Nothing of src/ is used, and no method of it: the motion is a power series of order 22 about
 * the beginning of each step, and its events are the roots of polynomials, isolated by bounding the series and its
 * derivative on ever smaller intervals. Chatter is followed impact by impact until what is left of it changes the
 * pressing force by less than 1e-9 of itself, and then summed.
 */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#ifndef REAL_IS_LONG
typedef double real;
#define R(name) name
#else
typedef long double real;
#define R(name) name##l
#endif

enum { ORDER = 22, HARMONICS = 8, LONGEST = 512, DEEPEST = 60 };
static const double LEAST_CHANGE = 1e-9;   /* a chatter is completed below this */
static const double COUNTED_CHANGE = 1e-6; /* impacts after this one do not count (docs/theory.md, Chatter) */

typedef struct {
  double spring, rest, cubic, pendulum, damping, kinetic, static_friction;
  double restitution, upper, lower, wall_stiffness; /* wall_stiffness > 0: soft walls */
  double frequency, cosine[HARMONICS], sine[HARMONICS];
  double longest_step; /* radians of the fastest part of the motion in one step */
} machine;

/* What a motion did over its cycle, or over the last periods if it has none. */
typedef struct {
  int period;          /* in drive periods, 0: none found */
  int turns;           /* of a pendulum per cycle */
  long settled;        /* drive periods until the cycle was found */
  int impacts;         /* per cycle, those of a completed chatter only as far as the rule above counts them */
  int simulated;       /* impacts that were followed */
  int chatters, stops; /* completed chatters, rests by friction */
  double exponent[2];  /* Lyapunov exponents per drive period; of a cycle ln|multiplier| / period */
  double trace, determinant;   /* of the linearised map over the cycle */
  double slowest;      /* impact of the cycle: the smallest speed */
  double margin;       /* smallest gap to a wall at a turning point that missed it, over the cycle */
  double cycle[LONGEST][2];
  bool failed;
} outcome;

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

static real value(const real *c, int n, real s) {
  real sum = c[n];
  for (int j = n - 1; j >= 0; j--)
    sum = sum * s + c[j];
  return sum;
}

static void shifted(const real *c, int n, real s, real *out) {
  for (int j = 0; j <= n; j++)
    out[j] = c[j];
  for (int i = 0; i < n; i++)
    for (int j = n - 1; j >= i; j--)
      out[j] += s * out[j + 1];
}

/* The root between a, where c is positive, and b, where it is not; c is monotone there. */
static real polished(const real *c, int n, real a, real b) {
  real s = (a + b) / 2;
  for (int i = 0; i < 200 && b > a; i++) {
    const real f = value(c, n, s);
    if (f > 0)
      a = s;
    else
      b = s;
    real slope = 0;
    for (int j = n; j >= 1; j--)
      slope = slope * s + j * c[j];
    real next = s - f / slope;
    if (!(next > a && next < b))
      next = (a + b) / 2;
    if (next == s || next == a || next == b)
      return next;
    s = next;
  }
  return s;
}

static real search(const real *c, int n, real a, real b, int depth) {
  const real middle = (a + b) / 2, r = (b - a) / 2;
  real d[ORDER + 1], range = 0, bend = 0, power = r;
  shifted(c, n, middle, d);
  for (int j = 1; j <= n; j++) {
    range += R(fabs)(d[j]) * power;
    if (j >= 2)
      bend += j * R(fabs)(d[j]) * power / r;
    power *= r;
  }
  if (d[0] > range)
    return -1;
  const real first = value(d, n, -r), last = value(d, n, r);
  if (first <= 0)
    return a;
  if (R(fabs)(d[1]) > bend)
    return last > 0 ? -1 : middle + polished(d, n, -r, r);
  if (depth == DEEPEST)
    return d[0] > 0 ? -1 : middle;
  const real left = search(c, n, a, middle, depth + 1);
  return left >= 0 ? left : search(c, n, middle, b, depth + 1);
}

/* The first s in (0, h] where the polynomial falls through zero, -1 if there is none. Roots at 0 itself do not count. */
static real first_fall(const real *c, int n, real h) {
  while (n > 0 && c[0] == 0) {
    c++;
    n--;
  }
  if (c[0] < 0)
    return 0;
  real range = 0;
  for (int j = n; j >= 1; j--)
    range = (range + R(fabs)(c[j])) * h;
  if (c[0] > range)
    return -1;
  return search(c, n, 0, h, 0);
}

static void drive_series(const machine *m, real time, real *f) {
  memset(f, 0, (ORDER + 1) * sizeof *f);
  for (int n = 1; n <= HARMONICS; n++) {
    if (m->cosine[n - 1] == 0 && m->sine[n - 1] == 0)
      continue;
    const real w = n * (real)m->frequency, c = R(cos)(w * time), s = R(sin)(w * time);
    const real term[2] = {m->cosine[n - 1] * c + m->sine[n - 1] * s, m->sine[n - 1] * c - m->cosine[n - 1] * s};
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
  real stretch[ORDER + 1], square[ORDER + 1], s[ORDER + 1], c[ORDER + 1];
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
      stretch[j] = (j == 0 ? m->rest : 0) + f[j] / m->spring - x[j];
      square[j] = product(stretch, stretch, j);
      a += m->cubic * product(stretch, square, j);
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
      real w = -(m->spring + (b->pressed ? m->wall_stiffness : 0)) * u[k][j] - m->damping * (j + 1) * u[k][j + 1];
      if (m->cubic != 0)
        w -= 3 * m->cubic * product(square, u[k], j);
      if (m->pendulum != 0)
        w -= m->pendulum * product(c, u[k], j);
      u[k][j + 2] = w / ((j + 1) * (real)(j + 2));
    }
  }
}

/* Force on a body at rest in its place, as a series in time. */
static void holding(const body *b, const real *f, real *force) {
  const machine *m = b->law;
  real stretch[ORDER + 1], square[ORDER + 1];
  for (int j = 0; j <= ORDER; j++) {
    force[j] = f[j] + (j == 0 ? m->spring * (m->rest - b->x) - m->pendulum * R(sin)(b->x) : 0);
    if (m->cubic != 0) {
      stretch[j] = (j == 0 ? m->rest - b->x : 0) + f[j] / m->spring;
      square[j] = product(stretch, stretch, j);
      force[j] += m->cubic * product(stretch, square, j);
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

/* By how much the force on a body at rest changes with its place. */
static real force_slope(const body *b) {
  const machine *m = b->law;
  real f[ORDER + 1];
  drive_series(m, b->time, f);
  const real stretch = m->rest - b->x + (m->spring != 0 ? f[0] / m->spring : 0);
  return -m->spring - 3 * m->cubic * stretch * stretch - m->pendulum * R(cos)(b->x);
}

static void begin_sliding(body *b, int direction, bool level) {
  b->mode = FREE;
  b->sign = direction;
  b->level = level;
}

/* The velocity is zero: does the body rest, or slide on? */
static void at_zero_velocity(body *b) {
  real rate;
  const real force = force_at_rest(b, &rate), before = force - b->law->kinetic * b->sign;
  b->v = 0;
  if (R(fabs)(force) <= b->law->static_friction) {
    b->mode = STUCK;
    b->stops++;
    for (int k = 0; k < 2; k++)
      b->tangent[1][k] = 0;
    return;
  }
  const int direction = force > 0 ? 1 : -1;
  const real after = force - b->law->kinetic * direction;
  if (b->sign != 0)
    for (int k = 0; k < 2; k++)
      b->tangent[1][k] *= after / before;
  begin_sliding(b, direction, after == 0);
}

/* A rigid wall: side +1 upper, -1 lower. */
static void impact(body *b, int side) {
  const machine *m = b->law;
  const real before = R(fabs)(b->v), after = m->restitution * before;
  b->x = side > 0 ? m->upper : m->lower;
  const real F = m->kinetic, force = side * force_at_rest(b, NULL);
  /* accelerations towards the wall just before and just after the impact */
  const real a_before = force - F - m->damping * before, a_after = force + F + m->damping * after;
  if (b->linearised)
    for (int k = 0; k < 2; k++) {
      const real dx = side * b->tangent[0][k], dv = side * b->tangent[1][k];
      b->tangent[0][k] = -side * m->restitution * dx;
      const real kick = before == 0 ? 0 : (a_after + m->restitution * a_before) / before * dx;
      b->tangent[1][k] = side * (kick - m->restitution * dv);
    }
  b->simulated++;
  if (!b->silent)
    b->impacts++;
  if (before < b->slowest)
    b->slowest = before;
  b->v = -side * after;
  b->sign = F != 0 || m->static_friction != 0 ? -side : 0;
  b->level = false;
  const real out = force + F, back = force - F;
  if (back > 0) {
    const real ratio = m->restitution * R(sqrt)(back / out);
    const real left = after * (1 / out + 1 / R(sqrt)(out * back)) / (1 - ratio);
    const real change = change_within(b, left) / back;
    b->silent = change < COUNTED_CHANGE;
    if (change < LEAST_CHANGE) {
      const real period = 2 * (real)M_PI / m->frequency;
      b->time += left;
      if (b->time > period)
        b->time = period; /* by less than a step: the section comes first */
      b->v = 0;
      b->mode = side > 0 ? ON_UPPER : ON_LOWER;
      b->chatters++;
      memset(b->tangent, 0, sizeof b->tangent);
    }
  } else {
    b->silent = false;
    if (after == 0) {
      if (force > -m->static_friction)
        b->mode = side > 0 ? ON_UPPER : ON_LOWER;
      else
        begin_sliding(b, b->sign, false);
    }
  }
}

/* One stretch of rest, by friction or on a wall, at most until `end`. */
static void rest(body *b, real h) {
  const machine *m = b->law;
  real f[ORDER + 1], force[ORDER + 1], guard[ORDER + 1];
  drive_series(m, b->time, f);
  holding(b, f, force);
  real soonest = -1;
  int direction = 0;
  for (int side = -1; side <= 1; side += 2) { /* the body leaves towards `side` */
    if ((b->mode == ON_UPPER && side > 0) || (b->mode == ON_LOWER && side < 0))
      continue;
    for (int j = 0; j <= ORDER; j++)
      guard[j] = -side * force[j];
    guard[0] += m->static_friction;
    const real s = first_fall(guard, ORDER, h);
    if (s >= 0 && (soonest < 0 || s < soonest)) {
      soonest = s;
      direction = side;
    }
  }
  if (soonest < 0) {
    b->time += h;
    return;
  }
  b->time += soonest;
  const bool held = b->mode == STUCK;
  begin_sliding(b, direction, m->static_friction == m->kinetic);
  b->silent = false;
  if (held && b->linearised) {
    real rate;
    force_at_rest(b, &rate);
    const real leap = direction * (m->static_friction - m->kinetic);
    for (int k = 0; k < 2; k++)
      b->tangent[1][k] = leap * force_slope(b) * b->tangent[0][k] / rate;
  }
  if (m->kinetic == 0 && m->static_friction == 0)
    b->sign = 0;
}

static real longest_step(const body *b, const real *x, real h) {
  if (b->law->cubic == 0 && b->law->pendulum == 0)
    return h;
  const real size = 1 + R(fabs)(x[0]);
  for (int j = ORDER - 1; j <= ORDER; j++)
    if (x[j] != 0) {
      const real allowed = R(pow)(1e-18 * size / R(fabs)(x[j]), 1 / (real)j);
      if (allowed < h)
        h = allowed;
    }
  return h;
}

/* The turning points of a flight that miss a wall: how near they come to it. */
static void note_margin(body *b, const real *x, real h) {
  const machine *m = b->law;
  if (!isfinite(m->upper) && !isfinite(m->lower))
    return;
  for (int side = -1; side <= 1; side += 2) {
    real v[ORDER];
    if (!isfinite(side > 0 ? m->upper : m->lower))
      continue;
    for (int j = 0; j < ORDER; j++)
      v[j] = side * (j + 1) * x[j + 1];
    if (!(v[0] > 0))
      continue;
    const real s = first_fall(v, ORDER - 1, h);
    if (s < 0)
      continue;
    const real gap = side > 0 ? m->upper - value(x, ORDER, s) : value(x, ORDER, s) - m->lower;
    if (gap < b->margin)
      b->margin = gap;
  }
}

/* One flight: to its first event, or over the step. */
static void flight(body *b, real h) {
  const machine *m = b->law;
  real f[ORDER + 1], x[ORDER + 1], guard[ORDER + 1], u[2][ORDER + 1];
  const bool friction = m->kinetic != 0 || m->static_friction != 0;
  drive_series(m, b->time, f);
  series(b, f, x, u);
  h = longest_step(b, x, h);
  real soonest = -1;
  int kind = 0; /* 1, -1: walls; 2: velocity zero */
  for (int side = -1; side <= 1; side += 2) {
    const real wall = side > 0 ? m->upper : m->lower;
    if (!isfinite((double)wall) || (b->pressed && b->pressed != side))
      continue;
    const int inside = b->pressed ? -1 : 1;
    for (int j = 0; j <= ORDER; j++)
      guard[j] = inside * side * ((j == 0 ? wall : 0) - x[j]);
    if (guard[0] < 0 && inside * side * b->v < 0) {
      guard[0] = 0; /* the rounding of a step that ended on the wall */
    }
    const real s = first_fall(guard, ORDER, h);
    if (s >= 0 && (soonest < 0 || s < soonest)) {
      soonest = s;
      kind = side;
    }
  }
  if (friction) {
    for (int j = 0; j < ORDER; j++)
      guard[j] = b->sign * (j + 1) * x[j + 1];
    const real s = first_fall(guard, ORDER - 1, h);
    if (s >= 0 && (soonest < 0 || s < soonest)) {
      soonest = s;
      kind = 2;
    }
  }
  const real s = soonest < 0 ? h : soonest;
  note_margin(b, x, s);
  b->time += s;
  b->x = value(x, ORDER, s);
  real v[ORDER];
  for (int j = 0; j < ORDER; j++)
    v[j] = (j + 1) * x[j + 1];
  b->v = value(v, ORDER - 1, s);
  b->level = false;
  if (b->linearised)
    for (int k = 0; k < 2; k++) {
      b->tangent[0][k] = value(u[k], ORDER, s);
      real w[ORDER];
      for (int j = 0; j < ORDER; j++)
        w[j] = (j + 1) * u[k][j + 1];
      b->tangent[1][k] = value(w, ORDER - 1, s);
    }
  if (soonest < 0)
    return;
  b->events++;
  if (kind == 2) {
    at_zero_velocity(b);
  } else if (m->wall_stiffness > 0) {
    b->x = kind > 0 ? m->upper : m->lower;
    if (!b->pressed) {
      b->simulated++;
      b->impacts++;
      if (R(fabs)(b->v) < b->slowest)
        b->slowest = R(fabs)(b->v);
    }
    b->pressed = b->pressed ? 0 : kind;
  } else {
    impact(b, kind);
  }
}

static body started(const machine *m, double x, double v) {
  body b = {.law = m, .x = x, .v = v, .slowest = INFINITY, .margin = INFINITY};
  b.tangent[0][0] = b.tangent[1][1] = 1;
  if (m->wall_stiffness > 0)
    b.pressed = x > m->upper ? 1 : x < m->lower ? -1 : 0;
  if (m->kinetic != 0 || m->static_friction != 0) {
    b.sign = v > 0 ? 1 : v < 0 ? -1 : 0;
    if (v == 0)
      at_zero_velocity(&b);
    b.stops = 0;
  }
  return b;
}

static void one_period(body *b) {
  const machine *m = b->law;
  const real period = 2 * (real)M_PI / m->frequency;
  int highest = 1;
  for (int n = 1; n <= HARMONICS; n++)
    if (m->cosine[n - 1] != 0 || m->sine[n - 1] != 0)
      highest = n;
  real fastest = highest * m->frequency;
  const real own = R(sqrt)(m->spring + m->pendulum + m->wall_stiffness);
  if (own > fastest)
    fastest = own;
  if (m->damping > fastest)
    fastest = m->damping;
  const real step = m->longest_step / fastest;
  const long most = b->events + 100000;
  int again = 0;
  while (b->time < period && b->events < most) {
    const real left = period - b->time, h = left < 1.5 * step ? left : step, before = b->time;
    if (b->mode == FREE)
      flight(b, h);
    else
      rest(b, h);
    again = b->time > before ? 0 : again + 1;
    if (again > 50)
      break;
  }
  b->failed = b->failed || b->events >= most || again > 50 || !isfinite((double)b->x);
  b->time = 0;
}

/* Strobes of one motion: rows x, v, impacts so far, chatters so far, turned into doubles. */
void referee_strobes(const machine *m, double x, double v, long periods, double *rows) {
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
  const real large = root < 0 ? R(sqrt)(R(fabs)((real)o->determinant)) : R(fabs)((real)o->trace) / 2 + R(sqrt)(root);
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

/* Where the motion from a start ends up: flown for `least` drive periods, and then until its section points come
 * back within `tolerance` of their size, for at most `most`. Where they do not, Lyapunov exponents over `more`. */
void referee_outcome(const machine *m, double x, double v, int longest, long least, long most, long more,
                     double tolerance, outcome *o) {
  static _Thread_local real ring[2 * LONGEST][2];
  body b = started(m, x, v);
  memset(o, 0, sizeof *o);
  if (longest > LONGEST)
    longest = LONGEST;
  long n = 0;
  while (n < most && !b.failed) {
    for (int k = 0; k < 32; k++, n++) {
      if (m->pendulum != 0)
        b.x = R(remainder)(b.x, 2 * (real)M_PI);
      ring[n % (2 * LONGEST)][0] = b.x;
      ring[n % (2 * LONGEST)][1] = b.v;
      one_period(&b);
    }
    const int within = n < 2 * longest + 16 ? (int)(n - 16) / 2 : longest;
    if (n < least || within < 1)
      continue;
    o->period = return_time(m, ring, n, within, tolerance);
    /* a decaying oscillation may come near itself after other periods than its own, for a while */
    if (o->period > 0 && return_time(m, ring, n, within, 1e4 * tolerance) == o->period)
      break;
  }
  o->settled = n;
  if (o->period > 0)
    measure_cycle(&b, o);
  else
    measure_exponents(&b, o, more);
  o->failed = b.failed;
}

/* The same for many starts. */
void referee_outcomes(const machine *m, int count, const double *starts, int longest, long least, long most, long more,
                      double tolerance, outcome *o) {
  for (int i = 0; i < count; i++)
    referee_outcome(m, starts[2 * i], starts[2 * i + 1], longest, least, most, more, tolerance, o + i);
}

int referee_size(void) { return (int)sizeof(outcome); }
