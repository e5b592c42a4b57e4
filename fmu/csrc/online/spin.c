/* A spin, the state of a tumble, and what it is wrong by: both go on by Euler's equation, and errors with white torque. */

#define FINE 0.15 /* rad, a step of the integration */
enum { MOST_STEPS = 500 };

/* Densities of white torque, of the angular acceleration, rad2/s3. */
static const double TORQUE[TORQUES] = {1e-15,       1e-15 * 1e1, 1e-15 * 1e2, 1e-15 * 1e3, 1e-15 * 1e4,
                                       1e-15 * 1e5, 1e-15 * 1e6, 1e-15 * 1e7, 1e-15 * 1e8, 1e-15 * 1e9};

static void inertia_of(const double j[5], double J[3][3]) {
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            J[a][b] = a == b ? 1.0 / 3.0 : 0.0;
            for (int k = 0; k < 5; k++) J[a][b] += j[k] * INERTIA_BASIS[k][a][b];
        }
}

/* Whether moments of inertia of trace 1 are possible: none is larger than the sum of the others. */
static int possible(double J[3][3]) {
    double half[3][3];
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) half[a][b] = (a == b ? 0.5 : 0.0) - J[a][b];
    return is_definite(J) && is_definite(half);
}

/* The spin corrected by x. */
static void correct_spin(Spin *spin, const double x[SPIN]) {
    double R[3][3];
    matrix_of(spin->q, R);
    turn_left(x, R);
    quaternion_of(R, spin->q);
    for (int k = 0; k < 3; k++) spin->w[k] += x[3 + k];
    for (int k = 0; k < 5; k++) spin->j[k] += x[6 + k];
}

/* What one spin is wrong by if another is right. */
static void spin_between(const Spin *right, const Spin *wrong, double x[SPIN]) {
    double A[3][3], B[3][3];
    matrix_of(right->q, A), matrix_of(wrong->q, B);
    angle_between(A, B, x);
    for (int k = 0; k < 3; k++) x[3 + k] = right->w[k] - wrong->w[k];
    for (int k = 0; k < 5; k++) x[6 + k] = right->j[k] - wrong->j[k];
}

/* The spin in axes against which the body was turned by `turn`, in B. */
static void turn_spin(Spin *spin, const double turn[3]) {
    double R[3][3], J[3][3], T[3][3], TJ[3][3], w[3];
    rotation(turn, T);
    matrix_of(spin->q, R);
    turn_axes(turn, R);
    quaternion_of(R, spin->q);
    for (int k = 0; k < 3; k++) w[k] = spin->w[k];
    times(T, w, spin->w);
    inertia_of(spin->j, J);
    product(T, J, TJ);
    for (int k = 0; k < 5; k++) {
        spin->j[k] = 0.0;
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) spin->j[k] += INERTIA_BASIS[k][a][b] * dot(TJ[a], T[b]);
    }
}

/* F and Q of `spin_on` after one more step, without what torque adds in it. */
static void stepped(const double G[6][SPIN], double F[6][SPIN], double Q[6][6]) {
    double A[6][SPIN], GQ[6][6];
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < SPIN; j++) A[i][j] = j < 6 ? 0.0 : G[i][j];
        for (int j = 0; j < 6; j++) GQ[i][j] = 0.0;
        for (int k = 0; k < 6; k++) {
            for (int j = 0; j < SPIN; j++) A[i][j] += G[i][k] * F[k][j];
            for (int j = 0; j < 6; j++) GQ[i][j] += G[i][k] * Q[k][j];
        }
    }
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < SPIN; j++) F[i][j] = A[i][j];
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k < 6; k++) sum += GQ[i][k] * G[j][k];
            Q[i][j] = Q[j][i] = sum;
        }
    }
}

/* Over T s: the spin, by what F its errors go on, and Q, which white torque of unit density adds; 0 if that is too far. */
static int spin_on(const OnlineOptions *options, Spin *spin, double begin, double T, double F[6][SPIN], double Q[6][6]) {
    double count = ceil(fabs(T) * sqrt(dot(spin->w, spin->w)) / FINE), J[3][3], columns[9], axis[3];
    if (!(count <= MOST_STEPS)) return 0;
    int steps = count < 1.0 ? 1 : (int)count;
    double h = T / steps;
    inertia_of(spin->j, J);
    for (int k = 0; k < 9; k++) columns[k] = J[k % 3][k / 3];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) Q[i][j] = 0.0;
    for (int s = 0; s < steps; s++) {
        double G[6][SPIN], R[3][3];
        const int pulled = spin->gradient != 0.0;
        if (pulled) gravity_gradient(options, begin + (s + 0.5) * h, axis);
        rotation_step(spin->q, spin->w, columns, pulled ? axis : NULL, h, s == 0 ? F : G);
        if (s > 0) stepped(G, F, Q);
        matrix_of(spin->q, R);
        for (int a = 0; a < 3; a++) {
            Q[a][a] += h * h * h / 3.0;
            Q[3 + a][3 + a] += h;
            for (int b = 0; b < 3; b++) Q[3 + b][a] += h * h / 2.0 * R[a][b], Q[a][3 + b] = Q[3 + b][a];
        }
    }
    return 1;
}

/* The covariance goes on, with torque of a density. */
static void spread_on(double P[SPIN][SPIN], const double F[6][SPIN], const double Q[6][6], double density) {
    double A[6][SPIN], across[SPIN][6];
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < SPIN; j++) A[i][j] = 0.0, across[j][i] = F[i][j];
        for (int k = 0; k < SPIN; k++)
            for (int j = 0; j < SPIN; j++) A[i][j] += F[i][k] * P[k][j];
    }
    for (int i = 0; i < 6; i++) {
        double row[6];
        for (int j = 0; j < 6; j++) row[j] = density * Q[i][j];
        for (int k = 0; k < SPIN; k++)
            for (int j = 0; j < 6; j++) row[j] += A[i][k] * across[k][j];
        for (int j = 0; j <= i; j++) P[i][j] = P[j][i] = row[j];
        for (int j = 6; j < SPIN; j++) P[i][j] = P[j][i] = A[i][j];
    }
}

static void error_on(SpinError *error, const double F[6][SPIN], const double Q[6][6], double density) {
    double x[6] = {0};
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < SPIN; k++) x[i] += F[i][k] * error->x[k];
    for (int i = 0; i < 6; i++) error->x[i] = x[i];
    spread_on(error->P, F, Q, density);
}

/* The update with the turn in C from the spin's attitude to that of a node; returns the weighted square of the innovation. */
static double update_error(SpinError *error, const double turn[3], const double noise[3][3]) {
    double L[9], e[3], W[3][SPIN];
    for (int k = 0; k < 3; k++) e[k] = turn[k] - error->x[k];
    for (int k = 0; k < 9; k++) L[k] = error->P[k / 3][k % 3] + noise[k / 3][k % 3];
    if (!factored(3, L)) return INFINITY;
    whitened(L, e);
    for (int a = 0; a < SPIN; a++)
        for (int k = 0; k < 3; k++) W[k][a] = error->P[a][k];
    whiten_rows(L, SPIN, SPIN, W[0]);
    for (int a = 0; a < SPIN; a++) {
        error->x[a] += W[0][a] * e[0] + W[1][a] * e[1] + W[2][a] * e[2];
        for (int b = 0; b < SPIN; b++) error->P[a][b] -= W[0][a] * W[0][b] + W[1][a] * W[1][b] + W[2][a] * W[2][b];
    }
    error->weight -= 0.5 * dot(e, e) + log(L[0] * L[4] * L[8]);
    return dot(e, e);
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
