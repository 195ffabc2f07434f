// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Exact flight of many multibody structures at once: linear structures with dry friction and contacts, rigid
// or linear. In every mode (which friction joints stick, which soft contacts are pressed) the motion is a sum
// of complex exponentials and harmonics.
#ifndef SEPARATRIX_STRUCTURE_KERNEL_HPP
#define SEPARATRIX_STRUCTURE_KERNEL_HPP

#include "structure_events.hpp"

namespace {

enum { structure_members = sizeof(structure_batch::fields) / sizeof(double[lanes]) };

// Stops are further apart than this share of a period.
const double stop_share = 1e-9;

inline void load(const structure_batch &batch, int first, structure_fields<vec> &s) {
  for (int i = 0; i < structure_members; i++)
    memcpy((vec *)&s + i, (const double *)&batch.fields + i * lanes + first, sizeof(vec));
}

inline void store(const structure_fields<vec> &s, int first, structure_batch &batch) {
  for (int i = 0; i < structure_members; i++)
    memcpy((double *)&batch.fields + i * lanes + first, (const vec *)&s + i, sizeof(vec));
}

// Flies the lanes of one vector until one has stopped or is left to the scalar code. Those that have come to
// a section wait until half of all have, or nothing else is due.
template <class size>
void fly_group(const structure_machine &m, const size &z, int first, lane_batch &control,
               structure_batch &batch) {
  structure_group g;
  g.c.exchange(control.fields, first, [](const double *from, vec &to) { memcpy(&to, from, sizeof to); });
  mask fresh = g.c.status == lane_fresh, sent = fresh | (g.c.status == lane_flying);
  if (!any(sent))
    return;
  load(batch, first, g.s);
  note_modes(m, z, ~mask{}, g);
  enter_modes(m, z, sent & ~fresh, g);
  structure_bases b;
  mask left = sent & ~fresh & (g.s.found < 0.5);
  if (any(left)) {
    harmonics_at(m, z, g.s.start, b);
    look_from_start(m, z, left, b, g);
  }
  left = mask{};
  if (any(fresh)) {
    harmonics_at(m, z, g.s.time, b);
    left = set_off(m, z, fresh, b, g);
  }
  put(g.c.status, fresh, lane_flying);
  put(g.c.status, left, lane_left);
  while (!any(sent & (g.c.status != lane_flying))) {
    mask seek = sent & (g.s.found < 0.5);
    left = mask{};
    if (any(seek))
      left = find_first(m, z, seek, g);
    left = left | (sent & (g.c.flights >= g.c.budget));
    mask flying = sent & ~left, due = flying & (g.s.start + g.s.span < g.c.until);
    // A flight that ended at a stop goes on only from there.
    if (z.misses)
      due = due & ((g.s.found < 1.5) | (g.s.start + g.s.span < g.c.until - stop_share * m.period));
    mask stops = flying & ~due;
    if (any(due) && 2 * count(stops) < count(flying))
      left = left | take_events(m, z, due, g);
    else if (any(stops))
      take_stops(m, z, stops, batch.complete != 0, batch, g);
    put(g.c.status, left, lane_left);
  }
  g.c.exchange(control.fields, first, [](double *to, const vec &from) { memcpy(to, &from, sizeof from); });
  store(g.s, first, batch);
}

template <class size> void fly_all(const structure_machine &m, lane_batch &control, structure_batch &batch) {
  for (int first = 0; first < lanes; first += vec_size)
    fly_group(m, size(m), first, control, batch);
}

// A friction joint, a contact and one harmonic are common: known to the compiler, they are faster. (For
// vectors of two doubles GCC 12 fails.)
inline void fly_structures(const structure_machine &m, lane_batch &control, structure_batch &batch) {
  const any_size z(m);
#if defined(__AVX__)
  const bool plain = z.joints == 2 && z.pushes == 0 && z.waves == 1 && z.terms == z.coordinates &&
                     z.powers == 1 && !z.idle && !z.misses;
  if (plain && z.terms == 2)
    fly_all<fixed_size<2, 2, 2, 1>>(m, control, batch);
  else if (plain && z.terms == 4)
    fly_all<fixed_size<4, 4, 2, 1>>(m, control, batch);
  else if (plain && z.terms == 8)
    fly_all<fixed_size<8, 8, 2, 1>>(m, control, batch);
  else
#endif
    fly_all<any_size>(m, control, batch);
}

} // namespace

#define SEPARATRIX_STRUCTURE_KERNEL(name)                                                                    \
  extern "C" void name(const structure_machine *m, lane_batch *control, structure_batch *batch) {            \
    fly_structures(*m, *control, *batch);                                                                    \
  }

#endif
