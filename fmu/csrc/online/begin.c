/* The first frame, or the first of another map: the path goes on where it is known.

A target that comes into view again with other features, or from another side before its tumble is known, shows nothing
that is in the map. The centre of mass is where it was predicted all the same. */

/* Whether the points are not all in a line. */
static int spread_out(const Frame *frame) {
    double axes[3][3];
    for (int i = 2; i < frame->count; i++)
        for (int j = 1; j < i; j++)
            if (triad(frame->y[0], frame->y[j], frame->y[i], axes)) return 1;
    return 0;
}

#define BETTER 4.0 /* times less is the variance of an attitude, of a frame that is a better first one */

/* The variance of the attitude that a frame shows by itself, rad2 over all axes; INFINITY where it shows none. */
static double own_attitude(const Frame *frame) {
    double mean[3] = {0}, J[3][3] = {{0}}, inverse[3][3], weight[MOST_FEATURES], total = 0.0;
    for (int i = 0; i < frame->count; i++) {
        weight[i] = 3.0 / (frame->noise[i][0][0] + frame->noise[i][1][1] + frame->noise[i][2][2]);
        total += weight[i];
        for (int k = 0; k < 3; k++) mean[k] += (frame->y[i][k] - mean[k]) * weight[i] / total;
    }
    for (int i = 0; i < frame->count; i++) {
        double arm[3], K[3][3];
        for (int k = 0; k < 3; k++) arm[k] = frame->y[i][k] - mean[k];
        moved_by_turn(arm, K);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) J[a][b] += weight[i] * dot(K[a], K[b]);
    }
    return inverted(J, inverse) ? inverse[0][0] + inverse[1][1] + inverse[2][2] : INFINITY;
}

/* Whether nothing is lost if the filter begins with this frame: it shows the attitude much better than the first did, and of
   the offset hardly anything is known yet. What comes into the map by a bad attitude has errors that are not small. */
static int is_better_first(const Online *filter, const Frame *frame) {
    return offset_variance(&filter->bank[likeliest(filter->bank)]) > 0.5 * filter->widest && own_attitude(frame) * BETTER < filter->first_attitude;
}

#define BELIEVED 4.6 /* logarithm of the odds that a path is as well known as it claims, when it goes on */
#define TIMES 10.0   /* what it claims, it is wrong by else */

/* What holds whatever the map is: of the path, and of the noise it is known from. */
typedef struct {
    double x[6], P[6][6], weight[STEADY], density, allowed;
    Trend trend;
    double squares, freedom, sightings;
    double manoeuvred, thrust[OF_THRUST], of_thrust[OF_THRUST][OF_THRUST];
    double rate[3], of_rate; /* angular, in C, and its variance over all axes; zeros where the target may have turned by a radian since */
} Path;

/* The angular rate as it is known now: that of the last two nodes, which may change by its square. */
static void known_rate(const Online *filter, Path *path) {
    const double since = filter->time - filter->turned, square = dot(filter->rate, filter->rate);
    const int known = square * since * since < 1.0;
    for (int k = 0; k < 3; k++) path->rate[k] = known ? filter->rate[k] : 0.0;
    path->of_rate = known ? filter->of_rate + square * square * since * since : 0.0;
}

/* The path as it is known now; 0 where that is not to be trusted. */
static int known_path(const Online *filter, Path *path) {
    Posterior posterior;
    double P[6][6], highest = -INFINITY;
    if (filter->frames == 0.0) return 0;
    find_posterior(filter, &posterior);
    double factor = factor_of(filter, &posterior);
    for (int i = 0; i < 6; i++) {
        path->x[i] = filter->x[i] + posterior.x[i];
        for (int j = 0; j < 6; j++) path->P[i][j] = posterior.own[i][j] + posterior.wider[i][j], P[i][j] = factor * path->P[i][j];
    }
    for (int m = 0; m < STEADY; m++) highest = fmax(highest, filter->bank[m].weight);
    for (int m = 0; m < STEADY; m++) path->weight[m] = filter->bank[m].weight - highest;
    path->density = filter->density, path->allowed = filter->allowed;
    path->squares = filter->squares, path->freedom = filter->freedom, path->sightings = filter->sightings;
    path->trend = (Trend){.sum = filter->trend.sum, .terms = filter->trend.terms}, path->manoeuvred = filter->manoeuvred;
    for (int a = 0; a < OF_THRUST; a++) {
        path->thrust[a] = filter->thrust[a];
        for (int b = 0; b < OF_THRUST; b++) path->of_thrust[a][b] = filter->of_thrust[a][b];
    }
    known_rate(filter, path);
    return worth_of(filter, &posterior, P) == TRACKING;
}

