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

typedef double reg __attribute__((vector_size(8 * width)));
typedef int64_t reg_mask __attribute__((vector_size(8 * width)));

inline reg all(double x) { return x - reg{}; }

// Registers of a vector: while the operations of one wait for each other, those of the others go on. `each`
// is a macro of a part and `x`.
#if defined(LANE_FOUR_REGISTERS)
enum { registers = 4 };
#define LANE_MEMBERS low, high, third, fourth
#define LANE_PARTS(each, x) each(low, x), each(high, x), each(third, x), each(fourth, x)
#else
enum { registers = 2 };
#define LANE_MEMBERS low, high
#define LANE_PARTS(each, x) each(low, x), each(high, x)
#endif

enum { vec_size = registers * width };

#define LANE_ALL(part, x) all(x)
#define LANE_BINARY(part, op) a.part op b.part
#define LANE_UNARY(part, name) name(a.part)
#define LANE_CHOICE(part, m) m.part ? a.part : b.part

struct mask {
  reg_mask LANE_MEMBERS;
};

struct parts {
  reg LANE_MEMBERS;
};

struct vec : parts {
  vec() = default;
  vec(double x) : parts{LANE_PARTS(LANE_ALL, x)} {}
  vec(parts p) : parts(p) {}
};

#define LANE_OPERATOR(result, type, op)                                                                      \
  inline result operator op(type a, type b) { return {LANE_PARTS(LANE_BINARY, op)}; }
#define LANE_VECTOR_OPERATOR(op)                                                                             \
  inline vec operator op(vec a, vec b) { return parts{LANE_PARTS(LANE_BINARY, op)}; }

LANE_VECTOR_OPERATOR(+)
LANE_VECTOR_OPERATOR(-)
LANE_VECTOR_OPERATOR(*)
LANE_VECTOR_OPERATOR(/)
LANE_OPERATOR(mask, vec, <)
LANE_OPERATOR(mask, vec, <=)
LANE_OPERATOR(mask, vec, >)
LANE_OPERATOR(mask, vec, >=)
LANE_OPERATOR(mask, vec, ==)
LANE_OPERATOR(mask, vec, !=)
LANE_OPERATOR(mask, mask, &)
LANE_OPERATOR(mask, mask, |)

#undef LANE_OPERATOR
#undef LANE_VECTOR_OPERATOR

inline vec operator-(vec a) { return parts{LANE_PARTS(LANE_UNARY, -)}; }
inline mask operator~(mask a) { return {LANE_PARTS(LANE_UNARY, ~)}; }
inline void operator+=(vec &a, vec b) { a = a + b; }
inline void operator-=(vec &a, vec b) { a = a - b; }
inline void operator*=(vec &a, vec b) { a = a * b; }

// a where m holds, elsewhere b.
inline vec pick(mask m, vec a, vec b) { return parts{LANE_PARTS(LANE_CHOICE, m)}; }
inline mask pick(mask m, mask a, mask b) { return (m & a) | (~m & b); }

// Replaces a by b where m holds.
inline void put(vec &a, mask m, vec b) { a = pick(m, b, a); }

// Down to two integers by vectors, so that few have to be taken out one by one.
inline bool any(mask m) {
  typedef int64_t two __attribute__((vector_size(16)));
  reg_mask both = m.low | m.high;
#if defined(LANE_FOUR_REGISTERS)
  both |= m.third | m.fourth;
#endif
  two parts[width / 2], bits = {};
  memcpy(parts, &both, sizeof both);
  for (const two &part : parts)
    bits |= part;
  return (bits[0] | bits[1]) != 0;
}

// Lanes of a mask.
inline int count(mask m) {
  reg_mask both = m.low + m.high;
#if defined(LANE_FOUR_REGISTERS)
  both += m.third + m.fourth;
#endif
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

// A function of all registers.
#define LANE_OF_PARTS(name)                                                                                  \
  LANE_LEAF vec name(vec a) { return parts{LANE_PARTS(LANE_UNARY, name)}; }

LANE_LEAF void sine_cosine(reg angle, reg &sine, reg &cosine);

LANE_LEAF void sine_cosine(vec angle, vec &sine, vec &cosine) {
  sine_cosine(angle.low, sine.low, cosine.low);
  sine_cosine(angle.high, sine.high, cosine.high);
#if defined(LANE_FOUR_REGISTERS)
  sine_cosine(angle.third, sine.third, cosine.third);
  sine_cosine(angle.fourth, sine.fourth, cosine.fourth);
#endif
}

} // namespace

#endif
