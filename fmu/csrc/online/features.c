/* The map: features that are found by name or by place, come, are forgotten, and are measured afresh. */

#define PLACED 16.3 /* chi-square of 3 degrees of freedom with p = 1e-3: within it a point is where a feature is */
#define CLEARLY_ELSEWHERE 4.0 /* times that is where no other one is */
#define SURE_ODDS 300.0 /* of a place that tells a name: a frame is one of many trials */
enum { PATIENT = 3, STUBBORN = 5, HOPELESS = 10 };

static int slot_of(const Online *filter, long long name) {
    for (int f = 0; f < (int)filter->used; f++)
        if (filter->feature[f].name == name) return f;
    return -1;
}

/* The weight of a residual of a point that is a mean of `count`, at the attitude R: its noise, the map's, and `more`. */
static void weigh(const Online *filter, Frame *frame, int i, const double R[3][3], double count,
                  const double more[3][3]) {
    frame->sightings[i] = count;
    copy(more, frame->more[i]);
    if (frame->slot[i] < 0) return;
    copy(filter->feature[frame->slot[i]].spread, frame->spread[i]);
    if (!(frame->spread[i][0][0] > 0.0) || !weighed(frame, i, R)) frame->slot[i] = -1;
}

/* The covariance in C of where a point shows its feature to be, seen from a pose whose place and rotation vector in C have the covariance V. */
static void of_sighting(const Frame *frame, int i, const double arm[3], const double V[6][6], double own[3][3]) {
    double K[3][3];
    moved_by_turn(arm, K);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) { /* (1, K) V (1, K)' */
            own[a][b] = frame->noise[i][a][b] + V[a][b];
            for (int l = 0; l < 3; l++) own[a][b] += V[a][3 + l] * K[b][l];
            for (int k = 0; k < 3; k++) {
                own[a][b] += K[a][k] * V[3 + k][b];
                for (int l = 0; l < 3; l++) own[a][b] += K[a][k] * V[3 + k][3 + l] * K[b][l];
            }
        }
}

/* What a point says of its feature, seen from a pose whose place and rotation vector in C have the covariance V. */
static void inform(Feature *feature, const Frame *frame, int i, const double arm[3], const double R[3][3], const double V[6][6]) {
    double own[3][3], weight[3][3], T[3][3];
    of_sighting(frame, i, arm, V, own);
    if (!inverted(own, weight)) return;
    product(weight, R, T);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b <= a; b++) {
            feature->information[a][b] += R[0][a] * T[0][b] + R[1][a] * T[1][b] + R[2][a] * T[2][b];
            feature->information[b][a] = feature->information[a][b];
        }
    if (!inverted(feature->information, feature->spread)) copy(NOTHING, feature->spread);
    feature->sightings += frame->sightings[i];
}

/* A feature that leaves has a share in what the bank knows of offset and scale. The others that have one take it, alike: else an offset of all
   features would be that of a part of them, and pass for a change when the next node sees it whole. What they are wrong by otherwise than the one
   that leaves is new to the bank. */
static void hand_over_share(Online *filter, int slot) {
    const int used = (int)filter->used, n = 3 * used;
    double lost[OF_MAP][3], D[OF_MAP][3 * MOST_FEATURES] = {{0}}, heirs = 0.0;
    int is_heir[MOST_FEATURES];
    for (int f = 0; f < used; f++) heirs += is_heir[f] = f != slot && dot(filter->share[f][0], filter->share[f][0]) > 0.0;
    copy_shares(filter->share[slot], lost);
    if (!(dot(lost[0], lost[0]) > 0.0) || heirs == 0.0) return;
    for (int f = 0; f < used; f++)
        for (int a = 0; a < OF_MAP; a++)
            for (int k = 0; k < 3; k++) {
                D[a][3 * f + k] = f == slot ? -lost[a][k] : is_heir[f] ? lost[a][k] / heirs : 0.0;
                filter->share[f][a][k] += D[a][3 * f + k];
            }
    for (int a = 0; a < OF_MAP; a++)
        for (int b = 0; b <= a; b++) {
            double sum = 0.0;
            for (int i = 0; i < n; i++)
                for (int j = 0; j < n; j++) sum += D[a][i] * filter->P[FEATURES + i][FEATURES + j] * D[b][j];
            for (int m = 0; m <= SHADOW; m++) filter->bank[m].P[packed_index(OFFSET + a, OFFSET + b)] += sum;
        }
}

