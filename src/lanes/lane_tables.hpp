// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Forces that a table gives over the extension, the position or the speed: a cubic between two knots. A step
// of a series knows one piece of each table; it ends where a lane leaves that.
#ifndef SEPARATRIX_LANE_TABLES_HPP
#define SEPARATRIX_LANE_TABLES_HPP

#include "lane_series.hpp"

namespace {

// Copies the pieces that the values `u` are in where `asked`. A piece reaches a little beyond its knots, so
// that a step that ends there begins the next piece inside.
LANE_DEVICE inline void find_piece(const lane_table &t, mask asked, vec u, table_piece &piece) {
  for (int i = 0; i <= int(t.knots); i++) {
    mask there = i == 0 ? asked : asked & (u >= t.from[i]);
    put(piece.from, there, t.from[i]);
    put(piece.low, there, t.low[i]);
    put(piece.high, there, t.high[i]);
    for (int k = 0; k < 4; k++)
      put(piece.c[k], there, t.c[i][k]);
  }
}

// The pieces that the lanes are in.
LANE_DEVICE inline void find_pieces(const lane_machine &m, const lane_group &g, table_piece *pieces) {
  vec foot, speed = g.direction * g.v;
  mask upward = g.direction > 0.0;
  if (m.law.table[over_extension].knots > 0 || m.law.table[over_play].knots > 0) {
    expand_foot(m, g.time, 1, &foot);
    vec extension = foot - g.x + m.law.length;
    if (m.law.table[over_extension].knots > 0)
      find_piece(m.law.table[over_extension], ~mask{}, extension, pieces[over_extension]);
    if (m.law.table[over_play].knots > 0)
      find_piece(m.law.table[over_play], ~mask{}, extension, pieces[over_play]);
  }
  if (m.law.table[over_position].knots > 0)
    find_piece(m.law.table[over_position], ~mask{}, g.x, pieces[over_position]);
  if (m.law.table[factor_over_position].knots > 0)
    find_piece(m.law.table[factor_over_position], ~mask{}, g.x, pieces[factor_over_position]);
  if (m.law.table[over_speed].knots > 0) {
    find_piece(m.law.table[over_speed], upward, speed, pieces[over_speed]);
    find_piece(m.law.table[over_speed_downwards], ~upward, speed, pieces[over_speed]);
  }
}

// Shortens the steps of the lanes `asked` to where a polynomial in the variable of the series leaves its
// piece. Returns the lanes for which it is proven that it does not do so before.
LANE_DEVICE inline mask keep_in_piece(const vec *c, const table_piece &piece, mask asked, vec &length) {
  vec scaled[order], power = length, reach = {}, last = c[0];
  scaled[0] = c[0];
  for (int k = 1; k < order; k++) {
    scaled[k] = c[k] * power;
    power *= length;
    reach += magnitude(scaled[k]);
    last += scaled[k];
  }
  mask doubtful = asked & ((c[0] + reach >= piece.high) | (c[0] - reach <= piece.low));
  if (!any(doubtful))
    return ~mask{};
  mask above = last >= piece.high, leaves = doubtful & (above | (last <= piece.low));
  vec side = pick(above, vec(1.0), vec(-1.0)), room[order], end = 1.0;
  mask lost = {};
  if (any(leaves)) {
    for (int k = 0; k < order; k++)
      room[k] = -side * scaled[k];
    room[0] += side * pick(above, piece.high, piece.low);
    lost = fall<order - 1>(room, leaves, vec(1.0), side * (pick(above, piece.high, piece.low) - last), end);
  }
  mask within = ~lost;
  for (int s = -1; s <= 1; s += 2) {
    for (int k = 0; k < order; k++)
      room[k] = -double(s) * scaled[k];
    room[0] += s > 0 ? piece.high : -piece.low;
    within = within & (~doubtful | positive_until(room, doubtful, end));
  }
  put(length, leaves & ~lost, end * length);
  return within;
}

// The same for every table: the steps `length` end where the first piece is left. Returns the lanes that are
// proven to keep within their pieces until then, with dry friction above zero.
template <class series>
LANE_DEVICE inline mask keep_in_pieces(const lane_machine &m, const lane_group &g, const table_piece *pieces,
                                       const series &p, mask asked, vec &length) {
  mask kept = ~mask{};
  if (m.law.table[over_extension].knots > 0)
    kept = kept & keep_in_piece(p.extension, pieces[over_extension], asked, length);
  if (m.law.table[over_play].knots > 0)
    kept = kept & keep_in_piece(p.extension, pieces[over_play], asked, length);
  if (m.law.table[over_position].knots > 0)
    kept = kept & keep_in_piece(p.x, pieces[over_position], asked, length);
  if (m.law.table[factor_over_position].knots > 0) {
    kept = kept & keep_in_piece(p.x, pieces[factor_over_position], asked, length);
    // A factor that has dropped to zero stays there: another law.
    vec factor[order], power = 1.0;
    for (int k = 0; k < order; k++) {
      factor[k] = p.factor[k] * power;
      power *= length;
    }
    kept = kept & positive_until(factor, asked, 1.0);
  }
  if (m.law.table[over_speed].knots > 0) {
    vec speed[order];
    for (int k = 0; k < order; k++)
      speed[k] = g.direction * p.v[k];
    kept = kept & keep_in_piece(speed, pieces[over_speed], asked, length);
  }
  return kept;
}

} // namespace

#endif
