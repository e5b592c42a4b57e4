/* One autonomous system of differential equations, integrated ahead of the time that is asked for.

   A flow takes steps as long as the tolerance allows and interpolates in the last of them, so that many short
   communication steps cost one integration step. It holds no pointers: a copy of it is a saved state.

   There are two methods. DOP853 suits any system. The attitude without gravity gradient has rates that are a constant and
   products of its states, so that the terms of its Taylor series follow from each other: Taylor's method then takes longer
   steps, of which each costs less than the stages it replaces. `make benchmark` prints the time of an orbit either way.
   The price is that a step which inputs cut short costs more. */

#ifndef BARYSCOPE_FLOW_H
#define BARYSCOPE_FLOW_H

#include <stdbool.h>

#define WIDTH 8 /* both parts of the unit have at most eight states; the rest are zeros that stay zero */
#define DOP853_DENSE_ORDER 7
#define TAYLOR_ORDER 20
#define EACH(i) (int i = 0; i < WIDTH; i++)
#define UNROLL _Pragma("GCC unroll 16")

#ifndef MOST_STEPS
#define MOST_STEPS 20000000L
#endif
#define SHORTEST_STEP (16.0 * DBL_EPSILON) /* of the time */
#define TOO_MANY_STEPS "it needs more than 20 million internal steps"
#define OUT_OF_BOUNDS "the state grows out of bounds or the tolerance cannot be met"

typedef struct {
    double time;                        /* end of the last step, s since the flow was started */
    double length;                      /* of the last step; 0 before the first */
    double step;                        /* the next one's; 0 when it has to be guessed */
    double state[WIDTH];                /* at `time` */
    double rates[WIDTH];                /* at `time`; by Taylor's method, of `previous` */
    double previous[WIDTH];             /* state at `time - length` */
    double dense[TAYLOR_ORDER][WIDTH];  /* polynomial within the last step, if it went past the time asked for */
    double unit;                        /* of time in Taylor's polynomial, s */
    double scale[WIDTH];                /* sizes of the states that the tolerance refers to */
} Flow;

/* Rates of the state under what `context` holds. */
typedef void Rates(const void *context, const double *state, double *rates);

/* Begin anew from `state` at time 0; the length of the steps is kept. */
static void flow_start(Flow *flow, const double *state, int size);

/* Integrate until `time` is reached or passed. With `exactly`, no step goes past it: for inputs that are about to change.
   Returns NULL, or why it could not be done; then the flow is of no further use. */
static const char *dop853_advance(Flow *flow, Rates *rates, const void *context, double tolerance, double time, bool exactly);

/* The state at a time within the last step. */
static void dop853_interpolate(const Flow *flow, double time, double *state, int size);

/* What the products of the states contribute to their rates; `sums` is the matrix of products, column by column. */
typedef void Products(const void *context, const double *sums, double *rates);

/* The same two by Taylor's method, for rates that are constants and products. It is fast where the calls of `products`
   are compiled in place. */
static inline __attribute__((always_inline)) const char *taylor_advance(
    Flow *flow, Rates *rates, Products *products, const void *context, double tolerance, double time, bool exactly);
static void taylor_interpolate(const Flow *flow, double time, double *state, int size);

#endif
