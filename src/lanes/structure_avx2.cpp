// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The kernel for multibody structures on processors with AVX2.
#include "structure_kernel.hpp"

SEPARATRIX_STRUCTURE_KERNEL(separatrix_fly_structures_avx2)
