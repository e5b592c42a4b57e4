/* The tumble: attitude, rate and inertia ratios from the attitudes of the nodes.

   Over the first turn, least squares for the inertia and the angular momentum L in C, R J R' w = L, from the rate between
   nodes. From there Kalman filters of (attitude, rate, inertia), one for each density of white torque, weighed by their
   likelihood. If the attitudes do not fit, it begins again. */

#define LEAST_TORQUE 1e-18 /* rad2/s3, of the angular acceleration */
#define TORQUE_RATIO 1e3
#define WHOLE_TURN 6.283185307179586
#define SPHERE 0.15   /* standard deviation of the coefficients of an inertia of trace 1 from those of a sphere */
#define WIDER 2.0     /* of the first estimate: rates are means over finite turns, and noisy */
#define KNOWN 0.1     /* relative deviation of the rate at which the filters begin */
#define MISFIT 4.0    /* mean square of the innovations, in units of their covariance */
#define FINE 0.15     /* rad, a step of the integration */
enum { FEWEST_PAIRS = 12, MOST_STEPS = 500, MEMORY = 16 };

static void inertia_of(const double j[5], double J[3][3]) {
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            J[a][b] = a == b ? 1.0 / 3.0 : 0.0;
            for (int k = 0; k < 5; k++) J[a][b] += j[k] * INERTIA_BASIS[k][a][b];
        }
}

/* Whether moments of inertia of trace 1 are possible: none is larger than the sum of the others. */
static int possible(double J[3][3]) {
    double half[3][3], inverse[3][3];
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) half[a][b] = (a == b ? 0.5 : 0.0) - J[a][b];
    return inverted(J, inverse) && inverted(half, inverse);
}

static void forget_tumble(Tumble *tumble) { *tumble = (Tumble){0}; }

/* ---- the first estimate ---- */

static void add_pair(Tumble *tumble, const double before[3][3], const double turn[3], double T, double variance) {
    double angle = sqrt(dot(turn, turn)), middle[3][3], half[3], w[3], A[3][8], target[3];
    if (angle > 1.0) return; /* over a gap the mean rate says little */
    for (int k = 0; k < 3; k++) half[k] = 0.5 * turn[k], w[k] = turn[k] / T;
    copy(before, middle);
    turn_left(half, middle);
    double body[3], weight = 4.5 * T * T / variance; /* J is a third, and both ends are noisy */
    transposed_times(middle, w, body);
    for (int k = 0; k < 5; k++) {
        double moved[3], column[3];
        times(INERTIA_BASIS[k], body, moved);
        times(middle, moved, column);
        for (int a = 0; a < 3; a++) A[a][k] = column[a];
    }
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++) A[a][5 + b] = a == b ? -1.0 : 0.0;
        target[a] = -w[a] / 3.0;
    }
    for (int i = 0; i < 8; i++) {
        for (int j = 0; j < 8; j++)
            for (int a = 0; a < 3; a++) tumble->N[8 * i + j] += weight * A[a][i] * A[a][j];
        for (int a = 0; a < 3; a++) tumble->rhs[i] += weight * A[a][i] * target[a];
    }
    tumble->pairs += 1.0;
    tumble->turned += angle;
}

