/* Taylor's method for an autonomous quadratic system: rates that are a constant and weighted products of the states.

   The coefficients of the solution follow one from the other by convolutions, and their size gives the length of the step:
   Jorba, Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods,
   Experimental Mathematics 14 (2005). A step need not be tried twice. At a tolerance of 1e-13 orders from 18 to 22 are
   equally fast, and 14 is slower by a quarter. */

#include "flow.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum { FIRST_FACTOR = 4, N_FACTORS = 3 }; /* ω, which has a part in every product: RATE_PART in models/target.py */
#define REST 1e-100                       /* slower relative changes than this, 1/s, are none */
#define LONGEST_REACH 1e9                 /* for a body at rest, whose terms are zero */

/* Two doubles in one register. In plain arrays gcc finds some of the pairs only, and half the speed is lost. */
typedef double Pair __attribute__((vector_size(2 * sizeof(double))));
#define PAIRS (WIDTH / 2)
typedef union {
    double of[WIDTH];
    Pair pairs[PAIRS];
} Row;

/* sums[j] += left × the j-th factor in `right`. */
static inline __attribute__((always_inline)) void add_products(Row sums[N_FACTORS], const Row *left, const Row *right)
{
    UNROLL for (int j = 0; j < N_FACTORS; j++)
        UNROLL for (int i = 0; i < PAIRS; i++) sums[j].pairs[i] += left->pairs[i] * right->of[FIRST_FACTOR + j];
}

/* The coefficients from the second on, for a time that is counted in `unit`. The last ones come in last: the processor
   adds up the others while it is still at work on these. */
static inline __attribute__((always_inline)) void expand(
    Row terms[TAYLOR_ORDER + 1], double unit, Products *products, const void *context)
{
    for (int k = 1; k < TAYLOR_ORDER; k++) {
        Row sums[N_FACTORS] = {{{0.0}}};
        for (int m = 1; m < k; m++) add_products(sums, &terms[m], &terms[k - m]);
        add_products(sums, &terms[0], &terms[k]);
        add_products(sums, &terms[k], &terms[0]);
        double rates[WIDTH];
        products(context, sums[0].of, rates);
        const double factor = unit / (k + 1);
        UNROLL for (int i = 0; i < PAIRS; i++) terms[k + 1].pairs[i] = (Pair){rates[2 * i], rates[2 * i + 1]} * factor;
    }
}

/* What the sizes of the states are multiplied by to be relative ones. */
static void relate(const Flow *flow, double relative[WIDTH])
{
    for EACH(i) relative[i] = 1.0 / larger(flow->scale[i], fabs(flow->state[i]));
}

/* The mean relative size of a term. */
static double size_of(const double *term, const double relative[WIDTH])
{
    double sum = 0.0;
    for EACH(i) sum += fabs(term[i]) * relative[i];
    return sum / WIDTH;
}

/* The time, in the unit of the terms, at which each of the last two is within the tolerance; 0 if they are not finite. */
static double reach_of(const Row terms[TAYLOR_ORDER + 1], const double relative[WIDTH], double tolerance)
{
    const double last = size_of(terms[TAYLOR_ORDER].of, relative), former = size_of(terms[TAYLOR_ORDER - 1].of, relative);
    if (!isfinite(last + former)) return 0.0;
    const double of_last = pow(tolerance / last, 1.0 / TAYLOR_ORDER);
    const double of_former = pow(tolerance / former, 1.0 / (TAYLOR_ORDER - 1));
    return smaller(smaller(of_last, of_former), LONGEST_REACH);
}

/* state = start + the terms from the first on, at a time in their unit; the least come first. */
static inline void evaluate(const double *start, const double terms[TAYLOR_ORDER][WIDTH], double time, double *state, int size)
{
    double sum[WIDTH] = {0.0};
    UNROLL for (int k = TAYLOR_ORDER - 1; k >= 0; k--)
        for EACH(i) sum[i] = (sum[i] + terms[k][i]) * time;
    for (int i = 0; i < size; i++) state[i] = start[i] + sum[i];
}

/* All terms at the state, in a unit of time in which it changes by its size, and the reach of their sum. */
static inline __attribute__((always_inline)) double expand_at(
    Flow *flow, Row terms[TAYLOR_ORDER + 1], Rates *rates, Products *products, const void *context, double tolerance)
{
    double relative[WIDTH];
    relate(flow, relative);
    rates(context, flow->state, flow->rates);
    const double speed = size_of(flow->rates, relative);
    flow->unit = speed > REST ? 1.0 / speed : 1.0;
    memcpy(terms[0].of, flow->state, sizeof flow->state);
    for EACH(i) terms[1].of[i] = flow->rates[i] * flow->unit;
    expand(terms, flow->unit, products, context);
    return reach_of(terms, relative, tolerance);
}

static inline const char *taylor_advance(Flow *flow, Rates *rates, Products *products, const void *context,
                                         double tolerance, double time, bool exactly)
{
    Row terms[TAYLOR_ORDER + 1];
    for (long steps = 0; flow->time < time; steps++) {
        if (steps == MOST_STEPS) return TOO_MANY_STEPS;
        const double remaining = time - flow->time;
        const double reach = expand_at(flow, terms, rates, products, context, tolerance), planned = reach * flow->unit;
        if (!(planned > SHORTEST_STEP * fmax(flow->time, remaining))) return OUT_OF_BOUNDS;
        const bool cut = exactly && planned >= remaining;
        flow->length = cut ? remaining : planned;
        flow->time = cut ? time : flow->time + planned;
        memcpy(flow->previous, flow->state, sizeof flow->state);
        evaluate(flow->previous, &terms[1].of, cut ? remaining / flow->unit : reach, flow->state, WIDTH);
        if (flow->time > time) memcpy(flow->dense, &terms[1], sizeof flow->dense);
    }
    return NULL;
}

static void taylor_interpolate(const Flow *flow, double time, double *state, int size)
{
    if (time == flow->time) memcpy(state, flow->state, (size_t)size * sizeof *state);
    else evaluate(flow->previous, flow->dense, (time - (flow->time - flow->length)) / flow->unit, state, size);
}
