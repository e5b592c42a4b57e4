/* Frames taken as one: sums over frames whose attitudes the noise does not let tell apart. */

/* The offset of the centre of mass shows in how the path of a point bends, by the square of the angle that the target
   turns. That has to be far beyond the noise of the attitude, and so has the angle itself. */
#define FAR 16.0
#define USUAL 0.25  /* rad, enough for the first */
#define WIDEST 0.5  /* rad, enough for both */

/* Whether a point that is in no map is where it was seen before in this node; if it mostly is not, it begins anew. */
static int is_same(const Online *filter, FeatureSums *sum, const Frame *frame, int i, const Pose *pose) {
    double arm[3], place[3], off[3], e[3], We[3], K[3][3], T[3][3], S[3][3], W[3][3], n = sum->count;
    for (int k = 0; k < 3; k++) arm[k] = frame->y[i][k] - pose->c[k];
    transposed_times(pose->R, arm, place);
    if (n > 0.0) {
        for (int k = 0; k < 3; k++) off[k] = place[k] - sum->place[k];
        times(pose->R, off, e);
        of_pose(pose, 3, T);
        moved_by_turn(arm, K);
        product(K, T, S);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) W[a][b] = (1.0 + 1.0 / n) * (frame->noise[i][a][b] + dot(S[a], K[b]));
        if (!inverted(W, S)) return 0;
        times(S, e, We);
        if (dot(e, We) > gate_of(filter)) {
            if (++sum->strangers < n) return 0;
            *sum = (FeatureSums){.name = sum->name};
            n = 0.0;
        }
    }
    for (int k = 0; k < 3; k++) sum->place[k] += (place[k] - sum->place[k]) / (n + 1.0);
    return 1;
}

/* Add a registered frame. */
static void gather(Online *filter, const Frame *frame, const Pose *pose) {
    Node *node = &filter->node;
    double turn[3];
    if (node->count == 0.0) {
        *node = (Node){0};
        node->begin = filter->time;
        copy(pose->R, node->R);
    }
    double t = filter->time - node->begin;
    angle_between(pose->R, node->R, turn);
    node->count += 1.0, node->times += t, node->squares += t * t;
    for (int k = 0; k < 3; k++) {
        double drift = pose->c[k] - filter->x[k];
        node->turn[k] += turn[k], node->turn_times[k] += t * turn[k];
        node->drift[k] += drift, node->drift_times[k] += t * drift;
        node->variance += pose->covariance[3 + k][3 + k] / 3.0;
    }
    if (filter->manoeuvred != 0.0) {
        double by_thrust[6][OF_THRUST];
        thrust_after(&filter->since_node, &filter->transition, by_thrust);
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < OF_THRUST; j++) node->by_thrust[k][j] += by_thrust[k][j];
    }
    for (int i = 0; i < frame->count; i++) {
        if (frame->slot[i] >= 0 && !frame->fits[i]) continue;
        const int s = place_in_node(node, frame->name[i]);
        if (s == MOST_FEATURES) continue;
        if (s == (int)node->used) {
            node->seen[s] = (FeatureSums){0};
            node->seen[s].name = frame->name[i];
            node->used += 1.0;
        }
        FeatureSums *sum = &node->seen[s];
        if (frame->slot[i] < 0 && !is_same(filter, sum, frame, i, pose)) continue;
        sum->count += 1.0, sum->times += t, sum->squares += t * t, sum->cubes += t * t * t;
        for (int a = 0; a < 3; a++) {
            double y = frame->y[i][a] - filter->x[a];
            sum->y[a] += y, sum->y_times[a] += t * y;
            for (int b = 0; b < 3; b++) sum->noise[a][b] += frame->noise[i][a][b];
        }
    }
}

/* What two attitudes of a node are apart at most: beyond it there was a gap. */
static double widest_within(const Node *node) { return WIDEST + 8.0 * sqrt(node->variance / node->count); }

/* The node's mean attitude; how far that is from the node before, and from where it is far beyond its noise, in rad. */
static double turned_by(const Online *filter, double R[3][3], double *beyond) {
    const Node *node = &filter->node;
    double turn[3];
    for (int k = 0; k < 3; k++) turn[k] = node->turn[k] / node->count;
    copy(node->R, R);
    turn_left(turn, R);
    *beyond = FAR * sqrt(filter->frames_per_error * node->variance) / node->count;
    return angle_between(R, filter->R, turn);
}

