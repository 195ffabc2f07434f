// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The pool of a GPU, for CUDA.
#define GPU_LAUNCH(kernel, blocks, threads, stream, ...)                                                     \
  kernel<<<unsigned(blocks), threads, 0, stream>>>(__VA_ARGS__)

#include "lane_gpu.hpp"

SEPARATRIX_LANE_GPU(separatrix_gpu_cuda)