static void start_filters(Tumble *tumble, const double R[3][3], double noise[3][3]) {
    double N[64], x[8], covariance[8][8], J[3][3], inverse[3][3], T[8][8] = {{0}}, w[3], L_B[3];
    for (int k = 0; k < 64; k++) N[k] = tumble->N[k] + (k % 9 == 0 && k < 45 ? 1.0 / (SPHERE * SPHERE) : 0.0);
    if (tumble->turned < WHOLE_TURN || tumble->pairs < FEWEST_PAIRS || !factored(8, N)) return;
    for (int k = 0; k < 8; k++) x[k] = tumble->rhs[k];
    solved(8, N, x);
    for (int j = 0; j < 8; j++) {
        double column[8] = {0};
        column[j] = 1.0;
        solved(8, N, column);
        for (int i = 0; i < 8; i++) covariance[i][j] = WIDER * WIDER * column[i];
    }
    inertia_of(x, J);
    if (!possible(J) || !inverted(J, inverse)) return;
    transposed_times(R, &x[5], L_B);
    times(inverse, L_B, w);
    /* (rate, inertia) by (inertia, L): J dw = R' dL - dJ w */
    for (int k = 0; k < 5; k++) {
        double moved[3], column[3];
        times(INERTIA_BASIS[k], w, moved);
        times(inverse, moved, column);
        for (int a = 0; a < 3; a++) T[a][k] = -column[a];
        T[3 + k][k] = 1.0;
    }
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) T[a][5 + b] = inverse[a][0] * R[b][0] + inverse[a][1] * R[b][1] + inverse[a][2] * R[b][2];
    Spin first = {0};
    quaternion_of(R, first.q);
    for (int k = 0; k < 3; k++) first.w[k] = w[k];
    for (int k = 0; k < 5; k++) first.j[k] = x[k];
    double square = 0.0;
    for (int i = 0; i < 8; i++)
        for (int j = 0; j < 8; j++)
            for (int a = 0; a < 8; a++)
                for (int b = 0; b < 8; b++) first.P[3 + i][3 + j] += T[i][a] * covariance[a][b] * T[j][b];
    for (int a = 0; a < 3; a++) {
        square += first.P[3 + a][3 + a];
        for (int b = 0; b < 3; b++) first.P[a][b] = noise[a][b];
    }
    if (!(square < KNOWN * KNOWN * dot(w, w))) return;
    for (int m = 0; m < TORQUES; m++) tumble->spin[m] = first;
    tumble->known = 1.0;
    tumble->misfit = 1.0;
}

/* ---- the filters ---- */

/* Over T s with white torque; 0 if that is too far. */
static int spin_on(Spin *spin, double T, double density) {
    double count = ceil(T * sqrt(dot(spin->w, spin->w)) / FINE), J[3][3], columns[9];
    if (!(count <= MOST_STEPS)) return 0;
    int steps = count < 1.0 ? 1 : (int)count;
    double h = T / steps;
    inertia_of(spin->j, J);
    for (int k = 0; k < 9; k++) columns[k] = J[k % 3][k / 3];
    for (int s = 0; s < steps; s++) {
        double G[6][11], A[6][11], R[3][3];
        rotation_step(spin->q, spin->w, columns, h, G);
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 11; j++) {
                A[i][j] = 0.0;
                for (int k = 0; k < 11; k++) A[i][j] += G[i][k] * spin->P[k][j];
            }
        for (int i = 0; i < 6; i++) {
            for (int j = 0; j <= i; j++) {
                double sum = 0.0;
                for (int k = 0; k < 11; k++) sum += A[i][k] * G[j][k];
                spin->P[i][j] = spin->P[j][i] = sum;
            }
            for (int j = 6; j < 11; j++) spin->P[i][j] = spin->P[j][i] = A[i][j];
        }
        matrix_of(spin->q, R);
        for (int a = 0; a < 3; a++) {
            spin->P[a][a] += density * h * h * h / 3.0;
            spin->P[3 + a][3 + a] += density * h;
            for (int b = 0; b < 3; b++) {
                spin->P[a][3 + b] += density * h * h / 2.0 * R[a][b];
                spin->P[3 + b][a] = spin->P[a][3 + b];
            }
        }
    }
    return 1;
}

