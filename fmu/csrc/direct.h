/* A sampled unit whose outputs are a function of inputs and parameters at the beginning of a step, of the time since the start, of
   the step's length, and of what is kept from one step to the next. */

#ifndef BARYSCOPE_DIRECT_H
#define BARYSCOPE_DIRECT_H

typedef struct {
    double started; /* s */
    double kept[N_KEPT];
} Model;

#endif
