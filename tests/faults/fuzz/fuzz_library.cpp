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
    const double times[2] = {0.0, 1e-3}, direction = 1;
    const int first[2] = {0, 2};
    int impacts = 0, steady = 0, reason = 0, impact_segment = 0;
    double impact[5];
    separatrix_segments segments = {};
    code =
        separatrix_segment_numbers(model, &segments.start_numbers, &segments.sample_numbers, message, size);
    if (code == 0) {
      const std::size_t rows = static_cast<std::size_t>(segments.sample_numbers);
      const std::vector<double> start(static_cast<std::size_t>(segments.start_numbers), 0.1);
      std::vector<double> motion(2 * rows), jacobian(2 * rows * (start.size() + 1));
      segments.chosen_count = segments.direction_count = some;
      segments.segment_count = segments.derivatives = segments.impact_capacity = 1;
      segments.tolerance = 1e-6;
      segments.chosen = &chosen;
      segments.values = &value;
      segments.directions = &direction;
      segments.start = start.data();
      segments.first = first;
      segments.times = times;
      segments.motion = motion.data();
      segments.jacobian = jacobian.data();
      segments.impacts = &impacts;
      segments.steady = &steady;
      segments.reason = &reason;
      segments.impact_segment = &impact_segment;
      segments.impact = impact;
      code = separatrix_propagate(model, &segments, message, size);
    }
  }
  separatrix_model_free(model);
  *message_length = static_cast<int>(std::strlen(message));
  return code;
}
