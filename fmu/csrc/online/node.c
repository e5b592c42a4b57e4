/* Frames taken as one: sums over frames whose attitudes the noise does not let tell apart. */

/* The offset of the centre of mass shows in how the path of a point bends, by the square of the angle that the target
   turns. That has to be far beyond the noise of the attitude, and so has the angle itself. */
#define FAR 16.0
#define USUAL 0.25  /* rad, enough for the first */
#define WIDEST 0.5  /* rad, enough for both */

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
        double drift = pose->c[k] - filter->x[k], column[6] = {0};
        node->turn[k] += turn[k], node->turn_times[k] += t * turn[k];
        node->drift[k] += drift, node->drift_times[k] += t * drift;
        column[3 + k] = 1.0;
        solved(6, pose->factor, column);
        node->variance += column[3 + k] / 3.0;
    }
    for (int i = 0; i < frame->count; i++) {
        int s = 0;
        if (frame->slot[i] >= 0 && !frame->fits[i]) continue;
        while (s < (int)node->used && node->seen[s].name != frame->name[i]) s++;
        if (s == MOST_FEATURES) continue;
        if (s == (int)node->used) {
            node->seen[s] = (Sum){0};
            node->seen[s].name = frame->name[i];
            node->used += 1.0;
        }
        Sum *sum = &node->seen[s];
        sum->count += 1.0, sum->times += t, sum->squares += t * t;
        for (int a = 0; a < 3; a++) {
            sum->y[a] += frame->y[i][a] - filter->x[a];
            for (int b = 0; b < 3; b++) sum->noise[a][b] += frame->noise[i][a][b];
        }
    }
}

/* What two attitudes of a node are apart at most: beyond it there was a gap. */
static double widest_within(const Node *node) { return WIDEST + 8.0 * sqrt(node->variance / node->count); }

/* Whether the node is far enough from the one before. */
static int far_enough(const Online *filter, double R[3][3]) {
    const Node *node = &filter->node;
    double turn[3];
    for (int k = 0; k < 3; k++) turn[k] = node->turn[k] / node->count;
    copy(node->R, R);
    turn_left(turn, R);
    double noise = sqrt(node->variance) / node->count;
    double least = fmax(fmin(USUAL, sqrt(FAR * noise)), FAR * noise);
    return angle_between(R, filter->R, turn) > fmin(least, WIDEST);
}

/* The node as one frame, each point moved to the mean time on its circle, and how long ago that is. */
static double as_frame(const Online *filter, const double R[3][3], Frame *frame) {
    const Node *node = &filter->node;
    double mean = node->times / node->count, spread = node->squares - mean * node->times, rate[3], drift[3];
    double swing[3];
    swing_of(&filter->tumble, node->begin + mean - filter->turned, swing);
    for (int k = 0; k < 3; k++) {
        rate[k] = spread > 0.0 ? (node->turn_times[k] - mean * node->turn[k]) / spread : 0.0;
        drift[k] = spread > 0.0 ? (node->drift_times[k] - mean * node->drift[k]) / spread : 0.0;
    }
    frame->count = (int)node->used;
    for (int i = 0; i < frame->count; i++) {
        const Sum *sum = &node->seen[i];
        double arm[3] = {0}, moved[3], bent[3], swung[3], at = sum->times / sum->count, later = mean - at;
        double square = sum->squares / sum->count - 2.0 * mean * at + mean * mean;
        frame->name[i] = sum->name;
        frame->slot[i] = slot_of(filter, sum->name);
        if (frame->slot[i] >= 0) times(R, filter->b[frame->slot[i]], arm);
        else for (int k = 0; k < 3; k++) arm[k] = sum->y[k] / sum->count;
        cross(rate, arm, moved);
        cross(rate, moved, bent);
        cross(swing, arm, swung);
        for (int a = 0; a < 3; a++) {
            frame->y[i][a] = filter->x[a] + sum->y[a] / sum->count + later * (drift[a] + moved[a]);
            frame->y[i][a] -= 0.5 * square * (bent[a] + swung[a]);
            for (int b = 0; b < 3; b++) frame->noise[i][a][b] = sum->noise[a][b] / (sum->count * sum->count);
        }
        weigh(filter, frame, i, R, sum->count);
    }
    return filter->time - node->begin - mean;
}

/* Give the node to the filter and begin another. */
static void close_node(Online *filter, const double R[3][3]) {
    Frame frame;
    Pose pose;
    double turn[3], before[3][3], noise[3][3], lag = as_frame(filter, R, &frame), time = filter->time - lag;
    filter->node.count = 0.0;
    if (!registered(filter, &frame, R, &pose)) return;
    copy(filter->R, before);
    settle(filter);
    update_frame(filter, &frame, &pose, lag);
    angle_between(filter->R, before, turn);
    for (int k = 0; k < 3; k++) filter->rate[k] = turn[k] / (time - filter->turned);
    of_pose(&pose, 3, noise);
    follow(&filter->tumble, before, turn, time - filter->turned, filter->R, noise);
    filter->turned = time;
    double V[6][6];
    for (int j = 0; j < 6; j++) {
        double column[6] = {0};
        column[j] = 1.0;
        solved(6, pose.factor, column);
        for (int k = 0; k < 6; k++) V[k][j] = column[k];
    }
    extend_map(filter, &frame, lag, V);
}
