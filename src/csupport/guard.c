/* SPDX-FileCopyrightText: The Separatrix developers */
/* SPDX-License-Identifier: GPL-3.0-or-later */

/* Ends the program with a message where a library loops for ever, or crashes, on a damaged file. The time is
   that of the processor, so that a slow file system is not taken for a loop. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/time.h>
#include <unistd.h>

#include "guard.h"

static const int guarded[] = {SIGPROF, SIGSEGV, SIGBUS, SIGFPE, SIGABRT};
enum { guarded_count = sizeof guarded / sizeof *guarded };

static struct sigaction before[guarded_count];
static char message[1024];
static int exit_code;
static volatile sig_atomic_t active;
static int held, timed;
/* Standard error, which is silent meanwhile: the C library has a word of its own before it aborts. */
static volatile sig_atomic_t messages = -1;

static void speak_again(void);

int separatrix_guard_messages(void) { return messages < 0 ? STDERR_FILENO : messages; }

static void give_up(int number) {
  if (!active) {
    /* Between two guards of one hold: not of the library that is guarded. */
    speak_again();
    for (size_t i = 0; i < guarded_count; i++)
      sigaction(guarded[i], &before[i], NULL);
    raise(number);
    return;
  }
  if (write(separatrix_guard_messages(), message, strlen(message)) < 0)
    _exit(exit_code);
  _exit(exit_code);
}

static void silence(void) {
  const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  messages = nowhere < 0 ? -1 : fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  if (messages >= 0)
    dup2(nowhere, STDERR_FILENO);
  if (nowhere >= 0)
    close(nowhere);
}

static void speak_again(void) {
  const int kept = messages;
  if (kept < 0)
    return;
  dup2(kept, STDERR_FILENO);
  messages = -1;
  close(kept);
}

static void install(void) {
  struct sigaction action = {0};
  action.sa_handler = give_up;
  sigemptyset(&action.sa_mask);
  for (size_t i = 0; i < guarded_count; i++)
    sigaction(guarded[i], &action, &before[i]);
  silence();
}

static void uninstall(void) {
  for (size_t i = 0; i < guarded_count; i++)
    sigaction(guarded[i], &before[i], NULL);
  speak_again();
}

/* From here to separatrix_guard_end the program ends with `code`, and prints `text`, when a library crashes
   or uses more than `seconds` of the processor (0 = no limit). Not to be nested. */
void separatrix_guard_begin(const char *text, int seconds, int code) {
  const struct itimerval limit = {{0, 0}, {seconds, 0}};
  snprintf(message, sizeof message, "separatrix: %s\n", text);
  exit_code = code;
  if (!held)
    install();
  active = 1;
  timed = seconds > 0;
  if (timed)
    setitimer(ITIMER_PROF, &limit, NULL);
}

void separatrix_guard_end(void) {
  const struct itimerval none = {{0, 0}, {0, 0}};
  if (timed)
    setitimer(ITIMER_PROF, &none, NULL);
  timed = 0;
  active = 0;
  if (!held)
    uninstall();
}

/* From here to separatrix_guard_release a guard costs a few system calls less, and standard error is silent
   between guards too. */
void separatrix_guard_hold(void) {
  if (held)
    return;
  active = 0;
  install();
  held = 1;
}

void separatrix_guard_release(void) {
  if (!held)
    return;
  held = 0;
  uninstall();
}
