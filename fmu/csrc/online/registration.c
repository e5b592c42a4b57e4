/* The pose of a frame: where the map of the features stands, and which points fit. */

#define GATE 21.1        /* chi-square of 3 degrees of freedom with p = 1e-4 */
#define ROUGHLY 9.0      /* a pose from three points has up to three times the noise */
#define ALIKE 0.1        /* rad, within which the map's covariances need not be turned */
#define LARGE 1.0        /* rad, of a turn between frames where nothing is known of the rate */
#define STILL 1e-6       /* rad, far below the noise of any attitude: a last step */
#define LEFT 1e-8        /* rad, what another step would turn by */
#define SURELY 4.0       /* standard deviations of the mean square of residuals */
enum { ROUNDS = 6, TRIPLES = 60 };

/* By what the residuals say that the noise is larger than some times what is told, or less, but not than told; 1 where they don't, as in a new map. */
static double ratio_over(const Online *filter, double scale) {
    if (filter->freedom <= 0.0) return 1.0;
    const double ratio = fmax(filter->squares / filter->freedom, 1.0) / scale;
    return fabs(ratio - 1.0) > SURELY * sqrt(2.0 / filter->freedom) ? ratio : 1.0;
}

/* By what the noise is larger than told, as a factor of covariances. */
static double noise_ratio(const Online *filter) { return ratio_over(filter, 1.0); }

/* By what points are taken for worse than told, before the first frame, too. */
static double scale_of_noise(const Online *filter) { return filter->noise_scale > 0.0 ? filter->noise_scale : 1.0; }

/* By what the noise is larger than it is taken for. */
static double excess_of_noise(const Online *filter) { return ratio_over(filter, scale_of_noise(filter)); }

/* The gate of weighted residuals: where all are larger, as of a wrong sigma, they are no outliers. */
static double gate_of(const Online *filter) { return GATE * excess_of_noise(filter); }

/* The weight of a residual at the attitude R, with which the map's covariance turns; 0 where it has none. */
static ALWAYS_INLINE int weighed(Frame *frame, int i, const double R[3][3]) {
    double T[3][3], both[3][3];
    product(R, frame->spread[i], T);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b <= a; b++) both[a][b] = both[b][a] = frame->noise[i][a][b] + dot(T[a], R[b]) + frame->more[i][a][b];
    return inverted(both, frame->W[i]);
}

static void weigh_all(Frame *frame, const double R[3][3]) {
    for (int i = 0; i < frame->count; i++)
        if (frame->slot[i] >= 0) weighed(frame, i, R);
}

/* Of a point against the map: its arm R b, what it is off by, and that weighted; returns the weighted square. */
static ALWAYS_INLINE double residual(const Online *filter, const Frame *frame, const Pose *pose, int i, double arm[3], double e[3], double We[3]) {
    times(pose->R, filter->b[frame->slot[i]], arm);
    for (int k = 0; k < 3; k++) e[k] = frame->y[i][k] - pose->c[k] - arm[k];
    times(frame->W[i], e, We);
    return dot(e, We);
}

/* The squares of the residuals of all points that are in the map. */
static void find_squares(const Online *filter, Frame *frame, const Pose *pose) {
    for (int i = 0; i < frame->count; i++) {
        double arm[3], e[3], We[3];
        if (frame->slot[i] >= 0) frame->square[i] = residual(filter, frame, pose, i, arm, e, We);
    }
}

/* Where a point with a residual e, weighted We, shows its feature to be, from where the map has it: there it turns. */
static void bend(Frame *frame, int i, const double e[3], const double We[3]) {
    for (int k = 0; k < 3; k++) frame->bent[i][k] = e[k] - dot(frame->noise[i][k], We) - dot(frame->more[i][k], We);
}

/* The covariance of a pose by the Cholesky factor of its normal equations, which is overwritten. */
static void invert_normal_equations(double L[36], double covariance[6][6]) {
    invert_triangle(6, L);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = i; k < 6; k++) sum += L[6 * k + i] * L[6 * k + j];
            covariance[i][j] = covariance[j][i] = sum;
        }
}

/* What a point at an arm from the pose's origin, with the weight W and a residual that W makes We, adds to the normal equations: of N
   the lower triangle. A turn moves it by K = -[arm]x, so that K' w = arm x w. */
