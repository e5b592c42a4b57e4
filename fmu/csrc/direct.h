/* A sampled unit whose outputs are a function of inputs and parameters at the beginning of a step, its time and its length. */

#ifndef BARYSCOPE_DIRECT_H
#define BARYSCOPE_DIRECT_H

typedef struct {
    double time; /* that the outputs are of, s */
} Model;

#endif