/* Take a feature out of the map; the last one takes its place. */
static void forget(Online *filter, int slot) {
    hand_over_share(filter, slot);
    int last = (int)filter->used - 1, n = size_of(filter);
    for (int k = 0; k < 3 && slot != last; k++) {
        int from = FEATURES + 3 * last + k, to = FEATURES + 3 * slot + k;
        filter->b[slot][k] = filter->b[last][k];
        for (int a = 0; a < OF_MAP; a++) filter->share[slot][a][k] = filter->share[last][a][k];
        for (int j = 0; j < n; j++) filter->P[to][j] = filter->P[from][j];
        for (int j = 0; j < n; j++) filter->P[j][to] = filter->P[j][from];
    }
    for (int s = 0; s < (int)filter->node.used; s++) /* what is not in its place is another feature */
        if (filter->node.seen[s].name == filter->feature[slot].name)
            filter->node.seen[s] = filter->node.seen[(int)--filter->node.used];
    filter->feature[slot] = filter->feature[last];
    filter->series[slot] = filter->series[last];
    filter->used = last;
}

static int is_in(const Frame *frame, long long name) {
    for (int i = 0; i < frame->count; i++)
        if (frame->name[i] == name) return 1;
    return 0;
}

/* A slot for a new feature: a free one, or that of the one not seen for longest; -1 if all are seen now. */
static int free_slot(Online *filter, const Frame *frame) {
    if ((int)filter->used == MOST_FEATURES) {
        int oldest = -1;
        for (int f = 0; f < MOST_FEATURES; f++)
            if (!is_in(frame, filter->feature[f].name) && (oldest < 0 || filter->feature[f].last < filter->feature[oldest].last))
                oldest = f;
        if (oldest < 0) return -1;
        forget(filter, oldest);
    }
    filter->used += 1.0;
    copy_shares(NO_SHARE, filter->share[(int)filter->used - 1]);
    return (int)filter->used - 1;
}

/* Put a point into the map: b = (M R)^-1 (y - shift - r + lag v - the sweep's part), with the errors of all of these; V is
   that of `inform`. */
static void add(Online *filter, const Frame *frame, int i, double lag, double V[6][6]) {
    int slot = free_slot(filter, frame);
    if (slot < 0) return;
    const Passage *passage = &frame->passage[i];
    int at = FEATURES + 3 * slot, n = size_of(filter);
    double arm[3], K[3][3], S[3][3], G[3][3], D[3][3], T[3][3], A[3][3], back[3][3], rows[3][MOST_ERRORS];
    double since = lag - passage->later;
    const double(*R)[3] = filter->R;
    product(passage->M, R, A);
    if (!inverse_of(A, back)) copy(R, A), transposed(R, back);
    times(back, passage->y, filter->b[slot]);
    times(R, filter->b[slot], arm);
    moved_by_turn(arm, K);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) G[a][b] = R[0][a] * K[0][b] + R[1][a] * K[1][b] + R[2][a] * K[2][b];
    moved_by_turn(passage->y, S);
    product(back, S, D);
    for (int a = 0; a < 3; a++)
        for (int j = 0; j < at; j++) {
            double sum = 0.0;
            for (int k = 0; k < 3; k++)
                sum -= back[a][k] * (filter->P[TRANSLATION + k][j] + filter->P[POSITION + k][j] - since * filter->P[VELOCITY + k][j]) +
                       G[a][k] * filter->P[ATTITUDE + k][j] + passage->swept * D[a][k] * filter->P[RATE + k][j];
            rows[a][j] = sum;
        }
    for (int j = 0; j < n; j++)
        for (int a = 0; a < 3; a++) filter->P[at + a][j] = filter->P[j][at + a] = j < at ? rows[a][j] : 0.0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) T[a][b] = dot(frame->noise[i][a], back[b]);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b <= a; b++) {
            double sum = back[a][0] * T[0][b] + back[a][1] * T[1][b] + back[a][2] * T[2][b];
            for (int k = 0; k < 3; k++)
                sum -= back[b][k] * (rows[a][TRANSLATION + k] + rows[a][POSITION + k] - since * rows[a][VELOCITY + k]) +
                       G[b][k] * rows[a][ATTITUDE + k] + passage->swept * D[b][k] * rows[a][RATE + k];
            filter->P[at + a][at + b] = filter->P[at + b][at + a] = a == b ? sum + ROUNDING * sum : sum;
        }
    filter->feature[slot] = (Feature){.name = frame->name[i], .last = filter->time};
    filter->series[slot] = (ResidualBlocks){.last = 0.0};
    inform(&filter->feature[slot], frame, i, arm, R, V);
}

