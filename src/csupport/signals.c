/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Stop signals set a counter that the scheduler reads between trajectories. Where nobody has read it in time,
   within one long trajectory, the process ends by itself: working files are whole at every moment. So does
   one that has not noticed that its time limit is over. */
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/time.h>
#include <unistd.h>

static volatile sig_atomic_t received = 0, terminated = 0, noticed = 0, limited = 0;

/* Seconds until a signal, or the end of the time, has to be noticed. */
enum { patience = 4, resumable = 75 };
static char farewell[1024] = "separatrix: stopped within one long trajectory\n";

static void give_up(int number) {
  (void)number;
  if (!limited && (noticed || received == 0))
    return;
  if (write(STDERR_FILENO, farewell, strlen(farewell)) < 0)
    _exit(resumable);
  _exit(resumable);
}

static void count_signal(int number) {
  if (number == SIGTERM)
    terminated = 1;
  if (received == 0) {
    limited = 0;
    alarm(patience);
  }
  if (received < 1000000)
    received++;
}

/* The first Ctrl-C stops cleanly, the second at once. */
static void count_interrupt(int number) {
  signal(number, SIG_DFL);
  count_signal(number);
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
  struct sigaction action = {0};
  action.sa_handler = count_signal;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (size_t i = 0; i < sizeof counted / sizeof *counted; i++) {
    if (sigaction(counted[i], &action, NULL) != 0)
      return -1;
  }
  action.sa_handler = give_up;
  if (sigaction(SIGALRM, &action, NULL) != 0)
    return -1;
  action.sa_handler = count_interrupt;
  return sigaction(SIGINT, &action, NULL);
}

/* What a process that ends by itself prints. */
void separatrix_signals_farewell(const char *text) {
  snprintf(farewell, sizeof farewell, "separatrix: %s\n", text);
}

/* The process ends by itself `patience` after so many seconds, unless separatrix_signals_no_limit comes
   before. A signal replaces the limit. Returns 0, or -1 if the timer cannot be set. */
int separatrix_signals_limit(double seconds) {
  struct sigaction action = {0};
  struct itimerval timer = {{0, 0}, {0, 0}};
  /* Longer than any run, and within the range of every time_t. */
  const double most = 1e8;
  const double due = patience + (seconds > 0 ? (seconds < most ? seconds : most) : 0);
  if (received > 0)
    return 0;
  action.sa_handler = give_up;
  sigemptyset(&action.sa_mask);
  if (sigaction(SIGALRM, &action, NULL) != 0)
    return -1;
  timer.it_value.tv_sec = (time_t)due;
  timer.it_value.tv_usec = (suseconds_t)((due - (double)timer.it_value.tv_sec) * 1e6);
  limited = 1;
  return setitimer(ITIMER_REAL, &timer, NULL);
}

/* The end of the time was noticed, or the work that it limits is done. */
void separatrix_signals_no_limit(void) {
  if (!limited)
    return;
  limited = 0;
  if (received == 0)
    alarm(0);
}

int separatrix_signals_received(void) {
  if (received > 0)
    noticed = 1;
  return (int)received;
}

/* Whether SIGTERM was among them. */
int separatrix_signals_terminated(void) { return (int)terminated; }

void separatrix_signals_clear(void) {
  alarm(0);
  limited = 0;
  received = 0;
  terminated = 0;
  noticed = 0;
}

/* Sends a signal to this process. */
int separatrix_signals_raise(int number) { return raise(number); }
