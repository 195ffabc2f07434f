// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The kernel for multibody structures on processors with AVX-512.
#include "structure_kernel.hpp"

SEPARATRIX_STRUCTURE_KERNEL(separatrix_fly_structures_avx512)
