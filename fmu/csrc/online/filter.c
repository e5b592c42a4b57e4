/* The Kalman filter of all errors: propagation, and updates with one feature after the other. */

static int size_of(const Online *filter) { return BODY + 3 * (int)filter->used; }

/* (r, v) and its transition from one time to another; the chaser's acceleration in C, m/s2. */
static void transition(const OnlineOptions *options, double begin, double end, const double a[3], double x[6],
                       double F[6][6]) {
    double T = end - begin;
    if (options->on_orbit != 0.0) {
        relative_step(begin, end, options->elements, x, F);
    } else {
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 6; j++) F[i][j] = i == j;
        for (int k = 0; k < 3; k++) F[k][3 + k] = T, x[k] += T * x[3 + k];
    }
    for (int k = 0; k < 3; k++) x[k] -= 0.5 * T * T * a[k], x[3 + k] -= T * a[k];
}

static void add_noise(double q, double T, double *P, int stride) {
    for (int k = 0; k < 3; k++) {
        P[k * stride + k] += q * T * T * T / 3.0;
        P[(3 + k) * stride + 3 + k] += q * T;
        P[k * stride + 3 + k] += q * T * T / 2.0;
        P[(3 + k) * stride + k] += q * T * T / 2.0;
    }
}

/* Count the transition from here. */
static void start_interval(Online *filter) {
    for (int i = 0; i < 6; i++) {
        filter->from[i] = filter->x[i];
        for (int j = 0; j < 6; j++) filter->F[i][j] = i == j;
    }
    filter->elapsed = 0.0;
}

static void multiplied(const double A[6][6], const double B[6][6], double C[6][6]) {
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            C[i][j] = 0.0;
            for (int k = 0; k < 6; k++) C[i][j] += A[i][k] * B[k][j];
        }
}

/* In how many steps to go: the noise's covariance is that of a straight line, true for a small arc of the orbit. */
static int steps_between(const OnlineOptions *options, double begin, double end) {
    if (options->on_orbit == 0.0) return 1;
    double a = options->elements[0], e = options->elements[1];
    double rate = sqrt(options->elements[6] / (a * a * a)) / ((1.0 - e) * (1.0 - e));
    double arcs = ceil((end - begin) * rate / 0.05);
    return arcs < 1.0 ? 1 : arcs > 200.0 ? 200 : (int)arcs;
}

/* Bring the covariances, and the bank, to the time of the state. */
static void settle(Online *filter) {
    int n = size_of(filter);
    double A[6][MOST_ERRORS], step[6];
    if (filter->elapsed == 0.0) return;
    for (int i = 0; i < 6; i++) {
        step[i] = filter->x[i] - (dot(filter->F[i], filter->from) + dot(&filter->F[i][3], &filter->from[3]));
        for (int j = 0; j < n; j++) A[i][j] = 0.0;
        for (int k = 0; k < 6; k++)
            for (int j = 0; j < n; j++) A[i][j] += filter->F[i][k] * filter->P[PLACE + k][j];
    }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < n; j++) filter->P[PLACE + i][j] = filter->P[j][PLACE + i] = A[i][j];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k < 6; k++) sum += A[i][PLACE + k] * filter->F[j][k];
            filter->P[PLACE + i][PLACE + j] = filter->P[PLACE + j][PLACE + i] = sum;
        }
    add_noise(filter->density, filter->elapsed, &filter->P[PLACE][PLACE], MOST_ERRORS);
    advance_bank(filter, filter->elapsed, step, filter->F);
    start_interval(filter);
}

/* The state at a later time; the covariances follow where the noise's would no longer be that of a straight line. */
static void advance(Online *filter, double end, const double a[3]) {
    int count = steps_between(&filter->options, filter->time, end);
    double begin = filter->time, T = (end - begin) / count;
    for (int s = 0; s < count; s++) {
        double F[6][6], before[6][6], from = begin + s * T;
        transition(&filter->options, from, s + 1 < count ? from + T : end, a, filter->x, F);
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 6; j++) before[i][j] = filter->F[i][j];
        multiplied(F, before, filter->F);
        filter->elapsed += T;
        if (s + 1 < count || steps_between(&filter->options, end - filter->elapsed, end) > 1) settle(filter);
    }
    filter->time = end;
}

/* Errors that every frame has of its own: none is known of them but a covariance. */
static void renew(Online *filter, int begin, double covariance[3][3]) {
    int n = size_of(filter);
    for (int a = 0; a < 3; a++)
        for (int j = 0; j < n; j++) filter->P[begin + a][j] = filter->P[j][begin + a] = 0.0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) filter->P[begin + a][begin + b] = covariance[a][b];
}

