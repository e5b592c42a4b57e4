/* Random legal and illegal calls on the unit, to be compiled with the unit's all.c under sanitizers.

   Several instances of both interfaces live at once. Every call is judged by a model of its own of what FMI allows: what is
   legal must succeed, what is illegal must be refused, and a refused call must leave the instance's memory as it was, bit
   for bit. Now and then allocations fail. From time to time an instance is reset and must compute what a new one computes.
   Prints the number of calls; ends with 1 and a line on standard error at the first deviation.

   Usage: fuzz_harness CALLS SEED */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- randomness, and memory that is scarce at times ---- */

#include "fuzz_random.h"

static bool one_in(unsigned n) { return below(n) == 0; }

static long blocks, failed_allocations;
static bool scarce;

static void *fuzz_allocate(void *block)
{
    if (block) blocks++;
    return block;
}

static bool fails(void)
{
    const bool now = scarce && one_in(2);
    failed_allocations += now;
    return now;
}

static void *fuzz_malloc(size_t size) { return fails() ? NULL : fuzz_allocate(malloc(size)); }
static void *fuzz_calloc(size_t count, size_t size) { return fails() ? NULL : fuzz_allocate(calloc(count, size)); }

static void fuzz_free(void *block)
{
    if (block) blocks--;
    free(block);
}

#define malloc fuzz_malloc
#define calloc fuzz_calloc
#define free fuzz_free
#include "all.c"
#undef malloc
#undef calloc
#undef free

#include "fuzz_calls.h"

/* ---- what is judged ---- */

#define SLOTS 4
#define SAVES 3
#define MOST 6 /* references in one call */

typedef struct {
    Instance *instance;
    void *saved[SAVES];
} Slot;

static Slot slots[SLOTS];
static long calls, refusals, messages;
static double reference_outputs[2][N_OUTPUTS];

static void hear(const char *message)
{
    messages += message[0] != '\0';
    if (strchr(message, '%') || strlen(message) >= LINE_SIZE) exit(2);
}

static void stop(const char *what, const char *why)
{
    fprintf(stderr, "call %ld: %s: %s\n", calls, what, why);
    exit(1);
}

typedef enum { ILLEGAL, LEGAL, OPEN } Verdict; /* OPEN: legal, but it depends on the numbers whether it can be done */

/* Both of a condition on the call and one on its numbers. */
static Verdict both(Verdict first, bool second) { return second ? first : ILLEGAL; }

static void judge(const char *what, const Slot *slot, const Core *before, Verdict verdict, int status)
{
    calls++;
    if (status != OK && status != ERROR) stop(what, "an unknown status");
    if (status == OK && verdict == ILLEGAL) stop(what, "illegal, but accepted");
    if (status == ERROR && verdict == LEGAL) stop(what, "legal, but refused");
    if (status == OK) return;
    refusals++;
    if (memcmp(before, &slot->instance->core, sizeof *before) != 0) stop(what, "refused, but it changed the instance");
}

#define TRY(slot, verdict, call)                          \
    do {                                                  \
        const Core before = (slot)->instance->core;       \
        const Verdict expected = (verdict);               \
        judge(#call, slot, &before, expected, (int)(call)); \
    } while (0)

static unsigned mode(const Slot *slot) { return slot->instance->core.state; }
static bool in(const Slot *slot, unsigned modes) { return mode(slot) & modes; }

#define RUN_MODES (STEPPING | EVENT | CONTINUOUS)
#define SETTABLE_EARLY (INPUT | PARAMETER | TUNABLE)

/* ---- arguments ---- */

static double any_number(void)
{
    static const double odd[] = {0.0, -0.0, 1e-320, 1e-30, 1.0, -1.0, 1e30, 1e300, -1e300, 1.7976931348623157e308};
    switch (below(12)) {
    case 0: return NAN;
    case 1: return one_in(2) ? INFINITY : -INFINITY;
    case 2: return odd[below(sizeof odd / sizeof *odd)];
    default: return (uniform() - 0.5) * pow(10.0, (double)below(7) - 3.0);
    }
}

static uint32_t reference_of(unsigned kinds, Type type)
{
    for (int tries = 0; tries < 200; tries++) {
        const uint32_t reference = below(N_REFERENCES);
        if (VARIABLES[reference].kind & kinds && VARIABLES[reference].type == type) return reference;
    }
    return 0;
}

/* Some references, mostly of these kinds; tells their size and whether all of them are of `kinds` and `type`. */
static size_t references_of(uint32_t *references, size_t *size, bool *fit, unsigned kinds, Type type)
{
    const size_t count = below(MOST + 1);
    const bool pure = !one_in(4);
    *size = 0;
    *fit = true;
    for (size_t i = 0; i < count; i++) {
        references[i] = pure ? reference_of(kinds, type) : one_in(9) ? (uint32_t)next_random() : below(N_REFERENCES + 2);
        if (references[i] >= N_REFERENCES || VARIABLES[references[i]].type != type || !(VARIABLES[references[i]].kind & kinds))
            *fit = false;
        if (references[i] < N_REFERENCES) *size += (size_t)VARIABLES[references[i]].size;
    }
    return count;
}

static bool has_kind(const uint32_t *references, size_t count, unsigned kinds)
{
    for (size_t i = 0; i < count; i++)
        if (references[i] < N_REFERENCES && VARIABLES[references[i]].kind & kinds) return true;
    return false;
}

/* The length to be told: in FMI 3 now and then a wrong one. */
static size_t told(size_t size, bool *fit)
{
    if (!ARRAYS || !one_in(20)) return size;
    *fit = false;
    return size ? size - 1 : 1;
}

/* Values as long as they are told to be, so that sanitizers see it if more is read or written. */
static double *numbers(size_t count, bool *finite, double share)
{
    double *values = malloc(count ? count * sizeof *values : 1);
    *finite = true;
    for (size_t i = 0; i < count; i++) {
        values[i] = any_number();
        if (uniform() > share && !isfinite(values[i])) values[i] = 0.5;
        if (!isfinite(values[i])) *finite = false;
    }
    return values;
}

#include "fuzz_values.h"

#include "fuzz_operations.h"

int main(int argc, char **argv)
{
    if (argc != 3) return 2;
    const long wanted = atol(argv[1]);
    random_state = strtoull(argv[2], NULL, 10) * 2654435769u + 1;
    for (int kind = 0; kind < 2; kind++) fresh_outputs((Interface)kind, reference_outputs[kind]);
    for (int i = 0; i < SLOTS; i++) replace(&slots[i]);
    while (calls < wanted) {
        Slot *slot = &slots[below(SLOTS)];
        OPERATIONS[below(sizeof OPERATIONS / sizeof *OPERATIONS)](slot);
    }
    for (int i = 0; i < SLOTS; i++) release(&slots[i]);
    if (blocks != 0) stop("the end", "memory was not given back");
    printf("%ld calls, %ld refused, %ld messages, %ld allocations failed\n", calls, refusals, messages, failed_allocations);
    return 0;
}
