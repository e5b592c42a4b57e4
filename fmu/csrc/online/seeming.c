/* Information on the offset that is none, taken back. */

/* The information on the offset that is not there: the noise of an attitude turns the offset, too, and seems to show it, by
   E[[turn]x' N^-1 [turn]x]. What it seems to show is noise again, of as much information: twice that is taken back. Of a
   measurement at the attitude R; with its inverse. */
static void find_seeming(const double R[3][3], Measurement *measurement) {
    double weight[3][3], found[3][3];
    if (!inverted(measurement->noise, weight)) copy(NOTHING, weight); /* rounding has left it indefinite */
    of_cross(measurement->turn, weight, found);
    in_body(R, found, measurement->seems);
    scale_block(measurement->seems[0], 9, 2.0);
    if (!inverted(measurement->seems, measurement->seems_spread)) copy(NOTHING, measurement->seems_spread);
    measurement->sharpness = (weight[0][0] + weight[1][1] + weight[2][2]) / 3.0;
}

/* By how much less of that a member can see whose path has white noise of a density: of nodes T apart and of the variance N, what a path takes for its own
   tells nothing of the offset. The path's second differences have the spectrum q T3 (2 + cos u) / 3, so the part that is seen is the mean over u from 0 to pi
   of 1 / (1 + s (2 + cos u) / (12 (1 - cos u)^2)), s = q T3 / N. The inverse of this has the limits of that for small and large s, and is within 6 % of it. */
static double unseen_factor(const Measurement *measurement, double density) {
    const double T = measurement->span, s = density * T * T * T * measurement->sharpness, root = sqrt(s);
    return 1.0 + 0.354 * sqrt(root) + 0.11 * root + s / 14.35;
}

/* M (1 + P M)^-1: information M, what a node seems to show where the path has white noise of a density, is taken from a covariance P, to first order,
   but never more than half of it, nor what was known before the first frame: a variance of `widest`. Of L members. */
static ALWAYS_INLINE void damped(int L, const double *restrict P, const Measurement *measurement, const double *density, double widest,
                                 double *restrict found) {
    const double *spread = measurement->seems_spread[0];
    double factor[ABREAST], sum[9 * ABREAST], sound[ABREAST];
    for (int m = 0; m < L; m++) factor[m] = unseen_factor(measurement, density[m]);
    for (int k = 0; k < 9; k++)
        for (int m = 0; m < L; m++) sum[k * L + m] = spread[k] * factor[m] + P[k * L + m];
    inverses(L, sum, found, sound);
    for (int m = 0; m < L; m++) {
        const double left = 1.0 - (P[m] + P[4 * L + m] + P[8 * L + m]) / (3.0 * widest);
        factor[m] = ((left > 0.0) & (spread[0] > 0.0)) ? left : 0.0;
    }
    for (int k = 0; k < 9; k++)
        for (int m = 0; m < L; m++) found[k * L + m] *= factor[m];
}

WIDE static void take_back(Online *filter, const Measurement *measurement) {
    int n = size_of(filter);
    double G[3][MOST_ERRORS], MG[3][MOST_ERRORS], P[3][3], less[3][3];
    with_centroid(filter, measurement->weight, 0, G);
    of_centroid(filter, measurement->weight, G, P);
    damped(1, P[0], measurement, &filter->allowed, filter->widest, less[0]);
    for (int a = 0; a < 3; a++)
        for (int j = 0; j < n; j++) MG[a][j] = less[a][0] * G[0][j] + less[a][1] * G[1][j] + less[a][2] * G[2][j];
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) filter->P[i][j] += G[0][i] * MG[0][j] + G[1][i] * MG[1][j] + G[2][i] * MG[2][j];
}

/* Of the densities that L members abreast take for the path's. */
static ALWAYS_INLINE void take_back_of(int L, int n, int bent, const Measurement *measurement, const double *density, double widest, double *restrict P) {
    double of_offset[9 * ABREAST], by[9 * ABREAST], G[3][ERRORS * ABREAST], MG[3][ERRORS * ABREAST];
    for (int a = 0; a < 3; a++) {
        for (int j = 0; j <= OFFSET + a; j++)
            for (int m = 0; m < L; m++) G[a][j * L + m] = P[ROW(L, OFFSET + a, j) + m];
        for (int j = OFFSET + a + 1; j < n; j++)
            for (int m = 0; m < L; m++) G[a][j * L + m] = P[ROW(L, j, OFFSET + a) + m];
    }
    for (int k = 0; k < 9; k++)
        for (int m = 0; m < L; m++) of_offset[k * L + m] = G[k / 3][(OFFSET + k % 3) * L + m];
    damped(L, of_offset, measurement, density, widest, by);
    for (int a = 0; a < 3; a++)
        for (int j = 0; j < n; j++)
            for (int m = 0; m < L; m++)
                MG[a][j * L + m] = by[3 * a * L + m] * G[0][j * L + m] + by[(3 * a + 1) * L + m] * G[1][j * L + m] + by[(3 * a + 2) * L + m] * G[2][j * L + m];
    add_products(L, n, bent, (const double(*)[ERRORS * ABREAST])G, (const double(*)[ERRORS * ABREAST])MG, P);
}

static ALWAYS_INLINE void take_back_abreast(int L, int manoeuvred, int bent, const Measurement *measurement, const double *density, double widest, double *P) {
    if (manoeuvred && bent) take_back_of(L, ERRORS, 1, measurement, density, widest, P);
    else if (manoeuvred) take_back_of(L, UNBENT, 0, measurement, density, widest, P);
    else if (bent) take_back_of(L, MOTION, 1, measurement, density, widest, P);
    else take_back_of(L, PATH_AND_MAP, 0, measurement, density, widest, P);
}

WIDE static void take_back_of_member(Member *member, const Measurement *measurement, double density, double widest) {
    take_back_abreast(1, member->errors > MOTION, bends(member), measurement, &density, widest, member->P[0]);
}
