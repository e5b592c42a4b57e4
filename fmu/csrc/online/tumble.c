/* The tumble: attitude, rate and inertia ratios from the attitudes of the nodes.

   It is free or, on an orbit, may be under the gravity gradient: two references. Over the first turn, least squares for
   the inertia and the angular momentum in C, R J R' w = L, from the rate between nodes, finds a reference, with the rate from
   the first attitude to the next one. Then Kalman filters of what its attitude, rate and inertia are wrong by, one for each
   density of white torque, take all nodes: first those that are kept, linear about the reference, and from there on one after
   the other, after each of which the reference goes to their mean. They are weighed by their likelihoods and, before the first
   node, by the root of their density: it is uniform. If the attitudes do not fit, all begins again. */

#define WHOLE_TURN 6.283185307179586
#define SPHERE 0.15   /* standard deviation of the coefficients of an inertia of trace 1 from those of a sphere */
#define KNOWN 0.1     /* relative deviation of the rate at which the filters begin */
#define NEAR 1.5      /* rad, between attitudes that tell the rate */
#define MISFIT 4.0    /* mean square of the innovations, in units of their covariance */
#define IMPOSSIBLE (-100.0)
enum { FEWEST_PAIRS = 12, MEMORY = 16, TO_AND_FRO = 2 };

static int reference_count(const OnlineOptions *options) { return options->on_orbit != 0.0 ? 2 : 1; }

static void forget_tumble(Tumble *tumble) { *tumble = (Tumble){0}; }

/* The map was turned by T, in B. Attitudes that are kept stay orthonormal to rounding, which they gather once a node. */
static void turn_tumble(Tumble *tumble, const OnlineOptions *options, const double T[3][3]) {
    for (int k = 0; k < (int)tumble->kept; k++) {
        double A[3][3];
        by_transposed(tumble->attitude[k].R, T, A);
        copy(A, tumble->attitude[k].R);
    }
    for (int c = 0; c < reference_count(options) && tumble->known != 0.0; c++) turn_spin(&tumble->reference[c].spin, T);
}

/* ---- the first estimate ---- */

/* What a pair of nodes says to a reference: the rate w in C from one to the other, T s, at the attitude `middle`; axis: of the
   gravity gradient, zero if that does not act. */
static void add_to_reference(ReferenceTumble *reference, const double middle[3][3], const double w[3], const double axis[3], double T,
                          double weight) {
    double body[3], up[3], A[3][8], target[3];
    transposed_times(middle, w, body);
    transposed_times(middle, axis, up);
    for (int k = 0; k < 5; k++) {
        double moved[3], column[3], pulled[3], torque[3];
        times(INERTIA_BASIS[k], body, moved);
        times(middle, moved, column);
        times(INERTIA_BASIS[k], up, moved);
        cross(up, moved, pulled);
        times(middle, pulled, torque);
        for (int a = 0; a < 3; a++) {
            A[a][k] = column[a] - reference->impulse[a][k] - 0.5 * T * torque[a];
            reference->impulse[a][k] += T * torque[a];
        }
    }
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++) A[a][5 + b] = a == b ? -1.0 : 0.0;
        target[a] = -w[a] / 3.0;
    }
    for (int i = 0; i < 8; i++) {
        for (int j = 0; j < 8; j++)
            for (int a = 0; a < 3; a++) reference->N[8 * i + j] += weight * A[a][i] * A[a][j];
        for (int a = 0; a < 3; a++) reference->rhs[i] += weight * A[a][i] * target[a];
    }
}

static void add_pair(Tumble *tumble, const OnlineOptions *options, const double before[3][3], const double turn[3], int far,
                     double T, double end, double variance) {
    double angle = sqrt(dot(turn, turn)), middle[3][3], half[3], w[3], axis[3];
    for (int k = 0; k < 3; k++) half[k] = 0.5 * turn[k], w[k] = turn[k] / T;
    copy(before, middle);
    turn_left(half, middle);
    gravity_gradient(options, end - 0.5 * T, axis);
    double weight = far ? 0.0 : 4.5 * T * T / variance; /* J is a third, and both ends are noisy */
    for (int c = 0; c < reference_count(options); c++) {
        tumble->reference[c].spin.gradient = c;
        add_to_reference(&tumble->reference[c], middle, w, c ? axis : NOTHING[0], T, weight);
    }
    if (far) return;
    tumble->pairs += 1.0;
    tumble->turned += angle;
}

