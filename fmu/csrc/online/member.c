/* What a member of the bank goes through: a transition, the change that comes with a node, and the node. From its update on only the lower triangle of a
covariance holds, as that is what is kept of it. Numbers of errors are constants where most of the time is spent: so compilers take as many numbers at once as
the processor does. What goes on in a member is written once for one member and for some abreast, L: each number of one stands beside the same of the others, so
that the same is done to all at once (abreast.c). */

/* Whether its acceleration counts: one of which nothing is uncertain is zero, and so is all that is known with it; but errors of thrusters come after it. */
static int bends(const Member *member) { return member->errors > MOTION || member->P[PATH_AND_MAP][PATH_AND_MAP] != 0.0; }

/* Factors times a column of a matrix whose rows have `stride` numbers. */
static ALWAYS_INLINE double by_column(int count, const double factors[], const double *column, int stride) {
    double sum = factors[0] * column[0];
    for (int k = 1; k < count; k++) sum += factors[k] * column[k * stride];
    return sum;
}

/* What an acceleration adds to a component of (r, v) in T s. */
static double bent_by(int component, double T) { return component < 3 ? 0.5 * T * T : T; }

/* Of a row of covariances that goes on by a transition the columns from `begin` to `end`: thrusters, if there are errors of them, and an
   acceleration, if a path bends, move it besides. */
static ALWAYS_INLINE void row_on(int L, int n, int bent, const Transition *transition, int a, int begin, int end, const double *restrict P,
                                 double *restrict row) {
    const double *F = transition->F[a], *by_thrust = transition->by_thrust[a], by_bend = bent_by(a, transition->span);
    const double *thrust = P + ROW(L, n - OF_THRUST, 0), *bend = P + ROW(L, PATH_AND_MAP + a % 3, 0);
    for (int j = begin * L; j < end * L; j++) {
        row[j] = by_column(6, F, P + j, ERRORS * L);
        if (n > MOTION) row[j] += by_column(OF_THRUST, by_thrust, thrust + j, ERRORS * L);
        if (bent) row[j] += by_bend * bend[j];
    }
}

/* What n errors of L members are wrong by goes on by a transition, and their covariance: in a straight line, as an orbit is gone in small
   arcs. Without process noise. */
static ALWAYS_INLINE void spread(int L, int n, int bent, const Transition *transition, double *restrict x, double *restrict P) {
    const int thrust = n - OF_THRUST;
    double A[6][ERRORS * ABREAST], to[6 * ABREAST];
    for (int a = 0; a < 6; a++) {
        for (int m = 0; m < L; m++) {
            double sum = transition->step[a] + by_column(6, transition->F[a], x + m, L);
            if (bent) sum += bent_by(a, transition->span) * x[(PATH_AND_MAP + a % 3) * L + m];
            if (n > MOTION) sum += by_column(OF_THRUST, transition->by_thrust[a], x + thrust * L + m, L);
            to[a * L + m] = sum;
        }
        row_on(L, n, bent, transition, a, 0, n, P, A[a]);
    }
    for (int a = 0; a < 6; a++) {
        for (int m = 0; m < L; m++) x[a * L + m] = to[a * L + m];
        for (int b = 0; b < n; b++)
            for (int m = 0; m < L; m++) P[ROW(L, b, a) + m] = A[a][b * L + m];
    }
    for (int a = 0; a < 6; a++) row_on(L, n, bent, transition, a, 0, a + 1, P, A[a]);
    for (int a = 0; a < 6; a++) {
        for (int b = 0; b < n; b++)
            for (int m = 0; m < L; m++) P[ROW(L, a, b) + m] = A[a][b * L + m];
        for (int m = 0; m < L; m++) P[ROW(L, a, a) + m] += ROUNDING * P[ROW(L, a, a) + m];
        for (int b = 0; b < a; b++)
            for (int m = 0; m < L; m++) P[ROW(L, b, a) + m] = A[a][b * L + m];
    }
}

