/* A spin, the state of a tumble, and what it is wrong by: both go on by Euler's equation, and errors with white torque. */

#define FINE 0.15             /* rad, a step of the integration */
#define ERROR_OF_MOMENTS 0.03 /* of an estimate, for a trace of 1 */
#define LEAST_MOMENT 0.003
enum { MOST_STEPS = 500, HALVINGS = 20 };

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

/* Whether no moment of inertia of trace 1 is less than a least one, nor larger than the sum of the others, but for errors of an estimate: of a sheet or a rod
   it is as large. */
static int moments_from(double least, double J[3][3]) {
    double more[3][3], left[3][3];
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            more[a][b] = J[a][b] - (a == b ? least : 0.0);
            left[a][b] = (a == b ? 0.5 + ERROR_OF_MOMENTS : 0.0) - J[a][b];
        }
    return is_definite(more) && is_definite(left);
}

/* Whether an estimate of the inertia may be that of a body. */
static int possible(double J[3][3]) { return moments_from(-ERROR_OF_MOMENTS, J); }

/* The inertia, held where Euler's equation can go on with it, no nearer to that of a sphere than has to be; taken: from its coefficients. */
static void hold_inertia(double j[5], double taken[5]) {
    double J[3][3], held = 0.0, over = 1.0; /* parts of the way from a sphere's: where it can, and where it cannot */
    for (int k = 0; k < 5; k++) taken[k] = j[k];
    inertia_of(j, J);
    if (!moments_from(LEAST_MOMENT, J)) {
        for (int n = 0; n < HALVINGS; n++) {
            const double part = 0.5 * (held + over);
            for (int k = 0; k < 5; k++) j[k] = part * taken[k];
            inertia_of(j, J);
            if (moments_from(LEAST_MOMENT, J)) held = part;
            else over = part;
        }
        for (int k = 0; k < 5; k++) j[k] = held * taken[k];
    }
    for (int k = 0; k < 5; k++) taken[k] -= j[k];
}

