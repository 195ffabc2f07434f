// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The kernel for tapes on processors with AVX2.
#define LANE_FOUR_REGISTERS
#include "tape_kernel.hpp"

SEPARATRIX_TAPE_KERNEL(separatrix_fly_tape_avx2)
