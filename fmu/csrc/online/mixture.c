/* What the bank says together, and how the large filter follows it. */

typedef enum { ANY, STRAIGHT, BENT } Shape; /* of the path of a member */

/* The mixture of the bank, of members of a shape, against the shadow: its mean, and its covariance, of the errors from `first` on.
   Returns the sum of their weights. */
static double mixed(const PackedMember bank[MEMBERS + 1], Shape shape, int first, double x[ERRORS], double P[ERRORS][ERRORS]) {
    const PackedMember *shadow = &bank[SHADOW];
    double weights[MEMBERS], parts[MEMBERS], sum = 0.0;
    for (int m = 0; m < MEMBERS; m++) {
        const int meant = is_alive(&bank[m]) && (shape == ANY || is_bending(&bank[m]) == (shape == BENT));
        sum += weights[m] = meant ? exp(bank[m].weight) : 0.0;
    }
    for (int m = 0; m < MEMBERS; m++) parts[m] = weights[m] / sum;
    for (int a = first; a < ERRORS; a++) {
        x[a] = 0.0;
        for (int m = 0; m < MEMBERS; m++)
            if (weights[m] > 0.0) x[a] += parts[m] * (bank[m].x[a] - shadow->x[a]);
        for (int b = first; b < ERRORS; b++) P[a][b] = 0.0;
    }
    for (int m = 0; m < MEMBERS; m++) {
        double off[ERRORS];
        if (!(weights[m] > 0.0)) continue;
        for (int a = first; a < ERRORS; a++) off[a] = bank[m].x[a] - shadow->x[a] - x[a];
        for (int a = first; a < ERRORS; a++)
            for (int b = first; b <= a; b++) P[a][b] += parts[m] * (bank[m].P[packed_index(a, b)] + off[a] * off[b]);
    }
    for (int a = first; a < ERRORS; a++)
        for (int b = first; b < a; b++) P[b][a] = P[a][b];
    return sum;
}

/* After a node: what the bank says of the thrusters. */
static void learn_thrust(Online *filter) {
    double x[ERRORS], P[ERRORS][ERRORS];
    if (filter->manoeuvred == 0.0) return;
    mixed(filter->bank, ANY, THRUST, x, P);
    for (int a = 0; a < OF_THRUST; a++) {
        filter->thrust[a] = filter->bank[SHADOW].x[THRUST + a] += x[THRUST + a];
        for (int b = 0; b < OF_THRUST; b++) filter->of_thrust[a][b] = P[THRUST + a][THRUST + b];
    }
}

#define DEFINITE 1e-12 /* least eigenvalue of a covariance, in units of the shadow's */

/* L A L' of a lower triangle L and a symmetric A. */
static void congruent(const double L[PATH_AND_MAP * PATH_AND_MAP], double A[PATH_AND_MAP][PATH_AND_MAP]) {
    double T[PATH_AND_MAP][PATH_AND_MAP];
    for (int i = 0; i < PATH_AND_MAP; i++)
        for (int j = 0; j < PATH_AND_MAP; j++) {
            T[i][j] = 0.0;
            for (int k = 0; k <= i; k++) T[i][j] += L[PATH_AND_MAP * i + k] * A[k][j];
        }
    for (int i = 0; i < PATH_AND_MAP; i++)
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k <= j; k++) sum += T[i][k] * L[PATH_AND_MAP * j + k];
            A[i][j] = A[j][i] = sum;
        }
}

