/* What pushes do to the path is no linear function of what thrusters are wrong by, and they stay in it: each push is linear about
what was known of the thrusters then, 2 % of which make errors of 0.02 % of it, which no later node shows to be such. So of what a
member knows of (r, v, offset, scale) for each error of the thrusters, a curve, its second derivatives by these are kept: a push adds
to them, they go on with the path, and what a node tells of (r, v, offset, scale) for given errors makes the curve straighter. Where a
node changes what is known of the thrusters, the member goes along the curve, and its regression on them is the slope there. That is
the extended Kalman filter of a path without pushes, which are put together anew for what is known of the thrusters now, but that
what pushes did is forgotten as process noise has it forgotten. All members have the curve of the likeliest. */

typedef const double (*Curve)[PRODUCTS];

/* Where the second derivative by two pointings is kept. */
static int product_of(int i, int j) { return 3 + packed_index(i, j); }

/* The curve goes on with a step of the path, at the end of which there is a manoeuvre, of which the transition tells, or NULL. */
static void advance_curve(Online *filter, const Transition *transition, const Manoeuvre *manoeuvre) {
    const double(*F)[6] = transition->F, (*by_thrust)[OF_THRUST] = transition->by_thrust;
    double(*curve)[PRODUCTS] = filter->curve;
    for (int p = 0; p < PRODUCTS; p++) {
        double before[6];
        for (int i = 0; i < 6; i++) before[i] = curve[i][p];
        for (int i = 0; i < 6; i++) curve[i][p] = dot(F[i], before) + dot(&F[i][3], &before[3]);
    }
    for (int half = 0; half < 6 && manoeuvre; half += 3) {
        double moved[3], along[3]; /* the first error of thrusters is their scale */
        for (int k = 0; k < 3; k++) moved[k] = -(1.0 + filter->thrust[0]) * by_thrust[half + k][0];
        transposed_times(manoeuvre->axes, moved, along);
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 3; i++) {
                curve[half + k][i] += by_thrust[half + k][1 + i] / (1.0 + filter->thrust[0]);
                for (int j = 0; j <= i; j++) /* half of t_i x (t_j x moved) + t_j x (t_i x moved), of axes t */
                    curve[half + k][product_of(i, j)] -=
                        0.5 * (manoeuvre->axes[k][i] * along[j] + manoeuvre->axes[k][j] * along[i]) - (i == j) * moved[k];
            }
    }
}

/* What L members abreast know of the thrusters has changed: they go along the curve. Sums of four are written out and rows are copied to where nothing else is
   written, else compilers do not take members together. */
static ALWAYS_INLINE void follow_curve(int L, int bent, Curve curve, const double *restrict change, double *restrict x, double *restrict P) {
    double slopes[OF_THRUST][PATH_AND_MAP * ABREAST], before[OF_THRUST][PATH_AND_MAP * ABREAST], after[OF_THRUST][MOTION * ABREAST], among[OF_THRUST * ABREAST];
    const int thrust = bent ? THRUST : UNBENT - OF_THRUST;
    for (int a = 0; a < PATH_AND_MAP; a++) {
        const double *by = curve[a];
        for (int m = 0; m < L; m++) {
            const int j = a * L + m;
            const double scale = change[m], first = change[L + m], second = change[2 * L + m], last = change[3 * L + m];
            slopes[0][j] = by[0] * first + by[1] * second + by[2] * last;
            slopes[1][j] = by[0] * scale + by[product_of(0, 0)] * first + by[product_of(0, 1)] * second + by[product_of(0, 2)] * last;
            slopes[2][j] = by[1] * scale + by[product_of(1, 0)] * first + by[product_of(1, 1)] * second + by[product_of(1, 2)] * last;
            slopes[3][j] = by[2] * scale + by[product_of(2, 0)] * first + by[product_of(2, 1)] * second + by[product_of(2, 2)] * last;
            x[j] += 0.5 * (slopes[0][j] * scale + slopes[1][j] * first + slopes[2][j] * second + slopes[3][j] * last);
        }
    }
    for (int k = 0; k < OF_THRUST; k++) {
        double *row = P + ROW(L, thrust + k, 0);
        for (int i = 0; i < OF_THRUST; i++)
            for (int m = 0; m < L; m++) among[i * L + m] = P[(k > i ? ROW(L, thrust + k, thrust + i) : ROW(L, thrust + i, thrust + k)) + m];
        for (int b = 0; b < PATH_AND_MAP; b++)
            for (int m = 0; m < L; m++) {
                const int j = b * L + m;
                const double more = among[m] * slopes[0][j] + among[L + m] * slopes[1][j] + among[2 * L + m] * slopes[2][j] + among[3 * L + m] * slopes[3][j];
                before[k][j] = row[j];
                after[k][j] = row[j] + more;
                row[j] += more;
            }
        for (int j = PATH_AND_MAP * L; j < MOTION * L && bent; j++) after[k][j] = row[j];
    }
    for (int a = 0; a < PATH_AND_MAP; a++)
        for (int b = 0; b <= a; b++)
            for (int m = 0; m < L; m++) {
                const int i = a * L + m, j = b * L + m;
                P[ROW(L, a, b) + m] += slopes[0][i] * before[0][j] + slopes[1][i] * before[1][j] + slopes[2][i] * before[2][j] + slopes[3][i] * before[3][j] +
                                       after[0][i] * slopes[0][j] + after[1][i] * slopes[1][j] + after[2][i] * slopes[2][j] + after[3][i] * slopes[3][j];
            }
    for (int a = PATH_AND_MAP; a < MOTION && bent; a++)
        for (int b = 0; b < PATH_AND_MAP; b++)
            for (int m = 0; m < L; m++) {
                const int i = a * L + m, j = b * L + m;
                P[ROW(L, a, b) + m] += after[0][i] * slopes[0][j] + after[1][i] * slopes[1][j] + after[2][i] * slopes[2][j] + after[3][i] * slopes[3][j];
            }
}

