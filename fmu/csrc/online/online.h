/* The online estimator: a Kalman filter of the centre of mass, frame by frame, in fixed memory.

State: the target's attitude R_C_B, the centre of mass (r, v) from the chaser in C, and the features b in B, from the
centre of mass; C has inertial axes. A feature is seen at r + R b. The attitude is free in every frame: it is registered
against the map of the features and its error eliminated with theirs, so nothing is taken for granted of the tumble.
Further filters find rate and inertia ratios where it is a free one, or under the gravity gradient, with white torque, and
say where a feature will be.
Frames between which the target turns less than their noise are taken together first, as a node: attitudes that differ
by noise alone would seem to show the offset of the centre of mass.
r moves on the orbit that is given, else in a straight line, and besides with white acceleration, or one in a random walk: a bank
of small filters weighs what it may be by the likelihood of its innovations, and finds what the chaser's thrusters are wrong by.
Everything is in one struct without pointers: copying it saves the filter. Nothing is allocated; the time of a frame is bounded.
Only <math.h> is needed. */
#ifndef ONLINE_H
#define ONLINE_H

#if defined(ONLINE_EXPORT) /* a unit has its own functions to show */
#elif defined(_WIN32)
#define ONLINE_EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define ONLINE_EXPORT __attribute__((visibility("default")))
#else
#define ONLINE_EXPORT
#endif

/* What is beyond has another unit, or is no number at all: absolute values of a coordinate, m, of an acceleration, m/s2, and of a
   standard deviation of a point along any direction, m; and of a time, s. */
#define FARTHEST 1e9
#define LATEST 1e10

/* From one time to another under J2, and from time 0 to the first frame, s: step by step farther would take too long. */
#define FARTHEST_UNDER_J2 1e7

enum {
    MOST_FEATURES = 32,
    /* Errors of the state, in this order: a node's angular rate, shift and attitude (a rotation vector), all in C, r, v,
       features. */
    RATE = 0,
    TRANSLATION = 3,
    ATTITUDE = 6,
    POSITION = 9,
    VELOCITY = 12,
    FEATURES = 15,
    MOST_ERRORS = FEATURES + 3 * MOST_FEATURES + 1, /* and one that is none: rows of an even length are aligned alike */
    DENSITIES = 12,
    ACCELERATIONS = 8, /* deviations of an acceleration by which a path bends */
    WALKS = 2, /* spans in which a random walk makes another of it */
    STEADY = DENSITIES + ACCELERATIONS * WALKS,
    ON_ORBIT = DENSITIES + 4, /* of them where an orbit is given, from which a path departs little */
    WANDERS = 5, /* sizes by which thrusters change: kinds after STEADY, of members after ON_ORBIT once the chaser has manoeuvred on an orbit */
    EXECUTIONS = 6, /* sizes of errors that each push has of its own: kinds after these, of members after theirs */
    JUMPS = 4, /* members at most that have jumped */
    MEMBERS = STEADY + JUMPS,
    SHADOW = MEMBERS,
    STORED_NODES = 32, /* nodes that are kept */
    SCALES = 14, /* blocks of 1, 2, 4 ... sightings */
    OFFSET = 6, /* first of the errors of a member of the bank after r and v: what the offset of the features seen is wrong by */
    SCALE = OFFSET + 3, /* what the size of the map is wrong by, as a part of it */
    PATH_AND_MAP = SCALE + 1,
    OF_MAP = PATH_AND_MAP - OFFSET, /* of these, what is of the map: offset and scale */
    MOTION = PATH_AND_MAP + 3, /* of one whose path bends: its acceleration, too */
    THRUST = MOTION,    /* once the chaser has manoeuvred: what its thrusters are wrong by, a scale and a rotation vector in their axes */
    OF_THRUST = 4,
    PRODUCTS = 9, /* of two of these: of the scale and a pointing, and of two pointings */
    ERRORS = THRUST + OF_THRUST,
    ABREAST = 4, /* members of the bank that are taken at once */
    PAIRS = ERRORS * (ERRORS + 1) / 2,
    N_ELEMENTS = 7,
    SPIN = 11,     /* errors of a tumble: a rotation vector in C, rate in B, coefficients of the inertia */
    SPIN_PAIRS = SPIN * (SPIN + 1) / 2,
    TORQUES = 10,  /* densities of white torque */
    REFERENCES = 2,   /* of the tumble: free, and under the gravity gradient */
    ATTITUDES = 32 /* that are kept until it is known */
};

typedef enum { WAITING, STARTING, TRACKING, DOUBTFUL, LOST } OnlineStatus;

