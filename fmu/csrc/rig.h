/* StereoRig: samples that are out, and those that wait for their latency. */

#ifndef BARYSCOPE_RIG_H
#define BARYSCOPE_RIG_H

typedef struct {
    double time;               /* at which it is due, start + k T, s */
    double outputs[N_OUTPUTS]; /* what the unit shows once it is out */
} Sample;

typedef struct {
    double started;                   /* time of sample 0, s */
    double next;                      /* number of the sample that is taken next */
    int waiting;                      /* samples that are not out yet, the oldest first */
    Sample samples[MOST_PENDING + 1]; /* and the newest that is out */
} Model;

#endif
