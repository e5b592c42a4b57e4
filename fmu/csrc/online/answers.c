/* What the filter answers: noise and status, the state at a time, the tumble, a point, the map. */

#define UNLIKE 1.2 /* mean square of the residuals over that of the told noise */
#define FEWEST 6.0 /* nodes, of three values each, for the nine unknowns of path and offset */
#define TREND 3.0 /* standard deviations */
#define SEEMING 0.5 /* what was taken back, over what is known of the offset, along some direction */

static int are_within(double range, const double *values, int count) {
    for (int k = 0; k < count; k++)
        if (!(fabs(values[k]) <= range)) return 0;
    return 1;
}

/* By how much covariances are to be wider, where what was taken back is a good part of what is known: that itself is noisy, and
   if it was all that is known, nothing is left. */
static double factor_of(const Online *filter, const Posterior *posterior) {
    return excess_of_noise(filter) * (posterior->seems > SEEMING && posterior->seems < 1.0 ? (1.0 - SEEMING) / (1.0 - posterior->seems) : 1.0);
}

/* Whether innovations surely agree. */
static int agree(const Trend *trend) { return trend->sum > TREND * sqrt(trend->terms); }

/* Whether the path bends otherwise than any member of the bank takes it for: successive innovations of those that were the likeliest surely agree, and
   so do those of each density that is not clearly less likely. They do where the errors of features last, too. */
static int is_bent(const Online *filter) {
    int bent = filter->frames_per_error <= 1.0 && agree(&filter->trend);
    for (int m = 0; m < DENSITIES && bent; m++) bent = !(filter->bank[m].weight > -CLEAR) || agree(&filter->bank[m].trend);
    return bent;
}

/* Whether the path surely needs more process noise than the largest density: as long as that is the likeliest, innovations are larger than it expects. */
static int is_too_noisy(const Online *filter) {
    return filter->bank[DENSITIES - 1].weight == 0.0 && filter->excess > TREND * sqrt(6.0 * filter->noisiest);
}

/* What a path of the covariance P is worth, whether the last frame fits or not. */
static OnlineStatus worth_of(const Online *filter, const Posterior *posterior, double P[6][6]) {
    double square = mean_square(filter->b, (int)filter->used), L[36];
    for (int k = 0; k < 36; k++) L[k] = P[k / 6][k % 6];
    if (!factored(6, L)) return STARTING; /* of rounding, where exact points meet a wide start */
    if (!(P[0][0] + P[1][1] + P[2][2] < square)) return STARTING;
    if (filter->stored_count >= 0.0 && filter->stored_count < FEWEST) return STARTING;
    if (noise_ratio(filter) > UNLIKE || is_too_noisy(filter)) return DOUBTFUL;
    if (filter->options.on_orbit == 0.0 && is_bent(filter)) return DOUBTFUL;
    return posterior->seems < 1.0 ? TRACKING : STARTING;
}

static OnlineStatus status_of(const Online *filter, const Posterior *posterior, double P[6][6]) {
    return filter->lost > 0.0 ? LOST : worth_of(filter, posterior, P);
}

/* What is known, on its way from the filter's time to later ones: r, v, and what the bank says. */
typedef struct {
    double time, x[6];
    OnlineOrbit orbit;
    Posterior posterior;
} Ahead;

/* At the filter's time. */
static void start_ahead(const Online *filter, Ahead *ahead) {
    find_posterior(filter, &ahead->posterior);
    ahead->time = filter->time;
    ahead->orbit = filter->options.orbit;
    for (int i = 0; i < 6; i++) ahead->x[i] = filter->x[i];
}

/* To a later time, until which manoeuvres have moved the chaser. */
static void go_ahead(const Online *filter, Ahead *ahead, double end, const Manoeuvre *manoeuvre) {
    int count = end > ahead->time ? steps_between(&filter->options, ahead->time, end) : 0;
    Manoeuvre now = *manoeuvre;
    now.end = end;
    if (count > 0 && is_manoeuvre(manoeuvre)) begin_thrust(&filter->options, &ahead->posterior);
    for (int s = 0; s < count; s++) {
        const int last = s + 1 == count;
        double T = (end - ahead->time) / count, from = ahead->time + s * T;
        Transition transition;
        step_on(filter, &ahead->orbit, from, last ? end : from + T, &now, ahead->x, &ahead->posterior, &transition);
    }
    ahead->time = end;
}

/* Of thrust in a span. */
static Manoeuvre manoeuvre_of(const OnlineThrust *thrust) {
    Manoeuvre manoeuvre = {0};
    for (int k = 0; k < 3; k++) manoeuvre.acceleration[k] = thrust->acceleration[k];
    copy(thrust->axes, manoeuvre.axes);
    return manoeuvre;
}

