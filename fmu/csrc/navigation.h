/* CentreOfMassEstimator: the online filter, and by what commands have moved the chaser. */

#ifndef BARYSCOPE_NAVIGATION_H
#define BARYSCOPE_NAVIGATION_H

#include "dialect.h"

#define ONLINE_EXPORT static PERHAPS_UNUSED
#include "online.h"

enum { MOST_PAST = 64 }; /* communication points that are remembered */

typedef struct {
    double time, moved[6]; /* s; m, m/s in C: by what commands have moved the chaser here since the point before */
} Past;

/* Why a sample, or a point of one, is left out, or all that was known; or what else is wrong with it. */
typedef enum { SAME_NUMBER, NUMBER_BACK, OLD_TIME, TIME_AHEAD, SINGULAR, UNUSABLE, TOO_STRONG, NO_STATE, N_FAULTS } Fault;

typedef struct {
    Online filter;
    double started; /* s: all other times here are since then, as the orbit's anomaly is that of the start */
    double taken, taken_time; /* number and sample.time of the last sample */
    double sighted; /* sample.time of the last one that was taken */
    double samples;
    bool told[N_FAULTS]; /* that so was the first one of them */
    double attitude[4]; /* (w, x, y, z), of the last one that fits */
    double axes[3][3];  /* of the camera at the last sample, R_C_V */
    double axes_at;     /* s, the time of that */
    double turned[3], turned_in; /* rotation vector in C from the sample before it, and s since that; 0: there is none */
    double sight[3];    /* mean of the points of the last one, in C */
    int count;
    Past past[MOST_PAST]; /* the oldest first */
} Model;

#endif
