// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

#include "toml_shim.h"

#include <algorithm>
#include <cerrno>
#include <cfenv>
#include <cfloat>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <toml.hpp>

namespace {

using Value = toml::basic_value<toml::discard_comments, std::map, std::vector>;

struct Entry {
  std::string path;
  int kind = SEPARATRIX_TOML_TABLE;
  int line = 0;
  int column = 0;
  std::int64_t integer = 0;
  double real = 0.0;
  std::string text;
};

struct Document {
  std::vector<Entry> entries;
  std::string message;
  int line = 0;
  int column = 0;

  void fail(const std::string &reason, int at_line, int at_column) {
    if (!message.empty())
      return;
    message = reason;
    line = at_line;
    column = at_column;
  }
};

// A position that toml11's report underlines.
struct Mark {
  int line = 0;
  int column = 0;
  std::string hint;
};

std::string quoted_if_needed(const std::string &key) {
  const bool bare =
      !key.empty() && key.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                            "0123456789_-") == std::string::npos;
  return bare ? key : "\"" + key + "\"";
}

// The decimal or hexadecimal integer at a position of the text as a number; false for any other text.
bool number_at(const std::string &text, int line, int column, double &number) {
  std::istringstream lines(text);
  std::string digits;
  for (int i = 0; i < line; ++i)
    if (!std::getline(lines, digits))
      return false;
  if (column < 1 || static_cast<std::size_t>(column) > digits.size())
    return false;
  digits.erase(0, static_cast<std::size_t>(column) - 1);
  digits.resize(std::min(digits.find_first_not_of("+-_0123456789xabcdefABCDEF"), digits.size()));
  digits.erase(std::remove(digits.begin(), digits.end(), '_'), digits.end());
  char *end = nullptr;
  number = std::strtod(digits.c_str(), &end);
  return !digits.empty() && *end == '\0' && std::fabs(number) >= 0x1p63 && std::fabs(number) <= DBL_MAX;
}

void flatten(const Value &value, const std::string &path, const std::string &text, Document &document) {
  Entry entry;
  entry.path = path;
  entry.line = static_cast<int>(value.location().line());
  entry.column = static_cast<int>(value.location().column());
  if (value.is_integer()) {
    entry.kind = SEPARATRIX_TOML_INTEGER;
    entry.integer = value.as_integer();
    entry.real = static_cast<double>(entry.integer);
    // toml11 clamps what it cannot hold, without a word. It is a number that no integer key allows.
    const bool clamped = entry.integer == INT64_MAX || entry.integer == INT64_MIN;
    if (clamped && number_at(text, entry.line, entry.column, entry.real))
      entry.kind = SEPARATRIX_TOML_FLOAT;
    else if (clamped)
      document.fail("the integer of key '" + path + "' is too large", entry.line, entry.column);
  } else if (value.is_floating()) {
    entry.kind = SEPARATRIX_TOML_FLOAT;
    entry.real = value.as_floating();
    if (entry.real == DBL_MAX || entry.real == -DBL_MAX)
      document.fail("the number of key '" + path + "' is too large", entry.line, entry.column);
  } else if (value.is_string()) {
    entry.kind = SEPARATRIX_TOML_STRING;
    entry.text = value.as_string().str;
  } else if (value.is_boolean()) {
    entry.kind = SEPARATRIX_TOML_BOOLEAN;
    entry.integer = value.as_boolean() ? 1 : 0;
  } else if (value.is_array()) {
    entry.kind = SEPARATRIX_TOML_ARRAY;
    entry.integer = static_cast<std::int64_t>(value.as_array().size());
  } else if (!value.is_table()) {
    entry.kind = SEPARATRIX_TOML_DATE;
  }
  if (!path.empty())
    document.entries.push_back(entry);
  if (value.is_table()) {
    for (const auto &item : value.as_table())
      flatten(item.second, (path.empty() ? "" : path + ".") + quoted_if_needed(item.first), text, document);
  } else if (value.is_array()) {
    int index = 0;
    for (const auto &item : value.as_array())
      flatten(item, path + "[" + std::to_string(++index) + "]", text, document);
  }
}

// The positions that a report marks: a line "  12 | text" followed by "     |   ^--- hint".
std::vector<Mark> marks_of(const std::string &report) {
  std::vector<Mark> marks;
  std::istringstream lines(report);
  std::string line;
  int number = 0;
  while (std::getline(lines, line)) {
    const auto bar = line.find('|');
    if (bar == std::string::npos)
      continue;
    if (std::atoi(line.c_str()) > 0) {
      number = std::atoi(line.c_str());
      continue;
    }
    const auto from = line.find_first_of("^~", bar);
    if (from == std::string::npos || number == 0)
      continue;
    const auto hint = line.find_first_not_of("^~- ", from);
    Mark mark;
    mark.line = number;
    mark.column = static_cast<int>(from - bar) - 1;
    if (hint != std::string::npos)
      mark.hint = line.substr(hint);
    marks.push_back(mark);
  }
  return marks;
}

