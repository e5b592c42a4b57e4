/* What a member of the bank goes through: a transition, the change that comes with a node, and the node. From its update on only the
lower triangle of a covariance holds, as that is what is kept of it. Numbers of errors are constants where most of the time is spent:
so compilers take as many numbers at once as the processor does. */

/* Whether its path bends: an acceleration of which nothing is uncertain is zero, and so is all that is known with it. */
static int bends(const Member *member) { return member->P[PATH_AND_MAP][PATH_AND_MAP] != 0.0; }

/* Factors times a column of a matrix whose rows have `stride` numbers. */
static ALWAYS_INLINE double by_column(int count, const double factors[], const double *column, int stride) {
    double sum = factors[0] * column[0];
    for (int k = 1; k < count; k++) sum += factors[k] * column[k * stride];
    return sum;
}

/* What an acceleration adds to a component of (r, v) in T s. */
static double bent_by(int component, double T) { return component < 3 ? 0.5 * T * T : T; }

/* The covariance of n errors goes on by a transition, in which thrusters, if there are errors of them, and an acceleration, if the path
   bends, move it besides. */
static ALWAYS_INLINE void spread_member(int n, int bent, const Transition *transition, double P[ERRORS][ERRORS]) {
    const double(*F)[6] = transition->F, (*by_thrust)[OF_THRUST] = transition->by_thrust;
    double A[6][ERRORS], across[6][6], across_thrust[OF_THRUST][6], s[6];
    for (int a = 0; a < 6; a++) {
        const double by = bent_by(a, transition->span);
        for (int k = 0; k < 6; k++) across[k][a] = F[a][k];
        for (int k = 0; k < OF_THRUST; k++) across_thrust[k][a] = by_thrust[a][k];
        for (int b = 0; b < n; b++) {
            A[a][b] = by_column(6, F[a], &P[0][b], ERRORS);
            if (n > MOTION) A[a][b] += by_column(OF_THRUST, by_thrust[a], &P[THRUST][b], ERRORS);
        }
        for (int b = 0; b < n && bent; b++) A[a][b] += by * P[PATH_AND_MAP + a % 3][b];
    }
    for (int a = 0; a < 6; a++) {
        for (int b = 0; b < 6; b++) {
            s[b] = by_column(6, A[a], &across[0][b], 6);
            if (n > MOTION) s[b] += by_column(OF_THRUST, &A[a][THRUST], &across_thrust[0][b], 6);
        }
        for (int b = 0; b < 6 && bent; b++) s[b] += bent_by(b, transition->span) * A[a][PATH_AND_MAP + b % 3];
        s[a] += ROUNDING * s[a];
        for (int b = 0; b <= a; b++) P[a][b] = P[b][a] = s[b];
        for (int b = 6; b < n; b++) P[a][b] = P[b][a] = A[a][b];
    }
}

/* The transition, and what an acceleration adds, in a straight line: an orbit is gone in small arcs. Without process noise. */
WIDE static void transit(Member *member, const Transition *transition) {
    const double T = transition->span;
    const int bent = bends(member);
    double x[6];
    for (int a = 0; a < 6; a++) {
        x[a] = transition->step[a] + by_column(6, transition->F[a], member->x, 1);
        if (bent) x[a] += bent_by(a, T) * member->x[PATH_AND_MAP + a % 3];
        if (member->errors > MOTION) x[a] += by_column(OF_THRUST, transition->by_thrust[a], &member->x[THRUST], 1);
    }
    for (int a = 0; a < 6; a++) member->x[a] = x[a];
    if (member->errors > MOTION && bent) spread_member(ERRORS, 1, transition, member->P);
    else if (member->errors > MOTION) spread_member(ERRORS, 0, transition, member->P);
    else if (bent) spread_member(MOTION, 1, transition, member->P);
    else spread_member(PATH_AND_MAP, 0, transition, member->P);
}

/* What process noise adds in a transition. */
static void add_process_noise(Member *member, ProcessNoise noise, const Transition *transition) {
    const double T = transition->span;
    add_noise(noise.white, T, &member->P[0][0], ERRORS);
    if (noise.jerk > 0.0) add_white_jerk(noise.jerk, T, member->P);
    for (int k = THRUST; k < (int)member->errors; k++) member->P[k][k] += noise.wander * T;
    if (noise.execution > 0.0) add_execution(noise.execution, transition->pushes, member->P);
}

