/* What the path is, besides what is known of it: filters of (r, v, offset) that take it for one thing each, weighed by their
likelihood.

Some take it for straight, or the orbit that is told, with white acceleration of one density each. The large filter goes with
the mean of the logarithms of these, which changes as the evidence grows. One more member, its shadow, does the same: by what
their mixture differs from the shadow, the large filter's estimate is corrected (mixture.c). Others take the path for bent, by
an acceleration in a random walk, which they estimate, too: gravity where no orbit is told, drag, light. They stand for themselves
(posterior.c). Others take thrusters for changing (wander.c), and further ones have jumped (jumps.c). A member sees where a frame puts the map's centre of mass: r + R d + g s,
d being what the map's offset is wrong by, and s its size: where depths are far less precise than directions, as a stereo rig's
are, a map that is too large is seen too far away, in all frames alike. Of the size a member knows what the large filter does. */

/* What a member takes the path for: densities of white acceleration, m2/s3, and of white jerk, m2/s5, and the deviation of
   an acceleration at first, m/s2; by how much of the told variance thrusters change, 1/s; and how much of it errors have that each push has
   of its own. */
typedef struct {
    double white, jerk, bend, wander, execution;
} ProcessNoise;

#define LOG_LEAST (-36.841361487904734) /* logarithm of the least density */
#define LOG_RATIO 3.453877639491069     /* of one to the one before, 10^1.5 */
#define UNLIKELY (-12.0)
#define BENT_ODDS (-2.0) /* logarithm of the odds that a path bends, by an acceleration of one size, where its orbit is told */
#define WANDER_ODDS BENT_ODDS /* that thrusters change, or that each push has an error of its own, by one size */
/* Where no orbit is told there is one, most likely, and gravity bends the path from the chaser by up to 3 n2 r, in m/s2: 1e-7
   6 m away in a geostationary orbit, 1e-4 30 m away in a low one. The eight members of such sizes are as likely as the other sixteen. */
#define LEAST_OF_GRAVITY 0.5e-7
#define MOST_OF_GRAVITY 2e-4
#define GRAVITY_ODDS 0.6931471805599453

static void add_noise(double q, double T, double *P, int stride) {
    for (int k = 0; k < 3; k++) {
        P[k * stride + k] += q * T * T * T / 3.0;
        P[(3 + k) * stride + 3 + k] += q * T;
        P[k * stride + 3 + k] += q * T * T / 2.0;
        P[(3 + k) * stride + k] += q * T * T / 2.0;
    }
}

/* Of the members without a jump, m2/s3. */
static const double DENSITY[DENSITIES] = {1e-16, 3.1622776601683794e-15, 1e-13, 3.1622776601683794e-12,
                                          1e-10, 3.1622776601683794e-9,  1e-7,  3.1622776601683794e-6};

/* Deviations of an acceleration, m/s2, and the spans in which its random walk is as much, s. */
static const double ACCELERATION[ACCELERATIONS] = {1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1};
static const double WALK_TIME[WALKS] = {1000.0, 30.0};

/* By how much of what is told of them thrusters change in 1000 s, from what the pushes of a flight hardly show on. */
static const double WANDER[WANDERS] = {1e-3, 1e-2, 1e-1, 1.0, 10.0};

/* Standard deviations of what each push is wrong by, as parts of what is told of thrusters. Over a flight pushes tell theirs to a few percent:
   so they are nearer to each other than densities. */
static const double EXECUTION[EXECUTIONS] = {0.0625, 0.125, 0.25, 0.5, 1.0, 2.0};

