/* A sampled unit whose outputs are a function of inputs and parameters at the beginning of a step, of the time since the start and
   of the step's length. */

#ifndef BARYSCOPE_DIRECT_H
#define BARYSCOPE_DIRECT_H

typedef struct {
    double started; /* s */
} Model;

#endif