static void advance_member(Member *member, ProcessNoise noise, const Transition *transition) {
    transit(member, transition);
    add_process_noise(member, noise, transition);
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

/* The offset that a node sees is of other features than the one before, and so is the scale: uncertain by as much more. What was
   known of them before tells of them as it does by the map: where a feature that was not seen comes back, the one may be half of
   the other. */
WIDE static void add_change(Member *member, const Measurement *measurement) {
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

/* A member goes on to a node, unless it has, and what it sees there is of other features than at the one before; without process noise. */
static void move_to_node(Member *member, const Measurement *measurement) {
    if (measurement->since) transit(member, measurement->since);
    add_change(member, measurement);
}

/* The process noise since the node before, unless a member has gone on. */
static void add_noise_since(const OnlineOptions *options, Member *member, const Measurement *measurement) {
    if (measurement->since) add_process_noise(member, noise_of(options, member), measurement->since);
}

static void go_to_node(const OnlineOptions *options, Member *member, const Measurement *measurement) {
    move_to_node(member, measurement);
    add_noise_since(options, member, measurement);
}

/* What n errors are with a coordinate of what a node says, which goes with (r, v, offset, scale) by `by`, and with an acceleration, if the
   path bends, and errors of thrusters. */
static ALWAYS_INLINE void with_node(int n, int bent, int k, const double by[PATH_AND_MAP], const Measurement *measurement,
                                    const double P[ERRORS][ERRORS], double *restrict row) {
    for (int a = 0; a < n; a++) {
        row[a] = P[k][a] + by_column(PATH_AND_MAP - 3, &by[3], &P[3][a], ERRORS);
        if (n > MOTION) row[a] += by_column(OF_THRUST, measurement->by_thrust[k], &P[THRUST][a], ERRORS);
    }
    for (int a = 0; a < n && bent; a++) row[a] += measurement->bend * P[PATH_AND_MAP + k][a];
}

/* What a node is not where a member predicts it: e, its covariance's Cholesky factor L, and what it is with the member's errors, B; 0 if
   there is no factor. */
WIDE static int innovation(const Member *member, const Measurement *measurement, double e[3], double L[9], double B[3][ERRORS]) {
    const double bend = measurement->bend, (*P)[ERRORS] = member->P;
    const int manoeuvred = member->errors > MOTION, bent = bends(member);
    double by[3][PATH_AND_MAP];
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++) {
            by[k][i] = i == k;
            by[k][3 + i] = -measurement->lag[k][i];
            by[k][OFFSET + i] = measurement->offset[k][i];
        }
        by[k][SCALE] = measurement->scale[k];
        if (manoeuvred && bent) with_node(ERRORS, 1, k, by[k], measurement, P, B[k]);
        else if (manoeuvred) with_node(ERRORS, 0, k, by[k], measurement, P, B[k]);
        else if (bent) with_node(MOTION, 1, k, by[k], measurement, P, B[k]);
        else with_node(PATH_AND_MAP, 0, k, by[k], measurement, P, B[k]);
    }
    for (int k = 0; k < 3; k++) {
        e[k] = measurement->c[k] - member->x[k] - by_column(PATH_AND_MAP - 3, &by[k][3], &member->x[3], 1) - bend * member->x[PATH_AND_MAP + k];
        if (manoeuvred) e[k] -= by_column(OF_THRUST, measurement->by_thrust[k], &member->x[THRUST], 1);
        for (int j = 0; j <= k; j++) {
            L[3 * k + j] = measurement->noise[k][j] + B[k][j] + by_column(PATH_AND_MAP - 3, &by[j][3], &B[k][3], 1);
            if (bent) L[3 * k + j] += bend * B[k][PATH_AND_MAP + j];
            if (manoeuvred) L[3 * k + j] += by_column(OF_THRUST, measurement->by_thrust[j], &B[k][THRUST], 1);
        }
    }
    return factored(3, L);
}

/* B' C of three rows is added to the lower triangle of the rows from `begin` to `end` of a covariance, up to a width. */
static ALWAYS_INLINE void add_to_rows(int begin, int end, int width, const double B[3][ERRORS], const double C[3][ERRORS], double (*restrict P)[ERRORS]) {
    for (int a = begin; a < end; a++) {
        const double x = B[0][a], y = B[1][a], z = B[2][a];
        for (int b = 0; b < width; b++) P[a][b] += x * C[0][b] + y * C[1][b] + z * C[2][b];
    }
}

/* The same of all rows of a member: those of an acceleration are zero unless its path bends. */
WIDE static void add_products(Member *member, const double B[3][ERRORS], const double C[3][ERRORS]) {
    add_to_rows(0, OFFSET, OFFSET, B, C, member->P);
    add_to_rows(OFFSET, PATH_AND_MAP, PATH_AND_MAP, B, C, member->P);
    if (bends(member)) add_to_rows(PATH_AND_MAP, MOTION, MOTION, B, C, member->P);
    if (member->errors > MOTION) add_to_rows(THRUST, ERRORS, ERRORS, B, C, member->P);
}

/* Where the path is as a member takes it for, successive innovations have nothing in common. One that may be a jump, whitened like all, does not count. */
static void note_innovation(const double e[3], Trend *trend) {
    if (dot(e, e) > GATE) return;
    if (dot(trend->last, trend->last) > 0.0) trend->terms += 3.0;
    trend->sum += dot(e, trend->last);
    for (int k = 0; k < 3; k++) trend->last[k] = e[k];
}

/* The update with a node; 0 if rounding has left the covariance indefinite. Of a member that becomes less likely than `least`, only how likely. */
static int update_member(Member *member, const Measurement *measurement, double least) {
    const int n = member->errors > MOTION ? ERRORS : bends(member) ? MOTION : PATH_AND_MAP;
    double e[3], L[9], B[3][ERRORS], less[3][ERRORS], more[ERRORS];
    if (!innovation(member, measurement, e, L, B)) return 0;
    whitened(L, e);
    member->weight -= 0.5 * dot(e, e) + log(L[0] * L[4] * L[8]);
    if (member->weight < least) return 1;
    note_innovation(e, &member->trend);
    whiten_rows(L, n, ERRORS, B[0]);
    for (int a = 0; a < n; a++) {
        for (int k = 0; k < 3; k++) less[k][a] = -B[k][a];
        member->x[a] += B[0][a] * e[0] + B[1][a] * e[1] + B[2][a] * e[2];
        more[a] = ROUNDING * member->P[a][a];
    }
    add_products(member, less, B);
    for (int a = 0; a < n; a++) member->P[a][a] += more[a];
    return 1;
}
