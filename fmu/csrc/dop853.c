/* DOP853: Dormand and Prince's explicit Runge-Kutta method of order 8 with adaptive steps.
   Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., sections II.4 and II.5.
   The coefficients come from scipy by way of tables.h. */

#include "unit.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define SAFETY 0.9
#define SMALLEST_FACTOR 0.2
#define LARGEST_FACTOR 6.0
#define ERROR_EXPONENT (-1.0 / 8.0)
#define MOST_STEPS 20000000L

static void rhs(Unit *unit, const double *state, double *rates)
{
    const double *arguments[RHS_ARGUMENTS] = {state, unit_inputs(unit), unit_parameters(unit)};
    double *results[RHS_RESULTS] = {rates};
    target_rhs(arguments, results, NULL, NULL, 0);
}

static double tolerance_of(const Unit *unit, int i, double value)
{
    return unit->tolerance * fmax(unit->scale[i], fabs(value));
}

/* The step at which the first-order change is one hundredth of the state, for a start. */
static double first_step(const Unit *unit, const double *rates)
{
    double fastest = 0.0;
    for (int i = 0; i < N_STATES; i++)
        fastest = fmax(fastest, fabs(rates[i]) / fmax(unit->scale[i], fabs(unit->state[i])));
    return fastest > 0.0 ? 0.01 / fastest : 1.0;
}

/* One trial step of length h. Returns the error in units of the tolerance; k[0] holds the rates at the start. */
static double trial(Unit *unit, double h, double k[DOP853_STAGES][N_STATES], double *next)
{
    for (int stage = 1; stage < DOP853_STAGES; stage++) {
        double increment[N_STATES] = {0.0};
        for (int j = 0; j < stage; j++) {
            const double a = DOP853_A[stage][j];
            if (a == 0.0) continue;
            for (int i = 0; i < N_STATES; i++) increment[i] += a * k[j][i];
        }
        for (int i = 0; i < N_STATES; i++) next[i] = unit->state[i] + h * increment[i];
        rhs(unit, next, k[stage]);
    }

    double slope[N_STATES] = {0.0}, error3[N_STATES] = {0.0}, error5[N_STATES] = {0.0};
    for (int j = 0; j < DOP853_STAGES; j++)
        for (int i = 0; i < N_STATES; i++) {
            slope[i] += DOP853_B[j] * k[j][i];
            error3[i] += DOP853_E3[j] * k[j][i];
            error5[i] += DOP853_E5[j] * k[j][i];
        }

    double sum3 = 0.0, sum5 = 0.0;
    for (int i = 0; i < N_STATES; i++) {
        next[i] = unit->state[i] + h * slope[i];
        const double allowed = tolerance_of(unit, i, fmax(fabs(unit->state[i]), fabs(next[i])));
        sum3 += (error3[i] / allowed) * (error3[i] / allowed);
        sum5 += (error5[i] / allowed) * (error5[i] / allowed);
    }
    if (sum5 == 0.0 && sum3 == 0.0) return 0.0;
    return fabs(h) * sum5 / sqrt((sum5 + 0.01 * sum3) * N_STATES);
}

static double step_factor(double error)
{
    if (!isfinite(error)) return SMALLEST_FACTOR;
    if (error == 0.0) return LARGEST_FACTOR;
    return fmin(LARGEST_FACTOR, fmax(SMALLEST_FACTOR, SAFETY * pow(error, ERROR_EXPONENT)));
}

/* The next step: what the error allows, cut so that the end is met without a sliver before it. */
static double cut(double h, double remaining)
{
    if (h >= remaining) return remaining;
    return 2.0 * h > remaining ? 0.5 * remaining : h;
}

/* Integrate the state over `duration` > 0; returns NULL or why it could not be done. */
static const char *dop853_advance(Unit *unit, double duration)
{
    double k[DOP853_STAGES][N_STATES], next[N_STATES];
    double done = 0.0;
    bool start_known = false;

    for (long steps = 0; done < duration; steps++) {
        if (steps == MOST_STEPS) return "the step needs more than 20 million internal steps";
        if (!start_known) rhs(unit, unit->state, k[0]);
        start_known = true;
        if (unit->step <= 0.0) unit->step = first_step(unit, k[0]);

        const double remaining = duration - done;
        const double h = cut(unit->step, remaining);
        const double error = trial(unit, h, k, next);
        const double proposal = h * step_factor(error);
        if (error <= 1.0) {
            memcpy(unit->state, next, sizeof next);
            done = h == remaining ? duration : done + h;
            /* A step cut short says nothing against the length that was planned. */
            unit->step = h < unit->step ? fmax(unit->step, proposal) : proposal;
            start_known = false;
        } else {
            unit->step = proposal;
            if (!(proposal > 16.0 * DBL_EPSILON * duration))
                return "the state grows out of bounds or the tolerance cannot be met";
        }
    }
    return NULL;
}
