/* What the filter takes: a start, the first frame, and a frame, or why it is refused. */

unsigned long long online_size(void) { return sizeof(Online); }

void online_start(Online *filter, const OnlineOptions *options) {
    /* All bytes, padding too, so that equal filters are equal byte for byte. */
    for (size_t k = 0; k < sizeof(Online); k++) ((unsigned char *)filter)[k] = 0;
    filter->options = *options;
    for (int k = 0; k < 3; k++) filter->attitude[k][k] = filter->reference[k][k] = 1.0; /* B has the axes of C as long as no frame shows others */
}

/* A variance over what is left of it where the two other coordinates are known: more is rounding of a singular covariance. */
static const double SINGULAR_BEYOND = 1e13;

/* A covariance (3, 3) of its upper triangle; 0 if it is not positive definite, or too large. */
static int covariance_of(const double upper[6], double P[3][3]) {
    static const int UPPER[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    double inverse[3][3];
    if (!are_within(FARTHEST * FARTHEST, upper, 6)) return 0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) P[a][b] = upper[UPPER[a][b]];
    if (!inverted(P, inverse)) return 0;
    for (int k = 0; k < 3; k++)
        if (!(P[k][k] * inverse[k][k] < SINGULAR_BEYOND)) return 0;
    return 1;
}

/* The frame of what is given, or why it is refused. */
static int read_frame(const Online *filter, const double R[3][3], int count, const long long *names, const double *points,
                      const double *covariances, Frame *frame) {
    if (count < 0 || count > MOST_FEATURES) return TOO_MANY;
    const double square = filter->options.sigma * filter->options.sigma, alike[6] = {square, 0.0, 0.0, square, 0.0, square};
    double shared[3][3];
    if (!covariances && !covariance_of(alike, shared)) return BAD_COVARIANCE;
    frame->count = count;
    for (int i = 0; i < count; i++) {
        if (!are_within(FARTHEST, points + 3 * i, 3)) return BAD_POINT;
        for (int j = 0; j < i; j++)
            if (names[j] == names[i]) return BAD_NAME;
        for (int k = 0; k < 3; k++) frame->y[i][k] = points[3 * i + k];
        if (!covariances) copy(shared, frame->noise[i]);
        else if (!covariance_of(covariances + 6 * i, frame->noise[i])) return BAD_COVARIANCE;
        scale_block(frame->noise[i][0], 9, scale_of_noise(filter));
        frame->name[i] = names[i];
        frame->slot[i] = slot_of(filter, names[i]);
        weigh(filter, frame, i, R, 1.0, NOTHING);
    }
    return ACCEPTED;
}

/* The angular rate in C from a time on, with its variance over all axes: of the last two nodes, or, before these and over a gap, of the open one's frames. */
static void last_rate(const Online *filter, double rate[3], double *variance, double *since) {
    const Node *node = &filter->node;
    double turn[3], span = filter->referred - node->begin;
    for (int k = 0; k < 3; k++) rate[k] = filter->rate[k];
    *variance = filter->of_rate, *since = filter->turned;
    if ((dot(rate, rate) > 0.0 && isfinite(filter->of_rate)) || node->count < 2.0 || !(span > 0.0)) return;
    angle_between(filter->reference, node->R, turn);
    for (int k = 0; k < 3; k++) rate[k] = turn[k] / span;
    *variance = 2.0 * filter->unsure / (span * span), *since = node->begin;
}

#define WEAK 4.0 /* times the variance of an attitude that was predicted has one that tells little */

/* The attitude at a time: of the tumble where it is known, else of a constant rate, which may change by its square. */
static void predict_attitude(const Online *filter, double time, OnlineTumble *found, PredictedAttitude *predicted) {
    double rate[3], of_rate, turned, turn[3], T = time - filter->referred;
    online_tumble(filter, time, found);
    if (found->known != 0.0) {
        copy(found->R, predicted->R);
        predicted->variance = found->turn[0][0] + found->turn[1][1] + found->turn[2][2];
        return;
    }
    last_rate(filter, rate, &of_rate, &turned);
    copy(filter->reference, predicted->R);
    for (int k = 0; k < 3; k++) turn[k] = rate[k] * T;
    turn_left(turn, predicted->R);
    double square = dot(rate, rate), change = square * T * (time - turned);
    predicted->variance = square > 0.0 && square * T * T < 1.0 ? filter->unsure + of_rate * T * T + change * change : INFINITY;
}

