/* The density of white acceleration: filters of (r, v, offset) with one density each, weighed by their likelihood.

The large filter goes with the mean of their logarithms, which changes as the evidence grows. One more member, its
shadow, does the same: by what the mixture differs from the shadow, the large filter's estimate is corrected.
A member sees where a frame puts the map's centre of mass: r + R d, d being what the map's offset is wrong by. A member
far less likely than the best goes on from the best's state, so that no evidence is older than it has to be. */

#define LEAST_DENSITY 1e-16 /* m2/s3 */
#define RATIO 31.622776601683793
#define UNLIKELY (-12.0)

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

/* All members as the large filter is. */
static void start_bank(Online *filter) {
    Member first = {{0}, {{0}}, 0.0};
    for (int k = 0; k < 6; k++) first.x[k] = filter->x[k];
    of_level(filter, first.P);
    for (int m = 0; m <= SHADOW; m++) filter->bank[m] = first;
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
                member->P[a][b] = member->P[b][a] = s;
            }
            for (int b = 6; b < LEVEL; b++) member->P[a][b] = member->P[b][a] = A[a][b];
        }
        for (int a = 0; a < 3; a++) {
            member->P[a][a] += q * T * T * T / 3.0;
            member->P[3 + a][3 + a] += q * T;
            member->P[a][3 + a] += q * T * T / 2.0;
            member->P[3 + a][a] = member->P[a][3 + a];
        }
    }
}

/* c is seen `lag` s before the time of the state. */
static void update_member(Member *member, double lag, const double c[3], const double R[3][3],
                          const double noise[3][3]) {
    double e[3], B[LEVEL][3], S[3][3], L[9], W[LEVEL][3];
    for (int a = 0; a < LEVEL; a++)
        for (int k = 0; k < 3; k++)
            B[a][k] = member->P[a][k] - lag * member->P[a][3 + k] + dot(&member->P[a][6], R[k]);
    for (int k = 0; k < 3; k++) {
        e[k] = c[k] - member->x[k] - dot(R[k], &member->x[6]);
        e[k] += lag * member->x[3 + k];
        for (int j = 0; j < 3; j++)
            S[k][j] = B[k][j] - lag * B[3 + k][j] + R[k][0] * B[6][j] + R[k][1] * B[7][j] + R[k][2] * B[8][j] + noise[k][j];
    }
    for (int k = 0; k < 9; k++) L[k] = S[k / 3][k % 3];
    if (!factored(3, L)) return;
    for (int k = 0; k < 3; k++) {
        for (int j = 0; j < k; j++) e[k] -= L[3 * k + j] * e[j];
        e[k] /= L[4 * k];
    }
    member->weight -= 0.5 * dot(e, e) + log(L[0] * L[4] * L[8]);
    for (int a = 0; a < LEVEL; a++) {
        for (int k = 0; k < 3; k++) {
            W[a][k] = B[a][k];
            for (int j = 0; j < k; j++) W[a][k] -= L[3 * k + j] * W[a][j];
            W[a][k] /= L[4 * k];
        }
        member->x[a] += dot(W[a], e);
    }
    for (int a = 0; a < LEVEL; a++)
        for (int b = 0; b < LEVEL; b++) member->P[a][b] -= dot(W[a], W[b]);
}

/* moved: by what the map's offset changed after this frame. */
static void update_bank(Online *filter, double lag, const double c[3], const double R[3][3],
                        const double noise[3][3], const double moved[3]) {
    int best = 0;
    for (int m = 0; m <= SHADOW; m++) {
        update_member(&filter->bank[m], lag, c, R, noise);
        for (int k = 0; k < 3; k++) filter->bank[m].x[6 + k] -= moved[k];
        if (m < SHADOW && filter->bank[m].weight > filter->bank[best].weight) best = m;
    }
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
