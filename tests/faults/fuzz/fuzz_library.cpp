// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// A case in memory as libseparatrix takes it: read, its parameters listed and found again, written out, and a
// short segment flown with derivatives by the first of them.
#include "separatrix.h"

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

extern "C" int fuzz_library(const char *bytes, int64_t length, int *message_length) {
  constexpr std::size_t size = 512;
  char message[size] = "", path[size] = "", unit[size] = "";
  separatrix_model *model = nullptr;
  const std::string text(bytes, static_cast<std::size_t>(length));
  int code = separatrix_model_from_text(text.c_str(), "", &model, message, size);
  int chosen = 0;
  double numbers[3] = {}, value = 0;
  const int count = code == 0 ? separatrix_parameter_count(model) : 0;
  for (int i = count - 1; i >= 0 && code == 0; --i) {
    code = separatrix_parameter(model, i, path, size, unit, size, numbers, message, size);
    if (code == 0)
      code = separatrix_find_parameter(model, path, &chosen, message, size);
    if (code == 0 && chosen != i)
      __builtin_trap();
    value = numbers[0];
  }
  const int some = count > 0 ? 1 : 0;
  std::size_t needed = 0;
  if (code == 0)
    code = separatrix_model_text(model, some, &chosen, &value, nullptr, 0, &needed, message, size);
  std::vector<char> resolved(needed + 1);
  if (code == 0)
    code = separatrix_model_text(model, some, &chosen, &value, resolved.data(), resolved.size(), &needed,
                                 message, size);
  if (code == 0) {
    const double start[3] = {0.4, 0.1, 0.0}, times[2] = {0.0, 1e-3};
    const int first[2] = {0, 2};
    double x[2], v[2], slopes[8], velocity_slopes[8], impact[4];
    int impacts = 0, steady = 0, reason = 0, met = 0, segment = 0;
    const double direction = 1;
    code = separatrix_segments(model, some, &chosen, &value, some, &direction, 1, start, first, times, 0, 0.0,
                               nullptr, 1, 1e-6, x, v, slopes, velocity_slopes, &impacts, &steady, &reason, 1,
                               &met, &segment, impact, message, size);
  }
  separatrix_model_free(model);
  *message_length = static_cast<int>(std::strlen(message));
  return code;
}