/* The update with an attitude; returns the weighted square of the innovation. */
static double update_spin(Spin *spin, const double R[3][3], double noise[3][3]) {
    double L[9], e[3], W[11][3], foreseen[3][3], turn[3], dx[11];
    matrix_of(spin->q, foreseen);
    angle_between(R, foreseen, e);
    for (int k = 0; k < 9; k++) L[k] = spin->P[k / 3][k % 3] + noise[k / 3][k % 3];
    if (!factored(3, L)) return INFINITY;
    for (int k = 0; k < 3; k++) {
        for (int j = 0; j < k; j++) e[k] -= L[3 * k + j] * e[j];
        e[k] /= L[4 * k];
    }
    for (int a = 0; a < 11; a++) {
        for (int k = 0; k < 3; k++) {
            W[a][k] = spin->P[a][k];
            for (int j = 0; j < k; j++) W[a][k] -= L[3 * k + j] * W[a][j];
            W[a][k] /= L[4 * k];
        }
        dx[a] = dot(W[a], e);
    }
    for (int a = 0; a < 11; a++)
        for (int b = 0; b < 11; b++) spin->P[a][b] -= dot(W[a], W[b]);
    for (int k = 0; k < 3; k++) turn[k] = dx[k], spin->w[k] += dx[3 + k];
    for (int k = 0; k < 5; k++) spin->j[k] += dx[6 + k];
    turn_left(turn, foreseen);
    quaternion_of(foreseen, spin->q);
    spin->weight -= 0.5 * dot(e, e) + log(L[0] * L[4] * L[8]);
    return dot(e, e);
}

static double torque_of(int member) { return LEAST_TORQUE * pow(TORQUE_RATIO, member); }

static int best_spin(const Tumble *tumble) {
    int best = 0;
    for (int m = 1; m < TORQUES; m++)
        if (tumble->spin[m].weight > tumble->spin[best].weight) best = m;
    return best;
}

/* Take the attitude of a node: R, `turn` from the one `before`, T s later. */
static void follow(Tumble *tumble, const double before[3][3], const double turn[3], double T, const double R[3][3],
                   double noise[3][3]) {
    double variance = (noise[0][0] + noise[1][1] + noise[2][2]) / 3.0;
    add_pair(tumble, before, turn, T, variance);
    if (tumble->known == 0.0) {
        start_filters(tumble, R, noise);
        return;
    }
    double square = INFINITY;
    int best = best_spin(tumble), fits = 1;
    for (int m = 0; m < TORQUES; m++) {
        double J[3][3], found;
        Spin *spin = &tumble->spin[m];
        fits = fits && spin_on(spin, T, torque_of(m));
        if (!fits) break;
        found = update_spin(spin, R, noise);
        if (m == best) square = found;
        inertia_of(spin->j, J);
        if (!possible(J)) spin->weight -= 100.0;
    }
    best = best_spin(tumble);
    double highest = tumble->spin[best].weight, J[3][3];
    for (int m = 0; m < TORQUES; m++) {
        tumble->spin[m].weight -= highest;
        if (!(tumble->spin[m].weight > UNLIKELY)) tumble->spin[m] = tumble->spin[best], tumble->spin[m].weight = UNLIKELY;
    }
    tumble->misfit += (square / 3.0 - tumble->misfit) / MEMORY;
    inertia_of(tumble->spin[best].j, J);
    if (!fits || !(tumble->misfit < MISFIT) || !possible(J)) forget_tumble(tumble);
}

/* The angular acceleration in the axes of R of a free tumble `back` s ago; zero if none is known. */
static void swing_of(const OnlineTumble *now, double back, double swing[3]) {
    double inverse[3][3], R[3][3], w[3], momentum[3], torque[3], change[3] = {0}, turn[3];
    for (int k = 0; k < 3; k++) swing[k] = 0.0;
    if (now->known == 0.0 || !inverted(now->inertia, inverse)) return;
    copy(now->R, R);
    times(R, now->rate, turn);
    for (int k = 0; k < 3; k++) turn[k] *= -back;
    turn_left(turn, R);
    for (int round = 0; round < 2; round++) {
        for (int k = 0; k < 3; k++) w[k] = now->rate[k] - back * change[k];
        times(now->inertia, w, momentum);
        cross(momentum, w, torque);
        times(inverse, torque, change);
    }
    times(R, change, swing);
}