/* Eigenvectors U, as columns, and eigenvalues, on the diagonal, of a symmetric A in place (Jacobi). */
static void eigen(double A[PATH_AND_MAP][PATH_AND_MAP], double U[PATH_AND_MAP][PATH_AND_MAP]) {
    for (int i = 0; i < PATH_AND_MAP; i++)
        for (int j = 0; j < PATH_AND_MAP; j++) U[i][j] = i == j;
    for (int sweep = 0; sweep < 12; sweep++) {
        double off = 0.0;
        for (int p = 0; p < PATH_AND_MAP; p++)
            for (int q = p + 1; q < PATH_AND_MAP; q++) {
                double a = A[p][q], scale = sqrt(fabs(A[p][p] * A[q][q]));
                if (!(fabs(a) > 1e-8 * scale)) continue;
                off = 1.0;
                double tau = (A[q][q] - A[p][p]) / (2.0 * a), sign = tau >= 0.0 ? 1.0 : -1.0;
                double t = sign / (fabs(tau) + sqrt(1.0 + tau * tau));
                double c = 1.0 / sqrt(1.0 + t * t), s = t * c;
                for (int k = 0; k < PATH_AND_MAP; k++) {
                    double x = A[k][p], y = A[k][q];
                    A[k][p] = c * x - s * y, A[k][q] = s * x + c * y;
                }
                for (int k = 0; k < PATH_AND_MAP; k++) {
                    double x = A[p][k], y = A[q][k];
                    A[p][k] = c * x - s * y, A[q][k] = s * x + c * y;
                    x = U[k][p], y = U[k][q];
                    U[k][p] = c * x - s * y, U[k][q] = s * x + c * y;
                }
            }
        if (off == 0.0) break;
    }
}

/* A = U diag(d) U' */
static void with_values(double U[PATH_AND_MAP][PATH_AND_MAP], const double d[PATH_AND_MAP], double A[PATH_AND_MAP][PATH_AND_MAP]) {
    for (int i = 0; i < PATH_AND_MAP; i++)
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k < PATH_AND_MAP; k++) sum += U[i][k] * d[k] * U[j][k];
            A[i][j] = A[j][i] = sum;
        }
}

/* y = L x of a lower triangle L. */
static void by_triangle(const double L[PATH_AND_MAP * PATH_AND_MAP], const double x[PATH_AND_MAP], double y[PATH_AND_MAP]) {
    for (int i = 0; i < PATH_AND_MAP; i++) {
        y[i] = 0.0;
        for (int k = 0; k <= i; k++) y[i] += L[PATH_AND_MAP * i + k] * x[k];
    }
}

/* y = A x */
static void by_matrix(double A[PATH_AND_MAP][PATH_AND_MAP], const double x[PATH_AND_MAP], double y[PATH_AND_MAP]) {
    for (int i = 0; i < PATH_AND_MAP; i++) {
        y[i] = 0.0;
        for (int k = 0; k < PATH_AND_MAP; k++) y[i] += A[i][k] * x[k];
    }
}

/* A = L'^-1 T L^-1 of a symmetric T and a symmetric N by its Cholesky factor L: N^-1, but as many times wider as T says. So in no
   direction it is wider by more than that, as T N^-1 T for the root of T would be: where one direction is known to millimetres,
   another to metres, that makes metres of millimetres. */
static void widened(const double N[PATH_AND_MAP * PATH_AND_MAP], double T[PATH_AND_MAP][PATH_AND_MAP], double A[PATH_AND_MAP][PATH_AND_MAP]) {
    double K[PATH_AND_MAP * PATH_AND_MAP], B[PATH_AND_MAP][PATH_AND_MAP];
    for (int k = 0; k < PATH_AND_MAP * PATH_AND_MAP; k++) K[k] = N[k];
    invert_triangle(PATH_AND_MAP, K);
    for (int i = 0; i < PATH_AND_MAP; i++)
        for (int j = 0; j < PATH_AND_MAP; j++) {
            B[i][j] = 0.0;
            for (int k = j; k < PATH_AND_MAP; k++) B[i][j] += T[i][k] * K[PATH_AND_MAP * k + j];
        }
    for (int i = 0; i < PATH_AND_MAP; i++)
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = i; k < PATH_AND_MAP; k++) sum += K[PATH_AND_MAP * k + i] * B[k][j];
            A[i][j] = A[j][i] = sum;
        }
}

/* The scale comes first, as nothing but the large filter knows it: what members know of the others they know for a scale. */
static int ordered(int a) { return (a + SCALE) % PATH_AND_MAP; }

/* A mixture that stands for itself: x, from the shadow, becomes that from the large filter. Returns the sum of its weights. */
static double alone(const PackedMember *shadow, const Member *large, double sum, double x[ERRORS]) {
    for (int a = 0; a < PATH_AND_MAP; a++) x[a] += shadow->x[a] - large->x[a];
    return sum;
}

