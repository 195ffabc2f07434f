/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later */

#include "machine.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

/* A flight in one mode: direction +1 or -1 while sliding, 0 while sticking. Within a mode everything is
 * smooth. */
struct motion {
  double t, y[STATES];
  int direction;
  bool in_contact; /* inside the soft barrier */
  int leaning;     /* +1, -1: at rest on the upper or lower barrier */
  long impacts;
};

enum { HALVINGS = 52, MOST_EVENTS = 300 };
static const double slowest_bounce = 1e-7; /* m/s */
/* Steps are this much shorter in the soft barrier. */
static const int refinement = 16;

long machine_size(void) { return (long)sizeof(struct machine); }

static double foot(const struct machine *m, double t) {
  double phi = m->frequency * t + m->phase;
  if (m->ripple_harmonic > 0) {
    phi += m->ripple_sine * sin(m->ripple_harmonic * phi) + m->ripple_cosine * cos(m->ripple_harmonic * phi);
  }
  phi += m->angle;
  double c1 = cos(phi), s1 = sin(phi), c = c1, s = s1, sum = 0;
  for (int n = 0; n < HARMONICS; n++) {
    sum += m->cosine[n] * c + m->sine[n] * s;
    double next = c * c1 - s * s1;
    s = s * c1 + c * s1;
    c = next;
  }
  return m->mean + m->scale * sum;
}

/* The position `delay` ago, by cubic Hermite interpolation. */
static double delayed_position(const struct machine *m, double t, double now) {
  double at = (t - m->delay - m->history_first) / m->history_step;
  long i = (long)floor(at);
  if (i < 0 || m->history_count < 2) {
    return now;
  }
  if (i > m->history_count - 2) {
    i = m->history_count - 2;
  }
  const double *a = m->history + 2 * i, *b = a + 2;
  double s = at - (double)i, r = 1 - s;
  return a[0] * r * r * (1 + 2 * s) + b[0] * s * s * (3 - 2 * s) +
         m->history_step * s * r * (a[1] * r - b[1] * s);
}

/* size^exponent, that of the catalogue where no other is given. */
static double power_of(double size, double exponent, double usual) {
  return pow(size, exponent > 0 ? exponent : usual);
}

static double spring_beyond_linear(const struct machine *m, double extension) {
  if (m->cubic_exponent > 0) {
    return m->cubic * copysign(pow(fabs(extension), m->cubic_exponent), extension);
  }
  return m->cubic * extension * extension * extension;
}

/* The force of the soft barrier beside its damping. */
static double contact_force(const struct machine *m, double depth) {
  return m->contact_stiffness *
         (m->contact_exponent > 0 ? pow(depth, m->contact_exponent) : depth * sqrt(depth));
}

/* Every force but friction and the soft barrier. */
static double driving_force(const struct machine *m, double t, const double y[STATES]) {
  double extension = m->free_length + foot(m, t) - y[X];
  double stiffness = m->stiffness;
  if (m->stiffness_wave != 0) {
    stiffness *= 1 + m->stiffness_wave * cos(m->stiffness_wave_frequency * t);
  }
  double force = stiffness * extension + spring_beyond_linear(m, extension) + m->offset - y[U];
  if (m->second_mass > 0) {
    force += m->second_stiffness * (y[X2] - y[X]) + m->second_damping * (y[V2] - y[V]);
  }
  if (m->delayed_stiffness != 0) {
    force -= m->delayed_stiffness * (delayed_position(m, t, y[X]) - m->free_length - m->mean);
  }
  return force;
}

/* The force that friction has to hold at rest. */
static double holding_force(const struct machine *m, const struct motion *b, double t,
                            const double y[STATES]) {
  double force = driving_force(m, t, y);
  if (b->in_contact && y[X] > m->upper) {
    force -= contact_force(m, y[X] - m->upper);
  }
  return force;
}

/* Share of dry friction at a position. */
static double roughness(const struct machine *m, double x) {
  double profile =
      m->friction_wave > 0 ? sin(m->friction_wave * x + m->friction_wave_phase) / m->friction_wave : x;
  return fmax(0, 1 + m->friction_slope * profile);
}

/* Friction force that opposes sliding in a direction. */
static double level(const struct machine *m, double t, double x, double v, int direction) {
  double dry = m->coulomb + direction * m->asymmetric_coulomb;
  if (m->friction_drift != 0 && t > 0) {
    dry *= 1 + m->friction_drift * t;
  }
  if (m->stribeck != 0) {
    dry += m->stribeck * exp(-power_of(fabs(v) / m->stribeck_velocity, m->stribeck_exponent, 2));
  }
  return dry * roughness(m, x);
}

