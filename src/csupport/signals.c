/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Stop signals set a counter that the scheduler reads between trajectories. Where nobody has read it in time,
   within one long trajectory, the process ends by itself: working files are whole at every moment. So does
   one that has not noticed that its time limit is over.

   A handler may run at any point of the other functions, in any thread: MPI has threads that take signals. So
   all of them only change when the process is due, and set the timer from that. */
#include <errno.h>
#include <signal.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include "guard.h"

_Static_assert(ATOMIC_INT_LOCK_FREE == 2 && ATOMIC_LLONG_LOCK_FREE == 2, "handlers must not wait for a lock");

/* Seconds until a signal, or the end of the time, has to be noticed. */
enum { patience = 4, resumable = 75 };
static const int64_t second = 1000000000, microsecond = 1000;

static atomic_int received, terminated, noticed;
/* When the process ends by itself, in nanoseconds of the monotonic clock; 0: not. */
static _Atomic int64_t signal_due, limit_due;
static atomic_int setting, again;

/* A handler may read one text while the next is written. */
static char farewells[4][1024] = {"separatrix: stopped within one long trajectory\n"};
static atomic_int farewell;

static int64_t now(void) {
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return (int64_t)time.tv_sec * second + time.tv_nsec;
}

/* A signal replaces the time limit. */
static int64_t due(void) {
  if (received > 0)
    return noticed ? 0 : signal_due;
  return limit_due;
}

static int set_timer_once(void) {
  struct itimerval timer = {{0, 0}, {0, 0}};
  const int64_t end = due();
  if (end != 0) {
    int64_t left = end - now();
    if (left < microsecond)
      left = microsecond;
    timer.it_value.tv_sec = (time_t)(left / second);
    timer.it_value.tv_usec = (suseconds_t)(left % second / microsecond);
  }
  return setitimer(ITIMER_REAL, &timer, NULL);
}

/* Sets the timer to what is due. Who finds another at it, interrupted or in another thread, leaves it to that
   one, which looks again. Returns 0, or -1 if the timer cannot be set. */
static int set_timer(void) {
  int status = 0;
  atomic_store(&again, 1);
  while (atomic_load(&again) && atomic_exchange(&setting, 1) == 0) {
    while (atomic_exchange(&again, 0))
      status = set_timer_once();
    atomic_store(&setting, 0);
  }
  return status;
}

static void give_up(int number) {
  const int kept = errno;
  const int64_t end = due();
  (void)number;
  if (end != 0 && now() >= end) {
    const char *text = farewells[farewell];
    if (write(separatrix_guard_messages(), text, strlen(text)) < 0)
      _exit(resumable);
    _exit(resumable);
  }
  /* The timer of what is not due any more. */
  set_timer();
  errno = kept;
}

static void count_signal(int number) {
  const int kept = errno;
  int64_t none = 0;
  if (number == SIGTERM)
    terminated = 1;
  atomic_compare_exchange_strong(&signal_due, &none, now() + patience * second);
  if (received < 1000000)
    atomic_fetch_add(&received, 1);
  set_timer();
  errno = kept;
}

/* The first Ctrl-C stops cleanly, the second at once. */
static void count_interrupt(int number) {
  signal(number, SIG_DFL);
  count_signal(number);
}

/* Handles a signal, also where the process that started this one has blocked it. Returns 0, or -1. */
static int handle(int number, void (*handler)(int)) {
  struct sigaction action = {0};
  sigset_t set;
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  sigemptyset(&set);
  sigaddset(&set, number);
  if (sigaction(number, &action, NULL) != 0)
    return -1;
  return pthread_sigmask(SIG_UNBLOCK, &set, NULL) == 0 ? 0 : -1;
}

/* Ignores SIGXFSZ, so that a write beyond the file size limit comes back as an error. Returns 0, or -1. */
int separatrix_signals_ignore_file_limit(void) {
  struct sigaction action = {0};
  action.sa_handler = SIG_IGN;
  return sigaction(SIGXFSZ, &action, NULL);
}

/* SIGUSR1, SIGUSR2, SIGTERM and the first SIGINT are counted. Returns 0, or -1 if a handler cannot be set. */
int separatrix_signals_install(void) {
  static const int counted[] = {SIGUSR1, SIGUSR2, SIGTERM};
  if (handle(SIGALRM, give_up) != 0)
    return -1;
  for (size_t i = 0; i < sizeof counted / sizeof *counted; i++) {
    if (handle(counted[i], count_signal) != 0)
      return -1;
  }
  return handle(SIGINT, count_interrupt);
}

/* What a process that ends by itself prints. */
void separatrix_signals_farewell(const char *text) {
  const int next = (farewell + 1) % (int)(sizeof farewells / sizeof *farewells);
  snprintf(farewells[next], sizeof *farewells, "separatrix: %s\n", text);
  farewell = next;
}

/* The process ends by itself `patience` after so many seconds, unless separatrix_signals_no_limit comes
   before. Returns 0, or -1 if the timer cannot be set. */
int separatrix_signals_limit(double seconds) {
  /* Longer than any run. */
  const double most = 1e8;
  const double left = patience + (seconds > 0 ? (seconds < most ? seconds : most) : 0);
  if (handle(SIGALRM, give_up) != 0)
    return -1;
  limit_due = now() + (int64_t)(left * (double)second);
  return set_timer();
}

/* The end of the time was noticed, or the work that it limits is done. */
void separatrix_signals_no_limit(void) {
  limit_due = 0;
  set_timer();
}

int separatrix_signals_received(void) {
  if (received > 0 && atomic_exchange(&noticed, 1) == 0)
    set_timer();
  return received;
}

/* The process ends, for whatever reason: no timer has to end it. */
void separatrix_signals_notice(void) {
  limit_due = 0;
  if (received > 0)
    noticed = 1;
  set_timer();
}

/* Whether SIGTERM was among them. */
int separatrix_signals_terminated(void) { return terminated; }

void separatrix_signals_clear(void) {
  limit_due = 0;
  received = 0;
  signal_due = 0;
  terminated = 0;
  noticed = 0;
  set_timer();
}

/* Sends a signal to this process. */
int separatrix_signals_raise(int number) { return raise(number); }