typedef enum {
    ACCEPTED, BAD_TIME, BAD_POINT, BAD_COVARIANCE, BAD_NAME, BAD_ACCELERATION, TOO_MANY, NO_SUCH, TOO_LATE, TOO_FAR
} OnlineResult;

/* The target's orbit: elements at time 0 of the ellipse that osculates at the epoch, and J2 with the equatorial radius that it refers to, m; 0 of
   a point mass, of which the ellipse stays. A filter's goes with its time. */
typedef struct {
    double elements[N_ELEMENTS], j2, equatorial_radius, epoch;
} OnlineOrbit;

typedef struct {
    double sigma;          /* standard deviation of a coordinate, m, where a point has no covariance of its own */
    double offset;         /* of the centre of mass from the features before the first frame, in radii of these */
    double speed;          /* of its velocity, per axis, m/s */
    double attitude_noise; /* of the camera, rad, per axis and frame */
    double thrust;         /* of the scale of an acceleration, and of its direction, rad per axis; 0: it is exact */
    double longest_gap;    /* from one frame to the next, s: a later one has a wrong time */
    double on_orbit;       /* 1: on the orbit; 0: in a straight line */
    OnlineOrbit orbit;
} OnlineOptions;

typedef struct {
    long long name;
    double last; /* time of the last sighting, s */
    double sightings;
    double refused; /* sightings in a row that did not fit */
    double exchanged; /* sightings in a row under the name of another feature, which was seen under its own */
    double information[3][3]; /* of its place in B, as if its sightings were independent, 1/m2 */
    double spread[3][3];      /* its inverse, m2; 0 where it has none */
    double stereo_sightings; /* those with a covariance */
    double last_stereo[3];   /* of the last one: ln of its range over the map's, of this, of its variance */
} Feature;

/* Sums of a feature's residuals over blocks that wait for their other halves, along C and B, of a scale each, of which `waits` has a bit; and
   the number of its last frame. */
typedef struct {
    double half[SCALES][2][3], last;
    long long waits;
} ResidualBlocks;

/* Of all features: how many blocks there were, and their squared sums over the numbers of sightings. */
typedef struct {
    double blocks[SCALES], power[2][SCALES];
} Lasting;

/* What frames of nearly the same attitude saw of a feature: sums over its sightings. */
typedef struct {
    long long name;
    double count, times, squares, cubes; /* of its times from the node's first */
    double y[3], y_times[3];             /* y is from the predicted centre of mass */
    double place[3];                     /* mean, in B, of a feature that is not in the map yet */
    double strangers;                    /* sightings of such a one that are not there */
    double noise[3][3];
} FeatureSums;

/* Frames that are taken as one, from `begin` on: until the target has turned far beyond the noise of its attitude. */
typedef struct {
    double count, begin, times, squares, used;
    double R[3][3], turn[3], turn_times[3]; /* first attitude, sums of rotation vectors in C from it */
    double drift[3], drift_times[3];        /* of the map from the predicted centre of mass */
    double by_thrust[3][OF_THRUST];              /* of what thrusters are wrong by in r, since the node before */
    double variance;                        /* of an attitude, rad2 per axis */
    double residuals, freedom;
    FeatureSums seen[MOST_FEATURES];
} Node;

/* What successive innovations of a member have in common: the last one, whitened; the sum of products of successive ones, of how many terms. */
typedef struct {
    double last[3], sum, terms;
} Trend;

typedef struct {
    double errors; /* PATH_AND_MAP, MOTION or ERRORS; others are 0 */
    double weight; /* logarithm, that of the best is 0; -INFINITY: there is none */
    double steady; /* the kind of its process noise, which is that of a member without a jump */
    double x[ERRORS];
    double P[ERRORS][ERRORS];
    Trend trend;
} Member;

/* A member as it is kept: of the covariance the lower triangle, row by row. */
typedef struct {
    double errors, weight, steady;
    double x[ERRORS];
    double P[PAIRS];
    Trend trend;
} PackedMember;

/* Of a member that has jumped. */
typedef struct {
    double parent;         /* the member that it was */
    double before[STEADY]; /* the weights of those without a jump then */
    double pending;        /* 1: the large filter has not jumped */
} Jump;

/* What moves the path in span s: x is step + F x + by_thrust e, e being what the thrusters are wrong by. turn: by which rotation vector in C the axes turn in
   which an acceleration stays. pushes: what its pushes, each in a direction of its own, make of (r, v) if they are wrong by their own size: variances of a
   coordinate of r and v, and what both have in common. */
typedef struct {
    double span, turn[3], step[6], F[6][6], by_thrust[6][OF_THRUST], pushes[3];
} Transition;

