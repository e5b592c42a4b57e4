/* DOP853: Dormand and Prince's explicit Runge-Kutta method of order 8, with adaptive steps and dense output of order 7.
   Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., sections II.4 to II.6.
   The coefficients come from scipy by way of dop853.h. */

#include "integrator.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define SAFETY 0.9
#define SMALLEST_FACTOR 0.2
#define LARGEST_FACTOR 6.0
#define NEGLIGIBLE 1e-3 /* error of a step, in units of the tolerance */
#define ALL_STAGES (DOP853_STAGES + 4) /* the stages, the rates at the end, three more for dense output */

/* The first step: the one over which the state changes by one hundredth, to first order. */
static double first_step(const Integrator *integrator)
{
    double fastest = 0.0;
    for EACH(i) {
        const double size = larger(integrator->scale[i], fabs(integrator->state[i]));
        fastest = larger(fastest, fabs(integrator->rates[i]) / size);
    }
    return fastest > 0.0 ? 0.01 / fastest : 1.0;
}

/* to = from + h times the sum of weights[j] k[j] over the first `count` stages. Zero weights are constants to the compiler and
   cost nothing. */
static ALWAYS_INLINE void combine(
    double *to, const double *from, double h, const double *weights, int count,
    double k[ALL_STAGES][WIDTH])
{
    double sum[WIDTH] = {0.0};
    UNROLL for (int j = 0; j < ALL_STAGES; j++) {
        if (j >= count || weights[j] == 0.0) continue;
        for EACH(i) sum[i] += weights[j] * k[j][i];
    }
    for EACH(i) to[i] = from[i] + h * sum[i];
}

/* The error of interpolation within a step, in units of the tolerance: the rounding of the state's change. */
static double rounding_of(const Integrator *integrator, double tolerance, const double *next)
{
    double largest = 0.0;
    for EACH(i) {
        const double size = larger(integrator->scale[i], fabs(integrator->state[i]));
        largest = larger(largest, fabs(next[i] - integrator->state[i]) / size);
    }
    return largest * DBL_EPSILON / tolerance;
}

/* The error of a step in units of the tolerance (Hairer's estimate from the embedded orders 5 and 3). Where the rates hardly
   change, as far from all gravity, it lets steps grow until interpolation has no digits left. */
static double error_of(const Integrator *integrator, double tolerance, double h, double k[ALL_STAGES][WIDTH],
                       const double *next)
{
    static const double zero[WIDTH];
    double error3[WIDTH], error5[WIDTH], sum3 = 0.0, sum5 = 0.0;
    combine(error3, zero, 1.0, DOP853_E3[0], DOP853_STAGES, k);
    combine(error5, zero, 1.0, DOP853_E5[0], DOP853_STAGES, k);
    for EACH(i) {
        const double allowed = tolerance * larger(integrator->scale[i], larger(fabs(integrator->state[i]), fabs(next[i])));
        error3[i] /= allowed;
        error5[i] /= allowed;
    }
    for EACH(i) sum3 += error3[i] * error3[i];
    for EACH(i) sum5 += error5[i] * error5[i];
    const double error = sum5 == 0.0 && sum3 == 0.0 ? 0.0 : h * sum5 / sqrt((sum5 + 0.01 * sum3) * WIDTH);
    return error < NEGLIGIBLE ? larger(error, rounding_of(integrator, tolerance, next)) : error;
}

/* One trial step of length h: fills the stages and `next` and returns the error in units of the tolerance. */
static double trial(const Integrator *integrator, Rates *rates, const void *context, double tolerance, double h,
                    double k[ALL_STAGES][WIDTH], double *next)
{
    memcpy(k[0], integrator->rates, sizeof integrator->rates);
    UNROLL for (int stage = 1; stage < DOP853_STAGES; stage++) {
        combine(next, integrator->state, h, DOP853_A[stage], stage, k);
        rates(context, integrator->time + DOP853_C[0][stage] * h, next, k[stage]);
    }
    combine(next, integrator->state, h, DOP853_B[0], DOP853_STAGES, k);
    return error_of(integrator, tolerance, h, k, next);
}

