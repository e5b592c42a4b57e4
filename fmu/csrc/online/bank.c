/* The density of white acceleration: filters of (r, v, offset) with one density each, weighed by their likelihood.

The large filter goes with the mean of their logarithms, which changes as the evidence grows. One more member, its
shadow, does the same: by what the mixture differs from the shadow, the large filter's estimate is corrected.
A member sees where a frame puts the map's centre of mass: r + R d, d being what the map's offset is wrong by. A member
far less likely than the best goes on from the best's state, so that no evidence is older than it has to be. */

#define LEAST_DENSITY 1e-16 /* m2/s3 */
#define RATIO 31.622776601683793
#define UNLIKELY (-12.0)
#define JUMP (-9.2) /* logarithm of the likelihood of one, as that of GATE */

static void add_noise(double q, double T, double *P, int stride) {
    for (int k = 0; k < 3; k++) {
        P[k * stride + k] += q * T * T * T / 3.0;
        P[(3 + k) * stride + 3 + k] += q * T;
        P[k * stride + 3 + k] += q * T * T / 2.0;
        P[(3 + k) * stride + k] += q * T * T / 2.0;
    }
}

static double density_of(int member) { return LEAST_DENSITY * pow(RATIO, member); }

/* The large filter's covariance of (r, v, offset), the offset being that of the features' mean. */
static void of_level(const Online *filter, double P[LEVEL][LEVEL]) {
    int used = (int)filter->used;
    for (int a = 0; a < LEVEL; a++)
        for (int b = 0; b < LEVEL; b++) {
            P[a][b] = a < 6 && b < 6 ? filter->P[PLACE + a][PLACE + b] : 0.0;
            for (int f = 0; f < used && a >= 6; f++) {
                if (b < 6) P[a][b] += filter->P[BODY + 3 * f + a - 6][PLACE + b] / used;
                for (int g = 0; g < used && b >= 6; g++)
                    P[a][b] += filter->P[BODY + 3 * f + a - 6][BODY + 3 * g + b - 6] / ((double)used * used);
            }
        }
    for (int a = 0; a < 6; a++)
        for (int b = 6; b < LEVEL; b++) P[a][b] = P[b][a];
}

/* All members as the large filter is, but for their weights. */
static void start_bank(Online *filter) {
    Member first = {{0}, {{0}}, 0.0};
    for (int k = 0; k < 6; k++) first.x[k] = filter->x[k];
    of_level(filter, first.P);
    for (int m = 0; m <= SHADOW; m++) {
        first.weight = filter->bank[m].weight;
        filter->bank[m] = first;
    }
}

