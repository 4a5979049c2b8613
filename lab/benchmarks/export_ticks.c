/* Measures the ticks of a library by themselves: INPUTS COUNT SECONDS; for `aloft bench export`.
 *
 * COUNT ticks on one processor, the recorded inputs over and over; the stack that a step takes; then for some rates
 * SECONDS of ticks that begin at absolute deadlines, as in the main of a library. It prints JSON. */
#define _GNU_SOURCE
#include <pthread.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include "library.h"

enum { STACK = 1 << 20, PAINT = 0xA5 };

static uint64_t memory[(LIB_MEMORY_SIZE + 7) / 8];
static _Alignas(64) unsigned char stack[STACK];
static lib_outputs outputs;
static unsigned char *inputs;
static long rows, next;

static int64_t now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (int64_t)time.tv_sec * 1000000000 + time.tv_nsec;
}

static int32_t tick(void)
{
    if (next == rows) {
        lib_reset((LIB *)memory);
        next = 0;
    }
    return lib_step((LIB *)memory, (const lib_inputs *)(inputs + next++ * LIB_INPUT_SIZE), &outputs);
}

static int compare(const void *a, const void *b)
{
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

static void report(const char *name, int64_t *spent, long count)
{
    qsort(spent, (size_t)count, sizeof *spent, compare);
    printf("\"%s\": {\"p50\": %lld, \"p99\": %lld, \"p99_99\": %lld, \"worst\": %lld}", name,
           (long long)spent[count / 2], (long long)spent[count - 1 - count / 100],
           (long long)spent[count - 1 - count / 10000], (long long)spent[count - 1]);
}

static void *whole_jump(void *none)
{
    next = rows;
    for (long k = 0; k < rows; ++k)
        tick();
    return none;
}

static void *nothing(void *none)
{
    return none;
}

/* How much of the painted stack a thread writes. */
static long depth(void *(*body)(void *))
{
    pthread_attr_t attributes;
    pthread_t thread;
    long untouched = 0;
    memset(stack, PAINT, STACK);
    pthread_attr_init(&attributes);
    if (pthread_attr_setstack(&attributes, stack, STACK) || pthread_create(&thread, &attributes, body, NULL))
        exit(5);
    pthread_join(thread, NULL);
    while (untouched < STACK && stack[untouched] == PAINT)
        ++untouched;
    return STACK - untouched;
}

int main(int argument_count, char **arguments)
{
    static const long RATES[] = {500, 1000, 5000};
    FILE *from;
    cpu_set_t allowed, one;
    struct sched_param priority = {.sched_priority = 80};
    if (argument_count != 4 || !(from = fopen(arguments[1], "rb")))
        return 2;
    long count = atol(arguments[2]), seconds = atol(arguments[3]);
    fseek(from, 0, SEEK_END);
    rows = ftell(from) / LIB_INPUT_SIZE;
    rewind(from);
    inputs = aligned_alloc(64, ((size_t)rows * LIB_INPUT_SIZE + 63) / 64 * 64);
    int64_t *spent = calloc((size_t)(count > 5000 * seconds ? count : 5000 * seconds), sizeof *spent);
    if (!inputs || !spent || fread(inputs, LIB_INPUT_SIZE, (size_t)rows, from) != (size_t)rows)
        return 3;
    if (lib_init(memory, sizeof memory))
        return 4;
    sched_getaffinity(0, sizeof allowed, &allowed);
    int processor = CPU_SETSIZE - 1;
    while (!CPU_ISSET(processor, &allowed))
        --processor;
    CPU_ZERO(&one);
    CPU_SET(processor, &one);
    int pinned = !sched_setaffinity(0, sizeof one, &one);
    int locked = !mlockall(MCL_CURRENT | MCL_FUTURE);
    long steps = depth(whole_jump) - depth(nothing);
    int fifo = !sched_setscheduler(0, SCHED_FIFO, &priority);
    next = rows;
    for (long k = 0; k < rows; ++k)
        tick();
    for (long k = 0; k < count; ++k) {
        static const struct timespec REST = {.tv_nsec = 20000000};
        if (k % 5000 == 0) /* Linux holds up what runs with SCHED_FIFO for 95 % of a second */
            nanosleep(&REST, NULL);
        int64_t began = now();
        int32_t status = tick();
        spent[k] = now() - began;
        if (status < 0)
            return 6;
    }
    printf("{\"pinned\": %d, \"locked\": %d, \"fifo\": %d, \"stack\": %ld, ", pinned, locked, fifo, steps);
    report("tick", spent, count);
    for (size_t k = 0; k < sizeof RATES / sizeof *RATES; ++k) {
        int64_t period = 1000000000 / RATES[k], deadline = now() + period;
        long late = 0, ticks = RATES[k] * seconds;
        char name[32];
        for (long each = 0; each < ticks; ++each) {
            struct timespec until = {.tv_sec = deadline / 1000000000, .tv_nsec = deadline % 1000000000};
            while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL))
                ;
            spent[each] = now() - deadline;
            tick();
            for (deadline += period; now() > deadline; deadline += period)
                ++late;
        }
        snprintf(name, sizeof name, "wake_%ld", RATES[k]);
        printf(", \"late_%ld\": %ld, ", RATES[k], late);
        report(name, spent, ticks);
    }
    printf("}\n");
    return 0;
}