/* Sums over what frames of a node show under one name are added to those under another. */
static void add_sums(FeatureSums *sum, const FeatureSums *more) {
    const double count = sum->count + more->count;
    for (int a = 0; a < 3; a++) {
        sum->place[a] += (more->place[a] - sum->place[a]) * more->count / count;
        sum->y[a] += more->y[a], sum->y_times[a] += more->y_times[a];
        for (int b = 0; b < 3; b++) sum->noise[a][b] += more->noise[a][b];
    }
    sum->count = count, sum->times += more->times, sum->squares += more->squares, sum->cubes += more->cubes;
}

/* The mean square of the features' distances from their centroid, m2. */
static double squared_radius(const Online *filter) {
    double mean[3] = {0}, squares = 0.0;
    for (int f = 0; f < (int)filter->used; f++)
        for (int k = 0; k < 3; k++) mean[k] += filter->b[f][k] / filter->used;
    for (int f = 0; f < (int)filter->used; f++)
        for (int k = 0; k < 3; k++) squares += (filter->b[f][k] - mean[k]) * (filter->b[f][k] - mean[k]) / filter->used;
    return squares;
}

/* How much likelier a point is that near to a feature, where that is, than in a ball with the features' mean square: the density of an error with the inverse
   covariance W and the chi-square `square`, sqrt(|W| / (2 pi)^3) exp(-square / 2), times 4/3 pi (5/3 squared_radius)^(3/2). */
static double odds_of_place(const Online *filter, const double W[3][3], double square) {
    const double radius = sqrt(squared_radius(filter));
    double last[3];
    cross(W[0], W[1], last);
    return 0.57226 * radius * radius * radius * sqrt(dot(last, W[2])) * exp(-0.5 * square);
}

/* Whether a point under an unknown name is where one that is out of sight was: a feature of the map, or another point of the open node that is in no
   map, with its name. Not if a second one is not clearly elsewhere, nor if its place is known so badly, as from an attitude about a line of features,
   that a new feature, which may be anywhere on the body, is likelier to be there than that one of those that are out of sight. */
static int has_returned(const Online *filter, const Frame *frame, int i, const Pose *pose, const FeatureSums *sum, long long *name) {
    const Node *node = &filter->node;
    const int used = (int)filter->used;
    double arm[3], own[3][3], nearest = INFINITY, second = INFINITY, odds = 0.0, away = 0.0;
    times(pose->R, sum->place, arm);
    of_sighting(frame, i, arm, pose->covariance, own);
    for (int c = 0; c < used + (int)node->used; c++) {
        const FeatureSums *other = c < used ? NULL : &node->seen[c - used];
        const long long one = other ? other->name : filter->feature[c].name;
        const double *place = other ? other->place : filter->b[c], shares = 1.0 / sum->count + (other ? 1.0 / other->count : 0.0);
        double S[3][3] = {{0}}, W[3][3], off[3], e[3], We[3];
        if (is_in(frame, one) || (other && slot_of(filter, one) >= 0)) continue;
        if (!other) {
            copy(filter->feature[c].spread, S);
            turned(pose->R, S);
        }
        for (int a = 0; a < 3; a++) {
            off[a] = sum->place[a] - place[a];
            for (int b = 0; b < 3; b++) S[a][b] += shares * own[a][b];
        }
        if (!inverted(S, W)) continue;
        times(pose->R, off, e);
        times(W, e, We);
        const double square = dot(e, We);
        away += 1.0;
        if (square < nearest) second = nearest, nearest = square, odds = odds_of_place(filter, W, square), *name = one;
        else if (square < second) second = square;
    }
    return nearest < PLACED && second > CLEARLY_ELSEWHERE * PLACED && odds > SURE_ODDS * away;
}