/* What the next attitude is predicted from: that of a registered frame, or where it was predicted if that is far better known. */
static void refer(Online *filter, const PredictedAttitude *predicted, const Pose *pose) {
    double variance = attitude_variance(filter, pose);
    int better = WEAK * predicted->variance < variance && !is_far(filter, predicted, pose);
    copy(better ? predicted->R : pose->R, filter->reference);
    filter->unsure = better ? predicted->variance : variance;
    filter->referred = filter->time;
}

/* Whether the attitude of a frame is far from the predicted one: points of it are not what they are taken for. But if that goes
   on, the target turns so. */
static int is_surprising(Online *filter, const PredictedAttitude *predicted, const Pose *pose) {
    filter->surprises = is_far(filter, predicted, pose) ? filter->surprises + 1.0 : 0.0;
    if (filter->surprises > 0.0 && filter->surprises < STUBBORN) return 1;
    filter->surprises = 0.0;
    return 0;
}

/* Whether a frame has a pose that is not surprising, if need be with the names of two points exchanged. */
static int is_expected(Online *filter, Frame *frame, const PredictedAttitude *predicted, Pose *pose) {
    double rate[3], of_rate, turned;
    Pose other = {.count = 0};
    int fits = registered(filter, frame, predicted, pose), far = fits && is_far(filter, predicted, pose);
    double angle = fits ? pose->apart : INFINITY;
    last_rate(filter, rate, &of_rate, &turned);
    const int any = !isfinite(predicted->variance) && dot(rate, rate) > 0.0; /* attitude may come: it turns too far for a prediction */
    if (fits && !far && (any || isfinite(predicted->variance) || angle < LARGE)) exchange_misfits(filter, frame, predicted, pose);
    else if (known_in(frame) >= 3 && known_in(frame) <= FEW && exchanged(filter, frame, predicted, &other) &&
             (far || other.apart < 0.5 * angle))
        *pose = other, fits = 1;
    else if (fits) {
        weigh_all(frame, predicted->R);
        fits = registered(filter, frame, predicted, pose);
    }
    if (fits && !any && is_ambiguous(filter, frame, predicted, pose)) return 0;
    return fits && !is_surprising(filter, predicted, pose);
}

/* The deviation of a coordinate of a feature, predicted: of the centre of mass, and of the attitude at its distance. */
static double place_deviation(const Online *filter, const OnlineTumble *tumble, double time) {
    static const OnlineThrust none;
    Ahead ahead;
    double P[6][6], square = 0.0;
    start_ahead(filter, &ahead);
    manoeuvre_ahead(filter, &ahead, time, &none);
    claim(filter, &ahead.posterior, P);
    for (int k = 0; k < 3; k++)
        square += (P[k][k] + tumble->turn[k][k] * mean_square(filter->b, (int)filter->used)) / 3.0;
    return sqrt(square);
}

#define GAP 2.0 /* times longer than since the node before, after which frames that wait are a node by themselves */

/* Whether a frame comes so late after the frames that wait that the way back to them would be long: noise of the path is on
   it, and it is not straight. */
static int is_left(const Online *filter, double time) {
    return filter->node.count > 0.0 && time - filter->registered > GAP * (filter->registered - filter->turned);
}

/* Whether the place is known less well than it would be from a frame alone, which shows the attitude better than the map's first. */
static int is_worse_than(const Online *filter, const Frame *frame) {
    Path path;
    const double offset = filter->options.offset;
    known_path(filter, &path);
    return path.P[0][0] + path.P[1][1] + path.P[2][2] > 3.0 * offset * offset * mean_square(frame->y, frame->count) &&
           own_attitude(frame) < filter->first_attitude;
}

/* A node that is to be a map by itself: how its points have turned since its mean time the map before has told, with its errors. */
static void own_errors_of(const Online *filter, const double R[3][3], Frame *frame) {
    for (int i = 0; i < frame->count; i++) {
        double D[3][3], own[3][3], T[3][3], S[3][3];
        if (frame->slot[i] < 0) continue;
        const int at = FEATURES + 3 * frame->slot[i];
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) D[a][b] = (a == b) - frame->passage[i].M[a][b], own[a][b] = filter->P[at + a][at + b];
        product(D, R, T);
        product(T, own, S);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) frame->noise[i][a][b] += dot(S[a], T[b]);
    }
}

/* Give the open node to the filter; 0 if it has to start again. A node that tells nothing by the map, as by one of bad depths, becomes the
   map itself if nothing is lost by that: it is a mean of many frames. */
