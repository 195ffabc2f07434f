# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""Signals that come at the worst moment: none is forgotten, and no timer ends what is not due."""

import subprocess
from pathlib import Path

import pytest

# A signal comes just before a timer is set, where `raced` is set; the clock can be put forward.
PROGRAM = """
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
static int raced, forward;
static void race(void) { if (raced) { raced = 0; raise(SIGUSR1); } }
static int racing_setitimer(int which, const struct itimerval *to, void *old) {
  race(); (void)old; return setitimer(which, to, NULL);
}
static unsigned racing_alarm(unsigned seconds) { race(); return alarm(seconds); }
static int put_forward(clockid_t clock, struct timespec *time) {
  const int status = clock_gettime(clock, time);
  time->tv_sec += forward;
  return status;
}
#define setitimer(which, to, old) racing_setitimer(which, to, old)
#define alarm(seconds) racing_alarm(seconds)
#define clock_gettime(clock, time) put_forward(clock, time)
#include "signals.c"
#undef clock_gettime
void separatrix_guard_begin(const char *, int, int);
static int left(void) {
  struct itimerval timer;
  getitimer(ITIMER_REAL, &timer);
  return (int)timer.it_value.tv_sec + (timer.it_value.tv_usec > 0);
}
int main(int count, char **words) {
  sigset_t set;
  (void)count; (void)racing_alarm; (void)put_forward; (void)forward;
  sigemptyset(&set);
  sigaddset(&set, SIGUSR1);
  sigprocmask(SIG_BLOCK, &set, NULL);
  if (separatrix_signals_install() != 0) return 1;
  separatrix_signals_farewell("one");
  separatrix_signals_farewell("two");
  switch (atoi(words[1])) { %s }
  printf("%%d", left());
  return 0;
}
"""
LIMIT = "separatrix_signals_limit(1000);"
NO_LIMIT = "separatrix_signals_no_limit();"


#: What is done, and the seconds that are left then.
TIMERS = [
    (f"raced = 1; {LIMIT}", 4),
    (f"{LIMIT} raced = 1; {NO_LIMIT}", 4),
    (f"{LIMIT} raise(SIGUSR1); {NO_LIMIT} {LIMIT}", 4),
    ("raise(SIGUSR1);", 4),
    (f"raise(SIGUSR1); separatrix_signals_received(); {LIMIT} raise(SIGUSR2);", 0),
    (f"{LIMIT} {NO_LIMIT}", 0),
    (LIMIT, 1004),
    # the timer of an earlier limit
    (f"separatrix_signals_limit(0); {NO_LIMIT} {LIMIT} raise(SIGALRM);", 1004),
    (f"{LIMIT} raise(SIGUSR1); separatrix_signals_notice();", 0),
    (f"{LIMIT} separatrix_signals_notice(); raise(SIGTERM);", 4),
]
SILENT = f'separatrix_guard_begin("damaged", 0, 74); {LIMIT} forward = 2000; raise(SIGALRM);'


@pytest.fixture(scope="module")
def program(source_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program; its argument is the number of what it does."""
    folder = tmp_path_factory.mktemp("races")
    done = [*(words for words, _ in TIMERS), SILENT]
    cases = (f"case {number}: {words} break;" for number, words in enumerate(done))
    (folder / "main.c").write_text(PROGRAM % "\n  ".join(cases))
    support = source_dir / "src/csupport"
    subprocess.run(
        ["cc", "-O0", f"-I{support}", "-o", folder / "main", folder / "main.c", support / "guard.c"],
        check=True,
    )
    return folder / "main"


def end_of(program: Path, number: int) -> tuple[int, str, str]:
    """Exit code, output and standard error."""
    done = subprocess.run([program, str(number)], capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout, done.stderr


def test_the_timer_is_that_of_what_is_due(program) -> None:
    for number, (words, seconds) in enumerate(TIMERS):
        assert end_of(program, number) == (0, str(seconds), ""), words


def test_the_end_is_reported_while_standard_error_is_silent(program) -> None:
    assert end_of(program, len(TIMERS)) == (75, "", "separatrix: two\n")