/* The covariance of a x b of independent a and b. */
static void of_cross(double A[3][3], double B[3][3], double C[3][3]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int p = (i + 1) % 3, q = (i + 2) % 3, r = (j + 1) % 3, s = (j + 2) % 3;
            C[i][j] = A[p][r] * B[q][s] - A[p][s] * B[q][r] - A[q][r] * B[p][s] + A[q][s] * B[p][r];
        }
}

/* The covariance (3, 3) of the pose's place, `first` 0, or of its rotation vector in C, `first` 3. */
static void of_pose(const Pose *pose, int first, double found[3][3]) {
    for (int j = 0; j < 3; j++) {
        double column[6] = {0};
        column[first + j] = 1.0;
        solved(6, pose->factor, column);
        for (int i = 0; i < 3; i++) found[i][j] = column[first + i];
    }
}

/* What moves all points of a frame together: the camera's attitude, and what is of second order, the error of the
   attitude times that of the offset. */
static void common_noise(const Online *filter, const Frame *frame, const Pose *pose, double found[3][3]) {
    double turn[3][3], offset[3][3] = {{0}}, T[3][3], a = filter->options.attitude_noise;
    of_pose(pose, 3, turn);
    for (int i = 0; i < frame->count; i++) {
        if (!frame->fits[i]) continue;
        int at = BODY + 3 * frame->slot[i];
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++) offset[j][k] += filter->P[at + j][at + k] / pose->count;
    }
    product(pose->R, offset, T);
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < 3; k++) offset[j][k] = dot(T[j], pose->R[k]);
    of_cross(turn, offset, found);
    double square = dot(pose->c, pose->c);
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < 3; k++) found[j][k] += a * a * ((j == k ? square : 0.0) - pose->c[j] * pose->c[k]);
}

/* The update with one point, seen `lag` s before the time of the state; dx are the errors found so far in this frame. */
static void update_point(Online *filter, const Frame *frame, int i, double lag, double dx[]) {
    int n = size_of(filter);
    int at = BODY + 3 * frame->slot[i];
    double arm[3], K[3][3], B[3][MOST_ERRORS], L[9], e[3];
    const double(*R)[3] = filter->R;
    times(R, filter->b[frame->slot[i]], arm);
    moved_by_turn(arm, K);
    for (int c = 0; c < 3; c++) {
        const double *p = filter->P[SHIFT + c], *q = filter->P[PLACE + c], *v = filter->P[SPEED + c];
        const double *t0 = filter->P[TURN], *t1 = filter->P[TURN + 1], *t2 = filter->P[TURN + 2];
        const double *b0 = filter->P[at], *b1 = filter->P[at + 1], *b2 = filter->P[at + 2];
        double *out = B[c];
        for (int j = 0; j < n; j++)
            out[j] = p[j] + q[j] - lag * v[j] + K[c][0] * t0[j] + K[c][1] * t1[j] + K[c][2] * t2[j] + R[c][0] * b0[j] +
                     R[c][1] * b1[j] + R[c][2] * b2[j];
        e[c] = frame->y[i][c] - filter->x[c] - arm[c] - dx[SHIFT + c] - dx[PLACE + c] + lag * dx[SPEED + c];
        e[c] -= dot(K[c], &dx[TURN]) + dot(R[c], &dx[at]);
    }
    for (int c = 0; c < 3; c++)
        for (int d = 0; d < 3; d++)
            L[3 * c + d] = B[c][SHIFT + d] + B[c][PLACE + d] - lag * B[c][SPEED + d] + dot(K[d], &B[c][TURN]) + dot(R[d], &B[c][at]) +
                           frame->noise[i][c][d];
    if (!factored(3, L)) return;
    for (int c = 0; c < 3; c++) {
        for (int d = 0; d < c; d++) {
            e[c] -= L[3 * c + d] * e[d];
            for (int j = 0; j < n; j++) B[c][j] -= L[3 * c + d] * B[d][j];
        }
        double f = 1.0 / L[4 * c];
        e[c] *= f;
        for (int j = 0; j < n; j++) B[c][j] *= f;
    }
    for (int j = 0; j < n; j++) dx[j] += B[0][j] * e[0] + B[1][j] * e[1] + B[2][j] * e[2];
    for (int k = 0; k < n; k++) {
        double x = B[0][k], y = B[1][k], z = B[2][k], *row = filter->P[k];
        for (int j = 0; j < n; j++) row[j] -= x * B[0][j] + y * B[1][j] + z * B[2][j];
    }
}

/* The information on the offset that a frame only seems to give: the noise of its attitude turns the offset, too, and the
   error of the estimate is taken for zero by as much. In B. */
