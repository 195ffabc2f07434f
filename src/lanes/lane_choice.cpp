// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Which kernel this processor gets. All give the same bits.
#include "lane_types.hpp"
#include "lane_untrapped.hpp"
#include "lane_widths.hpp"

#include <cstddef>

extern "C" {

void separatrix_fly_sse2(const lane_machine *, const lane_regions *, lane_batch *);
void separatrix_fly_avx2(const lane_machine *, const lane_regions *, lane_batch *);
void separatrix_fly_avx512(const lane_machine *, const lane_regions *, lane_batch *);
void separatrix_vary_sse2(const lane_machine *, lane_batch *, lane_tangents *);
void separatrix_vary_avx2(const lane_machine *, lane_batch *, lane_tangents *);
void separatrix_vary_avx512(const lane_machine *, lane_batch *, lane_tangents *);
void separatrix_sample_sse2(const lane_machine *, lane_batch *, const lane_samples *);
void separatrix_sample_avx2(const lane_machine *, lane_batch *, const lane_samples *);
void separatrix_sample_avx512(const lane_machine *, lane_batch *, const lane_samples *);

// Doubles in the widest vector that the processor has and this build a kernel for: 2, 4 or 8.
int separatrix_lane_width(void) {
#if defined(LANES_AVX512)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512cd"))
    return 8;
#endif
#if defined(LANES_AVX2)
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("fma"))
    return 4;
#endif
  return 2;
}

void separatrix_lane_sizes(size_t *machine, size_t *regions, size_t *batch, size_t *impacts) {
  *machine = sizeof(lane_machine);
  *regions = sizeof(lane_regions);
  *batch = sizeof(lane_batch);
  *impacts = most_impacts * impact_rows * sizeof(double);
}

void separatrix_fly_lanes(int width, const lane_machine *machine, const lane_regions *regions,
                          lane_batch *batch) {
  const untrapped around;
  CHOOSE(separatrix_fly, machine, regions, batch);
}

void separatrix_vary_lanes(int width, const lane_machine *machine, lane_batch *batch,
                           lane_tangents *tangents) {
  const untrapped around;
  CHOOSE(separatrix_vary, machine, batch, tangents);
}

void separatrix_sample_lanes(int width, const lane_machine *machine, lane_batch *batch, int64_t most,
                             const int64_t *count, const double *times, int64_t *taken, double *x, double *v,
                             int64_t *impacts, double *impact, double most_steps, double *steps) {
  const untrapped around;
  const lane_samples samples = {most, count, times, taken, x, v, impacts, impact, most_steps, steps};
  CHOOSE(separatrix_sample, machine, batch, &samples);
}
}