/* Accelerations of L members, whose errors are n, turn with the axes in which they stay. */
static ALWAYS_INLINE void turn_bend(int L, int n, const double turn[3], double *restrict x, double *restrict P) {
    double R[3][3], to[3][ERRORS * ABREAST];
    rotation(turn, R);
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < L; j++) to[k][j] = by_column(3, R[k], x + PATH_AND_MAP * L + j, L);
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < L; j++) x[(PATH_AND_MAP + k) * L + j] = to[k][j];
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < n * L; j++) to[k][j] = by_column(3, R[k], P + ROW(L, PATH_AND_MAP, 0) + j, ERRORS * L);
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < n * L; j++) P[ROW(L, PATH_AND_MAP + k, 0) + j] = to[k][j];
    for (int a = 0; a < n; a++) {
        double *row = P + ROW(L, a, PATH_AND_MAP);
        for (int k = 0; k < 3; k++)
            for (int m = 0; m < L; m++) to[k][m] = by_column(3, R[k], row + m, L);
        for (int k = 0; k < 3; k++)
            for (int m = 0; m < L; m++) row[k * L + m] = to[k][m];
    }
}

static ALWAYS_INLINE void transit_abreast(int L, int manoeuvred, int bent, const Transition *transition, double *x, double *P) {
    if (manoeuvred && bent) spread(L, ERRORS, 1, transition, x, P);
    else if (manoeuvred) spread(L, UNBENT, 0, transition, x, P);
    else if (bent) spread(L, MOTION, 1, transition, x, P);
    else spread(L, PATH_AND_MAP, 0, transition, x, P);
    if (bent && dot(transition->turn, transition->turn) > 0.0) turn_bend(L, manoeuvred ? ERRORS : MOTION, transition->turn, x, P);
}

WIDE static void transit(Member *member, const Transition *transition) {
    transit_abreast(1, member->errors > MOTION, bends(member), transition, member->x, member->P[0]);
}

/* Process noise of members abreast. */
typedef struct {
    double white[ABREAST], jerk[ABREAST], wander[ABREAST], execution[ABREAST];
} NoiseAbreast;

static void put_noise(ProcessNoise noise, int m, NoiseAbreast *noises) {
    noises->white[m] = noise.white, noises->jerk[m] = noise.jerk, noises->wander[m] = noise.wander, noises->execution[m] = noise.execution;
}

/* What process noise adds in a transition to L members that have errors of thrusters, or bend. */
static ALWAYS_INLINE void add_noise_abreast(int L, int manoeuvred, int bent, const NoiseAbreast *noise, const Transition *transition, double *P) {
    const double T = transition->span;
    const int thrust = bent ? THRUST : UNBENT - OF_THRUST;
    add_noise(L, noise->white, T, P, ERRORS * L);
    if (bent) add_white_jerk(L, noise->jerk, T, P);
    if (!manoeuvred) return;
    for (int k = thrust; k < thrust + OF_THRUST; k++)
        for (int m = 0; m < L; m++) P[ROW(L, k, k) + m] += noise->wander[m] * T;
    add_execution(L, noise->execution, transition->pushes, P);
}

static void add_process_noise(Member *member, ProcessNoise noise, const Transition *transition) {
    NoiseAbreast one;
    put_noise(noise, 0, &one);
    add_noise_abreast(1, member->errors > MOTION, 1, &one, transition, member->P[0]);
}

static void advance_member(Member *member, ProcessNoise noise, const Transition *transition) {
    transit(member, transition);
    add_process_noise(member, noise, transition);
}

/* The process noise of a kind. */
static ProcessNoise noise_of(const OnlineOptions *options, double steady) {
    ProcessNoise noise = PROCESS_NOISE[(int)steady];
    if (options->on_orbit != 0.0) noise.jerk = noise.bend * noise.bend / SPAN_OF_FORCES;
    noise.wander *= options->thrust * options->thrust, noise.execution *= options->thrust * options->thrust;
    return noise;
}

/* The large filter, or its shadow: for them what the thrusters are wrong by is noise of each transition. */
static void advance_large(const Online *filter, Member *large, const Transition *transition) {
    for (int k = THRUST; k < ERRORS; k++)
        for (int j = THRUST; j < ERRORS; j++) large->P[k][j] = 0.0;
    advance_member(large, (ProcessNoise){.white = filter->allowed}, transition);
    add_thrust(filter, transition, &large->P[0][0], ERRORS);
}

