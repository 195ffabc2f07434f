// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The kernel of the lanes once more, with counts of what it does: linked in place of the usual one into
// the program `separatrix_counted`, which adds them as a line to the file $LANE_COUNTS when it ends.
#include <cstddef>
#include <cstdio>
#include <cstdlib>

namespace {

// Over all lanes: evaluations of the motion, or expansions of it (also for lanes that wait meanwhile);
// events; and lanes that were left to the event loop.
struct lane_counts {
  long long evaluations = 0, events = 0, left = 0, panels = 0;
  ~lane_counts() {
    const char *path = getenv("LANE_COUNTS");
    FILE *file = path == nullptr ? nullptr : fopen(path, "a");
    if (file == nullptr)
      return;
    fprintf(file, "%lld %lld %lld\n", evaluations, events, left);
    fclose(file);
  }
} counts;

} // namespace

#define LANE_COUNT(what, number) counts.what += number

#include "lane_variation.hpp"
#include "structure_kernel.hpp"

SEPARATRIX_LANE_KERNEL(separatrix_fly_counted)
SEPARATRIX_LANE_VARIATION(separatrix_vary_counted)
SEPARATRIX_STRUCTURE_KERNEL(separatrix_fly_structures_counted)

extern "C" {

int separatrix_lane_width(void) { return width; }

void separatrix_lane_sizes(size_t *machine, size_t *regions, size_t *batch) {
  *machine = sizeof(lane_machine);
  *regions = sizeof(lane_regions);
  *batch = sizeof(lane_batch);
}

void separatrix_fly_lanes(int, const lane_machine *machine, const lane_regions *regions, lane_batch *batch) {
  separatrix_fly_counted(machine, regions, batch);
  for (double status : batch->fields.status)
    counts.left += status == lane_left;
}

void separatrix_vary_lanes(int, const lane_machine *machine, lane_batch *batch, lane_tangents *tangents) {
  separatrix_vary_counted(machine, batch, tangents);
}

void separatrix_structure_sizes(size_t *machine, size_t *batch) {
  *machine = sizeof(structure_machine);
  *batch = sizeof(structure_batch);
}

void separatrix_fly_structures(int, const structure_machine *machine, lane_batch *control,
                               structure_batch *batch) {
  separatrix_fly_structures_counted(machine, control, batch);
  for (double status : control->fields.status)
    counts.left += status == lane_left;
}
}