/* Keep the attitude of a node; when there are too many, every other one. */
static void keep_attitude(Tumble *tumble, const Attitude *attitude) {
    tumble->waits -= 1.0;
    if (tumble->waits > 0.0) return;
    if (tumble->kept >= ATTITUDES) {
        tumble->kept /= 2.0, tumble->skip = 2.0 * tumble->skip + 1.0;
        for (int k = 0; k < (int)tumble->kept; k++) tumble->attitude[k] = tumble->attitude[2 * k];
    }
    tumble->attitude[(int)tumble->kept] = *attitude;
    tumble->kept += 1.0, tumble->waits = tumble->skip + 1.0;
}

/* The reference through the first attitude by least squares, its inertia J with its inverse, and the covariance of its rate in B; 0 if they do not tell it. */
static int of_momentum(ReferenceTumble *reference, const double R[3][3], double J[3][3], double inverse[3][3], double of_rate[3][3]) {
    double N[64], x[8], taken[5], L[3], rows[3][8], *w = reference->spin.w;
    for (int k = 0; k < 64; k++) N[k] = reference->N[k] + (k % 9 == 0 && k < 45 ? 1.0 / (SPHERE * SPHERE) : 0.0);
    for (int k = 0; k < 8; k++) x[k] = reference->rhs[k];
    if (!factored(8, N)) return 0;
    solved(8, N, x);
    inertia_of(x, J);
    if (!possible(J)) return 0;
    hold_inertia(x, taken);
    inertia_of(x, J);
    if (!inverted(J, inverse)) return 0;
    quaternion_of(R, reference->spin.q);
    transposed_times(R, &x[5], L);
    times(inverse, L, w);
    for (int k = 0; k < 5; k++) reference->spin.j[k] = x[k];
    /* J dw = R' dL - dJ w */
    for (int a = 0; a < 3; a++) {
        for (int k = 0; k < 5; k++) {
            double moved[3];
            times(INERTIA_BASIS[k], w, moved);
            rows[a][k] = -dot(inverse[a], moved);
        }
        for (int b = 0; b < 3; b++) rows[a][5 + b] = dot(inverse[a], R[b]);
    }
    for (int a = 0; a < 3; a++) {
        double solution[8];
        for (int k = 0; k < 8; k++) solution[k] = rows[a][k];
        solved(8, N, solution);
        for (int b = 0; b < 3; b++) {
            of_rate[a][b] = 0.0;
            for (int k = 0; k < 8; k++) of_rate[a][b] += rows[b][k] * solution[k];
        }
    }
    return 1;
}

/* The rate in B at an attitude by the next one, of an inertia J, and its covariance; 0 if that is too far. */
static int rate_between(const Attitude *first, const Attitude *next, const double J[3][3], const double inverse[3][3], double w[3], double of_rate[3][3]) {
    const double T = next->time - first->time;
    double turn[3], momentum[3], torque[3], change[3], noise[3][3], body[3][3], turned[3][3];
    if (!(angle_between(next->R, first->R, turn) < NEAR)) return 0;
    transposed_times(first->R, turn, w);
    for (int k = 0; k < 3; k++) w[k] /= T;
    times(J, w, momentum);
    cross(w, momentum, torque);
    times(inverse, torque, change); /* J dw = -w x J w dt, from halfway back to the first */
    for (int k = 0; k < 3; k++) w[k] += 0.5 * T * change[k];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) noise[i][j] = (first->noise[i][j] + next->noise[i][j]) / (T * T);
    transposed(first->R, body);
    product(body, noise, turned);
    by_transposed(turned, body, of_rate);
    return 1;
}