/* What moves the chaser until `end`: by how much it is moved then, (r, v) in C, and an acceleration meanwhile, by which it is
   moved besides, so far by `pushed`; and the axes in which its thrusters are fixed, R_C_D. */
typedef struct {
    double end, moved[6], acceleration[3], pushed[6], axes[3][3];
} Manoeuvre;

/* A node as the bank was given it, and the transition to it. */
typedef struct {
    Transition transition;
    double c[3], lag[3][3], offset[3][3], scale[3], by_thrust[3][OF_THRUST], bend; /* see Measurement */
    double change[OF_MAP][OF_MAP], follow[OF_MAP][OF_MAP];
    double noise[3][3], turn[3][3], both[3][3]; /* of c without what is of second order, of the attitude, of c by it */
    double moved[OF_MAP];                       /* by which offset, in B, and scale were corrected after it */
} StoredNode;

/* What is known from all frames: what the large filter's (r, v, offset) is wrong by, as the bank says, its covariance, and
   by how much the true one is wider; with the acceleration of a path that bends, and the noise of its random walk. */
typedef struct {
    double errors; /* MOTION or ERRORS; others are 0 */
    double x[ERRORS], own[ERRORS][ERRORS], wider[ERRORS][ERRORS];
    double white, jerk, wander, execution; /* densities of white acceleration and jerk, m2/s3, m2/s5, by how much the variance of thrusters grows, 1/s, and
                                              that of what each push is wrong by, as a part of it */
    double seems;       /* what was taken back as noise, over what is known of the offset */
} Posterior;

/* Attitude (w, x, y, z) B to C, rate in B, coefficients of an inertia of trace 1; 1 if the gravity gradient acts. */
typedef struct {
    double q[4], w[3], j[5], gradient;
} Spin;

/* What a spin is wrong by under white torque of one density: of the covariance the lower triangle, row by row. */
typedef struct {
    double x[SPIN], P[SPIN_PAIRS];
    double weight; /* logarithm, that of the best is 0 */
} SpinError;

/* The same under that of every density, side by side, so that compilers take several at once. */
typedef struct {
    double x[SPIN][TORQUES], P[SPIN_PAIRS][TORQUES];
    double weight[TORQUES];
} SpinErrors;

/* A tumble with or without the gravity gradient. */
typedef struct {
    double N[64], rhs[8]; /* normal equations of the inertia and of the first angular momentum in C */
    double impulse[3][5]; /* what a torque of unit coefficients has added to that since, in C */
    Spin spin;
    SpinErrors errors;
} ReferenceTumble;

/* Of a node, R_C_B, and its covariance as a rotation vector in C. */
typedef struct {
    double time, R[3][3], noise[3][3];
} Attitude;

typedef struct {
    double known;                  /* 1: the filters run */
    double pairs, turned;          /* of nodes, rad */
    double kept, skip, waits;      /* attitudes, nodes left out after each, and nodes till the next one */
    Attitude attitude[ATTITUDES];
    double misfit;                 /* running mean square of the innovations, 1 if all is well */
    ReferenceTumble reference[REFERENCES];
    Spin spin;                     /* after the last node, of the likeliest reference, with the mean of all errors taken from it */
    double P[SPIN][SPIN], torque;  /* their covariance, and the mean density */
} Tumble;

/* Of a point of the last frame that the map had: under which name it came, what it is off by in C, m, NaN where no pose was found, and 1: it
   fits. */
typedef struct {
    long long name;
    double e[3], fits;
} PointResidual;