/* The inertia of a spin is held; 0 if it is none of a body. */
static int settled_inertia(Spin *spin) {
    double J[3][3], taken[5];
    inertia_of(spin->j, J);
    if (!possible(J)) return 0;
    hold_inertia(spin->j, taken);
    return 1;
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

/* The spin in axes against which the body was turned by T, in B. */
static void turn_spin(Spin *spin, const double T[3][3]) {
    double R[3][3], J[3][3], TJ[3][3], w[3];
    matrix_of(spin->q, R);
    turn_axes(T, R);
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

static SpinError error_of(const SpinErrors *errors, int m) {
    SpinError error = {.weight = errors->weight[m]};
    for (int a = 0; a < SPIN; a++) error.x[a] = errors->x[a][m];
    for (int p = 0; p < SPIN_PAIRS; p++) error.P[p] = errors->P[p][m];
    return error;
}

static void put_error(const SpinError *error, int m, SpinErrors *errors) {
    errors->weight[m] = error->weight;
    for (int a = 0; a < SPIN; a++) errors->x[a][m] = error->x[a];
    for (int p = 0; p < SPIN_PAIRS; p++) errors->P[p][m] = error->P[p];
}

/* Of all densities: row[m] is added up of factors times what stands `stride` apart. */
static ALWAYS_INLINE void by_columns(int first, const double factors[SPIN], const double *columns, int stride, double row[TORQUES]) {
    for (int m = 0; m < TORQUES; m++) {
        double sum = row[m];
        for (int k = first; k < SPIN; k++) sum += factors[k] * columns[k * stride + m];
        row[m] = sum;
    }
}

/* Errors of rate and inertia, from `first` 3 on, or all, go on by F. A free tumble is turned as a whole: so F leaves errors of its attitude as
   they are. */
static ALWAYS_INLINE void spread_errors(int first, const double F[6][SPIN], const double Q[6][6], SpinErrors *errors) {
    double P[SPIN][SPIN][TORQUES], A[6][SPIN][TORQUES];
    for (int a = 0, p = 0; a < SPIN; a++)
        for (int b = 0; b <= a; b++, p++)
            for (int m = 0; m < TORQUES; m++) P[a][b][m] = P[b][a][m] = errors->P[p][m];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < SPIN; j++) {
            for (int m = 0; m < TORQUES; m++) A[i][j][m] = i < first ? P[i][j][m] : 0.0;
            by_columns(first, F[i], P[0][j], SPIN * TORQUES, A[i][j]);
        }
    for (int i = 0, p = 0; i < 6; i++)
        for (int j = 0; j <= i; j++, p++) {
            for (int m = 0; m < TORQUES; m++) errors->P[p][m] = TORQUE[m] * Q[i][j] + (j < first ? A[i][j][m] : 0.0);
            by_columns(first, F[j], A[i][0], TORQUES, errors->P[p]);
        }
    for (int i = 6, p = 6 * 7 / 2; i < SPIN; p += ++i)
        for (int j = 0; j < 6; j++)
            for (int m = 0; m < TORQUES; m++) errors->P[p + j][m] = A[j][i][m];
}

/* The errors of a spin go on: F and Q are those of `spin_on`. */
WIDE static void errors_on(SpinErrors *errors, int pulled, const double F[6][SPIN], const double Q[6][6]) {
    double x[6][TORQUES] = {{0}};
    for (int i = 0; i < 6; i++) by_columns(0, F[i], errors->x[0], TORQUES, x[i]);
    for (int i = 0; i < 6; i++)
        for (int m = 0; m < TORQUES; m++) errors->x[i][m] = x[i][m];
    if (pulled) spread_errors(0, F, Q, errors);
    else spread_errors(3, F, Q, errors);
}

#define SINGULAR 1e-13 /* what is left of a variance where others are known: less is rounding */

/* The update with the turn in C from the spin's attitude to that of a node, by L D L' of the innovations' covariance; squares: weighted, of
   these. Where rounding has left that indefinite the square is INFINITY and the weight none. */
WIDE static void update_errors(SpinErrors *errors, const double turn[3], const double noise[3][3], double squares[TORQUES]) {
    double W[3][SPIN][TORQUES], V[3][SPIN][TORQUES], e[3][TORQUES], L[3][TORQUES], D[3][TORQUES], back[3][TORQUES];
    for (int k = 0; k < 3; k++)
        for (int a = 0; a < SPIN; a++)
            for (int m = 0; m < TORQUES; m++) W[k][a][m] = errors->P[packed_index(a, k)][m];
    for (int m = 0; m < TORQUES; m++) {
        const double s00 = W[0][0][m] + noise[0][0], s10 = W[0][1][m] + noise[1][0], s20 = W[0][2][m] + noise[2][0];
        const double s11 = W[1][1][m] + noise[1][1], s21 = W[1][2][m] + noise[2][1], s22 = W[2][2][m] + noise[2][2];
        const double by0 = 1.0 / s00, l10 = s10 * by0, l20 = s20 * by0, d1 = s11 - l10 * s10, by1 = 1.0 / d1;
        const double left = s21 - l20 * s10, l21 = left * by1, d2 = s22 - l20 * s20 - l21 * left, by2 = 1.0 / d2;
        L[0][m] = l10, L[1][m] = l20, L[2][m] = l21;
        D[0][m] = s00, D[1][m] = d1 - SINGULAR * s11, D[2][m] = d2 - SINGULAR * s22;
        squares[m] = s00 * d1 * d2;
        back[0][m] = by0, back[1][m] = by1, back[2][m] = by2;
        e[0][m] = turn[0] - errors->x[0][m];
        e[1][m] = turn[1] - errors->x[1][m] - l10 * e[0][m];
        e[2][m] = turn[2] - errors->x[2][m] - l20 * e[0][m] - l21 * e[1][m];
    }
    for (int m = 0; m < TORQUES; m++) {
        if (D[0][m] > 0.0 && D[1][m] > 0.0 && D[2][m] > 0.0) {
            const double determinant = squares[m];
            squares[m] = e[0][m] * e[0][m] * back[0][m] + e[1][m] * e[1][m] * back[1][m] + e[2][m] * e[2][m] * back[2][m];
            errors->weight[m] -= 0.5 * (squares[m] + log(determinant));
        } else {
            squares[m] = INFINITY, errors->weight[m] = -INFINITY;
            for (int k = 0; k < 3; k++) L[k][m] = back[k][m] = 0.0;
        }
    }
    for (int a = 0; a < SPIN; a++)
        for (int m = 0; m < TORQUES; m++) {
            W[1][a][m] -= L[0][m] * W[0][a][m];
            W[2][a][m] -= L[1][m] * W[0][a][m] + L[2][m] * W[1][a][m];
            for (int k = 0; k < 3; k++) V[k][a][m] = W[k][a][m] * back[k][m];
            errors->x[a][m] += V[0][a][m] * e[0][m] + V[1][a][m] * e[1][m] + V[2][a][m] * e[2][m];
        }
    for (int a = 0, p = 0; a < SPIN; a++)
        for (int b = 0; b <= a; b++, p++)
            for (int m = 0; m < TORQUES; m++)
                errors->P[p][m] -= V[0][a][m] * W[0][b][m] + V[1][a][m] * W[1][b][m] + V[2][a][m] * W[2][b][m];
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
