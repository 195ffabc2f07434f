/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

#include <stdint.h>
#include <zlib.h>
#ifdef SEPARATRIX_ISAL
#include <isa-l.h>
#endif

/* CRC-32 (zlib) of `size` bytes that follow those of `previous` (0 at the start). */
uint32_t separatrix_crc32(uint32_t previous, const void *bytes, int64_t size) {
#ifdef SEPARATRIX_ISAL
  return crc32_gzip_refl(previous, bytes, (uint64_t)size);
#else
  return (uint32_t)crc32_z(previous, bytes, (z_size_t)size);
#endif
}

/* CRC-32 of two pieces one after the other, from that of each and the bytes of the second. */
uint32_t separatrix_crc32_combine(uint32_t first, uint32_t second, int64_t size) {
  return (uint32_t)crc32_combine(first, second, (z_off_t)size);
}

/* 64-bit FNV-1a hash of `length` bytes. */
uint64_t separatrix_fnv1a(const char *text, int64_t length) {
  uint64_t hash = 14695981039346656037ULL;
  for (int64_t i = 0; i < length; ++i) {
    hash ^= (unsigned char)text[i];
    hash *= 1099511628211ULL;
  }
  return hash;
}
