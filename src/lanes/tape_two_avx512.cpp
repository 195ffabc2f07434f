// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The kernel for tapes, two batches at once, on processors with AVX-512.
#define LANE_FOUR_REGISTERS
#include "tape_kernel.hpp"

SEPARATRIX_TAPE_KERNEL(separatrix_fly_two_tape_avx512)
