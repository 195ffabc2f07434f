// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The pool of a GPU, for CUDA.
#define GPU_LAUNCH(kernel, blocks, threads, stream, ...)                                                     \
  kernel<<<unsigned(blocks), threads, 0, stream>>>(__VA_ARGS__)

// On a multiprocessor: the kernels take 168 of its 65536 registers for each body, or more.
#define GPU_BODIES_AT_ONCE (3 * threads_per_block)

#include "lane_gpu.hpp"

SEPARATRIX_LANE_GPU(separatrix_gpu_cuda)
