// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Which kernel for multibody structures this processor gets. All give the same bits.
#include "lane_types.hpp"
#include "lane_untrapped.hpp"
#include "lane_widths.hpp"
#include "structure_types.hpp"

#include <cstddef>

extern "C" {

void separatrix_fly_structures_sse2(const structure_machine *, lane_batch *, structure_batch *);
void separatrix_fly_structures_avx2(const structure_machine *, lane_batch *, structure_batch *);
void separatrix_fly_structures_avx512(const structure_machine *, lane_batch *, structure_batch *);

void separatrix_structure_sizes(size_t *machine, size_t *batch) {
  *machine = sizeof(structure_machine);
  *batch = sizeof(structure_batch);
}

void separatrix_fly_structures(int width, const structure_machine *machine, lane_batch *control,
                               structure_batch *batch) {
  const untrapped around;
  CHOOSE(separatrix_fly_structures, machine, control, batch);
}
}
