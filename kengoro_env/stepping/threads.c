/* Threads that help the thread that calls them with one piece of work.

   They are started by the first call and stay, for starting a thread takes as long as a step of a
   small robot. Between two calls a thread waits busily for LINGER and lets others run meanwhile;
   then it sleeps. */

#define _POSIX_C_SOURCE 200809L

#include <pthread.h>
#include <sched.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

enum { LINGER = 50000 }; /* [ns] */

typedef struct {
  void (*work)(void*, int64_t);
  void* argument;
  pid_t process; /* the process that started the threads */
  sem_t calls;
  atomic_bool ended;
  atomic_int_fast64_t started; /* number of threads that run */
  int64_t count; /* number of threads */
  pthread_t threads[];
} Helpers;

static int64_t now(void) {
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return (int64_t)time.tv_sec * 1000000000 + time.tv_nsec;
}

static void await_call(Helpers* h) {
  int64_t until = now() + LINGER;
  do {
    if (!sem_trywait(&h->calls)) return;
    sched_yield();
  } while (now() < until);
  while (sem_wait(&h->calls)) continue; /* a signal interrupted it */
}

static void* help(void* helpers) {
  Helpers* h = helpers;
  int64_t index = atomic_fetch_add(&h->started, 1) + 1;
  for (;;) {
    await_call(h);
    if (atomic_load(&h->ended)) return NULL;
    h->work(h->argument, index);
  }
}

static Helpers* start(int64_t count, void (*work)(void*, int64_t), void* argument) {
  Helpers* h = calloc(1, sizeof(Helpers) + (size_t)count * sizeof(pthread_t));
  if (!h) return NULL;
  h->work = work;
  h->argument = argument;
  h->process = getpid();
  sem_init(&h->calls, 0, 0);
  while (h->count < count && !pthread_create(&h->threads[h->count], NULL, help, h)) h->count++;
  return h;
}

/* Let `count` threads work beside the caller, which does not wait for them. The work gets the index
   of its thread, from 1 on. It must end at once where nothing is left, for a thread may come late,
   even in a later call.

   `helpers` is what the last call returned; NULL before the first. Fewer threads than `count`, or
   none, help where the system refuses more. */
void* call_helpers(
    void* helpers, int64_t count, void (*work)(void*, int64_t), void* argument) {
  Helpers* h = helpers;
  if (h && h->process != getpid()) h = NULL; /* a fork has no threads of its parent */
  if (!h) h = start(count, work, argument);
  if (!h) return NULL;
  int calls = 0;
  for (sem_getvalue(&h->calls, &calls); calls < h->count; calls++) sem_post(&h->calls);
  return h;
}

/* End the threads and wait for them. */
void end_helpers(void* helpers) {
  Helpers* h = helpers;
  if (!h || h->process != getpid()) return;
  atomic_store(&h->ended, 1);
  for (int64_t k = 0; k < h->count; k++) sem_post(&h->calls);
  for (int64_t k = 0; k < h->count; k++) pthread_join(h->threads[k], NULL);
  sem_destroy(&h->calls);
  free(h);
}