static void add_to_pose(const double arm[3], const double W[3][3], const double We[3], double N[36], double rhs[6]) {
    double torque[3], WK[3][3], KW[3][3], KWK[3][3];
    cross(arm, We, torque);
    for (int a = 0; a < 3; a++) cross(arm, W[a], WK[a]);
    transposed(WK, KW);
    for (int a = 0; a < 3; a++) cross(arm, KW[a], KWK[a]);
    for (int a = 0; a < 3; a++) {
        rhs[a] += We[a], rhs[3 + a] += torque[a];
        for (int b = 0; b < 3; b++) N[6 * (3 + a) + b] += KW[a][b];
        for (int b = 0; b <= a; b++) N[6 * a + b] += W[a][b], N[6 * (3 + a) + 3 + b] += KWK[a][b];
    }
}

/* Gauss and Newton's steps with the points that fit, which are weighed at the attitude from which it begins; 0 if these leave a direction
   free. Weights that go with the attitude make them converge by about the same ratio each: so the last one is that after which the next,
   by the ratio to the one before, would turn by less than LEFT. */
static int adjusted(const Online *filter, Frame *frame, Pose *pose) {
    double N[36], before = 0.0;
    for (int round = 0; round < ROUNDS; round++) {
        double step[6] = {0}, largest = 0.0;
        for (int k = 0; k < 36; k++) N[k] = 0.0;
        pose->count = 0;
        for (int i = 0; i < frame->count; i++) {
            if (!frame->fits[i]) continue;
            double arm[3], e[3], We[3];
            if (round > 0) weighed(frame, i, pose->R);
            residual(filter, frame, pose, i, arm, e, We);
            bend(frame, i, e, We);
            for (int k = 0; k < 3; k++) arm[k] += frame->bent[i][k];
            add_to_pose(arm, (const double(*)[3])frame->W[i], We, N, step);
            pose->count++;
        }
        if (pose->count < 3 || !factored(6, N)) return 0;
        solved(6, N, step);
        for (int k = 0; k < 3; k++) pose->c[k] += step[k];
        for (int k = 0; k < 6; k++) largest = fmax(largest, fabs(step[k]));
        const double width = fmax(fabs(step[3]), fmax(fabs(step[4]), fabs(step[5])));
        if (!isfinite(largest)) return 0;
        turn_left(step + 3, pose->R);
        if (width < STILL || width * width < LEFT * before) break;
        before = width;
    }
    invert_normal_equations(N, pose->covariance);
    find_squares(filter, frame, pose);
    pose->squares = 0.0;
    for (int i = 0; i < frame->count; i++)
        if (frame->fits[i]) pose->squares += frame->square[i];
    return 1;
}

/* Marks the points whose residuals' squares are within a gate; returns how many marks changed. */
static int sorted_out(Frame *frame, double gate) {
    int changed = 0;
    for (int i = 0; i < frame->count; i++) {
        int fits = frame->slot[i] >= 0 && frame->square[i] < gate;
        changed += fits != frame->fits[i];
        frame->fits[i] = fits;
    }
    return changed;
}

static int settled(const Online *filter, Frame *frame, Pose *pose) {
    for (int round = 0; round < ROUNDS; round++) {
        double before[3][3], turn[3];
        copy(pose->R, before);
        weigh_all(frame, before);
        if (!adjusted(filter, frame, pose)) return 0;
        if (!sorted_out(frame, gate_of(filter)) && angle_between(pose->R, before, turn) < ALIKE) return 1;
    }
    weigh_all(frame, pose->R);
    return adjusted(filter, frame, pose);
}

/* The axes of a triangle as rows; 0 if its corners are nearly in a line. */
static int triad(const double a[3], const double b[3], const double c[3], double axes[3][3]) {
    double u[3], w[3];
    for (int k = 0; k < 3; k++) u[k] = b[k] - a[k], w[k] = c[k] - a[k];
    double length = sqrt(dot(u, u));
    cross(u, w, axes[2]);
    double area = sqrt(dot(axes[2], axes[2]));
    if (!(area > 0.05 * length * sqrt(dot(w, w)))) return 0;
    for (int k = 0; k < 3; k++) axes[0][k] = u[k] / length, axes[2][k] /= area;
    cross(axes[2], axes[0], axes[1]);
    return 1;
}

