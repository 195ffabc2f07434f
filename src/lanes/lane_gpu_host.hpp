// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The calls of CUDA's runtime that `lane_gpu.hpp` makes, on the host, for tests: threads run one after the
// other, when somebody waits for their stream and not before. $SEPARATRIX_GPU_ON_HOST is the number of
// devices, with $SEPARATRIX_GPU_FAULT=N the Nth call and all after it fail. $SEPARATRIX_GPU_CAPABILITY, as
// 75,90, is their compute capability in turn, else 9.0; there is code from 8.0 on.
#ifndef SEPARATRIX_LANE_GPU_HOST_HPP
#define SEPARATRIX_LANE_GPU_HOST_HPP

#define LANE_ONE_BODY
// Few and odd, so that a small map fills the pool many times.
#define GPU_BODIES_AT_ONCE 43
#define __global__
#define __launch_bounds__(threads)

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <vector>

namespace {

typedef int cudaError_t;
enum { cudaSuccess = 0, cudaErrorMemoryAllocation = 2, cudaErrorLaunchFailure = 719 };
enum gpu_attribute {
  cudaDevAttrMultiProcessorCount,
  cudaDevAttrComputeCapabilityMajor,
  cudaDevAttrComputeCapabilityMinor
};
enum gpu_copy { cudaMemcpyHostToDevice, cudaMemcpyDeviceToHost };

struct cudaDeviceProp {
  char name[256];
};

// What is still to do.
typedef std::vector<std::function<void()>> *cudaStream_t;

struct gpu_index {
  int64_t x;
};

gpu_index blockIdx, blockDim, threadIdx;

cudaError_t made_call() {
  static const char *asked = getenv("SEPARATRIX_GPU_FAULT");
  static const long failing = asked == nullptr ? 0 : atol(asked);
  static long calls = 0;
  return failing > 0 && ++calls >= failing ? cudaErrorLaunchFailure : cudaSuccess;
}

const char *cudaGetErrorString(cudaError_t error) {
  return error == cudaErrorMemoryAllocation ? "out of memory" : "failure made for a test";
}

cudaError_t cudaGetDeviceCount(int *count) {
  const char *asked = getenv("SEPARATRIX_GPU_ON_HOST");
  *count = asked == nullptr ? 0 : atoi(asked);
  return cudaSuccess;
}

cudaError_t cudaGetDeviceProperties(cudaDeviceProp *properties, int) {
  snprintf(properties->name, sizeof properties->name, "stand-in on the host, for tests");
  return cudaSuccess;
}

cudaError_t cudaSetDevice(int) { return made_call(); }
cudaError_t cudaGetLastError() { return made_call(); }

int capability_of(int device) {
  const char *asked = getenv("SEPARATRIX_GPU_CAPABILITY");
  for (; asked != nullptr && device > 0; device--) {
    asked = strchr(asked, ',');
    asked = asked == nullptr ? nullptr : asked + 1;
  }
  return asked == nullptr ? 90 : atoi(asked);
}

cudaError_t cudaDeviceGetAttribute(int *value, gpu_attribute attribute, int device) {
  if (attribute >= cudaDevAttrComputeCapabilityMajor) {
    *value = capability_of(device);
    *value = attribute == cudaDevAttrComputeCapabilityMajor ? *value / 10 : *value % 10;
    return cudaSuccess;
  }
  *value = 3;
  return made_call();
}

cudaError_t cudaMemGetInfo(size_t *free_bytes, size_t *all_bytes) {
  *free_bytes = *all_bytes = size_t(1) << 30;
  return made_call();
}

cudaError_t cudaMalloc(void **memory, size_t bytes) {
  *memory = malloc(bytes);
  return *memory == nullptr ? cudaErrorMemoryAllocation : made_call();
}

cudaError_t cudaMallocHost(void **memory, size_t bytes) { return cudaMalloc(memory, bytes); }

cudaError_t cudaFree(void *memory) {
  free(memory);
  return cudaSuccess;
}

cudaError_t cudaFreeHost(void *memory) { return cudaFree(memory); }

cudaError_t cudaStreamCreate(cudaStream_t *stream) {
  static std::vector<std::function<void()>> streams[2];
  static int made = 0;
  *stream = &streams[made++ % 2];
  return made_call();
}

cudaError_t cudaMemcpyAsync(void *to, const void *from, size_t bytes, gpu_copy, cudaStream_t stream) {
  stream->push_back([=] { memcpy(to, from, bytes); });
  return made_call();
}

cudaError_t cudaStreamSynchronize(cudaStream_t stream) {
  for (const auto &work : *stream)
    work();
  stream->clear();
  return made_call();
}

template <class kernel, class... values>
void launch_on_host(kernel run, int64_t blocks, int64_t threads, cudaStream_t stream, values... given) {
  stream->push_back([=] {
    blockDim.x = threads;
    for (blockIdx.x = 0; blockIdx.x < blocks; blockIdx.x++)
      for (threadIdx.x = 0; threadIdx.x < threads; threadIdx.x++)
        run(given...);
  });
}

} // namespace

#define GPU_LAUNCH(kernel, blocks, threads, stream, ...)                                                     \
  launch_on_host(kernel, blocks, threads, stream, __VA_ARGS__)

#endif