/* To a later time, until which there is thrust. */
static void manoeuvre_ahead(const Online *filter, Ahead *ahead, double end, const OnlineThrust *thrust) {
    const Manoeuvre manoeuvre = manoeuvre_of(thrust);
    go_ahead(filter, ahead, end, &manoeuvre);
}

/* The covariance of (r, v) there. */
static void claim(const Online *filter, const Posterior *posterior, double P[6][6]) {
    double factor = factor_of(filter, posterior);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) P[i][j] = factor * (posterior->own[i][j] + posterior->wider[i][j]);
}

/* What a filter says of a time before its first frame: there is no path and no attitude. */
static void begin_state(const Online *filter, double time, OnlineState *state) {
    *state = (OnlineState){.time = time, .status = WAITING, .features = filter->used, .density = filter->density};
    state->noise_ratio = filter->freedom > 0.0 ? filter->squares / filter->freedom : 1.0;
    state->lasting = filter->frames_per_error, state->maps = filter->maps;
    for (int i = 0; i < 3; i++) {
        state->r[i] = state->v[i] = NAN;
        for (int j = 0; j < 3; j++) state->R[i][j] = NAN;
    }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) state->covariance[i][j] = NAN;
}

/* What it says after that. */
static void state_there(const Online *filter, const Ahead *ahead, OnlineState *state) {
    double P[6][6];
    begin_state(filter, ahead->time, state);
    claim(filter, &ahead->posterior, P);
    state->status = status_of(filter, &ahead->posterior, P);
    for (int i = 0; i < 3; i++) {
        state->r[i] = ahead->x[i] + ahead->posterior.x[i], state->v[i] = ahead->x[3 + i] + ahead->posterior.x[3 + i];
        for (int j = 0; j < 3 && ahead->time == filter->registered; j++) state->R[i][j] = filter->attitude[i][j];
    }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) state->covariance[i][j] = 0.5 * (P[i][j] + P[j][i]);
    state->execution = sqrt(ahead->posterior.execution);
    for (int i = 0; i < OF_THRUST && ahead->posterior.errors == ERRORS; i++) {
        state->thrust[i] = filter->thrust[i] + ahead->posterior.x[THRUST + i];
        for (int j = 0; j < OF_THRUST; j++) {
            const double known = ahead->posterior.own[THRUST + i][THRUST + j] + ahead->posterior.wider[THRUST + i][THRUST + j];
            state->of_thrust[i][j] = factor_of(filter, &ahead->posterior) * known;
        }
    }
}

/* Whether thrust is within range: axes are directions. */
static int is_thrust(const OnlineThrust *thrust) {
    return are_within(FARTHEST, thrust->acceleration, 3) && are_within(2.0, thrust->axes[0], 9);
}

int online_predict(const Online *filter, double time, const OnlineThrust *thrust, OnlineState *state) {
    if (!are_within(LATEST, &time, 1) || time < filter->time) return BAD_TIME;
    if (is_too_far(&filter->options, time)) return TOO_FAR;
    if (!is_thrust(thrust)) return BAD_ACCELERATION;
    Ahead ahead;
    if (filter->frames == 0.0) {
        begin_state(filter, time, state);
        return ACCEPTED;
    }
    start_ahead(filter, &ahead);
    manoeuvre_ahead(filter, &ahead, time, thrust);
    state_there(filter, &ahead, state);
    return ACCEPTED;
}

int online_tumble(const Online *filter, double time, OnlineTumble *found) {
    *found = (OnlineTumble){0};
    if (!are_within(LATEST, &time, 1) || time < filter->turned) return BAD_TIME;
    if (filter->tumble.known == 0.0) return ACCEPTED;
    double factor = excess_of_noise(filter), F[6][SPIN], Q[6][6], P[SPIN][SPIN];
    Spin spin = filter->tumble.spin;
    if (!spin_on(&filter->options, &spin, filter->turned, time - filter->turned, F, Q)) return ACCEPTED;
    for (int a = 0; a < SPIN; a++)
        for (int b = 0; b < SPIN; b++) P[a][b] = filter->tumble.P[a][b];
    spread_on(P, F, Q, filter->tumble.torque);
    found->known = 1.0;
    matrix_of(spin.q, found->R);
    inertia_of(spin.j, found->inertia);
    for (int a = 0; a < 3; a++) {
        found->rate[a] = spin.w[a];
        for (int b = 0; b < 3; b++) {
            found->turn[a][b] = factor * P[a][b];
            found->of_rate[a][b] = factor * P[3 + a][3 + b];
        }
    }
    for (int a = 0; a < 5; a++)
        for (int b = 0; b < 5; b++) found->of_inertia[a][b] = factor * P[6 + a][6 + b];
    return ACCEPTED;
}

