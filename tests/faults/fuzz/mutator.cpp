// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

#include "mutator.hpp"

#include <algorithm>
#include <cctype>

namespace {

// What readers stumble over: numbers at the edge of their types, other encodings, ends of lines, brackets.
const std::vector<std::string> &awkward_words() {
  static const std::vector<std::string> words = {
      "0",
      "-0.0",
      "1e308",
      "1e309",
      "-1e309",
      "1e-320",
      "9223372036854775807",
      "9223372036854775808",
      "-9223372036854775809",
      "2147483647",
      "2147483648",
      "99999999999999999999999999",
      "nan",
      "inf",
      "-inf",
      "0x7f",
      "1_000",
      "1e",
      ".5",
      "5.",
      "true",
      "1979-05-27T07:32:00Z",
      "\"\"",
      "\"1.1 m\"",
      "\"1.1 kg\"",
      "\"nan m\"",
      "\"1e999 deg\"",
      "'",
      "\"\"\"",
      "'''",
      "\\u0000",
      "\\U0010FFFF",
      "\r\n",
      "\r",
      "\n\n",
      std::string(1, '\0'),
      "\xEF\xBB\xBF",
      "\xC3\xA9",
      "\xFF\xFE",
      "\xC0\x80",
      "\xED\xA0\x80",
      "\xF0\x9F\x98\x80",
      "[[axis]]",
      "[",
      "]",
      "[[[[[[[[",
      "{",
      "}",
      "={",
      "=",
      ",",
      ",,,,",
      "#",
      ".",
      "\t",
      " ",
      "x0,v0,ratio",
      "values = []",
      "values = [0, 1, 2]",
      "count = 2000000000",
      "count = 1",
      "step = 1e-300",
      std::string(5000, '1'),
      std::string(300, '['),
      std::string(5000, 'a'),
  };
  return words;
}

bool is_word(char letter) {
  return std::isalnum(static_cast<unsigned char>(letter)) != 0 || letter == '_' || letter == '.' ||
         letter == '-' || letter == '+';
}

} // namespace

std::size_t Mutator::below(std::size_t end) { return end == 0 ? 0 : random_() % end; }

void Mutator::learn(const std::string &input) {
  if (!text_)
    return;
  std::string word;
  for (const char letter : input + " ") {
    if (is_word(letter)) {
      word += letter;
    } else if (!word.empty()) {
      if (words_.size() < 4000 && std::find(words_.begin(), words_.end(), word) == words_.end())
        words_.push_back(word);
      word.clear();
    }
  }
}

std::string Mutator::mutate(const std::string &input, const std::string &other, std::size_t most) {
  std::string changed = input;
  const std::size_t times = 1 + below(below(4) == 0 ? 16 : 3);
  for (std::size_t i = 0; i < times; ++i)
    change(changed, other);
  if (changed.size() > most)
    changed.resize(most);
  return changed;
}

void Mutator::change(std::string &input, const std::string &other) {
  const std::size_t at = below(input.size());
  const std::size_t length = 1 + below(std::min<std::size_t>(input.size() - at, below(3) == 0 ? 4096 : 8));
  switch (below(8)) {
  case 0:
    if (below(4) == 0)
      input.resize(at);
    else
      input.erase(at, length);
    break;
  case 1:
    input.insert(at, input.substr(at, length));
    break;
  case 2: {
    const std::size_t from = below(other.size());
    const std::string part = other.substr(from, 1 + below(below(3) == 0 ? 4096 : 64));
    if (below(2) == 0 || text_)
      input.insert(at, part);
    else
      input.replace(at, part.size(), part);
    break;
  }
  case 3:
    for (std::size_t i = at; i < std::min(input.size(), at + length); ++i)
      input[i] = static_cast<char>(below(256));
    break;
  default:
    if (!text_)
      change_binary(input);
    else if (below(3) == 0)
      change_number(input);
    else if (below(2) == 0)
      change_line(input);
    else
      put_word(input);
  }
}

// One bit, a byte at an edge, or an edge of an integer of 1, 2, 4 or 8 bytes.
void Mutator::change_binary(std::string &input) {
  static const std::uint64_t edges[] = {0,      1,      0x7F,       0x80,       0xFF,
                                        0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 0x7FFFFFFFFFFFFFFF,
                                        ~0ULL,  100000, 1ULL << 40, 1ULL << 62, 0x7FF8000000000000};
  if (input.empty())
    return;
  const std::size_t at = below(input.size());
  if (below(2) == 0) {
    input[at] = static_cast<char>(input[at] ^ (1 << below(8)));
    return;
  }
  const std::uint64_t value = edges[below(std::size(edges))] + below(3) - 1;
  const std::size_t width = std::size_t(1) << below(4);
  for (std::size_t i = 0; i < width && at + i < input.size(); ++i)
    input[at + i] = static_cast<char>(value >> (8 * i));
}

// Deletes, doubles or moves a line.
void Mutator::change_line(std::string &input) {
  const std::size_t near = below(input.size());
  const std::size_t before = input.rfind('\n', near);
  const std::size_t from = before == std::string::npos ? 0 : before + 1;
  const std::size_t after = input.find('\n', from);
  const std::size_t to = after == std::string::npos ? input.size() : after + 1;
  const std::string line = input.substr(from, to - from);
  const std::size_t what = below(3);
  if (what != 1)
    input.erase(from, to - from);
  if (what == 0)
    return;
  const std::size_t elsewhere = input.find('\n', below(input.size()));
  input.insert(elsewhere == std::string::npos ? 0 : elsewhere + 1, line);
}

// Another number, or another word, in place of one.
void Mutator::change_number(std::string &input) {
  std::size_t from = input.find_first_of("0123456789", below(input.size()));
  if (from == std::string::npos)
    return;
  std::size_t to = from;
  while (to < input.size() && is_word(input[to]))
    ++to;
  const auto &words = awkward_words();
  std::string word = words[below(words.size())];
  if (below(2) == 0) {
    word = std::to_string(static_cast<std::int64_t>(random_()) >> below(63));
    if (below(2) == 0)
      word += "e" + std::to_string(static_cast<int>(below(700)) - 350);
  }
  input.replace(from, to - from, word);
}

void Mutator::put_word(std::string &input) {
  const auto &awkward = awkward_words();
  const bool learnt = !words_.empty() && below(2) == 0;
  const std::string word = learnt ? words_[below(words_.size())] : awkward[below(awkward.size())];
  std::size_t at = below(input.size());
  if (below(2) == 0) {
    while (at > 0 && is_word(input[at - 1]))
      --at;
    std::size_t to = at;
    while (to < input.size() && is_word(input[to]))
      ++to;
    input.erase(at, to - at);
  }
  input.insert(std::min(at, input.size()), word);
}
