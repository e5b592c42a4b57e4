/* What a node says of (r, v, offset), with all that is uncertain about it. */

/* The covariance of a x b of independent a and b. */
static void of_cross(const double A[3][3], double B[3][3], double C[3][3]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int p = (i + 1) % 3, q = (i + 2) % 3, r = (j + 1) % 3, s = (j + 2) % 3;
            C[i][j] = A[p][r] * B[q][s] - A[p][s] * B[q][r] - A[q][r] * B[p][s] + A[q][s] * B[p][r];
        }
}

/* The covariance (3, 3) of the pose's place, `first` 0, or of its rotation vector in C, `first` 3. */
static void of_pose(const Pose *pose, int first, double found[3][3]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) found[i][j] = pose->covariance[first + i][first + j];
}

/* A = R A R' */
static void turned(const double R[3][3], double A[3][3]) {
    double T[3][3];
    product(R, A, T);
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < 3; k++) A[j][k] = dot(T[j], R[k]);
}

/* The variance of the camera's attitude about an axis, and so of every attitude of the target that it shows: it turns all points
   of a frame together. */
static double square_of_camera(const Online *filter) { return filter->options.attitude_noise * filter->options.attitude_noise; }

/* A share of what the camera's attitude, that moves all points of a frame together, does to a place in C; added. */
static void of_camera(const Online *filter, const double place[3], double share, double found[3][3]) {
    double variance = share * square_of_camera(filter), square = dot(place, place);
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < 3; k++) found[j][k] += variance * ((j == k ? square : 0.0) - place[j] * place[k]);
}

/* What an error of an attitude, a rotation vector t, does to a place besides t x place: (t t' - t.t) place / 2, on an arc, as if
   its mean were noise, too; added. With one t for both, the square of t x (t x place) is three times that of two. */
static void add_arc(const double turn[3][3], double place[3][3], double found[3][3]) {
    double once[3][3], twice[3][3];
    of_cross(turn, place, once);
    of_cross(turn, once, twice);
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < 3; k++) found[j][k] += 0.75 * twice[j][k];
}

/* Of what a node shows by itself: the camera's attitude, and the arc on which its attitude moves the centre of mass. */
static void of_itself(const Online *filter, const Frame *frame, const Pose *pose, const Measurement *measurement, double found[3][3]) {
    double mean[3] = {0}, arm[3], place[3][3];
    for (int i = 0; i < frame->count; i++)
        for (int k = 0; k < 3 && frame->fits[i]; k++) mean[k] += filter->b[frame->slot[i]][k] / pose->count;
    times(pose->R, mean, arm);
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < 3; k++) place[j][k] = arm[j] * arm[k];
    add_arc(measurement->turn, place, found);
    of_camera(filter, pose->c, 1.0, found);
}

/* What moves all points of a frame together: the camera's attitude, and what is of second order, the error of the
   attitude times that of the offset, and the arc of its own. */
static void common_noise(const Online *filter, const Frame *frame, const Pose *pose, const Measurement *measurement,
                         double found[3][3]) {
    double offset[3][3] = {{0}};
    for (int i = 0; i < frame->count; i++) {
        if (!frame->fits[i]) continue;
        int at = FEATURES + 3 * frame->slot[i];
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++) offset[j][k] += filter->P[at + j][at + k] / pose->count;
    }
    turned(pose->R, offset);
    of_cross(measurement->turn, offset, found);
    add_arc(measurement->turn, offset, found);
    of_itself(filter, frame, pose, measurement, found);
}

/* What an error of a rotation does to one of a place, added with a factor; covariances of both, of the place in B. */
static void add_cross(const double turn[3][3], const double R[3][3], double place[3][3], double factor, double found[3][3]) {
    double more[3][3];
    turned(R, place);
    of_cross(turn, place, more);
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < 3; k++) found[j][k] += factor * more[j][k];
}

/* Of a feature's place, what the errors of attitude and rate do to it besides: of second order. With the attitude's it is the
   feature's own error, as that of the whole map is in `common_noise`. */
static void add_second_order(const Online *filter, Frame *frame, const Pose *pose, const Sweep *sweep) {
    double turn[3][3], place[3][3];
    of_pose(pose, 3, turn);
    for (int i = 0; i < frame->count; i++) {
        double swept = frame->passage[i].swept;
        if (!frame->fits[i]) continue;
        copy(frame->spread[i], place);
        add_cross(turn, pose->R, place, 1.0, frame->noise[i]);
        if (swept == 0.0) continue;
        int at = FEATURES + 3 * frame->slot[i];
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++) place[j][k] = filter->P[at + j][at + k];
        add_cross(sweep->covariance, pose->R, place, swept * swept, frame->noise[i]);
    }
}

