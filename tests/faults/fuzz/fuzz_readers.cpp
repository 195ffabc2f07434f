// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// fuzz_readers TARGET SEEDS WORK --seconds S --seed N: feeds a reader with mutated inputs in one process,
// keeps what reaches new basic blocks, and prints one JSON line. WORK/current is the input under way, so that
// the caller has it when this process dies; an input that takes too long, an exit or an internal error of the
// reader (code 70) ends the process as a crash does.
#include "mutator.hpp"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <sanitizer/common_interface_defs.h>
#include <sstream>
#include <string>
#include <sys/mman.h>
#include <sys/time.h>
#include <unistd.h>
#include <vector>

// fuzz_targets.f90: exit code and length of the message of a reader.
extern "C" void fuzz_target(int target, const char *bytes, int64_t length, const char *path,
                            int64_t path_length, int *code, int *message_length);
// fuzz_library.cpp: the same for libseparatrix.
extern "C" int fuzz_library(const char *bytes, int64_t length, int *message_length);
extern "C" void fuzz_make_working(const char *path, int64_t path_length);

namespace {

constexpr std::size_t most_text = 16384;
constexpr std::size_t most_binary = 1 << 20;
// Of the processor; the clock may run longer on a busy machine.
constexpr int longest_seconds = 10, longest_wait = 120;

const std::vector<std::string> target_names = {"case",   "override", "points", "info",
                                               "verify", "resume",   "force",  "library"};
constexpr int target_points = 2, target_resume = 5, target_force = 6, target_library = 7;

// Whether the block at an address has been reached; the code ends before this address.
constexpr std::size_t map_size = 1 << 26;
unsigned char *reached = nullptr;
bool reached_new = false;
bool tracing = false;
bool running = false;

// Memory that is a file, and so outlives this process.
char *map_file(const std::string &path, std::size_t size) {
  std::ofstream(path, std::ios::binary | std::ios::app).close();
  if (truncate(path.c_str(), static_cast<off_t>(size)) != 0)
    throw std::runtime_error("cannot size " + path);
  std::FILE *file = std::fopen(path.c_str(), "r+b");
  void *memory = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, fileno(file), 0);
  std::fclose(file);
  if (memory == MAP_FAILED)
    throw std::runtime_error("cannot map " + path);
  return static_cast<char *>(memory);
}

// The input under way: its length and the number of inputs so far in 8 bytes each, then the input.
class Current {
public:
  explicit Current(const std::string &path) : memory_(map_file(path, most_binary + 16)) {}
  void set(const std::string &input) {
    const std::uint64_t head[2] = {input.size(), ++inputs_};
    std::memcpy(memory_, head, sizeof head);
    std::memcpy(memory_ + sizeof head, input.data(), input.size());
  }

private:
  std::uint64_t inputs_ = 0;
  char *memory_;
};

void die(const char *reason) {
  const std::string line = std::string("fuzz_readers: ") + reason + "\n";
  if (write(STDERR_FILENO, line.data(), line.size()) < 0)
    std::_Exit(98);
  __sanitizer_print_stack_trace();
  std::_Exit(99);
}

void on_alarm(int) { die("the reader takes more than 10 s"); }

void on_exit() {
  if (running)
    die("the reader ended the program");
}

std::string read_file(const std::filesystem::path &path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream content;
  content << file.rdbuf();
  return content.str();
}

void make_working(const std::string &path) {
  fuzz_make_working(path.data(), static_cast<int64_t>(path.size()));
}

std::map<int, long> codes;

// Runs one input; returns whether it reached new blocks.
bool run(int target, const std::string &input, const std::string &scratch, Current &current) {
  current.set(input);
  if (target >= target_points && target <= target_force) {
    std::filesystem::remove(scratch); // for HDF5 the same file would be one that it knows
    std::ofstream file(scratch, std::ios::binary | std::ios::trunc);
    file.write(input.data(), static_cast<std::streamsize>(input.size()));
  }
  reached_new = false;
  int code = -1;
  int message_length = 0;
  const itimerval limit = {{0, 0}, {longest_seconds, 0}};
  const itimerval wait = {{0, 0}, {longest_wait, 0}};
  const itimerval none = {{0, 0}, {0, 0}};
  setitimer(ITIMER_VIRTUAL, &limit, nullptr);
  setitimer(ITIMER_REAL, &wait, nullptr);
  running = tracing = true;
  if (target == target_library)
    code = fuzz_library(input.data(), static_cast<int64_t>(input.size()), &message_length);
  else
    fuzz_target(target, input.data(), static_cast<int64_t>(input.size()), scratch.data(),
                static_cast<int64_t>(scratch.size()), &code, &message_length);
  running = tracing = false;
  setitimer(ITIMER_VIRTUAL, &none, nullptr);
  setitimer(ITIMER_REAL, &none, nullptr);
  ++codes[code];
  if (code == 70)
    die("the reader reports an internal error (code 70)");
  if (code != 0 && message_length == 0)
    die("the reader fails without a message");
  return reached_new;
}

} // namespace

// GCC calls this in every basic block of the layers that read.
extern "C" __attribute__((no_sanitize_coverage, no_sanitize("address", "undefined"))) void
__sanitizer_cov_trace_pc() {
  if (!tracing)
    return;
  const auto block = reinterpret_cast<std::uintptr_t>(__builtin_return_address(0));
  unsigned char &seen = reached[block % map_size];
  if (seen != 0)
    return;
  seen = 1;
  reached_new = true;
}

