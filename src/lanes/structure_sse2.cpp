// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The kernel for multibody structures on any processor of its kind.
#include "structure_kernel.hpp"

SEPARATRIX_STRUCTURE_KERNEL(separatrix_fly_structures_sse2)