/* R' A R */
static void in_body(const double R[3][3], const double A[3][3], double found[3][3]) {
    double T[3][3];
    product(A, R, T);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) found[a][b] = R[0][a] * T[0][b] + R[1][a] * T[1][b] + R[2][a] * T[2][b];
}

#define ROUNDS_OF_WEIGHTS 3 /* from the plain centroid, which features that are badly known lead astray */

/* Of each feature of the map in what its centroid and attitude are, together 1: one whose place among the others is known worse than
   what the frame shows of one counts less. Else one that was seen for a moment and never again would move and turn the map by all
   that is not known of it. */
static void weights_of_map(const Online *filter, const Frame *frame, double weight[MOST_FEATURES]) {
    const int used = (int)filter->used;
    double shown = 0.0, count = 0.0;
    for (int i = 0; i < frame->count; i++)
        for (int k = 0; k < 3 && frame->fits[i]; k++) shown += frame->noise[i][k][k], count += 1.0 / 3.0;
    for (int f = 0; f < used; f++) weight[f] = 1.0 / used;
    for (int round = 0; round < ROUNDS_OF_WEIGHTS; round++) {
        double of_mean = 0.0, by_mean[MOST_FEATURES] = {0}, sum = 0.0;
        for (int f = 0; f < used; f++)
            for (int k = 0; k < 3; k++)
                for (int g = 0; g < used; g++) by_mean[g] += weight[f] * filter->P[FEATURES + 3 * f + k][FEATURES + 3 * g + k];
        for (int f = 0; f < used; f++) of_mean += weight[f] * by_mean[f];
        for (int f = 0; f < used; f++) {
            double own = of_mean - 2.0 * by_mean[f];
            for (int k = 0; k < 3; k++) own += filter->P[FEATURES + 3 * f + k][FEATURES + 3 * f + k];
            sum += weight[f] = 1.0 / (shown / count + fmax(own, 0.0));
        }
        scale_block(weight, used, 1.0 / sum);
    }
}

/* By how much of each feature's error the whole map is turned, in B: least squares of a rotation about the centroid. */
static void turn_of_map(const Online *filter, const double weight[MOST_FEATURES], double share[MOST_FEATURES][3][3]) {
    int used = (int)filter->used;
    double mean[3] = {0}, J[3][3] = {{0}}, inverse[3][3];
    for (int f = 0; f < used; f++)
        for (int k = 0; k < 3; k++) mean[k] += weight[f] * filter->b[f][k];
    for (int f = 0; f < used; f++) {
        double arm[3], K[3][3];
        for (int k = 0; k < 3; k++) arm[k] = filter->b[f][k] - mean[k];
        moved_by_turn(arm, K);
        transposed(K, share[f]);
        scale_block(share[f][0], 9, weight[f]);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) J[a][b] += weight[f] * dot(K[a], K[b]);
    }
    if (!inverted(J, inverse)) copy(NOTHING, inverse);
    for (int f = 0; f < used; f++) {
        double T[3][3];
        copy(share[f], T);
        product(inverse, T, share[f]);
    }
}

#define NODES_OF_A_TURN 25.0 /* about: of USUAL */

/* What the errors of the features do: to the offset and scale that are seen, as other features are than in the node before, and to
   the attitude against that of the whole map, `turned_by`, to which it is added; in B. What is known of offset and scale goes on
   by the regression of their change on what they were. What that leaves open is of errors that stay. Where points
   have covariances of their own, as a rig's, by which each side of the target is weighed otherwise, it comes again with each side, and is no
   noise, new in each node, of which many nodes make nothing. So it counts as often as there are nodes in a turn, after the nodes that
   are kept, which are somewhat more than a turn: in the first turn nothing comes again. */
