// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Which GPU, if any, this build gets.
#include "lane_types.hpp"
#include "lane_untrapped.hpp"

#include <chrono>
#include <cstdlib>

extern "C" {

const lane_gpu *separatrix_gpu_on_host(void);
const lane_gpu *separatrix_gpu_cuda(void);

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

int separatrix_gpu_number(int index) { return gpu()->number(index); }

void separatrix_gpu_name(int device, char *text, int size) { gpu()->name(device, text, size); }

int separatrix_gpu_open(int device, int64_t wanted, lane_batch *halves[2], int64_t *batches, char *message,
                        int size) {
  return gpu()->open(device, wanted, halves, batches, message, size);
}

int separatrix_gpu_send(int half, int64_t batches, const lane_machine *machine, const lane_regions *regions,
                        char *message, int size) {
  return gpu()->send(half, batches, machine, regions, message, size);
}

static double waited = 0;

int separatrix_gpu_wait(int half, char *message, int size) {
  const untrapped around;
  const auto begun = std::chrono::steady_clock::now();
  const int failed = gpu()->wait(half, message, size);
  waited += std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return failed;
}

// Seconds that this process has waited for its GPU so far.
double separatrix_gpu_waited(void) { return waited; }
}