/* Nothing is known of the path: the centre of mass is somewhere about the centroid of a frame. */
static void guess_path(Online *filter, const Frame *frame) {
    const OnlineOptions *options = &filter->options;
    double variance = options->offset * options->offset * mean_square(frame->y, frame->count);
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < frame->count; i++) filter->x[k] += frame->y[i][k] / frame->count;
        filter->P[POSITION + k][POSITION + k] = variance;
        filter->P[VELOCITY + k][VELOCITY + k] = options->speed * options->speed;
    }
    for (int m = 0; m < STEADY; m++) filter->bank[m].weight = first_weight(filter, m);
    filter->density = filter->allowed = LEAST_DENSITY;
}

/* The path goes on. What of the offset is known comes from it: the first nodes need not be taken again. */
static void resume_path(Online *filter, const Path *path) {
    for (int i = 0; i < 6; i++) {
        filter->x[i] = path->x[i];
        for (int j = 0; j < 6; j++) filter->P[POSITION + i][POSITION + j] = path->P[i][j];
    }
    for (int m = 0; m < STEADY; m++) filter->bank[m].weight = path->weight[m];
    filter->density = path->density, filter->allowed = path->allowed;
    filter->squares = path->squares, filter->freedom = path->freedom, filter->sightings = path->sightings;
    filter->trend = path->trend, filter->manoeuvred = path->manoeuvred;
    for (int a = 0; a < OF_THRUST; a++) {
        filter->thrust[a] = path->thrust[a];
        for (int b = 0; b < OF_THRUST; b++) filter->of_thrust[a][b] = path->of_thrust[a][b];
    }
    for (int k = 0; k < 3; k++) filter->rate[k] = path->rate[k];
    filter->of_rate = path->of_rate;
    filter->stored_count = -1.0;
}

/* One more member, which takes the path for far less well known: the new map will tell. */
static void doubt_path(Online *filter) {
    double more = TIMES * TIMES - 1.0;
    int best = likeliest(filter->bank);
    PackedMember *member = &filter->bank[STEADY];
    Jump *jump = &filter->jump[0];
    const double(*P)[MOST_ERRORS] = (const double(*)[MOST_ERRORS])filter->P;
    *member = filter->bank[best];
    for (int m = 0; m < STEADY; m++) jump->before[m] = filter->bank[m].weight;
    jump->parent = best, jump->pending = 1.0, member->weight -= BELIEVED;
    for (int a = 0; a < SCALE; a++)
        for (int b = 0; b <= a; b++) {
            double sign = (a < OFFSET) == (b < OFFSET) ? 1.0 : -1.0; /* the offset's error is opposite */
            member->P[packed_index(a, b)] += more * sign * P[POSITION + a % OFFSET][POSITION + b % OFFSET];
        }
}

/* The filter starts with a frame, which defines the body's axes; path: what is known of it, or NULL. Of the sensor, what is
   known stays. */
static void begin(Online *filter, Frame *frame, const Path *path) {
    const OnlineOptions options = filter->options;
    const Lasting lasting = filter->lasting;
    double time = filter->time, frames_per_error = fmax(filter->frames_per_error, 1.0), noise_scale = scale_of_noise(filter);
    double pairs = filter->pairs, maps = filter->maps, kind[5];
    for (int k = 0; k < 5; k++) kind[k] = filter->kind[k];
    online_start(filter, &options);
    filter->lasting = lasting, filter->frames_per_error = frames_per_error, filter->noise_scale = noise_scale;
    filter->pairs = pairs, filter->maps = maps;
    for (int k = 0; k < 5; k++) filter->kind[k] = kind[k];
    filter->time = filter->turned = filter->registered = filter->referred = time;
    if (frame->count < 3 || !spread_out(frame)) return;
    filter->maps += 1.0;
    if (path) resume_path(filter, path);
    else guess_path(filter, frame);
    filter->widest = (filter->P[POSITION][POSITION] + filter->P[POSITION + 1][POSITION + 1] + filter->P[POSITION + 2][POSITION + 2]) / 3.0;
    filter->first_attitude = own_attitude(frame);
    for (int k = 0; k < 3; k++) filter->R[k][k] = 1.0;
    double exact[6][6] = {{0}};
    for (int i = 0; i < frame->count; i++) {
        frame->passage[i] = (Passage){.M = {{1.0, 0, 0}, {0, 1.0, 0}, {0, 0, 1.0}}};
        for (int k = 0; k < 3; k++) frame->passage[i].y[k] = frame->y[i][k] - filter->x[k];
        add(filter, frame, i, 0.0, exact);
    }
    for (int i = 0; i < frame->count; i++) frame->slot[i] = slot_of(filter, frame->name[i]), frame->fits[i] = 1;
    scale_of_map(filter, frame, filter->share);
    for (int f = 0; f < (int)filter->used; f++)
        for (int k = 0; k < 3; k++) filter->share[f][k][k] = 1.0 / filter->used;
    filter->frames = 1.0;
    start_interval(filter);
    start_bank(filter);
    if (path) doubt_path(filter);
    start_transition(&filter->since_node);
    filter->first = filter->bank[0];
    filter->again = FIRST_AGAIN * filter->widest;
}
