// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The kernel for any processor of its kind.
#include "lane_samples.hpp"
#include "lane_variation.hpp"

SEPARATRIX_LANE_KERNEL(separatrix_fly_sse2)
SEPARATRIX_LANE_VARIATION(separatrix_vary_sse2)
SEPARATRIX_LANE_SAMPLES(separatrix_sample_sse2)
