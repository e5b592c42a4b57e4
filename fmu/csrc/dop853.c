/* DOP853: Dormand and Prince's explicit Runge-Kutta method of order 8, with adaptive steps and dense output of order 7.
   Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., sections II.4 to II.6.
   The coefficients come from scipy by way of dop853.h. */

#include "flow.h"

#include "dop853.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define SAFETY 0.9
#define SMALLEST_FACTOR 0.2
#define LARGEST_FACTOR 6.0
#define ALL_STAGES (DOP853_STAGES + 4) /* the stages, the rates at the end, three more for dense output */

/* The step at which the first-order change is one hundredth of the state, for a start. */
static double first_step(const Flow *flow)
{
    double fastest = 0.0;
    for EACH(i) fastest = larger(fastest, fabs(flow->rates[i]) / larger(flow->scale[i], fabs(flow->state[i])));
    return fastest > 0.0 ? 0.01 / fastest : 1.0;
}

/* to = from + h Σ weights[j] k[j] over the first `count` stages; what is zero in the tables costs nothing. */
static inline __attribute__((always_inline)) void combine(
    double *restrict to, const double *restrict from, double h, const double *weights, int count,
    const double k[ALL_STAGES][WIDTH])
{
    double sum[WIDTH] = {0.0};
    UNROLL for (int j = 0; j < ALL_STAGES; j++) {
        if (j >= count || weights[j] == 0.0) continue;
        for EACH(i) sum[i] += weights[j] * k[j][i];
    }
    for EACH(i) to[i] = from[i] + h * sum[i];
}

/* The error of a step in units of the tolerance (Hairer's estimate from the embedded orders 5 and 3). */
static double error_of(const Flow *flow, double tolerance, double h, const double k[ALL_STAGES][WIDTH], const double *next)
{
    static const double zero[WIDTH];
    double error3[WIDTH], error5[WIDTH], sum3 = 0.0, sum5 = 0.0;
    combine(error3, zero, 1.0, DOP853_E3[0], DOP853_STAGES, k);
    combine(error5, zero, 1.0, DOP853_E5[0], DOP853_STAGES, k);
    for EACH(i) {
        const double allowed = tolerance * larger(flow->scale[i], larger(fabs(flow->state[i]), fabs(next[i])));
        error3[i] /= allowed;
        error5[i] /= allowed;
    }
    for EACH(i) sum3 += error3[i] * error3[i];
    for EACH(i) sum5 += error5[i] * error5[i];
    if (sum5 == 0.0 && sum3 == 0.0) return 0.0;
    return h * sum5 / sqrt((sum5 + 0.01 * sum3) * WIDTH);
}

/* One trial step of length h: fills the stages and `next`, returns the error in units of the tolerance. */
static double trial(const Flow *flow, Rates *rates, const void *context, double tolerance, double h,
                    double k[ALL_STAGES][WIDTH], double *next)
{
    memcpy(k[0], flow->rates, sizeof flow->rates);
    UNROLL for (int stage = 1; stage < DOP853_STAGES; stage++) {
        combine(next, flow->state, h, DOP853_A[stage], stage, k);
        rates(context, next, k[stage]);
    }
    combine(next, flow->state, h, DOP853_B[0], DOP853_STAGES, k);
    return error_of(flow, tolerance, h, k, next);
}

static double step_factor(double error)
{
    if (!isfinite(error)) return SMALLEST_FACTOR;
    if (error == 0.0) return LARGEST_FACTOR;
    return fmin(LARGEST_FACTOR, fmax(SMALLEST_FACTOR, SAFETY / sqrt(sqrt(sqrt(error)))));
}

/* The interpolating polynomial of a step that has been taken (Hairer's form, as in scipy). */
static void make_dense(Flow *flow, Rates *rates, const void *context, double k[ALL_STAGES][WIDTH])
{
    static const double zero[WIDTH];
    const double h = flow->length;
    double argument[WIDTH];
    UNROLL for (int extra = 0; extra < 3; extra++) {
        combine(argument, flow->previous, h, DOP853_A_EXTRA[extra], DOP853_STAGES + 1 + extra, k);
        rates(context, argument, k[DOP853_STAGES + 1 + extra]);
    }
    for EACH(i) {
        const double change = flow->state[i] - flow->previous[i];
        flow->dense[0][i] = change;
        flow->dense[1][i] = h * k[0][i] - change;
        flow->dense[2][i] = 2.0 * change - h * (flow->rates[i] + k[0][i]);
    }
    UNROLL for (int row = 0; row < 4; row++) combine(flow->dense[3 + row], zero, h, DOP853_D[row], ALL_STAGES, k);
}

static const char *dop853_advance(Flow *flow, Rates *rates, const void *context, double tolerance, double time, bool exactly)
{
    double k[ALL_STAGES][WIDTH], next[WIDTH];
    if (flow->length == 0.0) rates(context, flow->state, flow->rates);
    if (flow->step <= 0.0) flow->step = first_step(flow);

    for (long steps = 0; flow->time < time; steps++) {
        if (steps == MOST_STEPS) return TOO_MANY_STEPS;
        const double remaining = time - flow->time;
        const bool cut = exactly && flow->step >= remaining;
        const double h = cut ? remaining : flow->step;
        const double error = trial(flow, rates, context, tolerance, h, k, next);
        const double proposal = h * step_factor(error);
        if (error <= 1.0) {
            memcpy(flow->previous, flow->state, sizeof flow->state);
            memcpy(flow->state, next, sizeof next);
            rates(context, flow->state, flow->rates);
            memcpy(k[DOP853_STAGES], flow->rates, sizeof flow->rates);
            flow->length = h;
            flow->time = cut ? time : flow->time + h;
            /* A step cut short says nothing against the length that was planned. */
            flow->step = cut ? fmax(flow->step, proposal) : proposal;
            if (flow->time > time) make_dense(flow, rates, context, k);
        } else {
            flow->step = proposal;
            if (!(proposal > SHORTEST_STEP * fmax(flow->time, remaining))) return OUT_OF_BOUNDS;
        }
    }
    return NULL;
}

static void dop853_interpolate(const Flow *flow, double time, double *state, int size)
{
    if (time == flow->time) {
        memcpy(state, flow->state, (size_t)size * sizeof *state);
        return;
    }
    const double forth = (time - (flow->time - flow->length)) / flow->length, back = 1.0 - forth;
    double sum[WIDTH] = {0.0};
    UNROLL for (int term = DOP853_DENSE_ORDER - 1; term >= 0; term--) {
        const double factor = term % 2 ? back : forth;
        for EACH(i) sum[i] = (sum[i] + flow->dense[term][i]) * factor;
    }
    for (int i = 0; i < size; i++) state[i] = flow->previous[i] + sum[i];
}
