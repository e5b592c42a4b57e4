/* The online estimator, after the generated steps of orbit and attitude. */
#include <math.h>
#include <stddef.h>

#include "dialect.h"
#include "online.h"
#include "small.h"
#include "frames.h"

#include "inertia_basis.h"

/* A transition, which generated functions store by columns. */
static void from_columns(const double columns[36], double F[6][6]) {
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) F[i][j] = columns[6 * j + i];
}

/* [r; v] in C to the end of a step, and the transition. */
static void relative_step(double begin, double end, const double *elements, double x[6], double F[6][6]) {
    double from[6], columns[36], work[relative_SZ_W];
    for (int k = 0; k < 6; k++) from[k] = x[k];
    const double *arguments[relative_SZ_ARG] = {&begin, &end, elements, from};
    double *results[relative_SZ_RES] = {x, columns};
    relative(arguments, results, (int[relative_SZ_IW + 1]){0}, work, 0);
    from_columns(columns, F);
}

/* By one step under J2: the target's place, (r, v) from the centre, and that of `relative_step`. */
static void oblate_step(double T, const double body[3], double place[6], double x[6], double F[6][6]) {
    double from[6], there[6], columns[36], work[oblate_SZ_W];
    for (int k = 0; k < 6; k++) from[k] = x[k], there[k] = place[k];
    const double *arguments[oblate_SZ_ARG] = {&T, body, there, from};
    double *results[oblate_SZ_RES] = {place, x, columns};
    oblate(arguments, results, (int[oblate_SZ_IW + 1]){0}, work, 0);
    from_columns(columns, F);
}

/* The target's place at a time, on the ellipse that osculates. */
static void place_on(const OnlineOrbit *orbit, double time, double place[6]) {
    double work[target_place_SZ_W];
    const double *arguments[target_place_SZ_ARG] = {&time, orbit->elements};
    double *results[target_place_SZ_RES] = {place};
    target_place(arguments, results, (int[target_place_SZ_IW + 1]){0}, work, 0);
}

/* The orbit has another epoch, at which the target is at a place. */
static void osculate(OnlineOrbit *orbit, double epoch, const double place[6]) {
    double work[osculating_SZ_W];
    const double mu = orbit->elements[N_ELEMENTS - 1];
    const double *arguments[osculating_SZ_ARG] = {&epoch, place, &mu};
    double *results[osculating_SZ_RES] = {orbit->elements};
    osculating(arguments, results, (int[osculating_SZ_IW + 1]){0}, work, 0);
    orbit->epoch = epoch;
}

/* The axis of the gravity gradient in C at a time, 1/s; zero without an orbit. */
static void gravity_gradient(const OnlineOptions *options, double time, double axis[3]) {
    double work[gradient_axis_SZ_W];
    for (int k = 0; k < 3; k++) axis[k] = 0.0;
    if (options->on_orbit == 0.0) return;
    const double *arguments[gradient_axis_SZ_ARG] = {&time, options->orbit.elements};
    double *results[gradient_axis_SZ_RES] = {axis};
    gradient_axis(arguments, results, (int[gradient_axis_SZ_IW + 1]){0}, work, 0);
}

/* A step of a tumble in place, under the gravity gradient of an axis, or free of it, NULL; and its Jacobian. */
static void rotation_step(double q[4], double w[3], const double inertia[9], const double axis[3], double h, double G[6][11]) {
    double q0[4], w0[3], columns[66], work[tumble_SZ_W + free_tumble_SZ_W];
    for (int k = 0; k < 4; k++) q0[k] = q[k];
    for (int k = 0; k < 3; k++) w0[k] = w[k];
    const double *arguments[tumble_SZ_ARG] = {q0, w0, inertia, &h, axis};
    double *results[tumble_SZ_RES] = {q, w, columns};
    if (axis) tumble(arguments, results, (int[tumble_SZ_IW + 1]){0}, work, 0);
    else free_tumble(arguments, results, (int[free_tumble_SZ_IW + 1]){0}, work, 0);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 11; j++) G[i][j] = columns[6 * j + i];
}

#include "registration.c"
#include "thrust.c"
#include "bank.c"
#include "member.c"
#include "wander.c"
#include "curve.c"
#include "orbit.c"
#include "filter.c"
#include "measurement.c"
#include "seeming.c"
#include "abreast.c"
#include "jumps.c"
#include "mixture.c"
#include "stereo.c"
#include "reprocess.c"
#include "update.c"
#include "features.c"
#include "exchange.c"
#include "spin.c"
#include "tumble.c"
#include "lasting.c"
#include "node.c"
#include "posterior.c"
#include "answers.c"
#include "residuals.c"
#include "begin.c"
#include "online.c"