/* The reference through the first of the attitudes that are kept; 0 as long as it is not known well enough. About the long axis of a rod momentum hardly tells
   the rate, but the next attitude does. */
static int first_spin(ReferenceTumble *reference, const Attitude kept[2]) {
    double of_rate[3][3], rate[3], noise[3][3], J[3][3], inverse[3][3], *w = reference->spin.w;
    if (!of_momentum(reference, kept[0].R, J, inverse, of_rate)) return 0;
    if (rate_between(&kept[0], &kept[1], J, inverse, rate, noise)) {
        double sum[3][3], gain[3][3], off[3], moved[3], less[3][3];
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) sum[i][j] = of_rate[i][j] + noise[i][j];
        if (!inverted(sum, less)) return 0;
        product(of_rate, less, gain);
        for (int k = 0; k < 3; k++) off[k] = rate[k] - w[k];
        times(gain, off, moved);
        for (int k = 0; k < 3; k++) w[k] += moved[k];
        product(gain, of_rate, less);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) of_rate[i][j] -= less[i][j];
    }
    return of_rate[0][0] + of_rate[1][1] + of_rate[2][2] < KNOWN * KNOWN * dot(w, w);
}

/* ---- the filters ---- */

static int best_error(const ReferenceTumble *reference) {
    int best = 0;
    for (int m = 1; m < TORQUES; m++)
        if (reference->errors.weight[m] > reference->errors.weight[best]) best = m;
    return best;
}

static double best_weight(const ReferenceTumble *reference) { return reference->errors.weight[best_error(reference)]; }

static int best_reference(const Tumble *tumble, int count) {
    int best = 0;
    for (int c = 1; c < count; c++)
        if (best_weight(&tumble->reference[c]) > best_weight(&tumble->reference[best])) best = c;
    return best;
}

/* Take the attitude of a node, T s after the last one; returns the weighted square of the likeliest innovation. */
static double follow_reference(ReferenceTumble *reference, const OnlineOptions *options, double begin, double T, const double R[3][3],
                            const double noise[3][3]) {
    double F[6][SPIN], Q[6][6], predicted[3][3], turn[3], squares[TORQUES];
    if (!spin_on(options, &reference->spin, begin, T, F, Q)) return INFINITY;
    matrix_of(reference->spin.q, predicted);
    angle_between(R, predicted, turn);
    int best = best_error(reference);
    errors_on(&reference->errors, reference->spin.gradient != 0.0, F, Q);
    update_errors(&reference->errors, turn, noise, squares);
    return squares[best];
}

static void refuse_impossible(ReferenceTumble *reference) {
    for (int m = 0; m < TORQUES; m++) {
        double j[5], J[3][3];
        for (int k = 0; k < 5; k++) j[k] = reference->spin.j[k] + reference->errors.x[6 + k][m];
        inertia_of(j, J);
        if (!possible(J)) reference->errors.weight[m] += IMPOSSIBLE;
    }
}

/* Weights against the best; what is unlikely goes on from the best of its reference, or from the best reference. */
static void weigh_errors(Tumble *tumble, int count) {
    int first = best_reference(tumble, count), most = best_error(&tumble->reference[first]);
    const SpinError best = error_of(&tumble->reference[first].errors, most);
    for (int c = 0; c < count; c++) {
        ReferenceTumble *reference = &tumble->reference[c];
        SpinError own = error_of(&reference->errors, best_error(reference));
        if (!(own.weight - best.weight > UNLIKELY)) {
            own = best;
            reference->spin = tumble->reference[first].spin;
            reference->spin.gradient = c;
            for (int m = 0; m < TORQUES; m++) reference->errors.weight[m] = -INFINITY;
        }
        for (int m = 0; m < TORQUES; m++) {
            double weight = reference->errors.weight[m] - best.weight;
            if (!(weight > UNLIKELY)) put_error(&own, m, &reference->errors), weight = UNLIKELY;
            reference->errors.weight[m] = weight;
        }
    }
}