/* By what members of a shape correct the large filter: x is to be added to its (r, v, offset, scale), P is the covariance of these
   then; with what these tell of the thrusters. Returns the sum of the weights.

   The large filter knows what its shadow does, and more, as that sees of each node but the centre of mass. This rest is true of
   the mixture, too: the shadow's information is taken from the large filter's, and the mixture's is put in its place. All is in
   units of the shadow's deviations S, where its covariance is 1, the mixture's D = U d U' and the large filter's V = W v W':
   the answer's is (1/D + 1/V - 1)^-1. Where the large filter knows less than its shadow, v > 1, there is no rest, and variances
   are as many times wider, T. Where the mixture knows less than the shadow, d > 1, as after a jump, the large filter's covariance
   grows by as much, G, `more`, and it follows by as much as that is of the mixture's. */
static double mixture(const PackedMember bank[MEMBERS + 1], Shape shape, const Member *large, double x[ERRORS],
                      double P[ERRORS][ERRORS], double more[PATH_AND_MAP][PATH_AND_MAP]) {
    double S[PATH_AND_MAP * PATH_AND_MAP], back[PATH_AND_MAP * PATH_AND_MAP], N[PATH_AND_MAP * PATH_AND_MAP];
    double off[PATH_AND_MAP], lead[PATH_AND_MAP], pull[PATH_AND_MAP], step[PATH_AND_MAP];
    double D[PATH_AND_MAP][PATH_AND_MAP], U[PATH_AND_MAP][PATH_AND_MAP], V[PATH_AND_MAP][PATH_AND_MAP], W[PATH_AND_MAP][PATH_AND_MAP];
    double G[PATH_AND_MAP][PATH_AND_MAP], T[PATH_AND_MAP][PATH_AND_MAP];
    double known[PATH_AND_MAP], rest[PATH_AND_MAP], wider[PATH_AND_MAP], growth[PATH_AND_MAP], inverse[PATH_AND_MAP], sum = mixed(bank, shape, 0, x, P);
    double before[PATH_AND_MAP], of_members[PATH_AND_MAP][PATH_AND_MAP];
    const PackedMember *shadow = &bank[SHADOW];
    for (int a = 0; a < PATH_AND_MAP; a++) {
        int i = ordered(a);
        pull[a] = x[i], step[a] = shadow->x[i] - large->x[i];
        for (int b = 0; b < PATH_AND_MAP; b++) {
            int j = ordered(b);
            S[PATH_AND_MAP * a + b] = packed(shadow, i, j), D[a][b] = P[i][j], V[a][b] = large->P[i][j];
            more[a][b] = 0.0;
        }
    }
    if (!factored(PATH_AND_MAP, S)) return alone(shadow, large, sum, x);
    for (int a = 0; a < PATH_AND_MAP; a++)
        for (int b = a + 1; b < PATH_AND_MAP; b++) S[PATH_AND_MAP * a + b] = 0.0;
    for (int k = 0; k < PATH_AND_MAP * PATH_AND_MAP; k++) back[k] = S[k];
    invert_triangle(PATH_AND_MAP, back);
    by_triangle(back, pull, off), by_triangle(back, step, lead); /* of the mixture from the shadow, of that from the filter */
    congruent(back, D), eigen(D, U);
    congruent(back, V), eigen(V, W);
    for (int k = 0; k < PATH_AND_MAP; k++) {
        double d = fmax(D[k][k], DEFINITE), v = fmax(V[k][k], DEFINITE);
        known[k] = 1.0 / fmin(d, 1.0), inverse[k] = 1.0 / d, growth[k] = fmax(d - 1.0, 0.0);
        rest[k] = fmax(1.0 / v - 1.0, 0.0), wider[k] = fmax(v, 1.0);
    }
    with_values(U, known, D), with_values(W, rest, V);
    for (int k = 0; k < PATH_AND_MAP * PATH_AND_MAP; k++) N[k] = D[k / PATH_AND_MAP][k % PATH_AND_MAP] + V[k / PATH_AND_MAP][k % PATH_AND_MAP];
    if (!factored(PATH_AND_MAP, N)) return alone(shadow, large, sum, x);
    with_values(U, growth, G), with_values(W, wider, T), with_values(U, inverse, V);
    by_matrix(V, off, pull), by_matrix(D, lead, step);
    for (int a = 0; a < PATH_AND_MAP; a++) step[a] += pull[a] - lead[a];
    solved(PATH_AND_MAP, N, step);
    by_matrix(G, pull, off);
    for (int a = 0; a < PATH_AND_MAP; a++) step[a] += off[a];
    by_triangle(S, step, off);
    widened(N, T, D);
    congruent(S, D), congruent(S, G);
    for (int a = 0; a < PATH_AND_MAP; a++) {
        before[a] = shadow->x[a] - large->x[a] + x[a];
        for (int b = 0; b < PATH_AND_MAP; b++) of_members[a][b] = P[a][b];
    }
    for (int a = 0; a < PATH_AND_MAP; a++) {
        x[ordered(a)] = off[a];
        for (int b = 0; b < PATH_AND_MAP; b++) {
            more[ordered(a)][ordered(b)] = G[a][b];
            P[ordered(a)][ordered(b)] = D[a][b] + G[a][b];
        }
    }
    if (large->errors == ERRORS) follow_path_and_map(before, of_members, x, P);
    return sum;
}

