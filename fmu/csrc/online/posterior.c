/* The posterior: what is known now, from all frames: those of the open node, which the filter has not taken yet, too. */

/* What the open node says, `since` being what has moved the path since the covariances; 0 where it is not to be taken: one that is not far
   beyond its noise would seem to show too much. */
static int open_node(const Online *filter, double since, Measurement *measurement) {
    Frame frame;
    Pose pose;
    Sweep sweep;
    OnlineTumble tumble;
    PredictedAttitude predicted = {.variance = INFINITY};
    double share[MOST_FEATURES][OF_MAP][3], common[3][3], beyond;
    if (!(turned_by(filter, predicted.R, &beyond) > beyond)) return 0;
    online_tumble(filter, filter->time, &tumble);
    double lag = as_frame(filter, &tumble, predicted.R, &frame, &sweep);
    if (!registered(filter, &frame, &predicted, &pose)) return 0;
    add_second_order(filter, &frame, &pose, &sweep);
    measurement_of(filter, &frame, &pose, lag, &sweep, share, measurement);
    if (is_loose(measurement)) return 0;
    common_noise(filter, &frame, &pose, measurement, common);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) measurement->noise[a][b] += common[a][b];
    measurement->span = filter->span + since;
    find_seeming(pose.R, measurement);
    return 1;
}

/* The bank takes what a node says, with a jump where it has to; 0 where rounding has left a covariance indefinite, and the bank is none. */
static int take_measurement(const OnlineOptions *options, PackedMember bank[MEMBERS], const Measurement *measurement, Curve curve, double widest) {
    const int best = likeliest(bank);
    Member member, changed;
    unpack_member(&bank[best], &member);
    changed = member;
    add_change(&changed, measurement);
    const double density = jump_at(&changed, measurement);
    if (density > 0.0) add_jump(&member, density, measurement->span, &bank[place_of_jump(bank, best)]);
    Abreast members;
    members.count = 0;
    for (int m = 0; m <= MEMBERS; m++) {
        if (members.count == ABREAST || (m == MEMBERS && members.count > 0)) {
            if (!take_abreast(options, bank, &members, 0, measurement, curve, widest)) return 0;
            members.count = 0;
        }
        if (m < MEMBERS && is_alive(&bank[m])) members.least[members.count] = NULL, members.at[members.count++] = m;
    }
    return 1;
}

/* The bank at the filter's time: the members that there are; others only are none, and leave nothing to one that is packed there. */
static void propagated_bank(const Online *filter, const Transition *transition, PackedMember bank[MEMBERS + 1]) {
    for (int m = 0; m <= SHADOW; m++)
        if (is_alive(&filter->bank[m])) bank[m] = filter->bank[m];
        else bank[m].errors = ERRORS, bank[m].weight = -INFINITY;
    if (transition->span > 0.0) advance_bank(filter, transition, bank);
}

/* What the bank says against the large filter: members whose path does not bend correct that, which does not know of bends;
   those whose path does stand for themselves. */
static void combine(const OnlineOptions *options, const Member *large, const PackedMember bank[MEMBERS + 1], Posterior *posterior) {
    double x[2][ERRORS], P[2][ERRORS][ERRORS], more[PATH_AND_MAP][PATH_AND_MAP], share[2], white = 0.0;
    *posterior = (Posterior){.errors = fmax(large->errors, MOTION)};
    const int n = (int)posterior->errors;
    for (int a = 0; a < PATH_AND_MAP; a++)
        for (int b = 0; b < PATH_AND_MAP; b++) posterior->own[a][b] = large->P[a][b];
    share[0] = mixture(bank, STRAIGHT, large, x[0], P[0], more);
    share[1] = alone(&bank[SHADOW], large, mixed(bank, BENT, 0, x[1], P[1]), x[1]);
    double sum = share[0] + share[1];
    for (int a = 0; a < n; a++) posterior->x[a] = (share[0] * x[0][a] + share[1] * x[1][a]) / sum;
    for (int a = 0; a < n; a++)
        for (int b = 0; b < n; b++) {
            posterior->wider[a][b] = -posterior->own[a][b];
            for (int k = 0; k < 2; k++)
                posterior->wider[a][b] += share[k] / sum * (P[k][a][b] + (x[k][a] - posterior->x[a]) * (x[k][b] - posterior->x[b]));
        }
    for (int m = 0; m < MEMBERS; m++) {
        if (!is_alive(&bank[m])) continue;
        ProcessNoise noise = noise_of(options, bank[m].steady);
        double part = exp(bank[m].weight) / sum;
        white += part * log(noise.white), posterior->jerk += part * noise.jerk;
        posterior->wander += part * noise.wander, posterior->execution += part * noise.execution;
    }
    posterior->white = exp(white);
}