/* Whether the node, of the mean attitude R, is far enough from the one before. */
static int far_enough(const Online *filter, double R[3][3]) {
    double beyond, angle = turned_by(filter, R, &beyond);
    return angle > fmin(fmax(fmin(USUAL, sqrt(beyond)), beyond), WIDEST);
}

/* The rate from how each feature moved between its own sightings: errors of its place, and of the centre of mass, have no
   part in it. */
static void find_rate(const Online *filter, double mean, double limit, Sweep *sweep) {
    const Node *node = &filter->node;
    double N[36] = {0}, rhs[6] = {0}, spread = node->squares - node->times * mean, since = sweep->since;
    const double *before = sweep->before, *swing = sweep->acceleration;
    for (int i = 0; i < (int)node->used; i++) {
        const FeatureSums *sum = &node->seen[i];
        double at = sum->times / sum->count, own = sum->squares - sum->times * at, later = at - mean;
        double noise[3][3], W[3][3], arm[3], place[3], K[3][3], WK[3][3], z[3], Wz[3], known[3], turned[3];
        if (!(own > 0.0)) continue;
        for (int a = 0; a < 3; a++) {
            arm[a] = sum->y[a] / sum->count, place[a] = filter->x[a] + arm[a];
            known[a] = since > 0.0 ? -2.0 * later / since * before[a] : later * swing[a];
            for (int b = 0; b < 3; b++) noise[a][b] = sum->noise[a][b] / (sum->count * own);
        }
        of_camera(filter, place, 1.0 / own - 1.0 / spread, noise); /* as in `as_frame` */
        if (!inverted(noise, W)) continue;
        cross(known, arm, turned);
        double f = since > 0.0 ? 1.0 + 2.0 * later / since : 1.0;
        moved_by_turn(arm, K);
        for (int a = 0; a < 3; a++) {
            z[a] = (sum->y_times[a] - at * sum->y[a]) / own - turned[a];
            for (int b = 0; b < 3; b++) K[a][b] *= f;
        }
        product(W, K, WK);
        times(W, z, Wz);
        for (int a = 0; a < 3; a++) {
            rhs[a] += Wz[a];
            rhs[3 + a] += K[0][a] * Wz[0] + K[1][a] * Wz[1] + K[2][a] * Wz[2];
            for (int b = 0; b < 3; b++) {
                N[6 * a + b] += W[a][b];
                N[6 * (3 + a) + b] += WK[b][a];
                N[6 * (3 + a) + 3 + b] += K[0][a] * WK[0][b] + K[1][a] * WK[1][b] + K[2][a] * WK[2][b];
            }
        }
    }
    /* Almost nothing: that of the attitudes, but for all that the target may turn within a node. */
    double little = spread / (node->count * limit * limit);
    for (int k = 0; k < 3; k++) {
        sweep->rate[k] = (node->turn_times[k] - mean * node->turn[k]) / spread;
        sweep->covariance[k][k] = 1.0 / little;
        N[7 * (3 + k)] += little;
        rhs[3 + k] += little * sweep->rate[k];
        if (!(N[7 * k] > 0.0)) N[7 * k] = 1.0;
    }
    if (!factored(6, N)) return;
    solved(6, N, rhs);
    for (int j = 0; j < 3; j++) {
        double column[6] = {0};
        column[3 + j] = 1.0;
        solved(6, N, column);
        sweep->drift[j] = rhs[j], sweep->rate[j] = rhs[3 + j];
        for (int k = 0; k < 3; k++) sweep->covariance[k][j] = column[3 + k];
    }
}

/* How the target turns about a node's mean time, at the attitude R. */
static void find_sweep(const Online *filter, const OnlineTumble *tumble, double mean, const double R[3][3],
                       Sweep *sweep) {
    const Node *node = &filter->node;
    double spread = node->squares - mean * node->times, since = node->begin + mean - filter->turned, turn[3];
    *sweep = (Sweep){.spread = fmax(spread, 0.0) / node->count};
    for (int a = 0; a < 3; a++)
        for (int k = 0; k < OF_THRUST; k++) sweep->by_thrust[a][k] = node->by_thrust[a][k] / node->count;
    if (!(spread > 0.0)) return;
    double angle = angle_between(R, filter->R, turn);
    if (tumble->known != 0.0) {
        swing_of(tumble, filter->time - node->begin - mean, sweep->acceleration);
    } else if (angle < 1.0 && since * since * node->count < FAR * 12.0 * spread) { /* no gap */
        sweep->since = since;
        for (int k = 0; k < 3; k++) sweep->before[k] = turn[k] / since;
    }
    find_rate(filter, mean, widest_within(node), sweep);
    for (int k = 0; k < 3; k++) sweep->covariance[k][k] += square_of_camera(filter) / spread;
    for (int k = 0; k < 3 && sweep->since > 0.0; k++)
        sweep->acceleration[k] = 2.0 * (sweep->rate[k] - sweep->before[k]) / since;
}

