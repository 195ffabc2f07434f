// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Lanes where they are to stop: at the section, or before it; and what may look on meanwhile.
#ifndef SEPARATRIX_LANE_STOPS_HPP
#define SEPARATRIX_LANE_STOPS_HPP

#include "lane_motion.hpp"

namespace {

// A GPU's thread comes back after so many rounds and is sent on, as no launch may last for long. Longer than
// a step is halved.
enum { most_rounds_away = 256 };

LANE_LEAF bool is_due_back(int &rounds) { return vec_size == 1 && ++rounds > most_rounds_away; }

// Nothing rides along with the bodies; see `lane_variation.hpp` and `lane_samples.hpp` for what may.
struct nothing_along {
  // The lanes `flying` move until `end` along `known`.
  template <class motion> LANE_LEAF void flown(mask, vec, const motion &) {}
  // Lanes that have taken too many steps.
  LANE_LEAF mask weary() const { return mask{}; }
  // The flights of these lanes have ended with an event, and the next have begun.
  LANE_LEAF void cross(const lane_machine &, mask, const lane_group &) {}
  // They have met a barrier on that side: when, and the speeds before and after.
  LANE_LEAF void met(mask, vec, vec, vec, vec) {}
  // They have come off a soft barrier at that speed; or it has ceased to push, and they are on the way to its
  // surface.
  LANE_LEAF void came_off(mask, vec) {}
  LANE_LEAF void released(mask, vec, vec) {}
};

// Until when a flight lasts that ends with no event.
const double for_ever = 1e300;

// What is not known: the speed after a soft contact while that lasts, a sample without a root.
const double not_known = __builtin_nan("");

// The attractors to which points on the section have converged, 0 = none; as `find_capture` of
// `attractors.f90`.
LANE_DEVICE inline vec attractors_reached(const lane_regions &regions, vec x, vec v) {
  vec reached = {};
  for (int i = regions.count - 1; i >= 0; i--) {
    const lane_region &r = regions.region[i];
    vec dx = (x - r.x) * r.scaling_x, dv = (v - r.v) * r.scaling_v;
    vec square = r.metric_xx * dx * dx + 2 * r.metric_xv * dv * dx + r.metric_vv * dv * dv;
    put(reached, square <= r.reach, r.attractor);
  }
  return reached;
}

// Lanes `there`, where they are to stop, at x and v. At the end of a period the clock starts anew, and those
// that need not stop pass.
LANE_DEVICE inline void stop_or_pass(double period, double domain, mask there, vec x, vec v,
                                     const lane_regions &regions, lane_group &g) {
  mask section = there & (g.until >= period);
  vec reached = attractors_reached(regions, x, v);
  mask passing =
      section & (g.sections > 0.5) & (magnitude(x) <= domain) & ((reached < 0.5) | (g.leaves < 0.5));
  passing = regions.complete ? passing : mask{};
  put(g.flights, there, g.flights + 1.0);
  put(g.x, there, x);
  put(g.v, there, v);
  put(g.time, there, pick(section, vec{}, g.until));
  put(g.start, section, g.start - period);
  put(g.elapsed, passing, g.elapsed + period);
  put(g.reached, passing, reached);
  put(g.settled, passing, pick(reached < 0.5, -1, pick(g.settled < 0.0, g.elapsed, g.settled)));
  put(g.sections, passing, g.sections - 1.0);
  put(g.status, there & ~passing, lane_stopped);
}

// A flight in closed form.
template <bool damping, class machine> struct closed_motion {
  const machine &m;
  const lane_group &g;

  LANE_DEVICE inline void at(vec time, mask, vec &x, vec &v) const {
    kinematics k = evaluate<damping, true>(m, g, time - g.start);
    x = k.x;
    if constexpr (machine::modal)
      x += m.origin;
    v = k.v;
  }
};

// The same for flights in closed form.
template <bool damping, class machine>
LANE_DEVICE inline void take_stops(const machine &m, mask there, const lane_regions &regions, lane_group &g) {
  if (!any(there))
    return;
  kinematics k = evaluate<damping>(m, g, g.until - g.start);
  if constexpr (machine::modal)
    k.x += m.origin;
  stop_or_pass(m.period, m.domain, there, k.x, k.v, regions, g);
}

} // namespace

#endif
