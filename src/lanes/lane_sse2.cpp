// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The kernel for any processor of its kind.
#include "lane_kernel.hpp"

SEPARATRIX_LANE_KERNEL(separatrix_fly_sse2)