static ProcessNoise process_noise_of(int kind) {
    if (kind < DENSITIES) return (ProcessNoise){.white = DENSITY[kind]};
    if (kind >= STEADY + WANDERS) {
        const double part = EXECUTION[kind - STEADY - WANDERS];
        return (ProcessNoise){.white = DENSITY[0], .execution = part * part};
    }
    if (kind >= STEADY) return (ProcessNoise){.white = DENSITY[0], .wander = WANDER[kind - STEADY] * WANDER[kind - STEADY] / 1000.0};
    double bend = ACCELERATION[(kind - DENSITIES) % ACCELERATIONS];
    return (ProcessNoise){.white = DENSITY[0], .jerk = bend * bend / WALK_TIME[(kind - DENSITIES) / ACCELERATIONS], .bend = bend};
}

/* The kind of process noise of a member without a jump, and the other way round. */
static int kind_of(const Online *filter, int m) {
    return filter->options.on_orbit != 0.0 && m >= ON_ORBIT ? m - ON_ORBIT + STEADY : m;
}

static int member_of(const Online *filter, int kind) { return kind >= STEADY ? kind - STEADY + ON_ORBIT : kind; }

/* Errors of pushes of a variance, as a part of these, in every direction alike. */
static void add_execution(double variance, const double pushes[3], double P[ERRORS][ERRORS]) {
    for (int k = 0; k < 3; k++) {
        P[k][k] += variance * pushes[0];
        P[3 + k][3 + k] += variance * pushes[1];
        P[k][3 + k] += variance * pushes[2];
        P[3 + k][k] += variance * pushes[2];
    }
}

/* White jerk over T s: of (r, v) and the acceleration. */
static void add_white_jerk(double jerk, double T, double P[ERRORS][ERRORS]) {
    const int AT[3] = {0, 3, PATH_AND_MAP};
    const double square = T * T, Q[3][3] = {{square * square * T / 20.0, square * square / 8.0, square * T / 6.0},
                                            {square * square / 8.0, square * T / 3.0, square / 2.0},
                                            {square * T / 6.0, square / 2.0, T}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++) P[AT[i] + k][AT[j] + k] += jerk * Q[i][j];
}

/* What the large filter's errors are with those of (r, v, offset, scale), the offset being what the last node saw: its share
   of each feature's error. */
static void with_path_and_map(const Online *filter, int n, double G[PATH_AND_MAP][MOST_ERRORS]) {
    for (int j = 0; j < n; j++) {
        for (int a = 0; a < 6; a++) G[a][j] = filter->P[POSITION + a][j];
        for (int a = OFFSET; a < PATH_AND_MAP; a++) G[a][j] = 0.0;
    }
    for (int f = 0; f < (int)filter->used; f++)
        for (int a = 0; a < OF_MAP; a++) {
            const double *x = filter->P[FEATURES + 3 * f], *y = x + MOST_ERRORS, *z = y + MOST_ERRORS, *part = filter->share[f][a];
            for (int j = 0; j < n; j++) G[OFFSET + a][j] += part[0] * x[j] + part[1] * y[j] + part[2] * z[j];
        }
}

/* The covariance of (r, v, offset, scale) from what they are with all errors. */
static void among_path_and_map(const Online *filter, double G[PATH_AND_MAP][MOST_ERRORS], double P[ERRORS][ERRORS]) {
    for (int a = 0; a < PATH_AND_MAP; a++)
        for (int b = 0; b <= a; b++) {
            double sum = b < OFFSET ? G[a][POSITION + b] : 0.0;
            for (int f = 0; f < (int)filter->used && b >= OFFSET; f++)
                sum += dot(filter->share[f][b - OFFSET], &G[a][FEATURES + 3 * f]);
            P[a][b] = P[b][a] = sum;
        }
}

/* The large filter's covariance of (r, v, offset, scale). */
static void of_path_and_map(const Online *filter, double P[ERRORS][ERRORS]) {
    double G[PATH_AND_MAP][MOST_ERRORS];
    with_path_and_map(filter, FEATURES + 3 * (int)filter->used, G);
    among_path_and_map(filter, G, P);
}

static const double NO_SHARE[OF_MAP][3];

static void copy_shares(const double from[OF_MAP][3], double to[OF_MAP][3]) {
    for (int a = 0; a < OF_MAP; a++)
        for (int k = 0; k < 3; k++) to[a][k] = from[a][k];
}

