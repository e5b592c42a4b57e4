/* What the bank says together, and how the large filter follows it. */

/* The mixture of the bank, against the shadow: its mean, and its covariance; of members with so many errors only, if that is
   not 0. Returns the sum of their weights. */
static double mixed(const Member bank[MEMBERS + 1], int errors, double x[MOTION], double P[MOTION][MOTION]) {
    const Member *shadow = &bank[SHADOW];
    double weights[MEMBERS], sum = 0.0;
    for (int m = 0; m < MEMBERS; m++)
        sum += weights[m] = is_alive(&bank[m]) && (errors == 0 || bank[m].errors == errors) ? exp(bank[m].weight) : 0.0;
    for (int a = 0; a < MOTION; a++) {
        x[a] = 0.0;
        for (int m = 0; m < MEMBERS; m++)
            if (weights[m] > 0.0) x[a] += weights[m] / sum * (bank[m].x[a] - shadow->x[a]);
        for (int b = 0; b < MOTION; b++) P[a][b] = 0.0;
    }
    for (int m = 0; m < MEMBERS; m++) {
        double off[MOTION], part = weights[m] / sum;
        if (!(weights[m] > 0.0)) continue;
        for (int a = 0; a < MOTION; a++) off[a] = bank[m].x[a] - shadow->x[a] - x[a];
        for (int a = 0; a < MOTION; a++)
            for (int b = 0; b < MOTION; b++) P[a][b] += part * (bank[m].P[a][b] + off[a] * off[b]);
    }
    return sum;
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

/* Eigenvectors U, as columns, and eigenvalues, on the diagonal, of a symmetric A in place (Jacobi). */
static void eigen(double A[LEVEL][LEVEL], double U[LEVEL][LEVEL]) {
    for (int i = 0; i < LEVEL; i++)
        for (int j = 0; j < LEVEL; j++) U[i][j] = i == j;
    for (int sweep = 0; sweep < 12; sweep++) {
        double off = 0.0;
        for (int p = 0; p < LEVEL; p++)
            for (int q = p + 1; q < LEVEL; q++) {
                double a = A[p][q], scale = sqrt(fabs(A[p][p] * A[q][q]));
                if (!(fabs(a) > 1e-8 * scale)) continue;
                off = 1.0;
                double tau = (A[q][q] - A[p][p]) / (2.0 * a), sign = tau >= 0.0 ? 1.0 : -1.0;
                double t = sign / (fabs(tau) + sqrt(1.0 + tau * tau));
                double c = 1.0 / sqrt(1.0 + t * t), s = t * c;
                for (int k = 0; k < LEVEL; k++) {
                    double x = A[k][p], y = A[k][q];
                    A[k][p] = c * x - s * y, A[k][q] = s * x + c * y;
                }
                for (int k = 0; k < LEVEL; k++) {
                    double x = A[p][k], y = A[q][k];
                    A[p][k] = c * x - s * y, A[q][k] = s * x + c * y;
                    x = U[k][p], y = U[k][q];
                    U[k][p] = c * x - s * y, U[k][q] = s * x + c * y;
                }
            }
        if (off == 0.0) break;
    }
}

/* By what members with so many errors, or all if 0, correct the large filter: x is to be added to its (r, v, offset), P is the
   covariance of these then. With M M' the filter's, S S' the shadow's and S^-1 P S'^-1 = U D U' of the mixture's P: where D
   is less than 1 the filter's is to the mixture's as the shadow's is, M U D U' M'; where it is more, as much is added as the
   mixture has more than the shadow: `more`, S U (D - 1) U' S'. Returns the sum of the weights. */
static double mixture(const Member bank[MEMBERS + 1], int errors, const Member *large, double x[MOTION],
                      double P[MOTION][MOTION], double more[LEVEL][LEVEL]) {
    double M[LEVEL * LEVEL], S[LEVEL * LEVEL], back[LEVEL * LEVEL];
    double sum = mixed(bank, errors, x, P);
    for (int a = 0; a < LEVEL; a++)
        for (int b = 0; b < LEVEL; b++) {
            M[LEVEL * a + b] = large->P[a][b];
            S[LEVEL * a + b] = bank[SHADOW].P[a][b];
            more[a][b] = 0.0;
        }
    if (factored(LEVEL, M) && factored(LEVEL, S)) {
        double U[LEVEL][LEVEL], D[LEVEL][LEVEL], less[LEVEL][LEVEL];
        for (int k = 0; k < LEVEL * LEVEL; k++) back[k] = S[k];
        for (int a = 0; a < LEVEL; a++)
            for (int b = 0; b < a; b++) M[LEVEL * b + a] = S[LEVEL * b + a] = back[LEVEL * b + a] = 0.0;
        for (int k = 0; k < LEVEL * LEVEL; k++) D[k / LEVEL][k % LEVEL] = P[k / LEVEL][k % LEVEL];
        invert_triangle(back);
        congruent(back, D);
        eigen(D, U);
        for (int a = 0; a < LEVEL; a++)
            for (int b = 0; b < LEVEL; b++) {
                less[a][b] = more[a][b] = 0.0;
                for (int k = 0; k < LEVEL; k++) {
                    double d = fmax(D[k][k], 0.0);
                    less[a][b] += U[a][k] * fmin(d, 1.0) * U[b][k];
                    more[a][b] += U[a][k] * fmax(d - 1.0, 0.0) * U[b][k];
                }
            }
        congruent(M, less);
        congruent(S, more);
        for (int a = 0; a < LEVEL; a++)
            for (int b = 0; b < LEVEL; b++) P[a][b] = less[a][b] + more[a][b];
    } /* else the mixture alone */
    return sum;
}

#define UNTRUE 0.1     /* part of a late correction that may be wrong: the filter's gains are not quite the shadow's */
#define ELSEWHERE 50.0 /* chi-square of 9 degrees of freedom, beyond any chance */

/* Whether the mixture is where the shadow does not expect it. */
static int is_elsewhere(const Online *filter) {
    double x[MOTION], y[LEVEL], P[MOTION][MOTION], S[LEVEL * LEVEL], square = 0.0;
    mixed(filter->bank, 0, x, P);
    for (int k = 0; k < LEVEL * LEVEL; k++) S[k] = filter->bank[SHADOW].P[k / LEVEL][k % LEVEL];
    if (!factored(LEVEL, S)) return 0;
    for (int k = 0; k < LEVEL; k++) y[k] = x[k];
    solved(LEVEL, S, y);
    for (int k = 0; k < LEVEL; k++) square += x[k] * y[k];
    return square > ELSEWHERE;
}

/* The large filter, and its shadow with it, go to where the mixture is, all features by the offset; dx: errors, to which
   this is added. */
static void take_mixture(Online *filter, double dx[]) {
    int n = size_of(filter);
    double x[MOTION], D[MOTION][MOTION], more[LEVEL][LEVEL];
    Member *shadow = &filter->bank[SHADOW];
    const Member large = large_at(filter, filter->x);
    mixture(filter->bank, 0, &large, x, D, more);
    for (int a = 0; a < LEVEL; a++) {
        shadow->x[a] += x[a];
        for (int b = 0; b < LEVEL; b++) more[a][b] += UNTRUE * UNTRUE * x[a] * x[b];
    }
    for (int i = PLACE; i < n; i++) {
        int a = i < BODY ? i - PLACE : 6 + (i - BODY) % 3;
        dx[i] += x[a];
        for (int j = PLACE; j < n; j++) filter->P[i][j] += more[a][j < BODY ? j - PLACE : 6 + (j - BODY) % 3];
    }
    of_level(filter, shadow->P);
    for (int m = STEADY; m < MEMBERS; m++) filter->bank[m].pending = 0.0;
    adopt(filter);
}
