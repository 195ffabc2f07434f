// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Which kernel for tapes this processor gets. All give the same bits.
#include "lane_types.hpp"
#include "lane_untrapped.hpp"
#include "lane_widths.hpp"
#include "tape_types.hpp"

#include <cstddef>

extern "C" {

void separatrix_fly_tape_sse2(const tape_machine *, lane_batch *const *, tape_batch *const *);
void separatrix_fly_tape_avx2(const tape_machine *, lane_batch *const *, tape_batch *const *);
void separatrix_fly_tape_avx512(const tape_machine *, lane_batch *const *, tape_batch *const *);
void separatrix_fly_two_tape_avx512(const tape_machine *, lane_batch *const *, tape_batch *const *);
}

namespace {

// Whether there is a batch with lanes that are to fly.
bool flies(const lane_batch *control) {
  if (!control)
    return false;
  for (double status : control->fields.status)
    if (status == lane_fresh || status == lane_flying)
      return true;
  return false;
}

void fly_one(int width, const tape_machine *machine, lane_batch *control, tape_batch *batch) {
  CHOOSE(separatrix_fly_tape, machine, &control, &batch);
}

} // namespace

extern "C" {

void separatrix_tape_sizes(size_t *machine, size_t *batch) {
  *machine = sizeof(tape_machine);
  *batch = sizeof(tape_batch);
}

// Batches that fly faster at once than one by one.
int separatrix_tape_batches(int width) {
#if defined(LANES_AVX512)
  return width >= 8 ? 2 : 1;
#else
  (void)width;
  return 1;
#endif
}

// A batch, and another one with the same machine (null: none).
void separatrix_fly_tape(int width, const tape_machine *machine, lane_batch *control, tape_batch *batch,
                         lane_batch *other_control, tape_batch *other_batch) {
  const untrapped around;
  lane_batch *const controls[] = {control, other_control};
  tape_batch *const batches[] = {batch, other_batch};
#if defined(LANES_AVX512)
  if (width >= 8 && flies(control) && flies(other_control))
    return separatrix_fly_two_tape_avx512(machine, controls, batches);
#endif
  for (int i = 0; i < 2; i++)
    if (flies(controls[i]))
      fly_one(width, machine, controls[i], batches[i]);
}
}