static void centroid_of_map(const Online *filter, double mean[3]) {
    int used = (int)filter->used;
    for (int k = 0; k < 3; k++) {
        mean[k] = 0.0;
        for (int f = 0; f < used; f++) mean[k] += filter->b[f][k] / used;
    }
}

/* What the error of the map's centroid is with all errors. */
static void with_centroid(const Online *filter, double G[3][MOST_ERRORS]) {
    int used = (int)filter->used, n = FEATURES + 3 * used;
    for (int a = 0; a < 3; a++)
        for (int j = 0; j < n; j++) G[a][j] = 0.0;
    for (int f = 0; f < used; f++)
        for (int a = 0; a < 3; a++)
            for (int j = 0; j < n; j++) G[a][j] += filter->P[FEATURES + 3 * f + a][j];
    for (int a = 0; a < 3; a++) scale_block(G[a], n, 1.0 / used);
}

static int is_alive(const PackedMember *member) { return member->weight > -INFINITY; }

/* Of a coordinate of the offset, m2. */
static double offset_variance(const PackedMember *member) {
    return (packed(member, OFFSET, OFFSET) + packed(member, OFFSET + 1, OFFSET + 1) + packed(member, OFFSET + 2, OFFSET + 2)) / 3.0;
}

static int is_bending(const PackedMember *member) { return process_noise_of((int)member->steady).bend > 0.0; }

/* A member that goes on with a process noise from where another one is: of an acceleration it knows what that one does, or nothing yet. One of
   which it would be more than three deviations is not its own: it would take that for as steady as a small one. */
static PackedMember going_on(const PackedMember *from, int steady) {
    PackedMember member = *from;
    double bend = process_noise_of(steady).bend, square = dot(&from->x[PATH_AND_MAP], &from->x[PATH_AND_MAP]) / 3.0;
    if (from->errors != ERRORS) member.errors = bend > 0.0 ? MOTION : PATH_AND_MAP;
    member.steady = steady;
    if ((bend > 0.0) == is_bending(from) && !(bend > 0.0 && square > 9.0 * bend * bend)) return member;
    for (int a = PATH_AND_MAP; a < MOTION; a++) {
        member.x[a] = 0.0;
        for (int b = 0; b < ERRORS; b++) member.P[packed_index(a, b)] = 0.0;
        member.P[packed_index(a, a)] = bend * bend;
    }
    return member;
}

/* How many members without a jump there are. */
static int count_of(const Online *filter) {
    return filter->options.on_orbit == 0.0 ? STEADY : filter->manoeuvred != 0.0 ? ON_ORBIT + WANDERS + EXECUTIONS : ON_ORBIT;
}

/* What a member weighs before the first frame. */
static double first_weight(const Online *filter, int m) {
    if (m >= count_of(filter)) return -INFINITY;
    double bend = process_noise_of(m).bend;
    if (filter->options.on_orbit != 0.0) return m >= ON_ORBIT ? WANDER_ODDS : bend > 0.0 ? BENT_ODDS : 0.0;
    return bend > LEAST_OF_GRAVITY && bend < MOST_OF_GRAVITY ? GRAVITY_ODDS : 0.0;
}

/* The large filter as a member, at x: of the thrusters it knows what the bank said last. */
static Member large_at(const Online *filter, const double x[6]) {
    Member large = {.errors = filter->manoeuvred != 0.0 ? ERRORS : PATH_AND_MAP};
    for (int k = 0; k < 6; k++) large.x[k] = x[k];
    of_path_and_map(filter, large.P);
    for (int a = 0; a < OF_THRUST; a++) {
        large.x[THRUST + a] = filter->thrust[a];
        for (int b = 0; b < OF_THRUST; b++) large.P[THRUST + a][THRUST + b] = filter->of_thrust[a][b];
    }
    return large;
}

