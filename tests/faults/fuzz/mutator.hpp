// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Changes inputs at random: bits, bytes, numbers, words, lines, lengths, and parts of other inputs.
#ifndef SEPARATRIX_MUTATOR_HPP
#define SEPARATRIX_MUTATOR_HPP

#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

class Mutator {
public:
  Mutator(std::uint64_t seed, bool text) : random_(seed), text_(text) {}

  // Adds the words of an input to those that are put into others.
  void learn(const std::string &input);

  // A changed copy; `other` is spliced in now and then. At most `most` bytes long.
  std::string mutate(const std::string &input, const std::string &other, std::size_t most);

  // A number from 0 to below `end` (0 if `end` is 0).
  std::size_t below(std::size_t end);

private:
  void change(std::string &input, const std::string &other);
  void change_binary(std::string &input);
  void change_line(std::string &input);
  void change_number(std::string &input);
  void put_word(std::string &input);

  std::mt19937_64 random_;
  bool text_;
  std::vector<std::string> words_;
};

#endif
