/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Stop signals set a counter that the scheduler reads between trajectories. Where nobody has read it in time,
   within one long trajectory, the process ends by itself: working files are whole at every moment. */
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static volatile sig_atomic_t received = 0, terminated = 0, noticed = 0;

/* Seconds until a signal has to be noticed. */
enum { patience = 4, resumable = 75 };
static char farewell[1024] = "separatrix: stopped within one long trajectory\n";

static void give_up(int number) {
  (void)number;
  if (noticed || received == 0)
    return;
  if (write(STDERR_FILENO, farewell, strlen(farewell)) < 0)
    _exit(resumable);
  _exit(resumable);
}

static void count_signal(int number) {
  if (number == SIGTERM)
    terminated = 1;
  if (received == 0)
    alarm(patience);
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

int separatrix_signals_received(void) {
  if (received > 0)
    noticed = 1;
  return (int)received;
}

/* Whether SIGTERM was among them. */
int separatrix_signals_terminated(void) { return (int)terminated; }

void separatrix_signals_clear(void) {
  alarm(0);
  received = 0;
  terminated = 0;
  noticed = 0;
}

/* Sends a signal to this process. */
int separatrix_signals_raise(int number) { return raise(number); }
