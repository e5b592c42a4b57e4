/* The density of white acceleration: filters of (r, v, offset) with one density each, weighed by their likelihood.

The large filter goes with the mean of their logarithms, which changes as the evidence grows. One more member, its
shadow, does the same: by what the mixture differs from the shadow, the large filter's estimate is corrected
(mixture.c). Further members have jumped (jumps.c). A member sees where a frame puts the map's centre of mass: r + R d,
d being what the map's offset is wrong by. */

#define LOG_LEAST (-36.841361487904734) /* logarithm of the least density */
#define LOG_RATIO 3.453877639491069     /* of one to the one before, 10^1.5 */
#define UNLIKELY (-12.0)

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

/* What the large filter's errors are with those of (r, v, offset), the offset being what the last node saw: its share
   of each feature's error. */
static void with_level(const Online *filter, int n, double G[LEVEL][MOST_ERRORS]) {
    for (int j = 0; j < n; j++) {
        for (int a = 0; a < 6; a++) G[a][j] = filter->P[PLACE + a][j];
        for (int a = 6; a < LEVEL; a++) G[a][j] = 0.0;
    }
    for (int f = 0; f < (int)filter->used; f++)
        for (int a = 0; a < 3; a++)
            for (int k = 0; k < 3; k++) {
                double part = filter->share[f][a][k], *to = G[6 + a];
                const double *row = filter->P[BODY + 3 * f + k];
                for (int j = 0; j < n; j++) to[j] += part * row[j];
            }
}

/* The covariance of (r, v, offset) from what they are with all errors. */
static void among_level(const Online *filter, double G[LEVEL][MOST_ERRORS], double P[LEVEL][LEVEL]) {
    for (int a = 0; a < LEVEL; a++)
        for (int b = 0; b <= a; b++) {
            double sum = b < 6 ? G[a][PLACE + b] : 0.0;
            for (int f = 0; f < (int)filter->used && b >= 6; f++)
                sum += dot(filter->share[f][b - 6], &G[a][BODY + 3 * f]);
            P[a][b] = P[b][a] = sum;
        }
}

/* The large filter's covariance of (r, v, offset). */
static void of_level(const Online *filter, double P[LEVEL][LEVEL]) {
    double G[LEVEL][MOST_ERRORS];
    with_level(filter, BODY + 3 * (int)filter->used, G);
    among_level(filter, G, P);
}

static int is_alive(const Member *member) { return member->weight > -INFINITY; }

/* All members as the large filter is; none has jumped. */
static void start_bank(Online *filter) {
    Member first = {{0}, {{0}}, 0.0, 0.0, 0.0, {0}, 0.0};
    for (int k = 0; k < 6; k++) first.x[k] = filter->x[k];
    of_level(filter, first.P);
    for (int m = 0; m <= SHADOW; m++) {
        first.steady = m;
        first.weight = m < DENSITIES ? fmax(filter->bank[m].weight, UNLIKELY) : m < SHADOW ? -INFINITY : 0.0;
        filter->bank[m] = first;
    }
}

/* Over T s with the density q: x is step + F x. */
static void advance_member(Member *member, double q, double T, const double step[6], const double F[6][6]) {
    double x[6], A[6][LEVEL];
    for (int a = 0; a < 6; a++) {
        x[a] = step[a];
        for (int k = 0; k < 6; k++) x[a] += F[a][k] * member->x[k];
        for (int b = 0; b < LEVEL; b++) {
            double s = 0.0;
            for (int k = 0; k < 6; k++) s += F[a][k] * member->P[k][b];
            A[a][b] = s;
        }
    }
    for (int a = 0; a < 6; a++) {
        member->x[a] = x[a];
        for (int b = 0; b <= a; b++) {
            double s = 0.0;
            for (int k = 0; k < 6; k++) s += A[a][k] * F[b][k];
            member->P[a][b] = member->P[b][a] = a == b ? s + ROUNDING * s : s;
        }
        for (int b = 6; b < LEVEL; b++) member->P[a][b] = member->P[b][a] = A[a][b];
    }
    add_noise(q, T, &member->P[0][0], LEVEL);
}

/* All members, the shadow with its own density. */
static void advance_bank(Member bank[MEMBERS + 1], double density, double T, const double step[6], const double F[6][6]) {
    for (int m = 0; m <= SHADOW; m++) {
        double q = m == SHADOW ? density : DENSITY[(int)bank[m].steady];
        if (is_alive(&bank[m])) advance_member(&bank[m], q, T, step, F);
    }
}

/* What a node is not where a member foresees it: e, its covariance's Cholesky factor L, and the members' errors by it, B; 0 if
   there is no factor. */
static int innovation(const Member *member, const Level *level, double e[3], double L[9], double B[LEVEL][3]) {
    const double(*late)[3] = level->lag, (*R)[3] = level->offset;
    for (int a = 0; a < LEVEL; a++)
        for (int k = 0; k < 3; k++)
            B[a][k] = member->P[a][k] - dot(&member->P[a][3], late[k]) + dot(&member->P[a][6], R[k]);
    for (int k = 0; k < 3; k++) {
        e[k] = level->c[k] - member->x[k] - dot(R[k], &member->x[6]) + dot(late[k], &member->x[3]);
        for (int j = 0; j < 3; j++) {
            L[3 * k + j] = B[k][j] + level->noise[k][j];
            for (int i = 0; i < 3; i++) L[3 * k + j] += R[k][i] * B[6 + i][j] - late[k][i] * B[3 + i][j];
        }
    }
    return factored(3, L);
}

static void whitened(const double L[9], double e[3]) {
    for (int k = 0; k < 3; k++) {
        for (int j = 0; j < k; j++) e[k] -= L[3 * k + j] * e[j];
        e[k] /= L[4 * k];
    }
}

/* The update with a node; 0 if rounding has left the covariance indefinite. */
static int update_member(Member *member, const Level *level) {
    double e[3], L[9], B[LEVEL][3];
    if (!innovation(member, level, e, L, B)) return 0;
    whitened(L, e);
    member->weight -= 0.5 * dot(e, e) + log(L[0] * L[4] * L[8]);
    for (int a = 0; a < LEVEL; a++) {
        whitened(L, B[a]);
        member->x[a] += dot(B[a], e);
    }
    for (int a = 0; a < LEVEL; a++) {
        double before = member->P[a][a];
        for (int b = 0; b < LEVEL; b++) member->P[a][b] -= dot(B[a], B[b]);
        member->P[a][a] += ROUNDING * before;
    }
    return 1;
}

/* The offset that a node sees is of other features than the one before: uncertain by as much more. */
static void add_change(Member *member, const Level *level) {
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) member->P[6 + a][6 + b] += level->change[a][b];
}

static int likeliest(const Member bank[MEMBERS]) {
    int best = 0;
    for (int m = 1; m < MEMBERS; m++)
        if (bank[m].weight > bank[best].weight) best = m;
    return best;
}
