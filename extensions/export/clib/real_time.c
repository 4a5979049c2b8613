/* Runs the library in a process of its own and exchanges its inputs and outputs over shared memory.
 *
 *     main MEMORY [--lockstep] [--priority N]
 *
 * MEMORY is a file that this process makes, best in /dev/shm; export.CLibrary with `memory: MEMORY` is the
 * other side. In real time a tick is made in every period of the library, with the newest inputs; deadlines that
 * were missed are counted, and told at the end. With --lockstep a tick is made whenever inputs are given. */
#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <semaphore.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

enum { MARK = 0x31545241 }; /* "ART1" */

typedef struct {
    _Atomic uint32_t mark; /* set when all else is ready */
    int32_t lockstep;
    char graph_hash[64];
    int64_t input_bytes, output_bytes;
    int32_t status, block;
    int64_t ticks, missed, worst_ns; /* ticks, missed deadlines, the longest from the start of a period to its end */
    _Atomic uint64_t given, found;   /* odd while inputs, or outputs, are being written */
    union {
        sem_t semaphore;
        char bytes[64];
    } inputs_ready, outputs_ready;
    unsigned char ports[]; /* inputs, and at the next multiple of 64 outputs */
} shared;

static uint64_t memory[(LIB_MEMORY_SIZE + 7) / 8];
static volatile sig_atomic_t ends;
static shared *with = MAP_FAILED;

static void end(int number)
{
    (void)number;
    ends = 1;
    sem_post(&with->inputs_ready.semaphore); /* a wait that is about to begin ends, too */
}

static int64_t now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (int64_t)time.tv_sec * 1000000000 + time.tv_nsec;
}

static void tick(const lib_inputs *inputs, lib_outputs *outputs)
{
    lib *self = (lib *)memory;
    with->status = lib_step(self, inputs, outputs);
    with->block = lib_last_block(self);
    with->ticks += 1;
}

static void run_in_lockstep(lib_inputs *inputs, lib_outputs *outputs)
{
    while (!ends) {
        if (sem_wait(&with->inputs_ready.semaphore) || ends)
            continue;
        tick(inputs, outputs);
        sem_post(&with->outputs_ready.semaphore);
    }
}

/* Take the newest inputs; those before where they are just being written. */
static int take(const void *from, lib_inputs *to)
{
    static lib_inputs newest;
    uint64_t before = atomic_load_explicit(&with->given, memory_order_acquire);
    if (before == 0)
        return 0;
    memcpy(&newest, from, sizeof newest);
    atomic_thread_fence(memory_order_acquire);
    if (before % 2 == 0 && atomic_load_explicit(&with->given, memory_order_relaxed) == before)
        *to = newest;
    return before > 1;
}

static void give(const lib_outputs *from, void *to)
{
    uint64_t count = atomic_load_explicit(&with->found, memory_order_relaxed);
    atomic_store_explicit(&with->found, count + 1, memory_order_relaxed);
    atomic_thread_fence(memory_order_release);
    memcpy(to, from, sizeof *from);
    atomic_store_explicit(&with->found, count + 2, memory_order_release);
}

static void run_in_real_time(const void *given, void *found)
{
    static lib_inputs inputs;
    static lib_outputs outputs;
    const int64_t period = (int64_t)(LIB_PERIOD * 1e9 + 0.5);
    int64_t begin = now();
    int begun = 0;
    while (!ends) {
        struct timespec until = {begin / 1000000000, begin % 1000000000};
        if (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL))
            continue;
        begun = take(given, &inputs) || begun;
        if (begun) {
            tick(&inputs, &outputs);
            give(&outputs, found);
        }
        int64_t spent = now() - begin;
        if (begun && spent > with->worst_ns)
            with->worst_ns = spent;
        with->missed += begun && spent > period;
        begin += (1 + spent / period) * period; /* periods that have passed are left out */
    }
}

int main(int count, char **arguments)
{
    int lockstep = 0, priority = 80;
    for (int k = 2; k < count; ++k)
        if (!strcmp(arguments[k], "--lockstep"))
            lockstep = 1;
        else if (!strcmp(arguments[k], "--priority") && k + 1 < count)
            priority = atoi(arguments[++k]);
        else
            count = 0;
    if (count < 2) {
        fprintf(stderr, "use: %s MEMORY [--lockstep] [--priority N]\n", arguments[0]);
        return 2;
    }
    const size_t place = (sizeof(lib_inputs) + 63) / 64 * 64, size = sizeof(shared) + place + sizeof(lib_outputs);
    unlink(arguments[1]);
    int file = open(arguments[1], O_RDWR | O_CREAT | O_EXCL, 0600);
    if (file >= 0 && !ftruncate(file, (off_t)size))
        with = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (with == MAP_FAILED) {
        fprintf(stderr, "%s: %s\n", arguments[1], strerror(errno));
        return 1;
    }
    if (lib_init(memory, sizeof memory) || sem_init(&with->inputs_ready.semaphore, 1, 0) ||
        sem_init(&with->outputs_ready.semaphore, 1, 0))
        return 1;
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = end;
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    if (mlockall(MCL_CURRENT | MCL_FUTURE))
        fprintf(stderr, "memory is not locked: %s\n", strerror(errno));
    struct sched_param scheduling = {.sched_priority = priority};
    if (!lockstep && sched_setscheduler(0, SCHED_FIFO, &scheduling))
        fprintf(stderr, "SCHED_FIFO is not permitted: %s\n", strerror(errno));
    with->lockstep = lockstep;
    with->input_bytes = sizeof(lib_inputs);
    with->output_bytes = sizeof(lib_outputs);
    with->block = -1;
    memcpy(with->graph_hash, LIB_GRAPH_HASH, sizeof with->graph_hash);
    atomic_store_explicit(&with->mark, MARK, memory_order_release);
    if (lockstep)
        run_in_lockstep((lib_inputs *)with->ports, (lib_outputs *)(with->ports + place));
    else
        run_in_real_time(with->ports, with->ports + place);
    fprintf(stderr, "%lld ticks, %lld deadlines missed, longest %.1f us, last status %d\n", (long long)with->ticks,
            (long long)with->missed, (double)with->worst_ns * 1e-3, (int)with->status);
    unlink(arguments[1]);
    return with->status < 0;
}