/* What was taken back as mere noise, over what is known of the offset, along the direction of which it is most. */
static double seeming_part(const Online *filter, const Posterior *posterior) {
    double v[3] = {1.0, 0.7, 0.4}, size = 0.0;
    for (int round = 0; round < 30; round++) { /* the largest eigenvalue of P S */
        double u[3];
        times(filter->seeming, v, u);
        for (int k = 0; k < 3; k++) v[k] = dot(&posterior->own[OFFSET + k][6], u) + dot(&posterior->wider[OFFSET + k][6], u);
        size = sqrt(dot(v, v));
        if (!(size > 0.0)) return 0.0;
        for (int k = 0; k < 3; k++) v[k] /= size;
    }
    return size;
}

/* At the filter's time. */
static void find_posterior(const Online *filter, Posterior *posterior) {
    PackedMember bank[MEMBERS + 1];
    Measurement measurement;
    if (filter->posterior_valid != 0.0) {
        *posterior = filter->posterior;
        return;
    }
    const Transition transition = transition_since(filter);
    Member large = large_at(filter, filter->from);
    propagated_bank(filter, &transition, bank);
    if (transition.span > 0.0) advance_large(filter, &large, &transition);
    int taken = filter->node.count > 0.0 && open_node(filter, transition.span, &measurement);
    if (taken && !take_measurement(&filter->options, bank, &measurement, filter->curve, filter->widest)) propagated_bank(filter, &transition, bank);
    for (int m = 0; m < MEMBERS && filter->manoeuvred != 0.0; m++)
        if (is_alive(&bank[m])) grade(&filter->options, excess_of_noise(filter), &bank[m]);
    combine(&filter->options, &large, bank, posterior);
    posterior->seems = seeming_part(filter, posterior);
}

/* Find the posterior, and go on from what is seen, until another frame fits: far ahead of the open node there is no straight way back to it. */
static void keep_posterior(Online *filter) {
    find_posterior(filter, &filter->posterior);
    filter->posterior_valid = 1.0;
}

/* A feature as it is known now: its place in B and the covariance, and how its error goes with (r, v). */
typedef struct {
    double b[3], P[3][3], with[6][3];
} FeaturePosterior;

/* How the errors of features go with the large filter's of offset and scale, and the Cholesky factor of the covariance of these;
   `sure` is 0 where it has none. */
typedef struct {
    double G[PATH_AND_MAP][MOST_ERRORS], L[OF_MAP * OF_MAP];
    int sure;
} FeatureCoupling;

static void couple_features(const Online *filter, const Posterior *posterior, FeatureCoupling *coupling) {
    with_path_and_map(filter, size_of(filter), coupling->G);
    for (int k = 0; k < OF_MAP * OF_MAP; k++) coupling->L[k] = posterior->own[OFFSET + k / OF_MAP][OFFSET + k % OF_MAP];
    coupling->sure = factored(OF_MAP, coupling->L);
}

/* The bank says nothing of a feature but by offset and scale. So whatever is known of these, the feature's regression on them stays
   that of the large filter, H = G' own^-1: its place is corrected by H x, and its covariance is what it has besides, P - H own H',
   and H (own + wider) H'. Together with (r, v) that is definite as own + wider is, at any later time, too, as no time changes
   offset and scale. Where own is singular, features go with the offset. */
static void posterior_of_feature(const Online *filter, const Posterior *posterior, const FeatureCoupling *coupling, int slot, FeaturePosterior *known) {
    const int at = FEATURES + 3 * slot;
    double H[3][OF_MAP], M[OF_MAP][3];
    for (int i = 0; i < 3; i++) {
        for (int a = 0; a < OF_MAP; a++) H[i][a] = coupling->sure ? coupling->G[OFFSET + a][at + i] : a == i;
        if (coupling->sure) solved(OF_MAP, coupling->L, H[i]);
        known->b[i] = filter->b[slot][i];
        for (int a = 0; a < OF_MAP; a++) known->b[i] += H[i][a] * posterior->x[OFFSET + a];
        for (int a = 0; a < PATH_AND_MAP; a++) {
            double sum = 0.0;
            for (int b = 0; b < OF_MAP; b++) sum += (posterior->own[a][OFFSET + b] + posterior->wider[a][OFFSET + b]) * H[i][b];
            *(a < OFFSET ? &known->with[a][i] : &M[a - OFFSET][i]) = sum;
        }
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j <= i; j++) {
            double sum = filter->P[at + i][at + j];
            for (int a = 0; a < OF_MAP; a++) sum += H[i][a] * (M[a][j] - coupling->G[OFFSET + a][at + j]);
            known->P[i][j] = known->P[j][i] = i == j ? sum + ROUNDING * filter->P[at + i][at + i] : sum;
        }
}