/* All members of a bank of the filter. */
static void advance_bank(const Online *filter, const Transition *transition, PackedMember bank[MEMBERS + 1]) {
    Member member;
    for (int m = 0; m <= SHADOW; m++) {
        if (!is_alive(&bank[m])) continue;
        unpack_member(&bank[m], &member);
        if (m == SHADOW) advance_large(filter, &member, transition);
        else advance_member(&member, noise_of(&filter->options, member.steady), transition);
        pack_member(&member, &bank[m]);
    }
}

/* The offset that a node sees is of other features than the one before, and so is the scale: uncertain by as much more. What was
   known of them before tells of them as it does by the map: where a feature that was not seen comes back, the one may be half of
   the other. Of n errors of L members. */
static ALWAYS_INLINE void change(int L, int n, const Measurement *measurement, double *restrict x, double *restrict P) {
    double rows[OF_MAP][ERRORS * ABREAST], by[OF_MAP * ABREAST], *of_map = P + ROW(L, OFFSET, 0);
    for (int a = 0; a < OF_MAP; a++) {
        const double *follow = measurement->follow[a];
        for (int m = 0; m < L; m++) by[a * L + m] = by_column(OF_MAP, follow, x + OFFSET * L + m, L);
        for (int j = 0; j < n * L; j++) rows[a][j] = of_map[ROW(L, a, 0) + j] + by_column(OF_MAP, follow, of_map + j, ERRORS * L);
    }
    for (int a = 0; a < OF_MAP; a++) {
        for (int m = 0; m < L; m++) x[(OFFSET + a) * L + m] += by[a * L + m];
        for (int b = 0; b < n; b++)
            for (int m = 0; m < L; m++) P[ROW(L, b, OFFSET + a) + m] = rows[a][b * L + m];
    }
    for (int a = 0; a < OF_MAP; a++) {
        const double *follow = measurement->follow[a];
        for (int j = OFFSET * L; j < PATH_AND_MAP * L; j++) rows[a][j] = of_map[ROW(L, a, 0) + j] + by_column(OF_MAP, follow, of_map + j, ERRORS * L);
        for (int b = 0; b < OF_MAP; b++)
            for (int m = 0; m < L; m++) rows[a][(OFFSET + b) * L + m] += measurement->change[a][b];
    }
    for (int a = 0; a < OF_MAP; a++)
        for (int b = 0; b < n; b++)
            for (int m = 0; m < L; m++) of_map[ROW(L, a, b) + m] = rows[a][b * L + m];
}

static ALWAYS_INLINE void change_abreast(int L, int manoeuvred, int bent, const Measurement *measurement, double *x, double *P) {
    if (manoeuvred && bent) change(L, ERRORS, measurement, x, P);
    else if (manoeuvred) change(L, UNBENT, measurement, x, P);
    else if (bent) change(L, MOTION, measurement, x, P);
    else change(L, PATH_AND_MAP, measurement, x, P);
}

WIDE static void add_change(Member *member, const Measurement *measurement) {
    change_abreast(1, member->errors > MOTION, bends(member), measurement, member->x, member->P[0]);
}

/* A member goes on to a node, unless it has, and what it sees there is of other features than at the one before. */
static void go_to_node(const OnlineOptions *options, Member *member, const Measurement *measurement) {
    if (measurement->since) transit(member, measurement->since);
    add_change(member, measurement);
    if (measurement->since) add_process_noise(member, noise_of(options, member->steady), measurement->since);
}

/* What a node is not where L members predict it: e, its covariance C, of which the lower triangle is set, and what it is with n errors of
   the members, B. */
