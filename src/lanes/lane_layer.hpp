// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Passages through a thin Stribeck layer. Outside it the motion is Coulomb's, whose course near a velocity
// zero is a short series: its acceleration as a polynomial of its own speed V. The excess friction E e(w)
// takes the body off that course by P = V - w, so that
//   dP/dw = E e(w)/D,   D = A(w + P) + omega^2 (lag) -+ E e(w),
// from rest outwards or from the edge inwards to rest. P changes A a little only: a guess, and one
// integration over the speed with fixed nodes, make it known to rounding. What counts outside is the change
// of the free part of the motion, the integral of E e exp(-i omega t) over time.
#ifndef SEPARATRIX_LANE_LAYER_HPP
#define SEPARATRIX_LANE_LAYER_HPP

#include "lane_motion.hpp"

namespace {

enum { most_improvements = 3 };

// Speed per time since V = 0, by its derivatives there, and what follows from them.
struct course {
  vec rate, curl, snap, crackle, pop;
  // Acceleration and time as polynomials of the speed.
  vec acceleration[5], time[4];
};

LANE_DEVICE inline course derivatives_of(vec rate, vec curl, vec snap, vec crackle, vec pop) {
  course c = {rate, curl, snap, crackle, pop, {}, {}};
  vec unit = 1.0 / rate, g1 = curl * unit, g2 = snap * unit, g3 = crackle * unit, g4 = pop * unit;
  vec square = g1 * g1, power = unit;
  c.acceleration[0] = rate;
  c.acceleration[1] = g1;
  c.time[0] = power;
  power *= unit;
  c.acceleration[2] = 0.5 * (g2 - square) * unit;
  c.time[1] = -0.5 * g1 * power;
  c.acceleration[3] = (1.0 / 6) * (g3 - g1 * (4 * g2 - 3 * square)) * power;
  power *= unit;
  c.time[2] = (0.5 * square - (1.0 / 6) * g2) * power;
  c.acceleration[4] =
      (1.0 / 24) * (g4 - 7 * g1 * g3 - 4 * g2 * g2 + square * (25 * g2 - 15 * square)) * power;
  c.time[3] = (g1 * ((5.0 / 12) * g2 - 0.625 * square) - (1.0 / 24) * g3) * (power * unit);
  return c;
}

LANE_DEVICE inline vec acceleration_at(const course &c, vec speed) {
  const vec *k = c.acceleration;
  return k[0] + speed * (k[1] + speed * (k[2] + speed * (k[3] + speed * k[4])));
}

LANE_DEVICE inline vec time_at(const course &c, vec speed) {
  return speed * (c.time[0] + speed * (c.time[1] + speed * (c.time[2] + speed * c.time[3])));
}

// Speed, acceleration and its rate at a time.
LANE_DEVICE inline void follow(const course &c, vec t, vec &speed, vec &rate, vec &curl) {
  vec half = 0.5 * t, third = (1.0 / 3) * t, fourth = 0.25 * t, fifth = 0.2 * t;
  speed = t * (c.rate + half * (c.curl + third * (c.snap + fourth * (c.crackle + fifth * c.pop))));
  rate = c.rate + t * (c.curl + half * (c.snap + third * (c.crackle + fourth * c.pop)));
  curl = c.curl + t * (c.snap + half * (c.crackle + third * c.pop));
}

// Integrals of E e cos(omega t) and E e sin(omega t) over the time since rest, for lanes that are `sound`.
struct passage {
  vec even, odd;
  mask sound;
};

// The values at the nodes while a passage is being integrated.
struct nodes {
  vec inverse[layer_nodes], before[layer_nodes], time[layer_nodes], total;
};

// From what is known of 1/D: P, and with it a better 1/D for the lanes `seek`. Returns the largest change.
template <bool outward>
LANE_DEVICE inline vec improve(const lane_machine &m, const course &c, mask seek, nodes &n) {
  const lane_layer &l = m.layer;
  const double (&table)[layer_nodes][layer_nodes] = outward ? l.from_rest : l.from_edge;
  vec lost[layer_nodes] = {}, moment[layer_nodes] = {}, total = {}, change = {};
  for (int i = 0; i < layer_nodes; i++) {
    vec slope = l.force[i] * n.inverse[i], late = slope * n.time[i];
    total += l.weight[i] * slope;
    for (int k = 0; k < layer_nodes; k++) {
      lost[k] += table[i][k] * slope;
      moment[k] += table[i][k] * late;
    }
  }
  put(n.total, seek, total);
  const double stiffness = m.natural * m.natural;
  for (int i = 0; i < layer_nodes; i++) {
    vec speed = l.speed[i] + lost[i], t = time_at(c, speed);
    vec now = acceleration_at(c, speed) + stiffness * (lost[i] * t - moment[i]);
    vec x = (now - n.before[i]) * n.inverse[i];
    put(change, magnitude(x) > change, magnitude(x));
    put(n.inverse[i], seek, n.inverse[i] * (1.0 - x * (1.0 - x)));
    put(n.before[i], seek, now);
    put(n.time[i], seek, t);
  }
  return change;
}

// The passage of a body whose Coulomb course is c. Inward the time runs backwards, from rest to the edge.
// `bound` is that of the seventh derivative of the position.
template <bool outward>
LANE_DEVICE passage pass_layer(const lane_machine &m, const course &c, mask due, vec bound) {
  const lane_layer &l = m.layer;
  const double *first = outward ? l.first_from_rest : l.first_from_edge;
  const double *second = outward ? l.second_from_rest : l.second_from_edge;
  vec share = l.excess / c.rate, lowest = c.rate;
  nodes n;
  for (int i = 0; i < layer_nodes; i++) {
    vec guess = share * (outward ? first[i] + share * second[i] : first[i] - share * second[i]);
    vec speed = l.speed[i] + guess;
    n.before[i] = acceleration_at(c, speed);
    put(lowest, n.before[i] < lowest, n.before[i]);
    n.inverse[i] = 1.0 / (outward ? n.before[i] - l.force[i] : n.before[i] + l.force[i]);
    n.time[i] = time_at(c, speed);
  }
  n.total = vec{};
  vec least = outward ? c.rate - l.excess : c.rate, bend = magnitude(c.curl) / least,
      unit = l.thickness / least;
  // What the series leaves out, over the whole layer.
  vec unit2 = unit * unit, bend2 = bend * bend;
  vec cut = unit2 * unit2 * unit * (bound / least + 105 * (bend2 * bend2 * bend));
  due = due & (c.rate > 0.0) & (lowest > 0.25 * c.rate);
  if (outward)
    due = due & (share <= l.steepest);
  passage p = {};
  for (int round = 0; round < most_improvements && any(due & ~p.sound); round++) {
    vec change = improve<outward>(m, c, ~p.sound, n);
    // What another round would change.
    vec left = change * n.total * (bend / least);
    p.sound = p.sound | (due & ((left + cut) * n.total <= l.precision) & (change < 1e-4));
  }
  vec rest = outward ? vec{} : time_at(c, n.total);
  for (int i = 0; i < layer_nodes; i++) {
    vec part = (l.weight[i] * l.force[i]) * n.inverse[i];
    vec angle = m.natural * (n.time[i] - rest), z = angle * angle;
    p.even += part * (1.0 - z * (0.5 - (1.0 / 24) * z));
    p.odd += part * angle * (1.0 - (1.0 / 6) * z);
  }
  return p;
}

// Where the flights of a machine with a layer are Coulomb's to the end: up to the edge of the layer, or to
// the barrier. Returns the lanes where the edge was not found.
LANE_DEVICE inline mask find_edge(const lane_machine &m, mask found, lane_group &g) {
  vec d = g.direction, speed, rate, curl;
  course c = derivatives_of(-d * g.end_a, d * g.end_j, -d * g.end_s, vec{}, vec{});
  vec t = time_at(c, m.layer.edge);
  follow(c, t, speed, rate, curl);
  mask hit = g.hits > 0.5;
  mask sound = hit | ((t > 0.0) & (magnitude(speed - m.layer.edge) < m.layer.edge - m.layer.level));
  put(g.reach, found, pick(hit, g.span, g.span - t));
  put(g.reach_v, found, pick(hit, g.end_v, d * speed));
  put(g.reach_a, found, pick(hit, g.end_a, -d * rate));
  put(g.reach_j, found, pick(hit, g.end_j, d * curl));
  return found & ~sound;
}

// The turning of a body at the end of its flight: in through the layer to rest, and out again in the other
// direction. The Coulomb course that it came on would have turned later.
struct turning {
  // Rest: how long before that, and where.
  vec early, x;
  // The flight out: free part at rest, and the time, motion at the outer edge.
  vec re, im, skip, v, a, j;
  mask sound;
};

LANE_DEVICE inline turning turn_in_layer(const lane_machine &m, mask due, const lane_group &g) {
  const double stiffness = m.natural * m.natural;
  vec end_s, end_c, end_p;
  end_derivatives(m, g, end_s, end_c, end_p);
  turning r;
  vec d = g.direction, bound = derivative_bound(m, g);
  course in = derivatives_of(-d * g.end_a, d * g.end_j, -d * end_s, d * end_c, -d * end_p);
  passage inward = pass_layer<false>(m, in, due, bound);
  r.early = time_at(in, inward.even);
  vec h = -r.early, half = 0.5 * h, third = (1.0 / 3) * h, fourth = 0.25 * h, fifth = 0.2 * h;
  vec p = end_p, c = end_c + h * p, s = end_s + h * (end_c + half * p);
  vec j = g.end_j + h * (end_s + half * (end_c + third * p));
  vec a = g.end_a + h * (g.end_j + half * (end_s + third * (end_c + fourth * p)));
  vec v = h * (g.end_a + half * (g.end_j + third * (end_s + fourth * (end_c + fifth * p))));
  vec path = half * (g.end_a + third * (g.end_j + fourth * (end_s + fifth * end_c)));
  // How far the body is off the old course, and what that and the reversed friction do to the derivatives.
  vec off = -d * inward.odd * (1 / m.natural), jump = (2 * m.kinetic) * d - stiffness * off;
  r.x = g.end_x + h * path + off;
  a += jump;
  j += stiffness * v;
  s -= stiffness * jump;
  c -= stiffness * (stiffness * v);
  p += stiffness * (stiffness * jump);
  course out = derivatives_of(-d * a, -d * j, -d * s, -d * c, -d * p);
  passage outward = pass_layer<true>(m, out, due & inward.sound, bound);
  r.re = g.end_re;
  r.im = g.end_im;
  turn_on<false, 6>(m, h, r.re, r.im);
  r.re += d * outward.even - v;
  r.im += m.damped * (off - (2 * m.offset) * d) - d * outward.odd;
  vec speed, rate, curl;
  r.skip = time_at(out, m.layer.edge + outward.even);
  follow(out, r.skip, speed, rate, curl);
  speed -= outward.even;
  r.v = -d * speed;
  r.a = -d * rate;
  r.j = -d * curl;
  r.sound = inward.sound & outward.sound & (out.rate + m.kinetic > m.break_away) & (r.skip > 0.0) &
            (magnitude(speed - m.layer.edge) < m.layer.edge - m.layer.level);
  return r;
}

} // namespace

#endif
