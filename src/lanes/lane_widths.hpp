// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// CHOOSE(name, arguments...) calls the kernel `name` for `width` doubles in a vector, or the widest below it
// that this build has.
#pragma once

#if defined(LANES_AVX512)
#define CHOOSE_AVX512(name, ...)                                                                             \
  if (width >= 8)                                                                                            \
  return name##_avx512(__VA_ARGS__)
#else
#define CHOOSE_AVX512(name, ...) (void)width
#endif
#if defined(LANES_AVX2)
#define CHOOSE_AVX2(name, ...)                                                                               \
  if (width >= 4)                                                                                            \
  return name##_avx2(__VA_ARGS__)
#else
#define CHOOSE_AVX2(name, ...) (void)width
#endif
#define CHOOSE(name, ...)                                                                                    \
  CHOOSE_AVX512(name, __VA_ARGS__);                                                                          \
  CHOOSE_AVX2(name, __VA_ARGS__);                                                                            \
  name##_sse2(__VA_ARGS__)