/* Every reference goes to the mean of its filters, or as near as it may be. */
static void centre_reference(ReferenceTumble *reference) {
    double mean[SPIN] = {0}, taken[5], sum = 0.0, highest = best_weight(reference);
    for (int m = 0; m < TORQUES; m++) {
        double share = exp(reference->errors.weight[m] - highest);
        sum += share;
        for (int a = 0; a < SPIN; a++) mean[a] += share * reference->errors.x[a][m];
    }
    for (int a = 0; a < SPIN; a++) mean[a] /= sum;
    correct_spin(&reference->spin, mean);
    hold_inertia(reference->spin.j, taken);
    for (int k = 0; k < 5; k++) mean[6 + k] -= taken[k];
    for (int a = 0; a < SPIN; a++)
        for (int m = 0; m < TORQUES; m++) reference->errors.x[a][m] -= mean[a];
}

/* The mean of all filters, their covariance, and the mean density of torque but of those that are as good as refuted. */
WIDE static void sum_up(Tumble *tumble, int count) {
    int first = best_reference(tumble, count);
    double apart[REFERENCES][SPIN], share[REFERENCES][TORQUES], mean[SPIN] = {0}, sum = 0.0, torque = 0.0, each[SPIN_PAIRS][TORQUES] = {{0}};
    tumble->spin = tumble->reference[first].spin;
    for (int c = 0; c < count; c++) {
        const SpinErrors *errors = &tumble->reference[c].errors;
        spin_between(&tumble->reference[c].spin, &tumble->spin, apart[c]);
        for (int m = 0; m < TORQUES; m++) {
            sum += share[c][m] = exp(errors->weight[m]);
            if (errors->weight[m] > UNLIKELY) torque += share[c][m] * TORQUE[m];
            for (int a = 0; a < SPIN; a++) mean[a] += share[c][m] * (apart[c][a] + errors->x[a][m]);
        }
    }
    for (int a = 0; a < SPIN; a++) mean[a] /= sum;
    for (int c = 0; c < count; c++) {
        const SpinErrors *errors = &tumble->reference[c].errors;
        double off[SPIN][TORQUES];
        for (int a = 0; a < SPIN; a++)
            for (int m = 0; m < TORQUES; m++) off[a][m] = apart[c][a] + errors->x[a][m] - mean[a];
        for (int a = 0, p = 0; a < SPIN; a++)
            for (int b = 0; b <= a; b++, p++)
                for (int m = 0; m < TORQUES; m++) each[p][m] += share[c][m] * (errors->P[p][m] + off[a][m] * off[b][m]);
    }
    for (int a = 0, p = 0; a < SPIN; a++)
        for (int b = 0; b <= a; b++, p++) {
            double all = 0.0;
            for (int m = 0; m < TORQUES; m++) all += each[p][m];
            tumble->P[a][b] = tumble->P[b][a] = all / sum;
        }
    correct_spin(&tumble->spin, mean);
    tumble->torque = torque / sum;
}

/* The filters of a reference take the attitudes that are kept, from the first on, and the last one; rate and inertia are known no
   better than before them. Returns the mean square of the likeliest's innovations, in units of their covariance; INFINITY if that is too far. */
static double take_kept(Tumble *tumble, int c, const OnlineOptions *options, const Attitude *last) {
    ReferenceTumble *reference = &tumble->reference[c];
    const Attitude *first = &tumble->attitude[0];
    double square = dot(reference->spin.w, reference->spin.w), off[3], predicted[3][3];
    matrix_of(reference->spin.q, predicted);
    angle_between(first->R, predicted, off);
    SpinError error = {.weight = 0.0};
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b <= a; b++) error.P[packed_index(a, b)] = first->noise[a][b];
        error.x[a] = off[a];
        error.P[packed_index(3 + a, 3 + a)] = square;
    }
    for (int k = 0; k < 5; k++) error.P[packed_index(6 + k, 6 + k)] = SPHERE * SPHERE, error.x[6 + k] = -reference->spin.j[k];
    for (int m = 0; m < TORQUES; m++) {
        error.weight = 0.5 * log(TORQUE[m]);
        put_error(&error, m, &reference->errors);
    }
    double begin = first->time, squares = 0.0, count = 0.0;
    for (int k = 1; begin < last->time && squares < INFINITY; k++) {
        const Attitude *next = k < (int)tumble->kept ? &tumble->attitude[k] : last;
        squares += follow_reference(reference, options, begin, next->time - begin, next->R, next->noise);
        begin = next->time, count += 1.0;
    }
    return squares / (3.0 * count);
}