/* When a feature of the node was seen, and how the target turned since the node's mean time. */
static Passage passage_of(const Node *node, const FeatureSums *sum, double mean, const Sweep *sweep) {
    double W[3][3], W2[3][3], W3[3][3], A[3][3], at = sum->times / sum->count, n = sum->count;
    double square = sum->squares / n - 2.0 * mean * at + mean * mean;
    double fine = 1e-9 * (fabs(at) + fabs(mean)), later = fabs(at - mean) > fine ? at - mean : 0.0;
    double other = square - (node->squares / node->count - mean * mean);
    double cube = sum->cubes / n - 3.0 * mean * sum->squares / n + 3.0 * mean * mean * at - mean * mean * mean;
    Passage passage = {.later = later, .swept = later};
    if (sweep->since > 0.0 && fabs(other) > 1e-9 * square) passage.swept += other / sweep->since;
    passage.unsteady = cube / 6.0 * dot(sweep->rate, sweep->rate) * sqrt(dot(sweep->rate, sweep->rate));
    moved_by_turn(sweep->rate, W); /* -[w]x */
    moved_by_turn(sweep->acceleration, A);
    product(W, W, W2);
    product(W2, W, W3);
    for (int a = 0; a < 3; a++) {
        passage.y[a] = sum->y[a] / n;
        for (int b = 0; b < 3; b++)
            passage.M[a][b] = (a == b) - passage.later * W[a][b] + 0.5 * square * (W2[a][b] - A[a][b]) - cube / 6.0 * W3[a][b];
    }
    return passage;
}

/* The node as one frame, at the mean time and the attitude R, and how long ago that is. */
static double as_frame(const Online *filter, const OnlineTumble *tumble, const double R[3][3], Frame *frame,
                       Sweep *sweep) {
    const Node *node = &filter->node;
    double mean = node->times / node->count;
    find_sweep(filter, tumble, mean, R, sweep);
    frame->count = (int)node->used;
    for (int i = 0; i < frame->count; i++) {
        const FeatureSums *sum = &node->seen[i];
        Passage *passage = &frame->passage[i];
        double arm[3], there[3], K[3][3], S[3][3], more[3][3];
        *passage = passage_of(node, sum, mean, sweep);
        frame->name[i] = sum->name;
        frame->slot[i] = slot_of(filter, sum->name);
        if (frame->slot[i] >= 0) times(R, filter->b[frame->slot[i]], arm);
        else for (int k = 0; k < 3; k++) arm[k] = passage->y[k];
        times(passage->M, arm, there);
        moved_by_turn(arm, K);
        product(K, sweep->covariance, S);
        double unsteady = passage->unsteady * passage->unsteady / 3.0;
        for (int a = 0; a < 3; a++) {
            frame->y[i][a] = filter->x[a] + passage->y[a] - passage->later * sweep->drift[a] - (there[a] - arm[a]);
            for (int b = 0; b < 3; b++) {
                frame->noise[i][a][b] = filter->frames_per_error * sum->noise[a][b] / (sum->count * sum->count);
                frame->noise[i][a][b] += unsteady * dot(K[a], K[b]);
                more[a][b] = passage->swept * passage->swept * dot(S[a], K[b]);
            }
        }
        /* A part of the frames has the mean of other errors of the camera's attitude than all of them. */
        of_camera(filter, frame->y[i], 1.0 / sum->count - 1.0 / node->count, frame->noise[i]);
        weigh(filter, frame, i, R, sum->count, more);
    }
    return filter->time - node->begin - mean;
}

