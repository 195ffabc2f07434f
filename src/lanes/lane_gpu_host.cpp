// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The pool of a GPU compiled for the host.
#include "lane_gpu_host.hpp"

#include "lane_gpu.hpp"

SEPARATRIX_LANE_GPU(separatrix_gpu_on_host)