static int finish_node(Online *filter, const OnlineTumble *tumble, const double R[3][3]) {
    Frame mean;
    double ago;
    const Closed closed = close_node(filter, tumble, R, &mean, &ago);
    if (closed != TELLS_NOTHING) return closed == SOUND;
    own_errors_of(filter, R, &mean);
    if (!is_better_first(filter, &mean) && !is_worse_than(filter, &mean)) return 1;
    begin(filter, &mean, NULL);
    filter->turned = filter->referred = filter->time - ago;
    return 1;
}

/* Take a frame, until which manoeuvres have moved the chaser since the last one. */
static int take_frame(Online *filter, double time, int count, const long long *names, const double *points,
                      const double *covariances, const Manoeuvre *manoeuvre) {
    Frame frame;
    Pose pose;
    Path path;
    OnlineTumble tumble;
    PredictedAttitude predicted;
    double R[3][3], turn[3];
    int sound = 1;
    if (!are_within(LATEST, &time, 1) || (filter->frames > 0.0 && !(time > filter->time))) return BAD_TIME;
    if (filter->frames > 0.0 && !(time - filter->time <= filter->options.longest_gap)) return TOO_LATE;
    if (is_too_far(&filter->options, time)) return TOO_FAR;
    predict_attitude(filter, time, &tumble, &predicted);
    int refused = read_frame(filter, predicted.R, count, names, points, covariances, &frame);
    if (refused) return refused;
    if (filter->frames == 0.0) {
        filter->time = time;
        go_with_orbit(&filter->options, time);
        begin(filter, &frame, NULL);
        return ACCEPTED;
    }
    if (is_left(filter, time)) {
        far_enough(filter, R);
        sound = finish_node(filter, &tumble, R);
        filter->posterior_valid = 0.0;
        predict_attitude(filter, time, &tumble, &predicted);
        read_frame(filter, predicted.R, count, names, points, covariances, &frame);
    }
    int fits = sound && is_expected(filter, &frame, &predicted, &pose);
    if (sound && !fits) keep_posterior(filter);
    advance(filter, time, manoeuvre);
    if (!sound) {
        begin(filter, &frame, NULL);
        return ACCEPTED;
    }
    if (is_better_first(filter, &frame)) {
        begin(filter, &frame, known_path(filter, &path) ? &path : NULL);
        return ACCEPTED;
    }
    if (tumble.known != 0.0 && known_in(&frame) < 3) {
        guess_by_place(filter, &frame, predicted.R, place_deviation(filter, &tumble, time));
        fits = is_expected(filter, &frame, &predicted, &pose);
    }
    if (!fits) {
        keep_residuals(filter, &frame, NULL, names);
        int strangers = known_in(&frame) < 3;
        if (frame.count < 3 || ++filter->lost < (strangers ? PATIENT : HOPELESS) || !spread_out(&frame)) return ACCEPTED;
        if (known_path(filter, &path)) begin(filter, &frame, &path);
        else if (filter->lost >= HOPELESS) begin(filter, &frame, NULL);
        return ACCEPTED;
    }
    filter->posterior_valid = 0.0;
    settle_names(filter, &frame);
    note_names(filter, &frame, names);
    keep_residuals(filter, &frame, &pose, names);
    filter->squares += filter->noise_scale * pose.squares;
    filter->freedom += 3.0 * pose.count - 6.0;
    filter->sightings += pose.count;
    filter->frames += 1.0;
    note_residuals(filter, &frame, &pose);
    if (covariances) carry_covariances(filter, &frame, &pose);
    filter->lost = 0.0;
    copy(pose.R, filter->attitude);
    refer(filter, &predicted, &pose);
    filter->registered = time;
    if (filter->node.count > 0.0 && angle_between(pose.R, filter->node.R, turn) > widest_within(&filter->node)) {
        far_enough(filter, R);
        sound = finish_node(filter, &tumble, R);
        if (sound && filter->frames == 1.0) return ACCEPTED; /* with another map */
    }
    gather(filter, &frame, &pose);
    welcome_back(filter, &frame, &pose);
    note_sightings(filter, &frame);
    if (sound && far_enough(filter, R)) sound = finish_node(filter, &tumble, R);
    if (!sound) begin(filter, &frame, NULL);
    return ACCEPTED;
}

int online_update(Online *filter, double time, int count, const long long *names, const double *points,
                  const double *covariances, const OnlineThrust *thrust) {
    if (!is_thrust(thrust)) return BAD_ACCELERATION;
    const Manoeuvre manoeuvre = manoeuvre_of(thrust);
    return take_frame(filter, time, count, names, points, covariances, &manoeuvre);
}
