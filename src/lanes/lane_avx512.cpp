// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The kernel for processors with AVX-512.
#include "lane_samples.hpp"
#include "lane_variation.hpp"

SEPARATRIX_LANE_KERNEL(separatrix_fly_avx512)
SEPARATRIX_LANE_VARIATION(separatrix_vary_avx512)
SEPARATRIX_LANE_SAMPLES(separatrix_sample_avx512)