static double break_away(const struct machine *m, double t, double x, int direction) {
  return level(m, t, x, 0, direction) + m->static_excess * roughness(m, x);
}

static void rates(const struct machine *m, const struct motion *b, double t, const double y[STATES],
                  double f[STATES]) {
  int s = b->direction;
  double force = driving_force(m, t, y), v = y[V];
  memset(f, 0, STATES * sizeof *f);
  if (s != 0) {
    double size = s * v;
    force -= m->viscous * v + m->asymmetric_viscous * size;
    if (m->quadratic != 0) {
      force -= s * m->quadratic * power_of(size, m->quadratic_exponent, 2);
    }
    force -= m->dahl > 0 ? y[Z] : s * level(m, t, y[X], v, s);
    if (b->in_contact && y[X] > m->upper) {
      force -= fmax(0, contact_force(m, y[X] - m->upper) * (1 + m->contact_damping * v));
    }
    f[X] = v;
    f[V] = force / m->mass;
    if (m->dahl > 0) {
      f[Z] = m->dahl * (1 - y[Z] * s / m->coulomb) * v;
    }
  }
  if (m->second_mass > 0) {
    f[X2] = y[V2];
    f[V2] = -(m->second_stiffness * (y[X2] - y[X]) + m->second_damping * (y[V2] - v)) / m->second_mass;
  }
  if (m->maxwell_stiffness > 0) {
    f[U] = m->maxwell_stiffness * v - y[U] / m->maxwell_time;
  }
}

/* The classical Runge-Kutta step. */
static void step(const struct machine *m, const struct motion *b, double h, double y[STATES]) {
  static const double nodes[4] = {0, 0.5, 0.5, 1}, weights[4] = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
  double f[STATES] = {0}, at[STATES];
  memcpy(y, b->y, sizeof b->y);
  for (int k = 0; k < 4; k++) {
    for (int i = 0; i < STATES; i++) {
      at[i] = b->y[i] + nodes[k] * h * f[i];
    }
    rates(m, b, b->t + nodes[k] * h, at, f);
    for (int i = 0; i < STATES; i++) {
      y[i] += weights[k] * h * f[i];
    }
  }
}

static bool rigid(const struct machine *m) { return !(m->contact_stiffness > 0); }

static bool beyond_barrier(const struct machine *m, int direction, double x) {
  return direction > 0 ? x > m->upper : direction < 0 && x < m->lower;
}

/* Whether the mode has ended before `y`. */
static bool ended(const struct machine *m, const struct motion *b, double t, const double y[STATES]) {
  int s = b->direction;
  if (s == 0) {
    double force = holding_force(m, b, t, y);
    if (m->dahl > 0) {
      return b->leaning * (force - y[Z]) < 0;
    }
    return (b->leaning <= 0 && force > break_away(m, t, y[X], 1)) ||
           (b->leaning >= 0 && -force > break_away(m, t, y[X], -1));
  }
  if (s * y[V] < 0 || (s < 0 && y[X] < m->lower)) {
    return true;
  }
  if (rigid(m)) {
    return s > 0 && y[X] > m->upper;
  }
  return b->in_contact ? y[X] < m->upper : y[X] > m->upper;
}

/* The mode in which a body at rest goes on. */
static void choose_direction(const struct machine *m, struct motion *b) {
  double force = holding_force(m, b, b->t, b->y);
  b->y[V] = 0;
  if (m->dahl > 0) {
    /* without a stick mode the body rests only where a barrier holds it */
    int pushed = force > b->y[Z] ? 1 : -1;
    b->direction = pushed == b->leaning ? 0 : pushed;
    b->leaning = b->direction == 0 ? pushed : 0;
    return;
  }
  b->direction = 0;
  if (b->leaning <= 0 && force > break_away(m, b->t, b->y[X], 1)) {
    b->direction = 1;
  } else if (b->leaning >= 0 && -force > break_away(m, b->t, b->y[X], -1)) {
    b->direction = -1;
  }
  if (b->direction != 0) {
    b->leaning = 0;
  }
}

/* Growth of what an impact loses with its speed. */
static double loss(const struct machine *m, double speed) {
  double constant = m->restitution_constant;
  switch ((int)m->restitution_shape) {
  case POWER:
    return pow(speed, constant);
  case SATURATING:
    return constant * (1 - exp(-speed / constant));
  case STEP:
    return 0.5 * (1 + tanh((speed - constant) / (0.15 * constant)));
  default:
    return speed;
  }
}

