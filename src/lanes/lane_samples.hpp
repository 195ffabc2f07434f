// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Bodies in lanes that are looked at on their way: position and velocity at given times, and every impact.
#ifndef SEPARATRIX_LANE_SAMPLES_HPP
#define SEPARATRIX_LANE_SAMPLES_HPP

#include "lane_kernel.hpp"

namespace {

// Takes the samples and the impacts of one vector of lanes, from lane `first` of the batch on.
class samples_along : public nothing_along {
public:
  samples_along(const lane_samples &given, int first) : all(given) {
    double ends[vec_size];
    for (int i = 0; i < vec_size; i++) {
      const int64_t lane = first + i;
      ends[i] = all.count[lane] > 0 ? all.times[lane * all.most + all.count[lane] - 1] : 0;
      times[i] = all.times + lane * all.most;
      x[i] = all.x + lane * all.most;
      v[i] = all.v + lane * all.most;
      left[i] = times[i] + all.count[lane];
      // Kept by the caller from call to call.
      times[i] += all.taken[lane];
      x[i] += all.taken[lane];
      v[i] += all.taken[lane];
      impact[i] = all.impact + lane * (most_impacts * impact_rows);
      impacts[i] = all.impacts + lane;
      taken[i] = all.taken + lane;
      next[i] = times[i] < left[i] ? *times[i] : for_ever;
    }
    memcpy(&upcoming, next, sizeof upcoming);
    memcpy(&last, ends, sizeof last);
    memcpy(&steps, all.steps + first, sizeof steps);
    step_count = all.steps + first;
  }

  ~samples_along() { memcpy(step_count, &steps, sizeof steps); }

  LANE_LEAF mask weary() const { return steps >= all.most_steps; }

  // The samples before `end` of the lanes `flying`, whose motion until then is known.
  template <class motion> LANE_DEVICE inline void flown(mask flying, vec end, const motion &known) {
    put(steps, flying, steps + 1.0);
    if (any(flying & (released_at < for_ever)))
      cross_surface(flying & (released_at < for_ever), known);
    mask due = flying & (upcoming < end);
    while (any(due)) {
      vec position, speed;
      known.at(upcoming, due, position, speed);
      double is_due[vec_size], positions[vec_size], speeds[vec_size];
      to_array(pick(due, vec(1.0), vec{}), is_due);
      to_array(position, positions);
      to_array(speed, speeds);
      for (int i = 0; i < vec_size; i++) {
        if (!(is_due[i] > 0))
          continue;
        *x[i]++ = positions[i];
        *v[i]++ = speeds[i];
        next[i] = ++times[i] < left[i] ? *times[i] : for_ever;
        ++*taken[i];
      }
      memcpy(&upcoming, next, sizeof upcoming);
      due = flying & (upcoming < end);
    }
  }

  // The lanes `struck` have met a barrier on `side` at `time`.
  LANE_DEVICE inline void met(mask struck, vec time, vec before, vec after, vec side) {
    if (!any(struck))
      return;
    double is_struck[vec_size], row[impact_rows][vec_size];
    to_array(pick(struck, vec(1.0), vec{}), is_struck);
    to_array(time, row[0]);
    to_array(before, row[1]);
    to_array(after, row[2]);
    to_array(side, row[3]);
    for (int i = 0; i < vec_size; i++) {
      if (!(is_struck[i] > 0))
        continue;
      const int64_t number = (*impacts[i])++;
      for (int k = 0; k < impact_rows && number < most_impacts; k++)
        impact[i][number * impact_rows + k] = row[k][i];
    }
  }

  LANE_DEVICE inline void released(mask out, vec time, vec from) {
    put(released_at, out, time);
    put(surface, out, from);
  }

  // The lanes `free` have come off the barrier that they pressed last.
  LANE_DEVICE inline void came_off(mask free, vec speed) {
    if (!any(free))
      return;
    double is_free[vec_size], speeds[vec_size];
    to_array(pick(free, vec(1.0), vec{}), is_free);
    to_array(speed, speeds);
    for (int i = 0; i < vec_size; i++) {
      const int64_t number = *impacts[i] - 1;
      if (is_free[i] > 0 && number >= 0 && number < most_impacts)
        impact[i][number * impact_rows + 2] = speeds[i];
    }
  }

private:
  // The speed of the lanes `out`, whose flight is known, at the surface that they come to, if they do so
  // before their last sample.
  template <class motion> LANE_DEVICE inline void cross_surface(mask out, const motion &known) {
    vec time = released_at, position, speed;
    for (int round = 0; round < most_crossing_rounds; round++) {
      known.at(time, out, position, speed);
      time -= (position - surface) / speed;
    }
    known.at(time, out, position, speed);
    came_off(out & (time <= last), magnitude(speed));
    put(released_at, out, for_ever);
  }

  static constexpr int most_crossing_rounds = 6;
  const lane_samples &all;
  const double *times[vec_size], *left[vec_size];
  double *x[vec_size], *v[vec_size], *impact[vec_size];
  int64_t *impacts[vec_size], *taken[vec_size];
  // Time of the next sample, by lane.
  double next[vec_size], *step_count;
  vec upcoming, steps, released_at = for_ever, surface = {}, last;

  LANE_LEAF void to_array(const vec &from, double (&to)[vec_size]) { memcpy(to, &from, sizeof to); }
};

template <flight kind>
inline void fly_sampled(const lane_machine &m, lane_batch &batch, const lane_samples &samples) {
  const lane_regions nowhere = {0, 1, {}};
  for (int first = 0; first < lanes; first += vec_size) {
    samples_along along(samples, first);
    fly_group<kind>(m, nowhere, first, batch, along);
  }
}

} // namespace

#define SEPARATRIX_LANE_SAMPLES(name)                                                                        \
  extern "C" void name(const lane_machine *m, lane_batch *batch, const lane_samples *samples) {              \
    LANE_FOR_FLIGHT(*m, fly_sampled, *m, *batch, *samples)                                                   \
  }

#endif