/* The rotation vector in B by which features went from `before`, about their centroid, the better known ones weighing more. */
static void map_turned(const Online *filter, const double before[MOST_FEATURES][3], double turn[3]) {
    double weight[MOST_FEATURES], sum = 0.0, centre[3] = {0}, moved[3] = {0}, N[3][3] = {{0}}, torque[3] = {0}, inverse[3][3];
    for (int k = 0; k < 3; k++) turn[k] = 0.0;
    for (int f = 0; f < (int)filter->used; f++) {
        int at = FEATURES + 3 * f;
        weight[f] = 1.0 / (filter->P[at][at] + filter->P[at + 1][at + 1] + filter->P[at + 2][at + 2]);
        sum += weight[f];
        for (int k = 0; k < 3; k++) {
            centre[k] += weight[f] * before[f][k];
            moved[k] += weight[f] * (filter->b[f][k] - before[f][k]);
        }
    }
    for (int f = 0; f < (int)filter->used; f++) {
        double arm[3], shift[3], pulled[3];
        for (int k = 0; k < 3; k++) {
            arm[k] = before[f][k] - centre[k] / sum;
            shift[k] = filter->b[f][k] - before[f][k] - moved[k] / sum;
        }
        cross(arm, shift, pulled);
        for (int a = 0; a < 3; a++) {
            torque[a] += weight[f] * pulled[a];
            for (int b = 0; b < 3; b++) N[a][b] += weight[f] * ((a == b ? dot(arm, arm) : 0.0) - arm[a] * arm[b]);
        }
    }
    if (inverted(N, inverse)) times(inverse, torque, turn);
}

/* Whether the target turned so far since the node before, as over a gap, that its rate is not the mean one, and whole turns do not show. */
static int is_over_gap(const Online *filter, const double turn[3], double span) {
    return dot(turn, turn) > 1.0 || (isfinite(filter->of_rate) && dot(filter->rate, filter->rate) * span * span > 1.0);
}

typedef enum { BROKEN, SOUND, TELLS_NOTHING } Closed;

/* Give the node to the filter and begin another; with the tumble as it is predicted now. BROKEN if the filter has to start again,
   TELLS_NOTHING if the map is too bad for its attitude. frame: the node as one, so long ago. */
static Closed close_node(Online *filter, const OnlineTumble *tumble, const double R[3][3], Frame *frame, double *ago) {
    Pose pose;
    Sweep sweep;
    Measurement measurement;
    Transition transition;
    double turn[3], T[3][3], before[3][3], map[MOST_FEATURES][3], share[MOST_FEATURES][OF_MAP][3];
    note_noise(filter);
    const double lag = as_frame(filter, tumble, R, frame, &sweep), time = filter->time - lag;
    *ago = lag;
    filter->node.count = 0.0;
    PredictedAttitude predicted = {.variance = INFINITY};
    copy(R, predicted.R);
    if (!registered(filter, frame, &predicted, &pose)) return TELLS_NOTHING;
    add_second_order(filter, frame, &pose, &sweep);
    measurement_of(filter, frame, &pose, lag, &sweep, share, &measurement);
    if (is_loose(&measurement)) return TELLS_NOTHING;
    add_what_stays(filter, frame, &pose, &measurement);
    copy(filter->R, before);
    for (int f = 0; f < (int)filter->used; f++)
        for (int k = 0; k < 3; k++) map[f][k] = filter->b[f][k];
    settle(filter, &transition);
    if (transition.span > 0.0) measurement.since = &transition;
    if (!update_frame(filter, frame, &pose, lag, &sweep, share, &measurement)) return BROKEN;
    map_turned(filter, map, turn);
    rotation(turn, T);
    turn_tumble(&filter->tumble, &filter->options, T);
    turn_axes(T, before);
    angle_between(filter->R, before, turn);
    double of_attitude = measurement.turn[0][0] + measurement.turn[1][1] + measurement.turn[2][2], span = time - filter->turned;
    const int far = is_over_gap(filter, turn, span);
    for (int k = 0; k < 3; k++) filter->rate[k] = turn[k] / span;
    filter->of_rate = far ? INFINITY : (filter->of_attitude + of_attitude) / (span * span);
    filter->of_attitude = of_attitude;
    follow(&filter->tumble, &filter->options, filter->turned, time, before, turn, far, filter->R, measurement.turn);
    filter->turned = time;
    extend_map(filter, frame, lag, pose.covariance);
    return SOUND;
}