static void bounce(const struct machine *m, struct motion *b) {
  int side = b->direction;
  double speed = fabs(b->y[V]);
  double k = m->restitution - m->restitution_slope * loss(m, speed);
  if (m->restitution_wave != 0) {
    k += m->restitution_wave * sin(m->restitution_wave_frequency * b->t);
  }
  k = fmin(1, fmax(0, k));
  b->impacts++;
  b->y[X] = side > 0 ? m->upper : m->lower;
  b->y[V] = -k * b->y[V];
  b->direction = -side;
  if (fabs(b->y[V]) < slowest_bounce) {
    b->leaning = side;
    choose_direction(m, b);
  }
}

static void pass_event(const struct machine *m, struct motion *b) {
  int s = b->direction;
  if (s != 0 && beyond_barrier(m, s, b->y[X]) && (rigid(m) || s < 0)) {
    bounce(m, b);
  } else if (s > 0 && !b->in_contact && b->y[X] > m->upper) {
    b->in_contact = true;
    b->impacts++;
  } else if (s < 0 && b->in_contact && b->y[X] < m->upper) {
    b->in_contact = false;
  } else {
    choose_direction(m, b);
  }
}

/* A step that is short beside the time in which presliding becomes sliding. */
static double presliding_step(const struct machine *m, double v, double longest) {
  if (!(m->dahl > 0)) {
    return longest;
  }
  return fmin(longest, fmax(longest / 256, 0.1 * m->coulomb / (m->dahl * fmax(fabs(v), 0.3))));
}

/* Flies to `end`, a step ahead. */
static int advance(const struct machine *m, struct motion *b, double end, double longest) {
  int events = 0;
  while (b->t < end) {
    double remaining = end - b->t, y[STATES];
    double h = fmin(remaining, fmin(b->in_contact ? longest / refinement : longest,
                                    presliding_step(m, b->y[V], longest)));
    step(m, b, h, y);
    if (!ended(m, b, b->t + h, y)) {
      memcpy(b->y, y, sizeof b->y);
      b->t = h < remaining ? b->t + h : end;
      continue;
    }
    double low = 0, high = h;
    for (int i = 0; i < HALVINGS; i++) {
      double middle = 0.5 * (low + high);
      step(m, b, middle, y);
      if (ended(m, b, b->t + middle, y)) {
        high = middle;
      } else {
        low = middle;
      }
    }
    step(m, b, high, y);
    memcpy(b->y, y, sizeof b->y);
    b->t += high;
    pass_event(m, b);
    if (++events > MOST_EVENTS) {
      return 1;
    }
  }
  return 0;
}

static struct motion begin(const struct machine *m, const double start[STATES], double t0) {
  struct motion b = {.t = t0};
  memcpy(b.y, start, sizeof b.y);
  b.in_contact = !rigid(m) && start[X] > m->upper;
  b.direction = start[V] > 0 ? 1 : -1;
  if (rigid(m) && b.direction > 0 && start[X] >= m->upper) {
    b.leaning = start[V] > slowest_bounce ? 0 : 1;
  }
  if (start[V] == 0 || b.leaning != 0) {
    choose_direction(m, &b);
  }
  return b;
}

static int fly(struct machine *m, bool remember, const double start[STATES], double t0, double interval,
               long count, long substeps, double (*states)[STATES], long *impacts) {
  struct motion b = begin(m, start, t0);
  double h = interval / (double)substeps;
  for (long i = 0; i < count; i++) {
    memcpy(states[i], b.y, sizeof b.y);
    for (long k = 0; k < substeps && i < count - 1; k++) {
      if (remember && m->history) {
        m->history[2 * m->history_count] = b.y[X];
        m->history[2 * m->history_count + 1] = b.y[V];
        m->history_count++;
      }
      if (advance(m, &b, t0 + (double)(i * substeps + k + 1) * h, h)) {
        return 1;
      }
    }
  }
  *impacts = b.impacts;
  return 0;
}

int simulate(struct machine *machine, const double start[STATES], double t0, double interval, long count,
             long substeps, double (*states)[STATES], long *impacts) {
  machine->history_first = t0;
  machine->history_step = interval / (double)substeps;
  machine->history_count = 0;
  return fly(machine, true, start, t0, interval, count, substeps, states, impacts);
}

int simulate_pieces(struct machine *machine, long n, const double (*starts)[STATES], const double *t0,
                    const long *first, double interval, long substeps, double (*states)[STATES],
                    long *impacts) {
  for (long i = 0; i < n; i++) {
    if (fly(machine, false, starts[i], t0[i], interval, first[i + 1] - first[i], substeps, states + first[i],
            &impacts[i])) {
      return 1;
    }
  }
  return 0;
}