/* What the second order of an error of the attitude does to an arm: (turn - tr turn) arm / 2 in the mean, and of quadratic forms
   with symmetric A for each coordinate the covariances 2 tr(A turn A' turn). Errors of more than a radian are taken for one. */
static void curve(const double arm[3], const double turn[3][3], double shift[3], double covariance[3][3]) {
    double size = turn[0][0] + turn[1][1] + turn[2][2], factor = 1.0 / fmax(size, 1.0), B[3][3][3];
    for (int i = 0; i < 3; i++) {
        double A[3][3] = {{0}}, T[3][3];
        for (int k = 0; k < 3; k++) {
            A[i][k] += 0.25 * arm[k], A[k][i] += 0.25 * arm[k], A[k][k] -= 0.5 * arm[i];
            for (int j = 0; j < 3; j++) T[k][j] = factor * turn[k][j];
        }
        product(A, T, B[i]);
        shift[i] = B[i][0][0] + B[i][1][1] + B[i][2][2];
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            covariance[i][j] = 0.0;
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++) covariance[i][j] += 2.0 * B[i][a][b] * B[j][b][a];
        }
}

int online_point(const Online *filter, double time, const OnlineThrust *thrust, long long name, double *position,
                 double *covariance) {
    OnlineTumble tumble;
    int slot = slot_of(filter, name);
    if (!are_within(LATEST, &time, 1) || time < filter->time) return BAD_TIME;
    if (is_too_far(&filter->options, time)) return TOO_FAR;
    if (!is_thrust(thrust)) return BAD_ACCELERATION;
    online_tumble(filter, time, &tumble);
    if (slot < 0 || tumble.known == 0.0) return NO_SUCH;
    Ahead ahead;
    FeatureCoupling coupling;
    FeaturePosterior known;
    double P[6][6], arm[3], K[3][3], KC[3][3], RB[3][3], X[3][3], shift[3], arc[3][3];
    start_ahead(filter, &ahead);
    manoeuvre_ahead(filter, &ahead, time, thrust);
    const Posterior *posterior = &ahead.posterior;
    couple_features(filter, posterior, &coupling);
    posterior_of_feature(filter, posterior, &coupling, slot, &known);
    double factor = factor_of(filter, posterior);
    claim(filter, posterior, P);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            X[i][j] = factor * known.with[i][j]; /* of r, then, and b */
            known.P[i][j] *= factor;
        }
    times(tumble.R, known.b, arm);
    moved_by_turn(arm, K);
    product(K, tumble.turn, KC);
    curve(arm, (const double(*)[3])tumble.turn, shift, arc);
    product(tumble.R, known.P, RB);
    for (int i = 0; i < 3; i++) {
        position[i] = ahead.x[i] + posterior->x[i] + arm[i] + shift[i];
        for (int j = 0; j <= i; j++)
            covariance[3 * i + j] = covariance[3 * j + i] =
                0.5 * (P[i][j] + P[j][i]) + dot(X[i], tumble.R[j]) + dot(X[j], tumble.R[i]) + dot(RB[i], tumble.R[j]) +
                dot(KC[i], K[j]) + 0.5 * (arc[i][j] + arc[j][i]);
    }
    return ACCEPTED;
}

/* The map, by what is known at any time from the filter's on; returns how many features it has. */
static int map_of(const Online *filter, const Posterior *posterior, long long *names, double *positions, double *covariances) {
    double factor = factor_of(filter, posterior);
    FeatureCoupling coupling;
    couple_features(filter, posterior, &coupling);
    for (int f = 0; f < (int)filter->used; f++) {
        FeaturePosterior known;
        posterior_of_feature(filter, posterior, &coupling, f, &known);
        names[f] = filter->feature[f].name;
        for (int i = 0; i < 3; i++) {
            positions[3 * f + i] = known.b[i];
            for (int j = 0; j < 3; j++) covariances[9 * f + 3 * i + j] = factor * known.P[i][j];
        }
    }
    return (int)filter->used;
}

int online_features(const Online *filter, long long *names, double *positions, double *covariances) {
    Posterior posterior;
    if (filter->frames == 0.0) return 0;
    find_posterior(filter, &posterior);
    return map_of(filter, &posterior, names, positions, covariances);
}