static ALWAYS_INLINE void innovate(int L, int n, int bent, const Measurement *measurement, const double *restrict x, const double *restrict P,
                                   double *restrict e, double *restrict C, double (*restrict B)[ERRORS * ABREAST]) {
    const double bend = measurement->bend;
    const int thrust = n - OF_THRUST;
    double by[3][PATH_AND_MAP];
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++) {
            by[k][i] = i == k;
            by[k][3 + i] = -measurement->lag[k][i];
            by[k][OFFSET + i] = measurement->offset[k][i];
        }
        by[k][SCALE] = measurement->scale[k];
        for (int j = 0; j < n * L; j++) {
            B[k][j] = P[ROW(L, k, 0) + j] + by_column(PATH_AND_MAP - 3, &by[k][3], P + ROW(L, 3, 0) + j, ERRORS * L);
            if (n > MOTION) B[k][j] += by_column(OF_THRUST, measurement->by_thrust[k], P + ROW(L, thrust, 0) + j, ERRORS * L);
            if (bent) B[k][j] += bend * P[ROW(L, PATH_AND_MAP + k, 0) + j];
        }
    }
    for (int k = 0; k < 3; k++) {
        for (int m = 0; m < L; m++) {
            double off = measurement->c[k] - x[k * L + m] - by_column(PATH_AND_MAP - 3, &by[k][3], x + 3 * L + m, L);
            if (bent) off -= bend * x[(PATH_AND_MAP + k) * L + m];
            if (n > MOTION) off -= by_column(OF_THRUST, measurement->by_thrust[k], x + thrust * L + m, L);
            e[k * L + m] = off;
        }
        for (int i = 0; i <= k; i++)
            for (int m = 0; m < L; m++) {
                double sum = measurement->noise[k][i] + B[k][i * L + m] + by_column(PATH_AND_MAP - 3, &by[i][3], &B[k][3 * L + m], L);
                if (bent) sum += bend * B[k][(PATH_AND_MAP + i) * L + m];
                if (n > MOTION) sum += by_column(OF_THRUST, measurement->by_thrust[i], &B[k][thrust * L + m], L);
                C[(3 * k + i) * L + m] = sum;
            }
    }
}

static ALWAYS_INLINE void innovate_abreast(int L, int manoeuvred, int bent, const Measurement *measurement, const double *x, const double *P,
                                           double *e, double *C, double (*B)[ERRORS * ABREAST]) {
    if (manoeuvred && bent) innovate(L, ERRORS, 1, measurement, x, P, e, C, B);
    else if (manoeuvred) innovate(L, UNBENT, 0, measurement, x, P, e, C, B);
    else if (bent) innovate(L, MOTION, 1, measurement, x, P, e, C, B);
    else innovate(L, PATH_AND_MAP, 0, measurement, x, P, e, C, B);
}

/* Covariances C of L members' innovations, of which the lower triangle is set, become their factors L D L', with D^-1 on the diagonal in place of ones: so
   there are no roots, which compilers do not take together. 0 where one has none. */
static ALWAYS_INLINE int separated(int L, double *restrict C) {
    double unsound = 0.0;
    for (int m = 0; m < L; m++) {
        const double c00 = C[m], c10 = C[3 * L + m], c11 = C[4 * L + m], c20 = C[6 * L + m], c21 = C[7 * L + m], c22 = C[8 * L + m];
        const double by0 = 1.0 / c00, l10 = c10 * by0, l20 = c20 * by0, d1 = c11 - l10 * c10, by1 = 1.0 / d1;
        const double left = c21 - l20 * c10, l21 = left * by1, d2 = c22 - l20 * c20 - l21 * left;
        const int sound = (c00 > 0.0) & (d1 > INDEFINITE * c11) & (d2 > INDEFINITE * c22);
        unsound += sound ? 0.0 : 1.0;
        C[m] = by0, C[3 * L + m] = l10, C[4 * L + m] = by1, C[6 * L + m] = l20, C[7 * L + m] = l21, C[8 * L + m] = 1.0 / d2;
    }
    return unsound == 0.0;
}

/* Three rows of n numbers of L members become independent by such factors. */
static ALWAYS_INLINE void separate(int L, int n, const double *restrict C, double *restrict first, double *restrict second, double *restrict last) {
    for (int a = 0; a < n; a++)
        for (int m = 0; m < L; m++) {
            const int j = a * L + m;
            second[j] -= C[3 * L + m] * first[j];
            last[j] -= C[6 * L + m] * first[j] + C[7 * L + m] * second[j];
        }
}

/* Of a member. */
static void whiten(const double C[9], double e[3]) {
    separate(1, 1, C, &e[0], &e[1], &e[2]);
    for (int k = 0; k < 3; k++) e[k] *= sqrt(C[4 * k]);
}

/* The same of a member, with the factors C of the covariance; 0 if there are none. */
WIDE static int innovation(const Member *member, const Measurement *measurement, double e[3], double C[9], double B[3][ERRORS * ABREAST]) {
    innovate_abreast(1, member->errors > MOTION, bends(member), measurement, member->x, member->P[0], e, C, B);
    return separated(1, C);
}

