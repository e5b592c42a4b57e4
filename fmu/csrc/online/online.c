/* The interface: what is refused, the first frame, a frame, and the state. */

#define UNLIKE 1.2 /* mean square of the residuals over that of the told noise */

unsigned long long online_size(void) { return sizeof(Online); }

void online_start(Online *filter, const OnlineOptions *options) {
    /* All bytes, padding too, so that equal filters are equal byte for byte. */
    for (size_t k = 0; k < sizeof(Online); k++) ((unsigned char *)filter)[k] = 0;
    filter->options = *options;
}

static int finite(const double *values, int count) {
    for (int k = 0; k < count; k++)
        if (!isfinite(values[k])) return 0;
    return 1;
}

/* The frame of what is given, or why it is refused. */
static int read_frame(const Online *filter, int count, const long long *names, const double *points,
                      const double *covariances, Frame *frame) {
    if (count < 0 || count > MOST_FEATURES) return TOO_MANY;
    frame->count = count;
    for (int i = 0; i < count; i++) {
        if (!finite(points + 3 * i, 3)) return BAD_POINT;
        for (int j = 0; j < i; j++)
            if (names[j] == names[i]) return BAD_NAME;
        double inverse[3][3];
        for (int a = 0; a < 3; a++) {
            frame->y[i][a] = points[3 * i + a];
            for (int b = 0; b < 3; b++) {
                static const int UPPER[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
                double own = a == b ? filter->options.sigma * filter->options.sigma : 0.0;
                frame->noise[i][a][b] = covariances ? covariances[6 * i + UPPER[a][b]] : own;
            }
        }
        if (!inverted(frame->noise[i], inverse)) return BAD_COVARIANCE;
        frame->name[i] = names[i];
        frame->slot[i] = slot_of(filter, names[i]);
        weigh(filter, frame, i, inverse, 1.0);
    }
    return ACCEPTED;
}

/* Whether the points are not all in a line. */
static int spread_out(const Frame *frame) {
    double axes[3][3];
    for (int i = 2; i < frame->count; i++)
        for (int j = 1; j < i; j++)
            if (triad(frame->y[0], frame->y[j], frame->y[i], axes)) return 1;
    return 0;
}

/* The mean square distance of points from their centroid. */
static double mean_square(const double (*points)[3], int count) {
    double mean[3] = {0}, sum = 0.0;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) mean[k] += points[i][k] / count;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) sum += (points[i][k] - mean[k]) * (points[i][k] - mean[k]) / count;
    return sum;
}

/* The first frame defines the body's axes, and puts the centre of mass at the features' centroid. */
static void begin(Online *filter, const Frame *frame, double time) {
    OnlineOptions options = filter->options;
    online_start(filter, &options);
    filter->time = filter->turned = filter->registered = time;
    if (frame->count < 3 || !spread_out(frame)) return;
    double variance = options.offset * options.offset * mean_square(frame->y, frame->count);
    for (int k = 0; k < 3; k++) {
        filter->R[k][k] = filter->attitude[k][k] = 1.0;
        for (int i = 0; i < frame->count; i++) filter->x[k] += frame->y[i][k] / frame->count;
        filter->P[PLACE + k][PLACE + k] = variance;
        filter->P[SPEED + k][SPEED + k] = options.speed * options.speed;
    }
    for (int i = 0; i < frame->count; i++) add(filter, frame, i, 0.0);
    filter->density = LEAST_DENSITY;
    filter->frames = 1.0;
    start_interval(filter);
    start_bank(filter);
}

int online_update(Online *filter, double time, int count, const long long *names, const double *points,
                  const double *covariances, const double *acceleration) {
    Frame frame;
    Pose pose;
    double foreseen[3][3], R[3][3], turn[3];
    if (!isfinite(time) || (filter->frames > 0.0 && !(time > filter->time))) return BAD_TIME;
    if (!finite(acceleration, 3)) return BAD_ACCELERATION;
    int refused = read_frame(filter, count, names, points, covariances, &frame);
    if (refused) return refused;
    if (filter->frames == 0.0) {
        begin(filter, &frame, time);
        return ACCEPTED;
    }
    for (int k = 0; k < 3; k++) turn[k] = filter->rate[k] * (time - filter->registered);
    copy(filter->attitude, foreseen);
    turn_left(turn, foreseen);
    advance(filter, time, acceleration);
    if (!registered(filter, &frame, foreseen, &pose)) {
        if (frame.count >= 3 && ++filter->lost >= HOPELESS) begin(filter, &frame, time);
        return ACCEPTED;
    }
    filter->squares += pose.squares;
    filter->freedom += 3.0 * pose.count - 6.0;
    filter->frames += 1.0;
    filter->lost = 0.0;
    copy(pose.R, filter->attitude);
    filter->registered = time;
    if (filter->node.count > 0.0 && angle_between(pose.R, filter->node.R, turn) > WIDEST) {
        far_enough(filter, R);
        close_node(filter, R);
    }
    gather(filter, &frame, &pose);
    note_sightings(filter, &frame);
    if (far_enough(filter, R)) close_node(filter, R);
    return ACCEPTED;
}