/* Where the open node has a name, or the number of its names. */
static int place_in_node(const Node *node, long long name) {
    int s = 0;
    while (s < (int)node->used && node->seen[s].name != name) s++;
    return s;
}

/* Features that come back under another name go on under that, in the open node, too, which may have seen them before: where a target turns slowly a node is so
   long that all features leave and come back in it, and a map of none of them would be lost. */
static void welcome_back(Online *filter, const Frame *frame, const Pose *pose) {
    Node *node = &filter->node;
    for (int i = 0; i < frame->count; i++) {
        const int s = place_in_node(node, frame->name[i]);
        long long name = 0;
        if (frame->slot[i] >= 0 || s == (int)node->used || !has_returned(filter, frame, i, pose, &node->seen[s], &name)) continue;
        const int f = slot_of(filter, name), before = place_in_node(node, name);
        if (f >= 0) filter->feature[f].name = frame->name[i], filter->feature[f].last = filter->time;
        if (before == (int)node->used) continue;
        add_sums(&node->seen[s], &node->seen[before]);
        node->seen[before] = node->seen[(int)--node->used];
    }
}

static int known_in(const Frame *frame) {
    int known = 0;
    for (int i = 0; i < frame->count; i++) known += frame->slot[i] >= 0;
    return known;
}

/* Where too few names are known: features that are predicted to be where unknown points are, at R from the centre of mass,
   with a deviation in m. A point is given a feature that is much nearer than any other; whether the frame fits, tells. */
static void guess_by_place(const Online *filter, Frame *frame, const double R[3][3], double deviation) {
    for (int i = 0; i < frame->count; i++) {
        const double(*noise)[3] = frame->noise[i];
        double nearest = INFINITY, second = INFINITY, variance = (noise[0][0] + noise[1][1] + noise[2][2]) / 3.0;
        int found = -1;
        if (frame->slot[i] >= 0) continue;
        for (int f = 0; f < (int)filter->used; f++) {
            double arm[3], square = 0.0;
            times(R, filter->b[f], arm);
            for (int k = 0; k < 3; k++) {
                double off = frame->y[i][k] - filter->x[k] - arm[k];
                square += off * off;
            }
            if (square < nearest) second = nearest, nearest = square, found = f;
            else if (square < second) second = square;
        }
        for (int j = 0; j < frame->count; j++)
            if (found >= 0 && frame->slot[j] == found) found = -1;
        if (found < 0 || nearest > PLACED * (variance + deviation * deviation) || second < 4.0 * nearest) continue;
        frame->slot[i] = found;
        weigh(filter, frame, i, R, 1.0, NOTHING);
    }
}

/* Guessed features take the names of points that fit; others are as before. */
static void settle_names(Online *filter, Frame *frame) {
    for (int i = 0; i < frame->count; i++) {
        int f = frame->slot[i];
        if (f < 0 || filter->feature[f].name == frame->name[i]) continue;
        if (frame->fits[i]) filter->feature[f].name = frame->name[i];
        else frame->slot[i] = -1;
    }
}

/* After a registered frame: what was seen, and what is not where it should be and is measured afresh. */
static void note_sightings(Online *filter, Frame *frame) {
    for (int i = 0; i < frame->count; i++) {
        int slot = slot_of(filter, frame->name[i]); /* places may have changed since the frame was read */
        if (frame->slot[i] < 0 || slot < 0) continue;
        filter->feature[slot].last = filter->time;
        filter->feature[slot].refused = frame->fits[i] ? 0.0 : filter->feature[slot].refused + 1.0;
    }
    for (int f = (int)filter->used - 1; f >= 0; f--) /* from the last, as `forget` moves that to f */
        if (filter->feature[f].refused >= STUBBORN) forget(filter, f);
}

/* After an update: features that it was made with, and new ones. */
static void extend_map(Online *filter, const Frame *frame, double lag, double V[6][6]) {
    for (int i = 0; i < frame->count; i++) {
        int known = slot_of(filter, frame->name[i]);
        if (known >= 0) {
            double arm[3];
            times(filter->R, filter->b[known], arm);
            if (frame->fits[i]) inform(&filter->feature[known], frame, i, arm, filter->R, V);
            continue;
        }
        add(filter, frame, i, lag, V);
    }
}