/* All members as the large filter is, with the weights that they have; none has jumped. */
static void start_bank(Online *filter) {
    const Member large = large_at(filter, filter->x);
    PackedMember first;
    pack_member(&large, &first);
    for (int m = 0; m < MEMBERS; m++) {
        double weight = m < count_of(filter) ? fmax(filter->bank[m].weight, UNLIKELY) : -INFINITY;
        filter->bank[m] = going_on(&first, m < STEADY ? kind_of(filter, m) : 0);
        filter->bank[m].weight = weight;
    }
    filter->bank[SHADOW] = first;
    for (int a = 0; a < PATH_AND_MAP; a++)
        for (int p = 0; p < PRODUCTS; p++) filter->curve[a][p] = 0.0;
}

/* What an acceleration adds to a component of (r, v) in T s. */
static double bent_by(int component, double T) { return component < 3 ? 0.5 * T * T : T; }

/* Of `advance_member`, what the errors of the thrusters add: to x, and to A, the covariance of (r, v) then with all now. */
static void add_thrust_of_member(const Member *member, const Transition *transition, const double by[6], double x[6], double A[6][ERRORS]) {
    for (int a = 0; a < 6; a++) {
        for (int b = THRUST; b < ERRORS; b++) A[a][b] = by[a] * member->P[PATH_AND_MAP + a % 3][b];
        for (int k = 0; k < 6; k++)
            for (int b = THRUST; b < ERRORS; b++) A[a][b] += transition->F[a][k] * member->P[k][b];
        for (int k = 0; k < OF_THRUST; k++) {
            x[a] += transition->by_thrust[a][k] * member->x[THRUST + k];
            for (int b = 0; b < ERRORS; b++) A[a][b] += transition->by_thrust[a][k] * member->P[THRUST + k][b];
        }
    }
}

/* The transition, and what an acceleration adds, in a straight line: an orbit is gone in small arcs. */
static void advance_member(Member *member, ProcessNoise noise, const Transition *transition) {
    const int n = (int)member->errors;
    const double T = transition->span, (*F)[6] = transition->F;
    double x[6], by[6], A[6][ERRORS], across[6][6];
    for (int a = 0; a < 6; a++) {
        by[a] = n < MOTION ? 0.0 : bent_by(a, T);
        x[a] = transition->step[a] + by[a] * member->x[PATH_AND_MAP + a % 3];
        for (int k = 0; k < 6; k++) x[a] += F[a][k] * member->x[k], across[k][a] = F[a][k];
        for (int b = 0; b < MOTION; b++) A[a][b] = by[a] * member->P[PATH_AND_MAP + a % 3][b];
        for (int k = 0; k < 6; k++)
            for (int b = 0; b < MOTION; b++) A[a][b] += F[a][k] * member->P[k][b];
    }
    if (n > MOTION) add_thrust_of_member(member, transition, by, x, A);
    for (int a = 0; a < 6; a++) {
        double s[6];
        member->x[a] = x[a];
        for (int b = 0; b < 6; b++) s[b] = by[b] * A[a][PATH_AND_MAP + b % 3];
        for (int k = 0; k < 6; k++)
            for (int b = 0; b < 6; b++) s[b] += A[a][k] * across[k][b];
        for (int k = 0; k < OF_THRUST && n > MOTION; k++)
            for (int b = 0; b < 6; b++) s[b] += A[a][THRUST + k] * transition->by_thrust[b][k];
        for (int b = 0; b <= a; b++) member->P[a][b] = member->P[b][a] = a == b ? s[b] + ROUNDING * s[b] : s[b];
        for (int b = 6; b < n; b++) member->P[a][b] = member->P[b][a] = A[a][b];
    }
    add_noise(noise.white, T, &member->P[0][0], ERRORS);
    if (noise.jerk > 0.0) add_white_jerk(noise.jerk, T, member->P);
    for (int k = THRUST; k < n; k++) member->P[k][k] += noise.wander * T;
    if (noise.execution > 0.0) add_execution(noise.execution, transition->pushes, member->P);
}

