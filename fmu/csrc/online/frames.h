/* A frame, or a node of frames as one: its points, its pose, and what it says of the centre of mass. */
#ifndef FRAMES_H
#define FRAMES_H

/* When a point of a node was seen, which is the mean of its sightings: y = x + M R b from the predicted path x. */
typedef struct {
    double y[3];    /* from the predicted centre of mass */
    double later;   /* than the node's mean time, s */
    double swept;   /* s, by which an error of the rate turns the target */
    double M[3][3]; /* the mean rotation in C since the mean time */
    double unsteady; /* rad, what a rate that changes by its cube may turn it by besides */
} Passage;

typedef struct {
    int count;
    double y[MOST_FEATURES][3];
    double noise[MOST_FEATURES][3][3];
    double more[MOST_FEATURES][3][3]; /* covariance that a residual has besides noise and map */
    double spread[MOST_FEATURES][3][3]; /* covariance of the place in the map, in B, as if its sightings were independent */
    double W[MOST_FEATURES][3][3]; /* of a residual: noise, map and `more` */
    double square[MOST_FEATURES]; /* of the weighted residual from the last pose that was adjusted to the frame */
    double bent[MOST_FEATURES][3]; /* where the point shows its feature to be, from where the map has it, in C */
    long long name[MOST_FEATURES];
    int slot[MOST_FEATURES]; /* of the map, -1: not in it */
    int fits[MOST_FEATURES];
    double sightings[MOST_FEATURES]; /* of which a point is the mean */
    Passage passage[MOST_FEATURES];
} Frame;

typedef struct {
    double c[3], R[3][3];  /* a feature b is at c + R b */
    double covariance[6][6]; /* of (c, rotation vector in C) */
    double squares;        /* of the weighted residuals */
    double apart;          /* rad, its attitude from the predicted one */
    int count;             /* points that fit */
} Pose;

/* An attitude with the variance of its rotation vector, rad2; INFINITY where any is possible. */
typedef struct {
    double R[3][3], variance;
} PredictedAttitude;

/* How the target turns about the mean time of a node: rate and acceleration in C, with the covariance of the rate, and the
   drift of the map's centre of mass from the predicted one. If `since` is not 0, `before` is the mean rate since the node
   before, that long ago, and acceleration the rate's change from then. spread: mean square of the frames' times. by_thrust: of what
   thrusters are wrong by in r, the mean over the frames. */
typedef struct {
    double spread;
    double rate[3], acceleration[3], drift[3], covariance[3][3];
    double before[3], since;
    double by_thrust[3][OF_THRUST];
} Sweep;

/* What a node says of a member's errors: c is r - lag v + offset + scale, with matrices for v and offset, which is in B, and
   a vector for the scale.
   turn: the covariance of its attitude, from that of the whole map. bend: what of an acceleration is in c, s2. span: since the node
   before, s. seems: information on the offset, in B, that it only seems to show, 1/m2 (seeming.c), and its inverse, 0 where it has none; sharpness: that on a
   coordinate of c, 1/m2. */
typedef struct {
    const Transition *since; /* by which members have to go on first, or NULL */
    double bend, span, seems[3][3], seems_spread[3][3], sharpness;
    double by_thrust[3][OF_THRUST]; /* what of the errors of the thrusters is in c, besides what is in (r, v) */
    double c[3], lag[3][3], offset[3][3], scale[3], noise[3][3], turn[3][3];
    double weight[MOST_FEATURES]; /* of each feature of the map in what its centroid and attitude are, together 1 */
    double both[3][3];   /* the covariance of c, without what is of second order, by that of the attitude */
    /* Of offset, in B, and scale since the node before, as other features are seen: the covariance, and how what is known of them
       goes on. */
    double change[OF_MAP][OF_MAP], follow[OF_MAP][OF_MAP];
} Measurement;

#endif
