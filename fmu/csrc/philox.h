/* Random numbers by counter: Philox4x64-10 (Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", 2011).

   A draw has no state: the same key and counter give the same four numbers in any order, after a restored state, and in numpy,
   whose Philox is this one (it counts up before the first draw). models/sensor/draws.py says what key and counter are. */

#ifndef BARYSCOPE_PHILOX_H
#define BARYSCOPE_PHILOX_H

#include <stdint.h>

/* The product of two 64-bit numbers; returns its high half. */
static uint64_t philox_product(uint64_t a, uint64_t b, uint64_t *low)
{
    const uint64_t half = 0xffffffffu, a_low = a & half, a_high = a >> 32, b_low = b & half, b_high = b >> 32;
    const uint64_t middle = a_high * b_low + (a_low * b_low >> 32), other = a_low * b_high + (middle & half);
    *low = a * b;
    return a_high * b_high + (middle >> 32) + (other >> 32);
}

static void philox(const uint64_t counter[4], const uint64_t key[2], uint64_t draw[4])
{
    uint64_t c[4] = {counter[0], counter[1], counter[2], counter[3]}, k[2] = {key[0], key[1]};
    for (int round = 0; round < 10; round++) {
        uint64_t low0, low1;
        const uint64_t high0 = philox_product(0xD2E7470EE14C6C93u, c[0], &low0);
        const uint64_t high1 = philox_product(0xCA5A826395121157u, c[2], &low1);
        const uint64_t next[4] = {high1 ^ c[1] ^ k[0], low1, high0 ^ c[3] ^ k[1], low0};
        for (int i = 0; i < 4; i++) c[i] = next[i];
        k[0] += 0x9E3779B97F4A7C15u;
        k[1] += 0xBB67AE8584CAA73Bu;
    }
    for (int i = 0; i < 4; i++) draw[i] = c[i];
}

/* Four uniform numbers between 0 and 1, neither included, for a purpose, frame and feature. */
static void uniform_draws(uint64_t seed, uint64_t purpose, uint64_t frame, uint64_t feature, double uniform[4])
{
    const uint64_t key[2] = {seed, purpose}, counter[4] = {frame + 1, feature, 0, 0};
    uint64_t draw[4];
    philox(counter, key, draw);
    for (int i = 0; i < 4; i++) uniform[i] = ((double)(draw[i] >> 12) + 0.5) * 0x1p-52;
}

#endif
