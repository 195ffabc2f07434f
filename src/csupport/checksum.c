/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

#include <stdint.h>
#include <zlib.h>

/* CRC-32 (zlib) of `size` bytes that follow those of `previous` (0 at the start). */
uint32_t separatrix_crc32(uint32_t previous, const void *bytes, int64_t size) {
  return (uint32_t)crc32_z(previous, bytes, (z_size_t)size);
}
