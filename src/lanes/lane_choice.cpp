// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Which kernel this processor gets. All give the same bits.
#include "lane_types.hpp"
#include "lane_untrapped.hpp"

#include <cstddef>
#include <cstdlib>

extern "C" {

const lane_gpu *separatrix_gpu_on_host(void);
const lane_gpu *separatrix_gpu_cuda(void);

void separatrix_fly_sse2(const lane_machine *, const lane_regions *, lane_batch *);
void separatrix_fly_avx2(const lane_machine *, const lane_regions *, lane_batch *);
void separatrix_fly_avx512(const lane_machine *, const lane_regions *, lane_batch *);

// Doubles in the widest vector that the processor has: 2, 4 or 8.
int separatrix_lane_width(void) {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512cd"))
    return 8;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("fma"))
    return 4;
#endif
  return 2;
}

void separatrix_lane_sizes(size_t *machine, size_t *regions, size_t *batch) {
  *machine = sizeof(lane_machine);
  *regions = sizeof(lane_regions);
  *batch = sizeof(lane_batch);
}

void separatrix_fly_lanes(int width, const lane_machine *machine, const lane_regions *regions,
                          lane_batch *batch) {
  const untrapped around;
  if (width >= 8)
    separatrix_fly_avx512(machine, regions, batch);
  else if (width >= 4)
    separatrix_fly_avx2(machine, regions, batch);
  else
    separatrix_fly_sse2(machine, regions, batch);
}

// Whether this build can use a GPU.
int separatrix_gpu_built(void) {
#ifdef SEPARATRIX_GPU
  return 1;
#else
  return 0;
#endif
}

// With $SEPARATRIX_GPU_ON_HOST the host does what a GPU would do, for tests.
static const lane_gpu *gpu(void) {
#ifdef SEPARATRIX_GPU
  if (std::getenv("SEPARATRIX_GPU_ON_HOST") == nullptr)
    return separatrix_gpu_cuda();
#endif
  return separatrix_gpu_on_host();
}

int separatrix_gpu_count(char *message, int size) { return gpu()->count(message, size); }

int separatrix_gpu_number(int place) { return gpu()->number(place); }

void separatrix_gpu_name(int device, char *text, int size) { gpu()->name(device, text, size); }

int separatrix_gpu_open(int device, int64_t wanted, lane_batch *halves[2], int64_t *batches, char *message,
                        int size) {
  return gpu()->open(device, wanted, halves, batches, message, size);
}

int separatrix_gpu_send(int half, int64_t batches, const lane_machine *machine, const lane_regions *regions,
                        char *message, int size) {
  return gpu()->send(half, batches, machine, regions, message, size);
}

int separatrix_gpu_wait(int half, char *message, int size) {
  const untrapped around;
  return gpu()->wait(half, message, size);
}
}
