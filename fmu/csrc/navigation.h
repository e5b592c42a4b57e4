/* CentreOfMassEstimator: the online filter, and how the chaser's velocity was changed by commands so far. */

#ifndef BARYSCOPE_NAVIGATION_H
#define BARYSCOPE_NAVIGATION_H

#define ONLINE_EXPORT static
#include "online.h"

enum { MOST_PAST = 64 }; /* communication points that are remembered */

typedef struct {
    double time, change[3]; /* s; m/s in C since the start, by commands */
} Past;

typedef struct {
    Online filter;
    double started; /* s: all other times here are since then, as the orbit's anomaly is that of the start */
    double taken;   /* number of the last sample */
    double samples;
    double attitude[4]; /* (w, x, y, z), of the last one that fits */
    int count;
    Past past[MOST_PAST]; /* the oldest first */
} Model;

#endif
