/* The features, one by one: place and normal in C, and their derivatives, by the functions of one feature in model.c. */

#include "unit.h"

#include <string.h>

enum {
    POSE_SIZE = 12, /* of the target: position in C and R_I_B */
    FEATURE_SIZE = 6,
    SIGHT_SIZE = POSE_SIZE + FEATURE_SIZE,
    N_SEEN = FEATURE_SIZE * N_FEATURES, /* outputs begin with them: all places, then all normals; parameters have them likewise */
    BODY_IN_KNOWNS = N_INPUTS + AT_TARGET_FEATURES - AT_PARAMETERS /* of the derivatives */
};

static inline void take_feature(const double all[N_SEEN], int feature, double one[FEATURE_SIZE])
{
    for (int k = 0; k < 3; k++) one[k] = all[3 * feature + k], one[3 + k] = all[3 * (N_FEATURES + feature) + k];
}

static inline void put_feature(const double one[FEATURE_SIZE], int feature, double all[N_SEEN])
{
    for (int k = 0; k < 3; k++) all[3 * feature + k] = one[k], all[3 * (N_FEATURES + feature) + k] = one[3 + k];
}

static void see_features(const double *pose, const double body[N_SEEN], double seen[N_SEEN])
{
    for (int feature = 0; feature < N_FEATURES; feature++) {
        double from[FEATURE_SIZE], to[FEATURE_SIZE];
        const double *arguments[] = {pose, from};
        double *results[] = {to};
        take_feature(body, feature, from);
        target_sight(arguments, results, NULL, NULL, 0);
        put_feature(to, feature, seen);
    }
}

/* The image of seeds of pose and body in what is seen. */
static void see_forward(const double *pose, const double body[N_SEEN], const double *pose_seed, const double body_seed[N_SEEN],
                        double seen_image[N_SEEN])
{
    double from[FEATURE_SIZE], seed[SIGHT_SIZE], image[FEATURE_SIZE];
    const double *arguments[] = {pose, from, seed};
    double *results[] = {image};
    memcpy(seed, pose_seed, POSE_SIZE * sizeof *seed);
    for (int feature = 0; feature < N_FEATURES; feature++) {
        take_feature(body, feature, from);
        take_feature(body_seed, feature, seed + POSE_SIZE);
        target_sight_forward(arguments, results, NULL, NULL, 0);
        put_feature(image, feature, seen_image);
    }
}

/* The images of a seed of what is seen in pose and body. */
static void see_reverse(const double *pose, const double body[N_SEEN], const double seen_seed[N_SEEN], double *pose_image,
                        double body_image[N_SEEN])
{
    double from[FEATURE_SIZE], seed[FEATURE_SIZE], image[SIGHT_SIZE];
    const double *arguments[] = {pose, from, seed};
    double *results[] = {image};
    memset(pose_image, 0, POSE_SIZE * sizeof *pose_image);
    for (int feature = 0; feature < N_FEATURES; feature++) {
        take_feature(body, feature, from);
        take_feature(seen_seed, feature, seed);
        target_sight_reverse(arguments, results, NULL, NULL, 0);
        for (int k = 0; k < POSE_SIZE; k++) pose_image[k] += image[k];
        put_feature(image + POSE_SIZE, feature, body_image);
    }
}