static double step_factor(double error)
{
    if (!isfinite(error)) return SMALLEST_FACTOR;
    if (error == 0.0) return LARGEST_FACTOR;
    return fmin(LARGEST_FACTOR, fmax(SMALLEST_FACTOR, SAFETY / sqrt(sqrt(sqrt(error)))));
}

/* The interpolating polynomial of a step that has been taken (Hairer's form, as in scipy). */
static void make_dense(Integrator *integrator, Rates *rates, const void *context, double k[ALL_STAGES][WIDTH])
{
    static const double zero[WIDTH];
    const double h = integrator->length;
    double argument[WIDTH];
    UNROLL for (int extra = 0; extra < 3; extra++) {
        combine(argument, integrator->previous, h, DOP853_A_EXTRA[extra], DOP853_STAGES + 1 + extra, k);
        rates(context, integrator->time - h + DOP853_C_EXTRA[0][extra] * h, argument, k[DOP853_STAGES + 1 + extra]);
    }
    for EACH(i) {
        const double change = integrator->state[i] - integrator->previous[i];
        integrator->dense[0][i] = change;
        integrator->dense[1][i] = h * k[0][i] - change;
        integrator->dense[2][i] = 2.0 * change - h * (integrator->rates[i] + k[0][i]);
    }
    UNROLL for (int row = 0; row < 4; row++) combine(integrator->dense[3 + row], zero, h, DOP853_D[row], ALL_STAGES, k);
}

static const char *dop853_advance(Integrator *integrator, Rates *rates, const void *context, double tolerance, double time,
                                  bool exactly)
{
    double k[ALL_STAGES][WIDTH], next[WIDTH];
    if (integrator->length == 0.0) rates(context, integrator->time, integrator->state, integrator->rates);
    if (integrator->step <= 0.0) integrator->step = first_step(integrator);

    for (long steps = 0; integrator->time < time; steps++) {
        if (steps == MOST_STEPS) return TOO_MANY_STEPS;
        const double remaining = time - integrator->time;
        const bool cut = exactly && integrator->step >= remaining;
        const double h = cut ? remaining : integrator->step;
        const double error = trial(integrator, rates, context, tolerance, h, k, next);
        const double proposal = h * step_factor(error);
        if (error <= 1.0) {
            memcpy(integrator->previous, integrator->state, sizeof integrator->state);
            memcpy(integrator->state, next, sizeof next);
            integrator->length = h;
            integrator->time = cut ? time : integrator->time + h;
            rates(context, integrator->time, integrator->state, integrator->rates);
            memcpy(k[DOP853_STAGES], integrator->rates, sizeof integrator->rates);
            /* A step that was cut short is no reason to shorten the planned one. */
            integrator->step = cut ? fmax(integrator->step, proposal) : proposal;
            if (integrator->time > time) make_dense(integrator, rates, context, k);
        } else {
            integrator->step = proposal;
            if (!(proposal > SHORTEST_STEP * fmax(integrator->time, remaining))) return OUT_OF_BOUNDS;
        }
    }
    return NULL;
}

static void dop853_interpolate(const Integrator *integrator, double time, double *state, int size)
{
    if (time == integrator->time) {
        memcpy(state, integrator->state, (size_t)size * sizeof *state);
        return;
    }
    const double fraction = (time - (integrator->time - integrator->length)) / integrator->length;
    double sum[WIDTH] = {0.0};
    UNROLL for (int term = DOP853_DENSE_ORDER - 1; term >= 0; term--) {
        const double factor = term % 2 ? 1.0 - fraction : fraction;
        for EACH(i) sum[i] = (sum[i] + integrator->dense[term][i]) * factor;
    }
    for (int i = 0; i < size; i++) state[i] = integrator->previous[i] + sum[i];
}