// First line of a report without "[error] " and the name of toml11's procedure.
std::string summary_of(const std::string &report) {
  std::string summary = report.substr(0, report.find('\n'));
  if (summary.rfind("[error] ", 0) == 0)
    summary.erase(0, 8);
  const auto end = summary.find(": ");
  if (end != std::string::npos && summary.find(' ') > end)
    summary.erase(0, end + 2);
  if (summary.rfind("bad ", 0) == 0)
    summary.replace(0, 3, "malformed");
  return summary;
}

bool has(const std::string &text, const char *part) { return text.find(part) != std::string::npos; }

std::string name_in(const std::string &summary) {
  const auto from = summary.find("(\"");
  const auto to = summary.find("\")");
  if (from == std::string::npos || to == std::string::npos)
    return "";
  return summary.substr(from + 2, to - from - 2);
}

// The rest of a line of the text, to quote in a message.
std::string rest_of_line(const std::string &text, int line, int column) {
  std::istringstream lines(text);
  std::string rest;
  for (int i = 0; i < line; ++i)
    if (!std::getline(lines, rest))
      return "";
  if (column < 1 || static_cast<std::size_t>(column) > rest.size())
    return "";
  rest.erase(0, static_cast<std::size_t>(column) - 1);
  rest.erase(0, rest.find_first_not_of(' '));
  while (!rest.empty() && (rest.back() == '\r' || rest.back() == ' '))
    rest.pop_back();
  if (rest.size() > 40) {
    rest.resize(40);
    while (!rest.empty() && (static_cast<unsigned char>(rest.back()) & 0xC0) == 0x80)
      rest.pop_back();
    if (!rest.empty() && static_cast<unsigned char>(rest.back()) >= 0xC0)
      rest.pop_back();
    rest += "...";
  }
  return rest;
}

// toml11's report in one line of plain English.
void explain(const std::string &report, const std::string &text, Document &document) {
  const std::string summary = summary_of(report);
  const std::vector<Mark> marks = marks_of(report);
  const Mark last = marks.empty() ? Mark{1, 1, ""} : marks.back();
  const std::string found = rest_of_line(text, last.line, last.column);
  const std::string tail = found.empty() ? ", found the end of the line" : ", found: " + found;
  const std::string name = name_in(summary);
  std::string reason;
  if (has(summary, "already exists") && marks.size() > 1) {
    const bool table = has(last.hint, "table");
    reason = (table ? "table '" : "key '") + name + "' is given twice, first in line " +
             std::to_string(marks.front().line);
  } else if (has(summary, "neither table nor")) {
    reason = "a key is used both as a value (line " + std::to_string(marks.front().line) + ") and as a table";
  } else if (has(summary, "missing value after")) {
    reason = "a value is missing after '='" + tail;
  } else if (has(summary, "missing key-value separator")) {
    reason = "'=' is missing after the key" + tail;
  } else if (has(summary, "invalid line format")) {
    reason = "only a comment may follow on this line (a text needs quotes)" + tail;
  } else if (has(summary, "is not a valid") && has(summary, "string")) {
    reason = "not a text that ends with the quote it begins with" + tail;
  } else if (has(summary, "invalid key") || has(summary, "empty key")) {
    reason = "not a key or a table header" + tail;
  } else if (has(summary, "missing array separator")) {
    reason = "',' or ']' is missing in the list begun in line " +
             std::to_string(marks.empty() ? 1 : marks.front().line) + tail;
  } else if (has(last.hint, "not a boolean") || has(summary, "unknown")) {
    reason = "not a value (a number, a text in quotes, true, false or a list)" + tail;
  } else {
    reason = summary + (last.hint.empty() || last.hint == "here" ? "" : ": " + last.hint) + tail;
  }
  document.fail(reason, last.line, last.column);
}

// toml11 parses recursively, so endless brackets would exhaust the stack.
bool nested_too_deep(const std::string &text) {
  int depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '#') {
      i = std::min(text.find('\n', i), text.size());
      if (i == text.size())
        break;
    }
    if (text[i] == '[' || text[i] == '{')
      ++depth;
    if ((text[i] == ']' || text[i] == '}') && depth > 0)
      --depth;
    if (depth > 100)
      return true;
  }
  return false;
}

// Length of the UTF-8 sequence at `at`, 0 if there is none.
std::size_t sequence_at(const std::string &text, std::size_t at) {
  const auto byte = [&text](std::size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
  };
  const unsigned first = byte(at);
  if (first < 0x80)
    return 1;
  const std::size_t length = first < 0xC2 ? 0 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : first < 0xF5 ? 4 : 0;
  for (std::size_t i = 1; i < length; ++i)
    if ((byte(at + i) & 0xC0) != 0x80)
      return 0;
  // Overlong forms, surrogates, and what is beyond the last code point.
  const unsigned second = byte(at + 1);
  if ((first == 0xE0 && second < 0xA0) || (first == 0xED && second > 0x9F) ||
      (first == 0xF0 && second < 0x90) || (first == 0xF4 && second > 0x8F))
    return 0;
  return length;
}

