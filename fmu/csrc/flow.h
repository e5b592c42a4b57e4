/* One autonomous system of differential equations, integrated by DOP853 ahead of the time that is asked for.

   A flow takes steps as long as the tolerance allows and interpolates in the last of them, so that many short
   communication steps cost one integration step. It holds no pointers: a copy of it is a saved state. */

#ifndef BARYSCOPE_FLOW_H
#define BARYSCOPE_FLOW_H

#include <stdbool.h>

#define WIDTH 8 /* both parts of the unit have at most eight states; the rest are zeros that stay zero */
#define DENSE_ORDER 7

typedef struct {
    double time;                        /* end of the last step, s since the flow was started */
    double length;                      /* of the last step; 0 before the first */
    double step;                        /* the next one's; 0 when it has to be guessed */
    double state[WIDTH];                /* at `time` */
    double rates[WIDTH];                /* at `time` */
    double previous[WIDTH];             /* state at `time - length` */
    double dense[DENSE_ORDER][WIDTH];   /* polynomial within the last step */
    double scale[WIDTH];                /* sizes of the states that the tolerance refers to */
    bool dense_known;
} Flow;

/* Rates of the state under what `context` holds. */
typedef void Rates(const void *context, const double *state, double *rates);

/* Begin anew from `state` at time 0; the length of the steps is kept. */
static void flow_start(Flow *flow, const double *state, int size);

/* Integrate until `time` is reached or passed. With `exactly`, no step goes past it: for inputs that are about to change.
   Returns NULL, or why it could not be done; then the flow is of no further use. */
static const char *flow_advance(Flow *flow, Rates *rates, const void *context, double tolerance, double time, bool exactly);

/* The state at a time within the last step. */
static void flow_interpolate(const Flow *flow, double time, double *state, int size);

#endif
