// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Which kernel for tapes this processor gets. All give the same bits.
#include "lane_types.hpp"
#include "lane_untrapped.hpp"
#include "lane_widths.hpp"
#include "tape_types.hpp"

#include <cstddef>

extern "C" {

void separatrix_fly_tape_sse2(const tape_machine *, lane_batch *, tape_batch *);
void separatrix_fly_tape_avx2(const tape_machine *, lane_batch *, tape_batch *);
void separatrix_fly_tape_avx512(const tape_machine *, lane_batch *, tape_batch *);

void separatrix_tape_sizes(size_t *machine, size_t *batch) {
  *machine = sizeof(tape_machine);
  *batch = sizeof(tape_batch);
}

void separatrix_fly_tape(int width, const tape_machine *machine, lane_batch *control, tape_batch *batch) {
  const untrapped around;
  CHOOSE(separatrix_fly_tape, machine, control, batch);
}
}