static void advance_bank(Online *filter, double T, const double step[6], const double F[6][6]) {
    for (int m = 0; m <= SHADOW; m++) {
        Member *member = &filter->bank[m];
        double x[6], A[6][LEVEL], q = m == SHADOW ? filter->density : density_of(m);
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

/* The update with a node, `span` s after the one before. An innovation that is else one in ten thousand is a jump: returns the
   density of the acceleration over the span that explains it, else 0; -1 where rounding has left the covariance indefinite. */
static double update_member(Member *member, const Level *level, double span) {
    double e[3], L[9], B[LEVEL][3], jump = 0.0;
    if (!innovation(member, level, e, L, B)) return -1.0;
    double square = dot(e, e), lag = (level->lag[0][0] + level->lag[1][1] + level->lag[2][2]) / 3.0;
    whitened(L, e);
    if (dot(e, e) > GATE && span > 0.0) {
        jump = square / (3.0 * span * (span * span / 3.0 - lag * span + lag * lag));
        add_noise(jump, span, &member->P[0][0], LEVEL);
        member->weight += JUMP;
        if (!innovation(member, level, e, L, B)) return -1.0;
        whitened(L, e);
    }
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
    return jump;
}

/* Returns the density of a jump that the most likely member takes, 0 for none. */
static double update_bank(Online *filter, const Level *level) {
    double jump[DENSITIES];
    int best = 0, sound = 1;
    for (int m = 0; m <= SHADOW; m++) {
        Member *member = &filter->bank[m];
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) member->P[6 + a][6 + b] += level->change[a][b];
        if (m < SHADOW) {
            jump[m] = update_member(member, level, filter->span);
            sound = sound && jump[m] >= 0.0;
            if (member->weight > filter->bank[best].weight) best = m;
        } else {
            add_noise(fmax(jump[best], 0.0), filter->span, &member->P[0][0], LEVEL);
            sound = update_member(member, level, 0.0) >= 0.0 && sound;
        }
    }
    if (!sound) start_bank(filter);
    double highest = filter->bank[best].weight, sum = 0.0, mean = 0.0;
    for (int m = 0; m < DENSITIES; m++) {
        Member *member = &filter->bank[m];
        member->weight -= highest;
        if (!(member->weight > UNLIKELY)) {
            *member = filter->bank[best];
            member->weight = UNLIKELY;
        }
        double w = exp(member->weight);
        sum += w, mean += w * log(density_of(m));
    }
    filter->density = exp(mean / sum);
    return fmax(jump[best], 0.0);
}

/* The mixture of the bank, against the shadow: its mean, and its covariance. */
static void mixed(const Online *filter, double x[LEVEL], double P[LEVEL][LEVEL]) {
    const Member *shadow = &filter->bank[SHADOW];
    double weights[DENSITIES], sum = 0.0;
    for (int m = 0; m < DENSITIES; m++) sum += weights[m] = exp(filter->bank[m].weight);
    for (int a = 0; a < LEVEL; a++) {
        x[a] = 0.0;
        for (int m = 0; m < DENSITIES; m++) x[a] += weights[m] / sum * (filter->bank[m].x[a] - shadow->x[a]);
    }
    for (int a = 0; a < LEVEL; a++)
        for (int b = 0; b < LEVEL; b++) {
            P[a][b] = 0.0;
            for (int m = 0; m < DENSITIES; m++) {
                const Member *member = &filter->bank[m];
                double u = member->x[a] - shadow->x[a] - x[a], v = member->x[b] - shadow->x[b] - x[b];
                P[a][b] += weights[m] / sum * (member->P[a][b] + u * v);
            }
        }
}

/* L A L' of a lower triangle L and a symmetric A. */
static void congruent(const double L[LEVEL * LEVEL], double A[LEVEL][LEVEL]) {
    double T[LEVEL][LEVEL];
    for (int i = 0; i < LEVEL; i++)
        for (int j = 0; j < LEVEL; j++) {
            T[i][j] = 0.0;
            for (int k = 0; k <= i; k++) T[i][j] += L[LEVEL * i + k] * A[k][j];
        }
    for (int i = 0; i < LEVEL; i++)
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k <= j; k++) sum += T[i][k] * L[LEVEL * j + k];
            A[i][j] = A[j][i] = sum;
        }
}

/* The inverse of a lower triangle in place. */
static void invert_triangle(double L[LEVEL * LEVEL]) {
    for (int j = 0; j < LEVEL; j++) {
        L[LEVEL * j + j] = 1.0 / L[LEVEL * j + j];
        for (int i = j + 1; i < LEVEL; i++) {
            double sum = 0.0;
            for (int k = j; k < i; k++) sum += L[LEVEL * i + k] * L[LEVEL * k + j];
            L[LEVEL * i + j] = -sum / L[LEVEL * i + i];
        }
    }
}

/* What is to be added to the large filter's (r, v, offset) and to its covariance, so that this is to the filter's own as the
   mixture's is to the shadow's: with M M' the filter's and S S' the shadow's, M S^-1 P S'^-1 M'. */
static void mixture(const Online *filter, double x[LEVEL], double P[LEVEL][LEVEL]) {
    double own[LEVEL][LEVEL], M[LEVEL * LEVEL], S[LEVEL * LEVEL];
    mixed(filter, x, P);
    of_level(filter, own);
    for (int a = 0; a < LEVEL; a++)
        for (int b = 0; b < LEVEL; b++) {
            M[LEVEL * a + b] = own[a][b];
            S[LEVEL * a + b] = filter->bank[SHADOW].P[a][b];
        }
    if (factored(LEVEL, M) && factored(LEVEL, S)) {
        double scaled[LEVEL][LEVEL], L[LEVEL * LEVEL];
        for (int k = 0; k < LEVEL * LEVEL; k++) scaled[k / LEVEL][k % LEVEL] = P[k / LEVEL][k % LEVEL];
        invert_triangle(S);
        congruent(S, scaled);
        congruent(M, scaled);
        for (int k = 0; k < LEVEL * LEVEL; k++) L[k] = scaled[k / LEVEL][k % LEVEL];
        if (factored(LEVEL, L)) /* else the mixture alone */
            for (int k = 0; k < LEVEL * LEVEL; k++) P[k / LEVEL][k % LEVEL] = scaled[k / LEVEL][k % LEVEL];
    }
    for (int a = 0; a < LEVEL; a++)
        for (int b = 0; b < LEVEL; b++) P[a][b] -= own[a][b];
}