/* B' C of three rows is added to the lower triangle of the rows from `begin` to `end` of covariances of L members, up to a width. */
static ALWAYS_INLINE void add_to_rows(int L, int begin, int end, int width, const double (*restrict B)[ERRORS * ABREAST],
                                      const double (*restrict C)[ERRORS * ABREAST], double *restrict P) {
    for (int a = begin; a < end; a++)
        for (int b = 0; b < (L > 1 ? a + 1 : width); b++)
            for (int m = 0; m < L; m++)
                P[ROW(L, a, b) + m] += B[0][a * L + m] * C[0][b * L + m] + B[1][a * L + m] * C[1][b * L + m] + B[2][a * L + m] * C[2][b * L + m];
}

/* The same of n errors. */
static ALWAYS_INLINE void add_products(int L, int n, int bent, const double B[3][ERRORS * ABREAST], const double C[3][ERRORS * ABREAST], double *P) {
    add_to_rows(L, 0, OFFSET, OFFSET, B, C, P);
    add_to_rows(L, OFFSET, PATH_AND_MAP, PATH_AND_MAP, B, C, P);
    if (bent) add_to_rows(L, PATH_AND_MAP, MOTION, MOTION, B, C, P);
    if (n > MOTION) add_to_rows(L, n - OF_THRUST, n, n, B, C, P);
}

/* Where the path is as a member takes it for, successive innovations have nothing in common. One that may be a jump, whitened like all, does not count. */
static void note_innovation(const double e[3], Trend *trend) {
    if (dot(e, e) > GATE) return;
    if (dot(trend->last, trend->last) > 0.0) trend->terms += 3.0;
    trend->sum += dot(e, trend->last);
    for (int k = 0; k < 3; k++) trend->last[k] = e[k];
}

/* The update of n errors of L members with a node: e, independent, B of `innovate` and the factors C. */
static ALWAYS_INLINE void learn(int L, int n, int bent, const double *restrict e, const double *restrict C, double (*restrict B)[ERRORS * ABREAST],
                                 double *restrict x, double *restrict P) {
    double less[3][ERRORS * ABREAST], more[ERRORS * ABREAST];
    separate(L, n, C, B[0], B[1], B[2]);
    for (int a = 0; a < n; a++)
        for (int m = 0; m < L; m++) {
            const int j = a * L + m;
            for (int k = 0; k < 3; k++) less[k][j] = -B[k][j] * C[4 * k * L + m];
            x[j] -= less[0][j] * e[m] + less[1][j] * e[L + m] + less[2][j] * e[2 * L + m];
            more[j] = ROUNDING * P[ROW(L, a, a) + m];
        }
    add_products(L, n, bent, (const double(*)[ERRORS * ABREAST])less, (const double(*)[ERRORS * ABREAST])B, P);
    for (int a = 0; a < n; a++)
        for (int m = 0; m < L; m++) P[ROW(L, a, a) + m] += more[a * L + m];
}

static ALWAYS_INLINE void update_abreast(int L, int manoeuvred, int bent, const double *e, const double *C, double (*B)[ERRORS * ABREAST], double *x,
                                         double *P) {
    if (manoeuvred && bent) learn(L, ERRORS, 1, e, C, B, x, P);
    else if (manoeuvred) learn(L, UNBENT, 0, e, C, B, x, P);
    else if (bent) learn(L, MOTION, 1, e, C, B, x, P);
    else learn(L, PATH_AND_MAP, 0, e, C, B, x, P);
}

/* What a whitened innovation says of how likely one of L members is, by the factors C. */
static double log_likelihood(int L, const double *C, const double e[3]) { return 0.5 * (log(C[0] * C[4 * L] * C[8 * L]) - dot(e, e)); }

/* The update with a node; 0 if rounding has left the covariance indefinite. */
WIDE static int update_member(Member *member, const Measurement *measurement) {
    const int manoeuvred = member->errors > MOTION, bent = bends(member);
    double e[3], C[9], B[3][ERRORS * ABREAST];
    innovate_abreast(1, manoeuvred, bent, measurement, member->x, member->P[0], e, C, B);
    if (!separated(1, C)) return 0;
    separate(1, 1, C, &e[0], &e[1], &e[2]);
    update_abreast(1, manoeuvred, bent, e, C, B, member->x, member->P[0]);
    return 1;
}