typedef struct {
    OnlineOptions options; /* first, where Python reads them */
    double time;
    double frames; /* used */
    double lost;   /* frames in a row that did not fit the map */
    double surprises; /* frames in a row with an attitude far from the predicted one */
    /* But for the one that is none. After 18 doubles: what malloc gives for so much begins 16 bytes after where four doubles are aligned. */
    double P[MOST_ERRORS - 1][MOST_ERRORS];
    double R[3][3], rate[3], turned;   /* of the last node; angular rate in C between the last two; its time */
    double attitude[3][3], registered; /* of the last frame that fits, and its time */
    double of_rate, of_attitude;       /* variances of rate and R, over all axes */
    double reference[3][3], referred, unsure; /* attitude from which the next one is predicted, its time, its variance, rad2 */
    double x[6];                       /* r, v at `time` */
    double from[6]; /* r, v at the time of the covariances */
    Transition transition; /* since then, but for its step */
    double manoeuvred; /* 1: the chaser has, and thrusters may be wrong; by as much as the filter goes by, and the covariance */
    double thrust[OF_THRUST], of_thrust[OF_THRUST][OF_THRUST];
    double curve[PATH_AND_MAP][PRODUCTS]; /* second derivatives of what a member knows of (r, v, offset, scale) by that */
    double widest;        /* variance of the offset before the first frame, m2 */
    double first_attitude; /* variance of the attitude that the first frame shows by itself, rad2 */
    double seeming[3][3]; /* information on the offset that was taken back so far, in B, 1/m2 */
    double span;    /* from the last node to the one before, s */
    double density; /* of white acceleration, m2/s3 */
    double allowed; /* that by which the large filter goes: and what the path may bend by */
    double squares, freedom; /* of the residuals of frames, in units of the noise */
    double sightings; /* that these are of */
    double frames_per_error; /* how many frames have the same errors of the features, as far as it was allowed for */
    double noise_scale;      /* by what covariances of points are larger than told, as far as it was allowed for */
    Lasting lasting;
    double kind[5], pairs;   /* sums of products of how `last_stereo` changes, and of how many pairs of sightings */
    double used;             /* features */
    Node node;
    Feature feature[MOST_FEATURES];
    ResidualBlocks series[MOST_FEATURES];
    double b[MOST_FEATURES][3];
    double share[MOST_FEATURES][OF_MAP][3]; /* of a feature's error, in B, in the offset that the last node saw, and in the scale */
    PackedMember bank[MEMBERS + 1]; /* without a jump, with one, and the shadow */
    Jump jump[JUMPS];
    double stored_count;     /* how many nodes since the first frame are kept, -1 if there were more */
    double again;      /* variance of the offset below which they are taken again, m2 */
    Transition since_node; /* since the last node */
    PackedMember first;        /* of the bank at the first frame */
    Trend trend; /* of the likeliest member at each node */
    double likely; /* 1: its path bends */
    double excess, noisiest; /* squares of whitened innovations less their mean, in how many nodes in a row the largest density has been likeliest */
    StoredNode stored[STORED_NODES];
    Tumble tumble;
    double posterior_valid; /* 1: `posterior` is what is known at `time`, as of the last frame */
    Posterior posterior;
    double residuals; /* how many */
    PointResidual residual[MOST_FEATURES];
    double maps; /* begun so far: each has its own axes B */
} Online;

typedef struct {
    double time, status, features, density, noise_ratio, lasting, maps;
    double r[3], v[3], R[3][3];
    double covariance[6][6]; /* of r and v */
    double thrust[4], of_thrust[4][4]; /* what the thrusters are wrong by: a scale, a rotation vector in their axes, rad; covariance */
    double execution; /* standard deviation of what each push is wrong by besides, in each direction, as a part of it */
} OnlineState;

/* The chaser's acceleration in C, m/s2, and the axes in which its thrusters are fixed, R_C_D. */
typedef struct {
    double acceleration[3], axes[3][3];
} OnlineThrust;

typedef struct {
    double known; /* 1, or 0: nothing else holds */
    double R[3][3], turn[3][3]; /* attitude R_C_B, covariance of a rotation vector in C */
    double rate[3], of_rate[3][3];
    double inertia[3][3], of_inertia[5][5]; /* of trace 1; covariance of its coefficients of the basis */
} OnlineTumble;

ONLINE_EXPORT unsigned long long online_size(void);
ONLINE_EXPORT void online_start(Online *filter, const OnlineOptions *options);
/* All numbers are within the ranges above. points: count times x, y, z in C, m; covariances: count times xx, xy, xz, yy, yz, zz, m2, or NULL for sigma's;
   thrust: since the last frame. What is refused changes nothing. */
ONLINE_EXPORT int online_update(Online *filter, double time, int count, const long long *names, const double *points,
                                const double *covariances, const OnlineThrust *thrust);
/* The state at a time that is not before the last frame. */
ONLINE_EXPORT int online_predict(const Online *filter, double time, const OnlineThrust *thrust, OnlineState *state);
/* The tumble at a time that is not before the last frame. */
ONLINE_EXPORT int online_tumble(const Online *filter, double time, OnlineTumble *found);
/* Where a feature will be, in C from the chaser, m, and its covariance (3, 3); NO_SUCH where that is not known. */
ONLINE_EXPORT int online_point(const Online *filter, double time, const OnlineThrust *thrust, long long name,
                               double *position, double *covariance);
/* Names, positions in B from the centre of mass and their covariances (3, 3); returns how many. */
ONLINE_EXPORT int online_features(const Online *filter, long long *names, double *positions, double *covariances);
/* Of the points of the last frame that the map had: the names under which they came, what they are off it by in the pose that was found,
   (3) in C, m, NaN where none was, and whether they fit, 1 or 0; returns how many. */
ONLINE_EXPORT int online_residuals(const Online *filter, long long *names, double *residuals, int *fits);

#endif
