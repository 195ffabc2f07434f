// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// A pool of bodies on a GPU, one thread each, by the kernel of the lanes. Written with the calls of CUDA's
// runtime, which `lane_gpu_host.hpp` has for the host as well. The pool has two halves: while one flies, the
// host serves the other.
#ifndef SEPARATRIX_LANE_GPU_HPP
#define SEPARATRIX_LANE_GPU_HPP

#include "lane_kernel.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <vector>

namespace {

enum { threads_per_block = 128 };

// Fortran has the same members; nothing between them.
static_assert(sizeof(lane_batch) == members * lanes * sizeof(double), "a batch is its members, lane by lane");
static_assert(alignof(lane_batch) == alignof(double) && sizeof(int) == 4, "as Fortran lays it out");
static_assert(sizeof(lane_regions) == 8 + most_regions * sizeof(lane_region), "as Fortran lays it out");

struct lane_task {
  lane_machine machine;
  lane_regions regions;
};

// The kernel: one thread per body, which comes back where it has stopped, is left to the event loop, or has
// been away for long.
template <flight kind>
__global__ void __launch_bounds__(threads_per_block)
    fly_bodies(const lane_task *task, int64_t bodies, lane_batch *batches) {
  const int64_t body = int64_t(blockIdx.x) * blockDim.x + threadIdx.x;
  if (body >= bodies)
    return;
  lane_batch &batch = batches[body / lanes];
  const int lane = int(body % lanes);
  const double status = batch.fields.status[lane];
  nothing_along along;
  if (status == lane_flying || status == lane_fresh)
    fly_group<kind>(task->machine, task->regions, lane, batch, along);
}

// What one half has on the host, in memory that the GPU can copy from and to meanwhile, and on the GPU.
struct gpu_half {
  lane_batch *batches, *on_gpu;
  lane_task *task, *task_on_gpu;
  cudaStream_t stream;
  int64_t sent;
};

struct gpu_pool {
  int device = -1;
  // Batches that a half has, and those that were asked for when it was made.
  int64_t batches = 0, asked = 0;
  gpu_half half[2] = {};
} pool;

// The first call that fails: CUDA keeps its error for all that follow.
struct gpu_attempt {
  cudaError_t error = cudaSuccess;
  const char *call = "";
  void operator()(const char *made, cudaError_t result) {
    if (error != cudaSuccess || result == cudaSuccess)
      return;
    error = result;
    call = made;
  }
  int end(char *message, int size) const {
    if (error != cudaSuccess)
      snprintf(message, size, "GPU %d: %s: %s (CUDA error %d)", pool.device, call, cudaGetErrorString(error),
               int(error));
    return int(error);
  }
};

// Makes a call if all before it went well.
#define GPU_ATTEMPT(attempt, call, ...)                                                                      \
  do {                                                                                                       \
    if ((attempt).error == cudaSuccess)                                                                      \
      (attempt)(#call, call(__VA_ARGS__));                                                                   \
  } while (0)

// Compute capabilities (100 major + 10 minor) that this build has code for, ascending, as nvcc lists them;
// for the stand-in those that CMake asks it for by default.
#ifdef __CUDA_ARCH_LIST__
const int architectures[] = {__CUDA_ARCH_LIST__};
#else
const int architectures[] = {800, 900};
#endif

// Whether code was built that a device of this capability runs: that of the same major number and no higher
// minor one, or, compiled by the driver, that of the last of the list.
bool gpu_has_code(int capability) {
  for (const int built : architectures)
    if (capability >= built && capability / 100 == built / 100)
      return true;
  return capability >= *std::rbegin(architectures);
}

// Numbers of the devices that this build has code for. `error`: of CUDA, where it sees none.
std::vector<int> gpu_usable(int &seen, cudaError_t &error) {
  std::vector<int> usable;
  seen = 0;
  error = cudaGetDeviceCount(&seen);
  if (error != cudaSuccess)
    seen = 0;
  for (int device = 0; device < seen; device++) {
    int major = 0, minor = 0;
    if (cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, device) == cudaSuccess &&
        cudaDeviceGetAttribute(&minor, cudaDevAttrComputeCapabilityMinor, device) == cudaSuccess &&
        gpu_has_code(100 * major + 10 * minor))
      usable.push_back(device);
  }
  return usable;
}

int gpu_count(char *message, int size) {
  int seen;
  cudaError_t error;
  const int count = int(gpu_usable(seen, error).size());
  snprintf(message, size, "%s", error == cudaSuccess ? "" : cudaGetErrorString(error));
  if (count == 0 && seen > 0)
    snprintf(message, size,
             "of %d, none has the compute capability that this build has code for, from %d.%d on", seen,
             architectures[0] / 100, architectures[0] / 10 % 10);
  return count;
}

int gpu_number(int index) {
  int seen;
  cudaError_t error;
  return gpu_usable(seen, error).at(index);
}

void gpu_name(int device, char *text, int size) {
  static cudaDeviceProp properties;
  const bool known = cudaGetDeviceProperties(&properties, device) == cudaSuccess;
  snprintf(text, size, "%s", known ? properties.name : "unknown");
}

// Gives back what the halves have; what fails then has been reported, or does no harm.
void gpu_free() {
  for (gpu_half &half : pool.half) {
    cudaFreeHost(half.batches);
    cudaFreeHost(half.task);
    cudaFree(half.on_gpu);
    cudaFree(half.task_on_gpu);
    half.batches = half.on_gpu = nullptr;
    half.task = half.task_on_gpu = nullptr;
  }
  pool.batches = pool.asked = 0;
}

// Batches that a half can have: as many bodies as the GPU flies at once, or $SEPARATRIX_GPU_BODIES, in a
// quarter of the memory that is free now, as the kernels need some for what registers do not hold. More would
// wait on the GPU, and what the host knows of them would not stay in its caches.
int64_t gpu_room(gpu_attempt &attempt) {
  int processors = 0;
  size_t free_bytes = 0, all_bytes = 0;
  GPU_ATTEMPT(attempt, cudaDeviceGetAttribute, &processors, cudaDevAttrMultiProcessorCount, pool.device);
  GPU_ATTEMPT(attempt, cudaMemGetInfo, &free_bytes, &all_bytes);
  const char *asked = std::getenv("SEPARATRIX_GPU_BODIES");
  const int64_t bodies =
      asked == nullptr ? int64_t(processors) * GPU_BODIES_AT_ONCE : std::max(1L, std::atol(asked));
  const int64_t busy = (bodies + lanes - 1) / lanes;
  return std::max<int64_t>(1, std::min<int64_t>(busy, free_bytes / 8 / sizeof(lane_batch)));
}

int gpu_open(int device, int64_t wanted, lane_batch *halves[2], int64_t *batches, char *message, int size) {
  gpu_attempt attempt;
  if (pool.device != device) {
    pool.device = device;
    GPU_ATTEMPT(attempt, cudaSetDevice, device);
    for (gpu_half &half : pool.half)
      GPU_ATTEMPT(attempt, cudaStreamCreate, &half.stream);
  }
  if (pool.asked < wanted && attempt.error == cudaSuccess) {
    gpu_free();
    const int64_t room = std::min(wanted, gpu_room(attempt));
    for (gpu_half &half : pool.half) {
      GPU_ATTEMPT(attempt, cudaMallocHost, (void **)&half.batches, room * sizeof(lane_batch));
      GPU_ATTEMPT(attempt, cudaMallocHost, (void **)&half.task, sizeof(lane_task));
      GPU_ATTEMPT(attempt, cudaMalloc, (void **)&half.on_gpu, room * sizeof(lane_batch));
      GPU_ATTEMPT(attempt, cudaMalloc, (void **)&half.task_on_gpu, sizeof(lane_task));
    }
    if (attempt.error != cudaSuccess)
      gpu_free();
    else {
      pool.batches = room;
      pool.asked = wanted;
    }
  }
  for (int i = 0; i < 2; i++)
    halves[i] = pool.half[i].batches;
  *batches = std::min(wanted, pool.batches);
  return attempt.end(message, size);
}

template <flight kind> void gpu_launch(gpu_half &half) {
  const int64_t bodies = half.sent * lanes, blocks = (bodies + threads_per_block - 1) / threads_per_block;
  GPU_LAUNCH(fly_bodies<kind>, blocks, threads_per_block, half.stream, half.task_on_gpu, bodies, half.on_gpu);
}

int gpu_send(int which, int64_t batches, const lane_machine *machine, const lane_regions *regions,
             char *message, int size) {
  gpu_attempt attempt;
  gpu_half &half = pool.half[which];
  const size_t bytes = batches * sizeof(lane_batch);
  half.sent = batches;
  *half.task = {*machine, *regions};
  GPU_ATTEMPT(attempt, cudaMemcpyAsync, half.task_on_gpu, half.task, sizeof(lane_task),
              cudaMemcpyHostToDevice, half.stream);
  GPU_ATTEMPT(attempt, cudaMemcpyAsync, half.on_gpu, half.batches, bytes, cudaMemcpyHostToDevice,
              half.stream);
  if (attempt.error == cudaSuccess) {
    LANE_FOR_FLIGHT(*machine, gpu_launch, half)
  }
  GPU_ATTEMPT(attempt, cudaGetLastError);
  GPU_ATTEMPT(attempt, cudaMemcpyAsync, half.batches, half.on_gpu, bytes, cudaMemcpyDeviceToHost,
              half.stream);
  return attempt.end(message, size);
}

// Reports what went wrong in the kernel as well: its errors come late.
int gpu_wait(int which, char *message, int size) {
  gpu_attempt attempt;
  GPU_ATTEMPT(attempt, cudaStreamSynchronize, pool.half[which].stream);
  return attempt.end(message, size);
}

} // namespace

#define SEPARATRIX_LANE_GPU(name)                                                                            \
  extern "C" const lane_gpu *name() {                                                                        \
    static const lane_gpu functions = {gpu_count, gpu_number, gpu_name, gpu_open, gpu_send, gpu_wait};       \
    return &functions;                                                                                       \
  }

#endif