WIDE static void of_map(const Online *filter, double share[MOST_FEATURES][OF_MAP][3], double turn[MOST_FEATURES][3][3], Measurement *measurement,
                   double turned_by[3][3]) {
    enum { BEFORE = OF_MAP, TURNED = 2 * OF_MAP, ROWS = TURNED + 3 };
    const double nodes = filter->pairs > 0.0 && filter->stored_count < 0.0 ? NODES_OF_A_TURN : 1.0;
    const int used = 3 * (int)filter->used, n = (used + AT_ONCE - 1) / AT_ONCE * AT_ONCE;
    double D[ROWS][3 * MOST_FEATURES], DP[3 * MOST_FEATURES], before[OF_MAP * OF_MAP];
    for (int a = 0; a < ROWS; a++)
        for (int j = used; j < n; j++) D[a][j] = 0.0;
    for (int j = 0; j < used; j++) {
        for (int a = 0; a < OF_MAP; a++) {
            D[BEFORE + a][j] = filter->share[j / 3][a][j % 3];
            D[a][j] = share[j / 3][a][j % 3] - D[BEFORE + a][j];
        }
        for (int a = 0; a < 3; a++) D[TURNED + a][j] = turn[j / 3][a][j % 3];
    }
    for (int a = 0; a < ROWS; a++) {
        int first = a < TURNED ? a / BEFORE * BEFORE : TURNED, end = a < TURNED ? TURNED : ROWS;
        for (int j = 0; j < n; j++) DP[j] = 0.0;
        for (int i = 0; i < used; i += 3) {
            const double *x = &filter->P[FEATURES + i][FEATURES], *y = x + MOST_ERRORS, *z = y + MOST_ERRORS, *part = &D[a][i];
            for (int j = 0; j < n; j++) DP[j] += part[0] * x[j] + part[1] * y[j] + part[2] * z[j];
        }
        for (int b = first; b < end; b++) {
            double sum = 0.0;
            for (int j = 0; j < n; j++) sum += DP[j] * D[b][j];
            if (a >= TURNED) turned_by[a - TURNED][b - TURNED] += sum;
            else if (a >= BEFORE) before[OF_MAP * (a - BEFORE) + b - BEFORE] = sum;
            else if (b >= BEFORE) measurement->follow[a][b - BEFORE] = sum;
            else measurement->change[a][b] = nodes * sum;
        }
    }
    const int sure = factored(OF_MAP, before);
    for (int a = 0; a < OF_MAP; a++)
        if (sure) solved(OF_MAP, before, measurement->follow[a]);
        else for (int b = 0; b < OF_MAP; b++) measurement->follow[a][b] = 0.0;
}

/* The share of each feature's error in the scale: least squares of the size of what a frame sees of the map about its middle. */
static void scale_of_map(const Online *filter, const Frame *frame, double share[MOST_FEATURES][OF_MAP][3]) {
    double square = 0.0, count = 0.0, middle[3] = {0};
    for (int i = 0; i < frame->count; i++) {
        if (!frame->fits[i]) continue;
        count += 1.0;
        for (int k = 0; k < 3; k++) middle[k] += (filter->b[frame->slot[i]][k] - middle[k]) / count;
    }
    for (int f = 0; f < (int)filter->used; f++)
        for (int k = 0; k < 3; k++) share[f][SCALE - OFFSET][k] = 0.0;
    for (int i = 0; i < frame->count; i++) {
        if (!frame->fits[i]) continue;
        double *arm = share[frame->slot[i]][SCALE - OFFSET];
        for (int k = 0; k < 3; k++) arm[k] = filter->b[frame->slot[i]][k] - middle[k];
        square += dot(arm, arm);
    }
    for (int f = 0; f < (int)filter->used; f++)
        for (int k = 0; k < 3; k++) share[f][SCALE - OFFSET][k] /= square;
}

/* Shares of each feature's error in a node's place of the centre of mass, in C, become those in the offset, in B, and in the
   scale: what a wrong size of the map does to the place is not the offset's, but `scale`. */
static void apart(const Online *filter, const Frame *frame, double share[MOST_FEATURES][OF_MAP][3], Measurement *measurement) {
    int used = (int)filter->used;
    double inverse[3][3], square = 0.0, in_B[3], *scale = measurement->scale;
    scale_of_map(filter, frame, share);
    for (int f = 0; f < used; f++) square += dot(share[f][SCALE - OFFSET], share[f][SCALE - OFFSET]);
    for (int k = 0; k < 3; k++) {
        scale[k] = 0.0; /* the inverse square of the shares in the scale is the square of the arms */
        for (int f = 0; f < used; f++) scale[k] += dot(share[f][k], share[f][SCALE - OFFSET]) / square;
    }
    if (!inverse_of(measurement->offset, inverse)) copy(NOTHING, inverse);
    times(inverse, scale, in_B);
    for (int f = 0; f < used; f++) {
        double T[3][3];
        product(inverse, (const double(*)[3])share[f], T);
        for (int a = 0; a < 3; a++)
            for (int k = 0; k < 3; k++) share[f][a][k] = T[a][k] - in_B[a] * share[f][SCALE - OFFSET][k];
    }
}

/* A S A' is added. */
static void add_congruent(double (*A)[3], const double S[3][3], double found[3][3]) {
    double T[3][3];
    product(A, S, T);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) found[a][b] += dot(T[a], A[b]);
}

/* While the chaser manoeuvres, r at the mean time of the node's frames is not r - lag v: what errors of the thrusters add. */
static void thrust_of_node(const Online *filter, const Sweep *sweep, double lag, Measurement *measurement) {
    if (filter->manoeuvred == 0.0) return;
    double by_thrust[6][OF_THRUST];
    thrust_after(&filter->since_node, &filter->transition, by_thrust);
    for (int a = 0; a < 3; a++)
        for (int k = 0; k < OF_THRUST; k++) measurement->by_thrust[a][k] = sweep->by_thrust[a][k] - (by_thrust[a][k] - lag * by_thrust[3 + a][k]);
}