static int from_triple(const Online *filter, Frame *frame, const int at[3], Pose *pose) {
    double body[3][3], seen[3][3], arm[3];
    const double(*b)[3] = filter->b;
    if (!triad(b[frame->slot[at[0]]], b[frame->slot[at[1]]], b[frame->slot[at[2]]], body)) return 0;
    if (!triad(frame->y[at[0]], frame->y[at[1]], frame->y[at[2]], seen)) return 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            pose->R[i][j] = seen[0][i] * body[0][j] + seen[1][i] * body[1][j] + seen[2][i] * body[2][j];
    for (int k = 0; k < 3; k++) pose->c[k] = 0.0;
    for (int p = 0; p < 3; p++) {
        times(pose->R, b[frame->slot[at[p]]], arm);
        for (int k = 0; k < 3; k++) pose->c[k] += (frame->y[at[p]][k] - arm[k]) / 3.0;
    }
    weigh_all(frame, pose->R);
    for (int i = 0; i < frame->count; i++) frame->fits[i] = i == at[0] || i == at[1] || i == at[2];
    return adjusted(filter, frame, pose);
}

/* The pose that most points, and the predicted attitude, agree on, by some of all triples. */
static int agreed(const Online *filter, Frame *frame, const PredictedAttitude *predicted, Pose *best) {
    int known[MOST_FEATURES], n = 0, number = 0, found = 0;
    for (int i = 0; i < frame->count; i++)
        if (frame->slot[i] >= 0) known[n++] = i;
    int every = (n * (n - 1) * (n - 2) / 6 + TRIPLES - 1) / TRIPLES;
    double least = 0.0;
    for (int i = 0; i < n; i++)
        for (int j = i + 1; j < n; j++)
            for (int k = j + 1; k < n; k++) {
                if (number++ % every) continue;
                int at[3] = {known[i], known[j], known[k]};
                Pose pose;
                if (!from_triple(filter, frame, at, &pose)) continue;
                double turn[3], angle = angle_between(pose.R, predicted->R, turn);
                double cost = fmin(angle * angle / predicted->variance, ROUGHLY * gate_of(filter));
                for (int p = 0; p < n; p++) {
                    double arm[3], e[3], We[3];
                    cost += fmin(residual(filter, frame, &pose, known[p], arm, e, We), ROUGHLY * gate_of(filter));
                }
                if (!found || cost < least) *best = pose, least = cost, found = 1;
            }
    if (!found) return 0;
    find_squares(filter, frame, best);
    sorted_out(frame, ROUGHLY * gate_of(filter));
    return settled(filter, frame, best);
}

/* The pose from all points that are in the map, which are weighed at a predicted attitude, near that; 0 if one does not fit. */
static int fits_as_a_whole(const Online *filter, Frame *frame, const PredictedAttitude *predicted, Pose *pose) {
    double arm[3], count = 0.0;
    for (int k = 0; k < 3; k++) pose->c[k] = 0.0;
    copy(predicted->R, pose->R);
    for (int i = 0; i < frame->count; i++) {
        frame->fits[i] = frame->slot[i] >= 0;
        if (!frame->fits[i]) continue;
        times(pose->R, filter->b[frame->slot[i]], arm);
        count += 1.0;
        for (int k = 0; k < 3; k++) pose->c[k] += (frame->y[i][k] - arm[k] - pose->c[k]) / count;
    }
    return adjusted(filter, frame, pose) && !sorted_out(frame, gate_of(filter));
}

static void set_apart(const PredictedAttitude *predicted, Pose *pose) {
    double turn[3];
    pose->apart = angle_between(pose->R, predicted->R, turn);
}

/* The pose of a frame near a predicted attitude, at which its points are weighed, or by agreement; 0 if fewer than three, or half of them, fit. */
static int registered(const Online *filter, Frame *frame, const PredictedAttitude *predicted, Pose *pose) {
    int known = 0;
    for (int i = 0; i < frame->count; i++) known += frame->slot[i] >= 0;
    if (known < 3) return 0;
    int fits = fits_as_a_whole(filter, frame, predicted, pose);
    if (fits) {
        set_apart(predicted, pose);
        if (pose->apart < ALIKE) return 1;
        fits = settled(filter, frame, pose) && pose->count == known;
    }
    if (!fits && !(agreed(filter, frame, predicted, pose) && 2 * pose->count > known)) return 0;
    set_apart(predicted, pose);
    return 1;
}