/* A member whose thrusters are taken for known; 0 where their covariance is none. */
static int know_thrust(Member *member) {
    double A[OF_THRUST * OF_THRUST], H[OF_THRUST][MOTION];
    for (int k = 0; k < OF_THRUST * OF_THRUST; k++) A[k] = member->P[THRUST + k / OF_THRUST][THRUST + k % OF_THRUST];
    if (!factored(OF_THRUST, A)) return 0;
    for (int k = 0; k < OF_THRUST; k++)
        for (int a = 0; a < MOTION; a++) H[k][a] = member->P[THRUST + k][a];
    solved_all(OF_THRUST, MOTION, A, H[0]);
    for (int a = 0; a < MOTION; a++)
        for (int k = 0; k < OF_THRUST; k++)
            for (int b = 0; b < MOTION; b++) member->P[a][b] -= H[k][a] * member->P[THRUST + k][b];
    member->errors = MOTION;
    return 1;
}

/* What a node tells of the curve: that it is straight where it is seen, by the gain that the likeliest member
   has for given thrusters. */
static void update_curve(Online *filter, const Measurement *measurement) {
    double(*curve)[PRODUCTS] = filter->curve, e[3], L[9], B[3][ERRORS * ABREAST];
    if (filter->manoeuvred == 0.0) return;
    Member member;
    unpack_member(&filter->bank[likeliest(filter->bank)], &member);
    go_to_node(&filter->options, &member, measurement);
    if (!know_thrust(&member) || !innovation(&member, measurement, e, L, B)) return;
    separate(1, PATH_AND_MAP, L, B[0], B[1], B[2]);
    for (int p = 0; p < PRODUCTS; p++) {
        double of_map[OF_MAP];
        for (int a = 0; a < OF_MAP; a++) {
            of_map[a] = curve[OFFSET + a][p];
            for (int b = 0; b < OF_MAP; b++) of_map[a] += measurement->follow[a][b] * curve[OFFSET + b][p];
        }
        for (int k = 0; k < 3; k++) {
            e[k] = curve[k][p] + dot(measurement->offset[k], of_map) + measurement->scale[k] * of_map[SCALE - OFFSET];
            for (int j = 0; j < 3; j++) e[k] -= measurement->lag[k][j] * curve[3 + j][p];
        }
        separate(1, 1, L, &e[0], &e[1], &e[2]);
        for (int k = 0; k < 3; k++) e[k] *= L[4 * k];
        for (int a = 0; a < PATH_AND_MAP; a++) {
            if (a >= OFFSET) curve[a][p] = of_map[a - OFFSET];
            curve[a][p] -= B[0][a] * e[0] + B[1][a] * e[1] + B[2][a] * e[2];
        }
    }
}