/* The process noise of a member. */
static ProcessNoise noise_of(const OnlineOptions *options, const Member *member) {
    ProcessNoise noise = process_noise_of((int)member->steady);
    noise.wander *= options->thrust * options->thrust, noise.execution *= options->thrust * options->thrust;
    return noise;
}

/* The large filter, or its shadow: for them what the thrusters are wrong by is noise of each transition. */
static void advance_large(const Online *filter, Member *large, const Transition *transition) {
    for (int k = THRUST; k < ERRORS; k++)
        for (int j = THRUST; j < ERRORS; j++) large->P[k][j] = 0.0;
    advance_member(large, (ProcessNoise){.white = filter->density}, transition);
    add_thrust(filter, transition, &large->P[0][0], ERRORS);
}

/* All members of a bank of the filter. */
static void advance_bank(const Online *filter, const Transition *transition, PackedMember bank[MEMBERS + 1]) {
    Member member;
    for (int m = 0; m <= SHADOW; m++) {
        if (!is_alive(&bank[m])) continue;
        unpack_member(&bank[m], &member);
        if (m == SHADOW) advance_large(filter, &member, transition);
        else advance_member(&member, noise_of(&filter->options, &member), transition);
        pack_member(&member, &bank[m]);
    }
}

/* What a node is not where a member predicts it: e, its covariance's Cholesky factor L, and what it is with the member's errors, B; 0 if
   there is no factor. */
static int innovation(const Member *member, const Measurement *measurement, double e[3], double L[9], double B[3][ERRORS]) {
    const double(*late)[3] = measurement->lag, (*R)[3] = measurement->offset, *g = measurement->scale, bend = measurement->bend;
    const double(*P)[ERRORS] = member->P;
    const int manoeuvred = member->errors > MOTION, n = manoeuvred ? ERRORS : MOTION;
    for (int k = 0; k < 3; k++) { /* along the rows of P, as many numbers at once as the processor takes */
        double *row = B[k];
        for (int a = 0; a < n; a++)
            row[a] = P[k][a] - (late[k][0] * P[3][a] + late[k][1] * P[4][a] + late[k][2] * P[5][a]) +
                     (R[k][0] * P[OFFSET][a] + R[k][1] * P[OFFSET + 1][a] + R[k][2] * P[OFFSET + 2][a]) + g[k] * P[SCALE][a] +
                     bend * P[PATH_AND_MAP + k][a];
        for (int i = 0; i < OF_THRUST && manoeuvred; i++)
            for (int a = 0; a < n; a++) row[a] += measurement->by_thrust[k][i] * P[THRUST + i][a];
    }
    for (int k = 0; k < 3; k++) {
        e[k] = measurement->c[k] - member->x[k] - dot(R[k], &member->x[OFFSET]) + dot(late[k], &member->x[3]);
        e[k] -= g[k] * member->x[SCALE] + bend * member->x[PATH_AND_MAP + k];
        for (int i = 0; i < OF_THRUST && manoeuvred; i++) e[k] -= measurement->by_thrust[k][i] * member->x[THRUST + i];
        for (int j = 0; j < 3; j++) {
            L[3 * k + j] = B[j][k] + g[k] * B[j][SCALE] + bend * B[j][PATH_AND_MAP + k] + measurement->noise[k][j];
            for (int i = 0; i < 3; i++) L[3 * k + j] += R[k][i] * B[j][OFFSET + i] - late[k][i] * B[j][3 + i];
            for (int i = 0; i < OF_THRUST && manoeuvred; i++) L[3 * k + j] += measurement->by_thrust[k][i] * B[j][THRUST + i];
        }
    }
    return factored(3, L);
}

