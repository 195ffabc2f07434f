// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// What `lane_vectors.hpp` has for several bodies, for one: a thread of a GPU, or one of a processor that does
// as such a thread does. Every operation is that of a part of a vector, so the bits are, too.
#ifndef SEPARATRIX_LANE_ONE_BODY_HPP
#define SEPARATRIX_LANE_ONE_BODY_HPP

#include <cmath>
#include <cstdint>
#include <cstring>

namespace {

enum { vec_size = 1 };

typedef double reg;
typedef uint64_t reg_mask;

LANE_LEAF reg all(double x) { return x; }

struct mask {
  bool low;
};

struct vec {
  reg low;
  vec() = default;
  LANE_LEAF vec(double x) : low(x) {}
};

#define LANE_OPERATOR(result, type, op)                                                                      \
  LANE_LEAF result operator op(type a, type b) { return {a.low op b.low}; }

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

#undef LANE_OPERATOR

LANE_LEAF mask operator&(mask a, mask b) { return {a.low && b.low}; }
LANE_LEAF mask operator|(mask a, mask b) { return {a.low || b.low}; }
LANE_LEAF mask operator~(mask m) { return {!m.low}; }
LANE_LEAF vec operator-(vec a) { return {-a.low}; }
LANE_LEAF void operator+=(vec &a, vec b) { a = a + b; }
LANE_LEAF void operator-=(vec &a, vec b) { a = a - b; }
LANE_LEAF void operator*=(vec &a, vec b) { a = a * b; }

LANE_LEAF vec pick(mask m, vec a, vec b) { return m.low ? a : b; }
LANE_LEAF mask pick(mask m, mask a, mask b) { return m.low ? a : b; }
LANE_LEAF void put(vec &a, mask m, vec b) { a = pick(m, b, a); }
LANE_LEAF bool any(mask m) { return m.low; }
LANE_LEAF int count(mask m) { return int(m.low); }

LANE_LEAF reg_mask bits_of(reg a) {
  reg_mask bits;
  memcpy(&bits, &a, sizeof bits);
  return bits;
}

LANE_LEAF reg real_of(reg_mask bits) {
  reg a;
  memcpy(&a, &bits, sizeof a);
  return a;
}

LANE_LEAF reg square_root(reg a) { return sqrt(a); }

#define LANE_OF_PARTS(name)                                                                                  \
  LANE_LEAF vec name(vec a) { return {name(a.low)}; }

LANE_LEAF void sine_cosine(reg angle, reg &sine, reg &cosine);

LANE_LEAF void sine_cosine(vec angle, vec &sine, vec &cosine) {
  sine_cosine(angle.low, sine.low, cosine.low);
}

} // namespace

#endif