/* By what the residuals say that the noise is larger than told, as a factor of covariances; 1 where they don't. */
static double noise_ratio(const Online *filter) {
    if (filter->freedom <= 0.0) return 1.0;
    double ratio = filter->squares / filter->freedom;
    return ratio > 1.0 + 4.0 * sqrt(2.0 / filter->freedom) ? ratio : 1.0;
}

static double status_of(const Online *filter, double P[6][6]) {
    if (filter->frames == 0.0) return WAITING;
    if (filter->lost > 0.0) return LOST;
    double square = mean_square(filter->b, (int)filter->used);
    if (!(P[0][0] + P[1][1] + P[2][2] < square)) return STARTING;
    return noise_ratio(filter) > UNLIKE ? DOUBTFUL : TRACKING;
}

/* P = F P F'. */
static void carry(const double F[6][6], double P[6][6]) {
    double A[6][6];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            A[i][j] = 0.0;
            for (int k = 0; k < 6; k++) A[i][j] += F[i][k] * P[k][j];
        }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            P[i][j] = 0.0;
            for (int k = 0; k < 6; k++) P[i][j] += A[i][k] * F[j][k];
        }
}

int online_predict(const Online *filter, double time, const double *acceleration, OnlineState *state) {
    if (!isfinite(time) || time < filter->time) return BAD_TIME;
    if (!finite(acceleration, 3)) return BAD_ACCELERATION;
    double x[6], P[6][6], more[LEVEL], wider[LEVEL][LEVEL];
    mixture(filter, more, wider);
    for (int i = 0; i < 6; i++) {
        x[i] = filter->x[i] + dot(filter->F[i], more) + dot(&filter->F[i][3], &more[3]);
        for (int j = 0; j < 6; j++) P[i][j] = noise_ratio(filter) * (filter->P[PLACE + i][PLACE + j] + wider[i][j]);
    }
    carry(filter->F, P);
    add_noise(filter->density, filter->elapsed, &P[0][0], 6);
    int count = time > filter->time ? steps_between(&filter->options, filter->time, time) : 0;
    for (int s = 0; s < count; s++) {
        double F[6][6], T = (time - filter->time) / count, from = filter->time + s * T;
        transition(&filter->options, from, from + T, acceleration, x, F);
        carry(F, P);
        add_noise(filter->density, T, &P[0][0], 6);
    }
    state->time = time;
    state->features = filter->used;
    state->density = filter->density;
    state->noise_ratio = filter->freedom > 0.0 ? filter->squares / filter->freedom : 1.0;
    state->status = status_of(filter, P);
    for (int i = 0; i < 3; i++) {
        state->r[i] = x[i], state->v[i] = x[3 + i];
        for (int j = 0; j < 3; j++) state->R[i][j] = time == filter->registered ? filter->attitude[i][j] : NAN;
    }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) state->covariance[i][j] = 0.5 * (P[i][j] + P[j][i]);
    return ACCEPTED;
}

int online_features(const Online *filter, long long *names, double *positions, double *covariances) {
    double factor = noise_ratio(filter), more[LEVEL], wider[LEVEL][LEVEL];
    mixture(filter, more, wider);
    for (int f = 0; f < (int)filter->used; f++) {
        names[f] = filter->feature[f].name;
        for (int i = 0; i < 3; i++) {
            positions[3 * f + i] = filter->b[f][i] + more[6 + i];
            for (int j = 0; j < 3; j++)
                covariances[9 * f + 3 * i + j] =
                    factor * (filter->P[BODY + 3 * f + i][BODY + 3 * f + j] + wider[6 + i][6 + j]);
        }
    }
    return (int)filter->used;
}