#define UNTRUE 0.1     /* part of a late correction that may be wrong: the filter's gains are not quite the shadow's */
#define ELSEWHERE 50.0 /* chi-square of 10 degrees of freedom, beyond any chance */

/* Whether the mixture is where the shadow does not expect it. */
static int is_elsewhere(const Online *filter) {
    double x[ERRORS], y[PATH_AND_MAP], P[ERRORS][ERRORS], S[PATH_AND_MAP * PATH_AND_MAP], square = 0.0;
    mixed(filter->bank, ANY, 0, x, P);
    for (int k = 0; k < PATH_AND_MAP * PATH_AND_MAP; k++) S[k] = packed(&filter->bank[SHADOW], k / PATH_AND_MAP, k % PATH_AND_MAP);
    if (!factored(PATH_AND_MAP, S)) return 0;
    for (int k = 0; k < PATH_AND_MAP; k++) y[k] = x[k];
    solved(PATH_AND_MAP, S, y);
    for (int k = 0; k < PATH_AND_MAP; k++) square += x[k] * y[k];
    return square > ELSEWHERE;
}

/* The large filter, and its shadow with it, go to where the mixture is, all features by the offset; dx: errors, to which
   this is added. Of the scale the mixture knows nothing more. */
static void take_mixture(Online *filter, double dx[]) {
    int n = size_of(filter);
    double x[ERRORS], D[ERRORS][ERRORS], more[PATH_AND_MAP][PATH_AND_MAP];
    Member large = large_at(filter, filter->x), shadow;
    unpack_member(&filter->bank[SHADOW], &shadow);
    for (int a = 0; a < OFFSET; a++) large.x[a] += dx[POSITION + a];
    for (int f = 0; f < (int)filter->used; f++)
        for (int a = 0; a < OF_MAP; a++) large.x[OFFSET + a] += dot(filter->share[f][a], &dx[FEATURES + 3 * f]);
    mixture(filter->bank, ANY, &large, x, D, more);
    shadow.x[SCALE] = large.x[SCALE];
    for (int a = 0; a < SCALE; a++) {
        shadow.x[a] = large.x[a] + x[a];
        for (int b = 0; b < SCALE; b++) more[a][b] += UNTRUE * UNTRUE * x[a] * x[b];
    }
    for (int i = POSITION; i < n; i++) {
        int a = i < FEATURES ? i - POSITION : OFFSET + (i - FEATURES) % 3;
        dx[i] += x[a];
        for (int j = POSITION; j < n; j++) filter->P[i][j] += more[a][j < FEATURES ? j - POSITION : OFFSET + (j - FEATURES) % 3];
    }
    of_path_and_map(filter, shadow.P);
    pack_member(&shadow, &filter->bank[SHADOW]);
    for (int j = 0; j < JUMPS; j++) filter->jump[j].pending = 0.0;
    adopt(filter);
}
