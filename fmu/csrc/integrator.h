/* An integrator of a system of differential equations, which may run ahead of the time that is asked for.

   It takes steps as long as the tolerance allows and interpolates in the last one, so that many short communication steps
   share one integration step. It holds no pointers: a copy of it is a saved state.

   There are two methods. DOP853 suits any system. Taylor's method suits the attitude: its rates are products of the states, and
   of values that follow from the target's place, and each term of the Taylor series follows from the terms before it.
   Its steps are longer, and each costs less than the stages it replaces; `make benchmark` prints the time of an orbit.
   A step that is cut short because inputs change costs more than one of DOP853. */

#ifndef BARYSCOPE_INTEGRATOR_H
#define BARYSCOPE_INTEGRATOR_H

#include "dialect.h"
#include "dop853.h" /* and WIDTH, the states of the attitude; the orbit has fewer, the rest are zeros that stay zero */

#include <stdbool.h>

#define DOP853_DENSE_ORDER 7
#define TAYLOR_ORDER 20
#define EACH(i) (int i = 0; i < WIDTH; i++)

#ifndef MOST_STEPS
#define MOST_STEPS 20000000L
#endif
#define SHORTEST_STEP (16.0 * DBL_EPSILON) /* of the time */
#define TOO_MANY_STEPS "it needs more than 20 million internal steps"
#define OUT_OF_BOUNDS "the state grows out of bounds or the tolerance cannot be met"

typedef struct {
    double time;                        /* end of the last step, s since integrator_start */
    double length;                      /* of the last step; 0 before the first */
    double step;                        /* length of the next step; 0: to be estimated */
    double state[WIDTH];                /* at `time` */
    double rates[WIDTH];                /* at `time`; Taylor's method has none */
    double previous[WIDTH];             /* state at `time - length` */
    double dense[TAYLOR_ORDER][WIDTH];  /* polynomial of the last step, if that passed the time asked for */
    double unit;                        /* of time in Taylor's polynomial, s */
    double scale[WIDTH];                /* nominal sizes of the states, for the tolerance */
} Integrator;

/* The rates (time derivatives) of the state at a time since integrator_start; `context` holds parameters and inputs. */
typedef void Rates(const void *context, double time, const double *state, double *rates);

/* Start again from `state` at time 0; the length of the next step is kept. */
static void integrator_start(Integrator *integrator, const double *state, int size);

/* Integrate until `time` is reached or passed. With `exactly`, no step passes it: for inputs that are about to change.
   Returns NULL, or the reason of a failure, after which the integrator must be started again. */
static const char *dop853_advance(Integrator *integrator, Rates *rates, const void *context, double tolerance, double time,
                                  bool exactly);

/* The first `size` states at a time within the last step. */
static void dop853_interpolate(const Integrator *integrator, double time, double *state, int size);

#define PAIRS (WIDTH / 2)
typedef union {
    double of[WIDTH];
    Pair pairs[PAIRS];
} Row;

/* All terms of the series at the current state, the first at 0; returns the time, in the integrator's unit, up to which they are
   within the tolerance, or 0. */
typedef double Expansion(Integrator *integrator, Row terms[TAYLOR_ORDER + 1], const void *context, double tolerance);

/* The same two functions by Taylor's method. It is fast only where the compiler inlines the expansion. */
static ALWAYS_INLINE const char *taylor_advance(
    Integrator *integrator, Expansion *expansion, const void *context, double tolerance, double time, bool exactly);
static void taylor_interpolate(const Integrator *integrator, double time, double *state, int size);

/* What products of the states contribute to their rates; `sums` is the matrix of products, column by column. */
typedef void Products(const void *context, const double *sums, double *rates);

/* The expansion for rates that are a constant plus products of states. `ramp` is the rate of that constant, or NULL. */
static ALWAYS_INLINE double expand_products(
    Integrator *integrator, Row terms[TAYLOR_ORDER + 1], Rates *rates, Products *products, const double *ramp,
    const void *context, double tolerance);

#endif
