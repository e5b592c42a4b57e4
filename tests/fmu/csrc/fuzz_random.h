/* Random numbers of the harnesses: xorshift64*. */

#include <stdint.h>

static uint64_t random_state;

static uint64_t next_random(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return random_state * 2685821657736338717u;
}

static unsigned below(unsigned n) { return (unsigned)((next_random() >> 32) % n); }
static double uniform(void) { return (double)(next_random() >> 11) / 9007199254740992.0; }