/* What a node says of its centre of mass; share: of each feature's error in the offset, in B, and in the scale. */
static void measurement_of(const Online *filter, const Frame *frame, const Pose *pose, double lag, const Sweep *sweep,
                     double share[MOST_FEATURES][OF_MAP][3], Measurement *measurement) {
    const double(*V)[6] = pose->covariance;
    double swept[2][3][3] = {{{0}}}, later[3][3] = {{0}}, turn[MOST_FEATURES][3][3], T[3][3];
    *measurement = (Measurement){.bend = 0.5 * (lag * lag + sweep->spread)};
    weights_of_map(filter, frame, measurement->weight);
    turn_of_map(filter, measurement->weight, turn);
    for (int f = 0; f < (int)filter->used; f++) copy(NOTHING, share[f]); /* of the offset */
    for (int i = 0; i < frame->count; i++) {
        if (!frame->fits[i]) continue;
        const Passage *passage = &frame->passage[i];
        double arm[3], K[3][3], G[3], D[2][3][3], M[3][3];
        int f = frame->slot[i];
        times(pose->R, filter->b[f], arm);
        for (int k = 0; k < 3; k++) arm[k] += frame->bent[i][k];
        moved_by_turn(arm, K);
        for (int j = 0; j < 6; j++) {
            for (int a = 0; a < 3; a++) G[a] = V[j][a] + dot(K[a], &V[j][3]);
            transposed_times(frame->W[i], G, D[j / 3][j % 3]);
        }
        add_congruent(D[0], frame->noise[i], measurement->noise);
        add_congruent(D[1], frame->noise[i], measurement->turn);
        product(D[0], frame->noise[i], T);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) measurement->both[a][b] += dot(T[a], D[1][b]);
        for (int part = 0; part < 2 && passage->swept != 0.0; part++) {
            product(D[part], K, T);
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++) swept[part][a][b] += passage->swept * T[a][b];
        }
        product(passage->M, pose->R, M);
        product(D[0], M, share[f]);
        in_body(pose->R, D[1], T);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) {
                later[a][b] += passage->later * D[0][a][b];
                measurement->offset[a][b] += share[f][a][b];
                turn[f][a][b] -= T[a][b];
            }
    }
    apart(filter, frame, share, measurement);
    copy(NOTHING, T);
    of_map(filter, share, turn, measurement, T);
    turned(pose->R, T);
    add_congruent(swept[0], sweep->covariance, measurement->noise);
    add_congruent(swept[1], sweep->covariance, measurement->turn);
    thrust_of_node(filter, sweep, lag, measurement);
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++) {
            measurement->turn[a][b] += T[a][b];
            measurement->lag[a][b] = (a == b ? lag : 0.0) - later[a][b];
        }
        measurement->turn[a][a] += square_of_camera(filter);
        measurement->c[a] = pose->c[a] + dot(later[a], sweep->drift) - dot(measurement->lag[a], &filter->x[3]);
        for (int k = 0; k < OF_THRUST; k++) measurement->c[a] += measurement->by_thrust[a][k] * filter->thrust[k];
    }
}

/* What a feature's error, against the map's centroid, and that of the attitude make of each other. It stays the same, until the map is
   better known: a filter that takes it for noise, new in each node, or leaves it out, soon knows of the map what it does not know,
   as the places about which it is linear change. So it counts as often as there are nodes in a turn. */
static void add_what_stays(const Online *filter, Frame *frame, const Pose *pose, const Measurement *measurement) {
    double G[3][MOST_ERRORS], mean[3][3], place[3][3];
    with_centroid(filter, measurement->weight, FEATURES, G);
    of_centroid(filter, measurement->weight, G, mean);
    for (int i = 0; i < frame->count; i++) {
        if (!frame->fits[i]) continue;
        int at = FEATURES + 3 * frame->slot[i];
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) place[a][b] = filter->P[at + a][at + b] - G[a][at + b] - G[b][at + a] + mean[a][b];
        add_cross(measurement->turn, pose->R, place, NODES_OF_A_TURN, frame->noise[i]);
    }
}

/* The variances of a node's attitude against the whole map, rad2, all together. */
static double turned_squares(const Measurement *measurement) { return measurement->turn[0][0] + measurement->turn[1][1] + measurement->turn[2][2]; }

#define LOOSE 0.3 /* rad, standard deviation of an attitude that is as good as none: of features near a line, or in a map of bad depths */

static int is_loose(const Measurement *measurement) { return !(turned_squares(measurement) < LOOSE * LOOSE); }