/* Begin with a reference: by least squares, which the filters make better as they go to and fro. Returns the mean square of the innovations of the attitudes
   that are kept: where their noise is much of what the target turns from one node to the next, filters may come to rest anywhere. 0 if it is not known well
   enough yet. */
static double start_reference(Tumble *tumble, int c, const OnlineOptions *options, const Attitude *last) {
    ReferenceTumble *reference = &tumble->reference[c];
    if (!first_spin(reference, tumble->attitude)) return 0.0;
    for (int round = 0; round < TO_AND_FRO; round++) {
        Spin before = reference->spin;
        double F[6][SPIN], Q[6][6], back = tumble->attitude[0].time - last->time;
        if (!(take_kept(tumble, c, options, last) < INFINITY)) return INFINITY;
        centre_reference(reference);
        if (!spin_on(options, &reference->spin, last->time, back, F, Q)) {
            reference->spin = before;
            break;
        }
    }
    const double misfit = take_kept(tumble, c, options, last);
    refuse_impossible(reference);
    return misfit;
}

static void start_filters(Tumble *tumble, const OnlineOptions *options, const Attitude *last) {
    int count = reference_count(options), begun = 0, misfits = 0, fails[REFERENCES] = {0};
    if (tumble->turned < WHOLE_TURN || tumble->pairs < FEWEST_PAIRS) return;
    for (int c = 0; c < count; c++) {
        const double misfit = start_reference(tumble, c, options, last);
        fails[c] = !(misfit > 0.0 && misfit < MISFIT);
        misfits += !(misfit < MISFIT);
        begun += !fails[c];
    }
    if (begun == 0) {
        if (misfits > 0) forget_tumble(tumble);
        return;
    }
    for (int c = 0; c < count; c++)
        for (int m = 0; m < TORQUES; m++)
            if (fails[c]) tumble->reference[c].errors.weight[m] = -INFINITY;
    weigh_errors(tumble, count);
    for (int c = 0; c < count; c++) centre_reference(&tumble->reference[c]);
    sum_up(tumble, count);
    if (!settled_inertia(&tumble->spin)) return;
    tumble->known = 1.0, tumble->kept = 0.0;
    tumble->misfit = 1.0;
}

/* Take the attitude of a node: R, `turn` from the one `before`, from `begin` to `end`; far: over a gap, where the mean rate says little. */
static void follow(Tumble *tumble, const OnlineOptions *options, double begin, double end, const double before[3][3],
                   const double turn[3], int far, const double R[3][3], const double noise[3][3]) {
    double squares[REFERENCES];
    int count = reference_count(options);
    if (tumble->known == 0.0) {
        add_pair(tumble, options, before, turn, far, end - begin, end, (noise[0][0] + noise[1][1] + noise[2][2]) / 3.0);
        Attitude last = {.time = end};
        copy(R, last.R), copy(noise, last.noise);
        keep_attitude(tumble, &last);
        start_filters(tumble, options, &last);
        return;
    }
    int best = best_reference(tumble, count);
    for (int c = 0; c < count; c++) {
        squares[c] = follow_reference(&tumble->reference[c], options, begin, end - begin, R, noise);
        if (!(squares[c] < INFINITY)) {
            forget_tumble(tumble);
            return;
        }
        refuse_impossible(&tumble->reference[c]);
    }
    weigh_errors(tumble, count);
    for (int c = 0; c < count; c++) centre_reference(&tumble->reference[c]);
    sum_up(tumble, count);
    tumble->misfit += (squares[best] / 3.0 - tumble->misfit) / MEMORY;
    if (!(tumble->misfit < MISFIT) || !settled_inertia(&tumble->spin)) forget_tumble(tumble);
}
