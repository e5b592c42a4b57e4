/* Taylor's method: for rates that are a constant and weighted products of the states, here; for others, by terms that come
   from generated code.

   Each coefficient of the solution follows from those before it by convolutions, and their size gives the length of the
   step, so that no step is rejected: Jorba, Zou, A software package for the numerical integration of ODEs by means of
   high-order Taylor methods, Experimental Mathematics 14 (2005). At a tolerance of 1e-13, orders from 18 to 22 are equally
   fast, and order 14 is slower by a quarter. */

#include "integrator.h"

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

enum { FIRST_FACTOR = 4, N_FACTORS = 3 }; /* the rate, a factor of every product: RATE_PART in models/target.py */
#define REST 1e-100                       /* relative changes slower than this, 1/s, count as rest */
#define LONGEST_REACH 1e9                 /* for a body at rest, whose terms are zero */

/* sums[j] += left times the j-th factor in `right`. */
static ALWAYS_INLINE void add_products(Row sums[N_FACTORS], const Row *left, const Row *right)
{
    UNROLL for (int j = 0; j < N_FACTORS; j++)
        UNROLL for (int i = 0; i < PAIRS; i++)
            sums[j].pairs[i] = SUM(sums[j].pairs[i], SCALED(left->pairs[i], right->of[FIRST_FACTOR + j]));
}

/* What a ramp, a rate of the rates that is constant over the step, adds to the second coefficient. */
static SELDOM void add_ramp(Row *terms, double unit, const double *ramp)
{
    for EACH(i) terms[2].of[i] += 0.5 * unit * unit * ramp[i];
}

/* The coefficients from the second on, with time in multiples of `unit`. The products of the newest coefficient are added
   last, so that the processor can add the others while it still computes that one. */
static ALWAYS_INLINE void expand(
    Row terms[TAYLOR_ORDER + 1], double unit, Products *products, const double *ramp, const void *context)
{
    const int ramped = ramp ? 1 : 0; /* the one comparison in the loop */
    for (int k = 1; k < TAYLOR_ORDER; k++) {
        Row sums[N_FACTORS] = {{{0.0}}};
        for (int m = 1; m < k; m++) add_products(sums, &terms[m], &terms[k - m]);
        add_products(sums, &terms[0], &terms[k]);
        add_products(sums, &terms[k], &terms[0]);
        double rates[WIDTH];
        products(context, sums[0].of, rates);
        const double factor = unit / (k + 1);
        UNROLL for (int i = 0; i < PAIRS; i++)
            terms[k + 1].pairs[i] = SCALED(PAIR(rates[2 * i], rates[2 * i + 1]), factor);
        if (k == ramped) add_ramp(terms, unit, ramp);
    }
}

/* The factors that make the states relative to their sizes. */
static void relate(const Integrator *integrator, double relative[WIDTH])
{
    for EACH(i) relative[i] = 1.0 / larger(integrator->scale[i], fabs(integrator->state[i]));
}

/* The mean relative size of a term. */
static double size_of(const double *term, const double relative[WIDTH])
{
    double sum = 0.0;
    for EACH(i) sum += fabs(term[i]) * relative[i];
    return sum / WIDTH;
}

static inline double integer_power(double x, int n)
{
    double power = 1.0;
    for (; n; n /= 2, x *= x)
        if (n % 2) power *= x;
    return power;
}

/* x^(-1/n) to three digits, n above 4, by a Newton step without a division from fits of log2 and 2^x. pow would do, but a
   library linked against it asks for the glibc of the machine that it is built on, and other platforms have another pow. */
static inline double inverse_root_of(double x, int n)
{
    if (!isfinite(x)) return 0.0;
    if (!(x >= DBL_MIN)) return INFINITY;
    const double share = 1.0 / n;
    uint64_t bits; /* of a double: the exponent stands above 52 bits of the mantissa */
    memcpy(&bits, &x, sizeof bits);
    const double binary = (1023.0 - (double)bits * (1.0 / 4503599627370496.0)) * share; /* log2(1 + m) is taken for m */
    const int whole = (int)binary - (binary < 0.0);
    const double rest = binary - whole;
    bits = (uint64_t)(whole + 1023) << 52;
    double root;
    memcpy(&root, &bits, sizeof root);
    root *= 1.0 + rest * (0.6565 + 0.3435 * rest);
    return root + root * (1.0 - x * integer_power(root, n)) * share;
}