// toml11 3.7.1 reads beyond its buffer when it reports bytes that are not UTF-8, so it never sees any.
bool refuse_bad_bytes(const std::string &text, Document &document) {
  int line = 1;
  std::size_t line_begin = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t length = sequence_at(text, at);
    if (length == 0) {
      const bool hdf5 = text.compare(0, 4, "\x89HDF") == 0;
      document.fail(hdf5 ? "found an HDF5 file, allowed a case in TOML" : "the text is not valid UTF-8", line,
                    static_cast<int>(at - line_begin) + 1);
      return true;
    }
    if (text[at] == '\n') {
      ++line;
      line_begin = at + 1;
    }
    at += length;
  }
  return false;
}

void parse(const std::string &text, Document &document) {
  if (refuse_bad_bytes(text, document))
    return;
  if (nested_too_deep(text)) {
    document.fail("lists or tables are nested too deep", 1, 1);
    return;
  }
  try {
    std::istringstream stream(text);
    flatten(toml::parse<toml::discard_comments, std::map, std::vector>(stream, "case"), "", text, document);
    std::stable_sort(document.entries.begin(), document.entries.end(), [](const Entry &a, const Entry &b) {
      return a.line < b.line || (a.line == b.line && a.column < b.column);
    });
  } catch (const std::exception &error) {
    explain(error.what(), text, document);
  }
}

char *copy_of(const std::string &text) {
  char *copy = static_cast<char *>(std::malloc(text.size() + 1));
  if (copy != nullptr)
    std::memcpy(copy, text.c_str(), text.size() + 1);
  return copy;
}

const Document &document_at(const void *pointer) { return *static_cast<const Document *>(pointer); }

std::int64_t copy_into(const std::string &text, char *buffer, std::int64_t capacity) {
  const auto length = static_cast<std::int64_t>(text.size());
  if (buffer != nullptr)
    std::memcpy(buffer, text.data(), static_cast<std::size_t>(std::min(length, capacity)));
  return length;
}

} // namespace

extern "C" {

char *separatrix_toml_read_file(const char *path, int64_t *length, char **message) {
  *length = 0;
  *message = nullptr;
  try {
    errno = 0;
    std::ifstream file(path, std::ios::binary);
    std::ostringstream content;
    if (file.is_open() && file.peek() != std::ifstream::traits_type::eof())
      content << file.rdbuf();
    if (!file.is_open() || file.bad() || content.bad()) {
      *message = copy_of(errno != 0 ? std::strerror(errno) : "reading failed");
      return nullptr;
    }
    *length = static_cast<int64_t>(content.str().size());
    return copy_of(content.str());
  } catch (const std::exception &error) {
    *message = copy_of(error.what());
    return nullptr;
  }
}

void separatrix_toml_free_text(char *text) { std::free(text); }

void *separatrix_toml_parse(const char *text, int64_t length) {
  // A number that is too large gets a message, also where the program stops at an overflow.
  std::fenv_t before;
  std::feholdexcept(&before);
  Document *document = nullptr;
  try {
    document = new Document;
    parse(std::string(text, static_cast<std::size_t>(length)), *document);
  } catch (...) {
    delete document;
    document = nullptr;
  }
  std::fesetenv(&before);
  return document;
}

void separatrix_toml_free(void *document) { delete static_cast<Document *>(document); }

int64_t separatrix_toml_error(const void *document, char *buffer, int64_t capacity, int *line, int *column) {
  *line = document_at(document).line;
  *column = document_at(document).column;
  return copy_into(document_at(document).message, buffer, capacity);
}

int separatrix_toml_count(const void *document) {
  return static_cast<int>(document_at(document).entries.size());
}

void separatrix_toml_value(const void *document, int entry, int *kind, int *line, int64_t *integer,
                           double *real) {
  const Entry &found = document_at(document).entries[static_cast<std::size_t>(entry)];
  *kind = found.kind;
  *line = found.line;
  *integer = found.integer;
  *real = found.real;
}

int64_t separatrix_toml_text(const void *document, int entry, int field, char *buffer, int64_t capacity) {
  const Entry &found = document_at(document).entries[static_cast<std::size_t>(entry)];
  return copy_into(field == SEPARATRIX_TOML_PATH ? found.path : found.text, buffer, capacity);
}

int64_t separatrix_first_bad_byte(const char *text, int64_t length) {
  try {
    const std::string all(text, static_cast<std::size_t>(length));
    for (std::size_t at = 0; at < all.size();) {
      const std::size_t step = sequence_at(all, at);
      const bool control =
          static_cast<unsigned char>(all[at]) < 0x20 && std::strchr("\t\r\n", all[at]) == nullptr;
      if (step == 0 || control || all[at] == '\0')
        return static_cast<int64_t>(at);
      at += step;
    }
    return -1;
  } catch (...) {
    return 0;
  }
}

} // extern "C"
