/* The path without a manoeuvre of the chaser: on the target's orbit, under J2 step by step, or in a straight line. */

static int is_oblate(const OnlineOptions *options) { return options->on_orbit != 0.0 && options->orbit.j2 != 0.0; }

#define NOISE_ARC 0.05  /* rad: over so much of the orbit the noise's covariance is that of a straight line */
#define OBLATE_ARC 0.025 /* rad: in such steps an orbit under J2 leads 2e-7 of the distance astray */

/* How many arcs there are from one time to another, where the target is fastest. */
static double arcs_between(const OnlineOrbit *orbit, double begin, double end, double arc) {
    const double a = orbit->elements[0], e = orbit->elements[1];
    const double rate = sqrt(orbit->elements[6] / (a * a * a)) / ((1.0 - e) * (1.0 - e));
    return fmax(1.0, ceil(fabs(end - begin) * rate / arc));
}

/* By which rotation vector in C the axes of LVLH turn from one time to another, in a small arc; zero without an orbit. */
static void turn_of_lvlh(const OnlineOptions *options, const OnlineOrbit *orbit, double begin, double end, double turn[3]) {
    double place[6];
    for (int k = 0; k < 3; k++) turn[k] = 0.0;
    if (options->on_orbit == 0.0) return;
    place_on(orbit, 0.5 * (begin + end), place);
    cross(place, &place[3], turn);
    for (int k = 0; k < 3; k++) turn[k] *= (end - begin) / dot(place, place);
}

/* In how many steps to go, for the noise's sake. */
static int steps_between(const OnlineOptions *options, double begin, double end) {
    return options->on_orbit == 0.0 || !(end > begin) ? 1 : (int)fmin(arcs_between(&options->orbit, begin, end, NOISE_ARC), 200.0);
}

static void multiplied(const double A[6][6], const double B[6][6], double C[6][6]) {
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            C[i][j] = 0.0;
            for (int k = 0; k < 6; k++) C[i][j] += A[i][k] * B[k][j];
        }
}

static void unit_transition(double F[6][6]) {
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) F[i][j] = i == j;
}

/* Under J2 to a time, from the epoch of the orbit, which goes along: (r, v) and its transition. */
static void go_under_j2(OnlineOrbit *orbit, double end, double x[6], double F[6][6]) {
    const double begin = orbit->epoch, body[3] = {orbit->elements[6], orbit->j2, orbit->equatorial_radius};
    const double count = arcs_between(orbit, begin, end, OBLATE_ARC), T = (end - begin) / count;
    double place[6];
    unit_transition(F);
    if (end == begin) return;
    if (!(fabs(end - begin) <= FARTHEST_UNDER_J2)) {
        for (int i = 0; i < 6; i++) x[i] = NAN;
        return;
    }
    place_on(orbit, begin, place);
    for (double s = 0.0; s < count; s += 1.0) {
        double G[6][6], before[6][6];
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 6; j++) before[i][j] = F[i][j];
        oblate_step(T, body, place, x, G);
        multiplied(G, before, F);
    }
    osculate(orbit, end, place);
}

/* The orbit goes to a time. */
static void go_with_orbit(OnlineOptions *options, double time) {
    double x[6] = {0}, F[6][6];
    if (is_oblate(options)) go_under_j2(&options->orbit, time, x, F);
}

/* (r, v) and its transition matrix F from one time to another, on the ellipse that osculates, or in a straight line. */
static void go_plainly(const OnlineOptions *options, double begin, double end, double x[6], double F[6][6]) {
    if (options->on_orbit != 0.0) {
        relative_step(begin, end, options->orbit.elements, x, F);
        return;
    }
    unit_transition(F);
    for (int k = 0; k < 3; k++) F[k][3 + k] = end - begin, x[k] += (end - begin) * x[3 + k];
}

/* The same, under J2 if there is any: the orbit, one like that of the options, goes along then. */
static void propagate(const OnlineOptions *options, OnlineOrbit *orbit, double begin, double end, double x[6], double F[6][6]) {
    if (is_oblate(options)) go_under_j2(orbit, end, x, F);
    else go_plainly(options, begin, end, x, F);
}

/* Whether a time is too far away to go there under J2. */
static int is_too_far(const OnlineOptions *options, double time) {
    return is_oblate(options) && !(fabs(time - options->orbit.epoch) <= FARTHEST_UNDER_J2);
}