/* The update with a node; 0 if rounding has left the covariance indefinite. */
static int update_member(Member *member, const Measurement *measurement) {
    const int n = (int)member->errors;
    double e[3], L[9], B[3][ERRORS];
    if (!innovation(member, measurement, e, L, B)) return 0;
    whitened(L, e);
    member->weight -= 0.5 * dot(e, e) + log(L[0] * L[4] * L[8]);
    whiten_rows(L, n, ERRORS, B[0]);
    for (int a = 0; a < n; a++) {
        double before = member->P[a][a];
        member->x[a] += B[0][a] * e[0] + B[1][a] * e[1] + B[2][a] * e[2];
        for (int b = 0; b < n; b++) member->P[a][b] -= B[0][a] * B[0][b] + B[1][a] * B[1][b] + B[2][a] * B[2][b];
        member->P[a][a] += ROUNDING * before;
    }
    return 1;
}

/* The offset that a node sees is of other features than the one before, and so is the scale: uncertain by as much more. What was
   known of them before tells of them as it does by the map: where a feature that was not seen comes back, the one may be half of
   the other. */
static void add_change(Member *member, const Measurement *measurement) {
    const int n = (int)member->errors;
    double more[OF_MAP][ERRORS], x[OF_MAP], (*of_map)[ERRORS] = &member->P[OFFSET];
    for (int a = 0; a < OF_MAP; a++) {
        const double *follow = measurement->follow[a];
        x[a] = 0.0;
        for (int b = 0; b < OF_MAP; b++) x[a] += follow[b] * member->x[OFFSET + b];
        for (int j = 0; j < n; j++)
            more[a][j] = follow[0] * of_map[0][j] + follow[1] * of_map[1][j] + follow[2] * of_map[2][j] + follow[3] * of_map[3][j];
    }
    for (int a = 0; a < OF_MAP; a++) {
        member->x[OFFSET + a] += x[a];
        for (int j = 0; j < n; j++) of_map[a][j] += more[a][j];
    }
    for (int a = 0; a < OF_MAP; a++)
        for (int b = 0; b <= a; b++) {
            double sum = measurement->change[a][b] + of_map[a][OFFSET + b];
            for (int k = 0; k < OF_MAP; k++) sum += of_map[a][OFFSET + k] * measurement->follow[b][k];
            more[a][b] = sum;
        }
    for (int a = 0; a < OF_MAP; a++)
        for (int b = 0; b <= a; b++) of_map[a][OFFSET + b] = of_map[b][OFFSET + a] = more[a][b];
    for (int j = 0; j < n; j++)
        for (int a = 0; a < OF_MAP; a++) member->P[j][OFFSET + a] = of_map[a][j];
}

/* Of the map's size a member knows what the large filter does, unless it knows more: that it is right, but for a variance. */
static void know_scale(PackedMember *member, double variance) {
    const double own = packed(member, SCALE, SCALE), off = member->x[SCALE];
    double gain[ERRORS], *row = member->P;
    if (!(own > variance)) return;
    for (int a = 0; a < ERRORS; a++) gain[a] = packed(member, a, SCALE) / own;
    for (int a = 0; a < ERRORS; row += ++a) {
        member->x[a] -= gain[a] * off;
        for (int b = 0; b <= a; b++) row[b] += gain[a] * gain[b] * (variance - own);
    }
}

/* All members know of the map's size what the large filter does. */
static void know_scale_of_map(Online *filter) {
    int used = (int)filter->used;
    double variance = 0.0;
    for (int f = 0; f < used; f++)
        for (int k = 0; k < 3; k++)
            for (int g = 0; g < used; g++)
                variance += filter->share[f][SCALE - OFFSET][k] *
                            dot(filter->share[g][SCALE - OFFSET], &filter->P[FEATURES + 3 * f + k][FEATURES + 3 * g]);
    for (int m = 0; m <= SHADOW; m++)
        if (is_alive(&filter->bank[m])) know_scale(&filter->bank[m], variance);
}

static int likeliest(const PackedMember bank[MEMBERS]) {
    int best = 0;
    for (int m = 1; m < MEMBERS; m++)
        if (bank[m].weight > bank[best].weight) best = m;
    return best;
}