namespace {
constexpr int guarded[] = {SIGPROF, SIGSEGV, SIGBUS, SIGFPE, SIGABRT};
struct sigaction before[std::size(guarded)];
std::string guard_message;
int guard_code = 0;

// Also when the address sanitizer has found that HDF5 reads beyond its memory there.
void give_up() {
  if (guard_code != 0 && write(STDERR_FILENO, guard_message.data(), guard_message.size()) > 0)
    std::_Exit(guard_code);
}
} // namespace

// In place of csupport/guard.c, with less patience: HDF5 loops or crashes in a damaged heap of strings.
extern "C" void separatrix_guard_begin(const char *text, int, int code) {
  guard_message = std::string(text) + "\n";
  guard_code = code;
  struct sigaction action = {};
  action.sa_handler = [](int) { give_up(); };
  for (std::size_t i = 0; i < std::size(guarded); ++i)
    sigaction(guarded[i], &action, &before[i]);
  const itimerval limit = {{0, 0}, {0, 500000}};
  setitimer(ITIMER_PROF, &limit, nullptr);
}

extern "C" void separatrix_guard_end() {
  const itimerval none = {{0, 0}, {0, 0}};
  setitimer(ITIMER_PROF, &none, nullptr);
  for (std::size_t i = 0; i < std::size(guarded); ++i)
    sigaction(guarded[i], &before[i], nullptr);
  guard_code = 0;
}

extern "C" int separatrix_guard_messages() { return STDERR_FILENO; }

// In place of csupport/trial.c: everything is read in this process, where it is looked at.
extern "C" int separatrix_fork() { return -1; }
extern "C" int separatrix_crashed(int) { return 0; }

int main(int count, char **arguments) {
  if (count != 8) {
    std::cerr << "usage: fuzz_readers TARGET SEEDS WORK --seconds S --seed N\n";
    return 64;
  }
  int target = -1;
  for (std::size_t i = 0; i < target_names.size(); ++i)
    if (target_names[i] == arguments[1])
      target = static_cast<int>(i);
  if (target < 0)
    return 64;
  const std::filesystem::path work = arguments[3];
  const double seconds = std::stod(arguments[5]); // at most half of it for the seeds
  const bool text = target <= target_points || target >= target_force;
  const std::size_t most = text ? most_text : most_binary;
  Mutator mutator(std::stoull(arguments[7]), text);
  Current current(work / "current");
  const std::string scratch = work / (target == target_resume ? "input.h5.part" : "input");
  std::signal(SIGALRM, on_alarm);
  std::signal(SIGVTALRM, on_alarm);
  std::atexit(on_exit);
  __sanitizer_set_death_callback(give_up);
  if (target == target_resume)
    make_working(work / "seed.h5");

  reached = reinterpret_cast<unsigned char *>(map_file(work / "reached", map_size));

  // What a process before this one kept is read behind the seeds, and the seeds are not run again.
  const bool again = std::filesystem::exists(work / "kept");
  std::filesystem::create_directory(work / "kept");
  std::vector<std::string> corpus;
  for (const auto &entry : std::filesystem::directory_iterator(arguments[2]))
    if (entry.file_size() <= most)
      corpus.push_back(read_file(entry.path()));
  if (target == target_resume)
    corpus.push_back(read_file(work / "seed.h5.part"));
  std::sort(corpus.begin(), corpus.end());
  for (std::size_t i = corpus.size(); i > 1; --i)
    std::swap(corpus[i - 1], corpus[mutator.below(i)]);
  const std::size_t seeds = corpus.size();
  for (const auto &entry : std::filesystem::directory_iterator(work / "kept"))
    corpus.push_back(read_file(entry.path()));
  for (const std::string &input : corpus)
    mutator.learn(input);
  // The reports of `info` and `verify` are not what is looked at.
  const int report = dup(STDOUT_FILENO);
  if (std::freopen("/dev/null", "w", stdout) == nullptr)
    return 74;
  long inputs = 0;
  long kept = 0;
  const auto started = std::chrono::steady_clock::now();
  const auto elapsed = [&started] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
  };
  for (std::size_t i = 0; i < seeds && !again && elapsed() < seconds / 2; ++i) {
    run(target, corpus[i], scratch, current);
    ++inputs;
  }
  while (elapsed() < seconds) {
    // Every second input comes from what was found last.
    const std::size_t newest = std::min<std::size_t>(corpus.size(), 32);
    const std::size_t from =
        mutator.below(2) == 0 ? corpus.size() - 1 - mutator.below(newest) : mutator.below(corpus.size());
    const std::string input = mutator.mutate(corpus[from], corpus[mutator.below(corpus.size())], most);
    ++inputs;
    if (run(target, input, scratch, current)) {
      corpus.push_back(input);
      ++kept;
      std::ofstream(work / "kept" / (std::string(arguments[7]) + "-" + std::to_string(kept)),
                    std::ios::binary)
          << input;
    }
  }
  std::ostringstream line;
  line << "{\"target\": \"" << target_names[static_cast<std::size_t>(target)] << "\", \"inputs\": " << inputs
       << ", \"seeds\": " << seeds << ", \"codes\": {";
  bool first = true;
  for (const auto &[code, times] : codes) {
    line << (first ? "" : ", ") << "\"" << code << "\": " << times;
    first = false;
  }
  line << "}}\n";
  const std::string out = line.str();
  return write(report, out.data(), out.size()) == static_cast<ssize_t>(out.size()) ? 0 : 74;
}