/* The time, in the unit of the terms, up to which the last two of them are within the tolerance; 0 if they are not finite. */
static inline double reach_of(const Row *terms, int order, const double relative[WIDTH], double tolerance)
{
    const double last = size_of(terms[order].of, relative), former = size_of(terms[order - 1].of, relative);
    if (!isfinite(last + former)) return 0.0;
    double reach = inverse_root_of(last / tolerance, order);
    if (former * integer_power(reach, order - 1) > tolerance)
        reach = smaller(reach, inverse_root_of(former / tolerance, order - 1));
    return smaller(reach, LONGEST_REACH);
}

/* Whether the last two terms are within the tolerance at a time in their unit: quicker than their reach. */
static inline bool is_within(const Row *terms, int order, const double relative[WIDTH], double tolerance, double time)
{
    double power = 1.0;
    for (int k = 1; k < order; k++) power *= time;
    return size_of(terms[order - 1].of, relative) * power <= tolerance &&
           size_of(terms[order].of, relative) * power * time <= tolerance;
}

/* state = start + the terms from the first on, at a time in their unit; the smallest are added first. */
static inline void evaluate(const double *start, const double terms[TAYLOR_ORDER][WIDTH], double time, double *state, int size)
{
    double sum[WIDTH] = {0.0};
    UNROLL for (int k = TAYLOR_ORDER - 1; k >= 0; k--)
        for EACH(i) sum[i] = (sum[i] + terms[k][i]) * time;
    for (int i = 0; i < size; i++) state[i] = start[i] + sum[i];
}

/* The first term is the state, and the second begins as its rates. */
static ALWAYS_INLINE void begin_terms(const Integrator *integrator, Row terms[TAYLOR_ORDER + 1], double relative[WIDTH])
{
    relate(integrator, relative);
    memcpy(terms[0].of, integrator->state, sizeof integrator->state);
}

/* The unit is a time over which the state changes by its own size; the second term goes from rates to that unit. */
static ALWAYS_INLINE void choose_unit(Integrator *integrator, Row terms[TAYLOR_ORDER + 1], const double relative[WIDTH])
{
    const double speed = size_of(terms[1].of, relative);
    integrator->unit = speed > REST ? 1.0 / speed : 1.0;
    for EACH(i) terms[1].of[i] *= integrator->unit;
}

static ALWAYS_INLINE double expand_products(
    Integrator *integrator, Row terms[TAYLOR_ORDER + 1], Rates *rates, Products *products, const double *ramp,
    const void *context, double tolerance)
{
    double relative[WIDTH];
    begin_terms(integrator, terms, relative);
    rates(context, integrator->time, integrator->state, terms[1].of);
    choose_unit(integrator, terms, relative);
    expand(terms, integrator->unit, products, ramp, context);
    return reach_of(terms, TAYLOR_ORDER, relative, tolerance);
}

static inline const char *taylor_advance(Integrator *integrator, Expansion *expansion, const void *context,
                                         double tolerance, double time, bool exactly)
{
    Row terms[TAYLOR_ORDER + 1];
    const double(*series)[WIDTH] = (const double(*)[WIDTH])&terms[1].of;
    for (long steps = 0; integrator->time < time; steps++) {
        if (steps == MOST_STEPS) return TOO_MANY_STEPS;
        const double remaining = time - integrator->time;
        const double reach = expansion(integrator, terms, context, tolerance);
        const double planned = reach * integrator->unit;
        if (!(planned > SHORTEST_STEP * larger(integrator->time, remaining))) return OUT_OF_BOUNDS;
        const bool cut = exactly && planned >= remaining;
        integrator->length = cut ? remaining : planned;
        integrator->time = cut ? time : integrator->time + planned;
        memcpy(integrator->previous, integrator->state, sizeof integrator->state);
        evaluate(integrator->previous, series, cut ? remaining / integrator->unit : reach, integrator->state, WIDTH);
        if (integrator->time > time) memcpy(integrator->dense, &terms[1], sizeof integrator->dense);
    }
    return NULL;
}

static void taylor_interpolate(const Integrator *integrator, double time, double *state, int size)
{
    if (time == integrator->time) {
        memcpy(state, integrator->state, (size_t)size * sizeof *state);
        return;
    }
    const double elapsed = (time - (integrator->time - integrator->length)) / integrator->unit;
    evaluate(integrator->previous, integrator->dense, elapsed, state, size);
}