static void seeming(const Pose *pose, double noise[3][3], double M[3][3]) {
    double turn[3][3], weight[3][3], T[3][3], found[3][3];
    of_pose(pose, 3, turn);
    if (!inverted(noise, weight)) weight[0][0] = 0.0;
    of_cross(turn, weight, found);
    product(found, pose->R, T);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            M[i][j] = pose->R[0][i] * T[0][j] + pose->R[1][i] * T[1][j] + pose->R[2][i] * T[2][j];
}

/* M (1 + P M)^-1: information M is taken from a covariance P, to first order, but never more than half of it. */
static void damped(double P[3][3], double M[3][3], double found[3][3]) {
    double inverse[3][3];
    if (!inverted(M, inverse)) {
        for (int k = 0; k < 9; k++) found[k / 3][k % 3] = 0.0;
        return;
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) inverse[i][j] += P[i][j];
    if (!inverted(inverse, found))
        for (int k = 0; k < 9; k++) found[k / 3][k % 3] = 0.0;
}

static void take_back(Online *filter, double M[3][3]) {
    int n = size_of(filter), used = (int)filter->used;
    double G[3][MOST_ERRORS] = {{0}}, MG[3][MOST_ERRORS], P[3][3] = {{0}}, less[3][3];
    for (int f = 0; f < used; f++)
        for (int a = 0; a < 3; a++)
            for (int j = 0; j < n; j++) G[a][j] += filter->P[BODY + 3 * f + a][j] / used;
    for (int f = 0; f < used; f++)
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) P[a][b] += G[a][BODY + 3 * f + b] / used;
    damped(P, M, less);
    for (int a = 0; a < 3; a++)
        for (int j = 0; j < n; j++) MG[a][j] = less[a][0] * G[0][j] + less[a][1] * G[1][j] + less[a][2] * G[2][j];
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) filter->P[i][j] += G[0][i] * MG[0][j] + G[1][i] * MG[1][j] + G[2][i] * MG[2][j];
}

static void take_back_of_member(Member *member, double M[3][3]) {
    double P[3][3], less[3][3], G[3][LEVEL], MG[3][LEVEL];
    for (int a = 0; a < 3; a++) {
        for (int j = 0; j < LEVEL; j++) G[a][j] = member->P[6 + a][j];
        for (int b = 0; b < 3; b++) P[a][b] = member->P[6 + a][6 + b];
    }
    damped(P, M, less);
    for (int a = 0; a < 3; a++)
        for (int j = 0; j < LEVEL; j++) MG[a][j] = less[a][0] * G[0][j] + less[a][1] * G[1][j] + less[a][2] * G[2][j];
    for (int i = 0; i < LEVEL; i++)
        for (int j = 0; j < LEVEL; j++) member->P[i][j] += G[0][i] * MG[0][j] + G[1][i] * MG[1][j] + G[2][i] * MG[2][j];
}

/* A frame whose points are where they were seen from the foreseen centre of mass `lag` s ago; afterwards they are where
   they would have been seen with the velocity as it is known now. */
static void update_frame(Online *filter, Frame *frame, const Pose *pose, double lag) {
    double dx[MOST_ERRORS] = {0}, common[3][3], free[3][3] = {{1.0, 0, 0}, {0, 1.0, 0}, {0, 0, 1.0}};
    double C[3][3], c[3], moved[3] = {0};
    common_noise(filter, frame, pose, common);
    renew(filter, SHIFT, common);
    renew(filter, TURN, free);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) filter->R[i][j] = pose->R[i][j];
    for (int i = 0; i < frame->count; i++)
        if (frame->fits[i]) update_point(filter, frame, i, lag, dx);
    of_pose(pose, 0, C);
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < 3; k++) C[k][j] += common[k][j];
    for (int k = 0; k < 3; k++) c[k] = pose->c[k] - lag * filter->x[3 + k];
    for (int k = 0; k < 6; k++) filter->x[k] += dx[PLACE + k];
    for (int i = 0; i < frame->count; i++)
        for (int k = 0; k < 3; k++) frame->y[i][k] += lag * dx[SPEED + k];
    start_interval(filter);
    for (int f = 0; f < (int)filter->used; f++)
        for (int k = 0; k < 3; k++) {
            filter->b[f][k] += dx[BODY + 3 * f + k];
            moved[k] += dx[BODY + 3 * f + k] / filter->used;
        }
    turn_left(&dx[TURN], filter->R);
    double M[3][3];
    seeming(pose, C, M);
    take_back(filter, M);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) filter->seeming[i][j] += M[i][j];
    update_bank(filter, lag, c, pose->R, C, moved);
    for (int m = 0; m <= SHADOW; m++) take_back_of_member(&filter->bank[m], M);
}
