/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Impacts, rest, flights from event to event, and one drive period of them.
 */
#include "series.h"

static const double LEAST_CHANGE = 1e-9;   /* a chatter is completed below this */
static const double COUNTED_CHANGE = 1e-6; /* impacts after this one do not count (docs/theory.md, Chatter) */

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

/* One interval of rest, by friction or on a wall, at most until `end`. */
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
    const real s = first_zero(guard, ORDER, h);
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
    const real s = first_zero(v, ORDER - 1, h);
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
    const real s = first_zero(guard, ORDER, h);
    if (s >= 0 && (soonest < 0 || s < soonest)) {
      soonest = s;
      kind = side;
    }
  }
  if (friction) {
    for (int j = 0; j < ORDER; j++)
      guard[j] = b->sign * (j + 1) * x[j + 1];
    const real s = first_zero(guard, ORDER - 1, h);
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
    b.pressed = x > m->upper || (x == m->upper && v > 0)   ? 1
                : x < m->lower || (x == m->lower && v < 0) ? -1
                                                           : 0;
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
    real end = period;
    if (m->samples > 0 && sample_before(m, b->time) < m->samples - 2)
      end = (sample_before(m, b->time) + 1) * (real)m->interval;
    const real left = end - b->time, h = left < 1.5 * step ? left : step, before = b->time;
    if (b->mode == FREE)
      flight(b, h);
    else
      rest(b, h);
    if (b->time >= end * (1 - 1e-15))
      b->time = end;
    again = b->time > before ? 0 : again + 1;
    if (again > 50)
      break;
  }
  b->failed = b->failed || b->events >= most || again > 50 || !isfinite((double)b->x);
  b->time = 0;
}
