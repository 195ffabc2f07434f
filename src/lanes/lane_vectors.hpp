// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Vectors as wide as the processor that this is compiled for. `lane_one_body.hpp` has the same for one body.
#ifndef SEPARATRIX_LANE_VECTORS_HPP
#define SEPARATRIX_LANE_VECTORS_HPP

#include <cstdint>
#include <cstring>

namespace {

#if defined(__AVX512F__)
enum { width = 8 };
#elif defined(__AVX__)
enum { width = 4 };
#else
enum { width = 2 };
#endif

enum { vec_size = 2 * width };

typedef double reg __attribute__((vector_size(8 * width)));
typedef int64_t reg_mask __attribute__((vector_size(8 * width)));

inline reg all(double x) { return x - reg{}; }

// Two registers: while the operations of one wait for each other, those of the other go on.
struct mask {
  reg_mask low, high;
};

struct vec {
  reg low, high;
  vec() = default;
  vec(double x) : low(all(x)), high(all(x)) {}
  vec(reg low, reg high) : low(low), high(high) {}
};

#define LANE_OPERATOR(result, type, op)                                                                      \
  inline result operator op(type a, type b) { return {a.low op b.low, a.high op b.high}; }

LANE_OPERATOR(vec, vec, +)
LANE_OPERATOR(vec, vec, -)
LANE_OPERATOR(vec, vec, *)
LANE_OPERATOR(vec, vec, /)
LANE_OPERATOR(mask, vec, <)
LANE_OPERATOR(mask, vec, <=)
LANE_OPERATOR(mask, vec, >)
LANE_OPERATOR(mask, vec, >=)
LANE_OPERATOR(mask, vec, ==)
LANE_OPERATOR(mask, vec, !=)
LANE_OPERATOR(mask, mask, &)
LANE_OPERATOR(mask, mask, |)

#undef LANE_OPERATOR

inline vec operator-(vec a) { return {-a.low, -a.high}; }
inline mask operator~(mask m) { return {~m.low, ~m.high}; }
inline void operator+=(vec &a, vec b) { a = a + b; }
inline void operator-=(vec &a, vec b) { a = a - b; }
inline void operator*=(vec &a, vec b) { a = a * b; }

// a where m holds, elsewhere b.
inline vec pick(mask m, vec a, vec b) { return {m.low ? a.low : b.low, m.high ? a.high : b.high}; }
inline mask pick(mask m, mask a, mask b) { return (m & a) | (~m & b); }

// Replaces a by b where m holds.
inline void put(vec &a, mask m, vec b) { a = pick(m, b, a); }

// Down to two integers by vectors, so that few have to be taken out one by one.
inline bool any(mask m) {
  typedef int64_t two __attribute__((vector_size(16)));
  reg_mask both = m.low | m.high;
  two parts[width / 2], bits = {};
  memcpy(parts, &both, sizeof both);
  for (const two &part : parts)
    bits |= part;
  return (bits[0] | bits[1]) != 0;
}

// Lanes of a mask.
inline int count(mask m) {
  reg_mask both = m.low + m.high;
  int64_t sum = 0;
  for (int i = 0; i < width; i++)
    sum -= both[i];
  return int(sum);
}

inline reg_mask bits_of(reg a) { return (reg_mask)a; }
inline reg real_of(reg_mask bits) { return (reg)bits; }

inline reg square_root(reg a) {
  reg root = a;
  for (int i = 0; i < width; i++)
    root[i] = __builtin_sqrt(a[i]);
  return root;
}

// A function of both registers.
#define LANE_OF_PARTS(name)                                                                                  \
  LANE_LEAF vec name(vec a) { return {name(a.low), name(a.high)}; }

LANE_LEAF void sine_cosine(reg angle, reg &sine, reg &cosine);

LANE_LEAF void sine_cosine(vec angle, vec &sine, vec &cosine) {
  sine_cosine(angle.low, sine.low, cosine.low);
  sine_cosine(angle.high, sine.high, cosine.high);
}

} // namespace

#endif
