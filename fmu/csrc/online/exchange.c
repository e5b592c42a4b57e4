/* Points that have each other's names: trackers exchange two features, for a frame or for a while. */

enum { FEW = 8 }; /* known points, of which two may leave too few that are right */

/* That of the rotation vector of a pose, rad2, summed over the axes. */
static double attitude_variance(const Online *filter, const Pose *pose) {
    double T[3][3];
    of_pose(pose, 3, T);
    return T[0][0] + T[1][1] + T[2][2] + 3.0 * square_of_camera(filter);
}

/* Give two points each other's names. */
static void exchange(Frame *frame, int i, int j) {
    int slot = frame->slot[i];
    long long name = frame->name[i];
    double spread[3][3];
    copy(frame->spread[i], spread);
    frame->slot[i] = frame->slot[j], frame->name[i] = frame->name[j], copy(frame->spread[j], frame->spread[i]);
    frame->slot[j] = slot, frame->name[j] = name, copy(spread, frame->spread[j]);
}

/* How far the attitude of a pose is from the predicted one, as a chi-square: about each axis by what that shows of it. */
static double attitude_square(const Online *filter, const PredictedAttitude *predicted, const Pose *pose) {
    double T[3][3], W[3][3], turn[3], weighted[3];
    if (!isfinite(predicted->variance)) return 0.0;
    of_pose(pose, 3, T);
    for (int k = 0; k < 3; k++) T[k][k] += square_of_camera(filter) + predicted->variance;
    if (!inverted(T, W)) return INFINITY;
    angle_between(pose->R, predicted->R, turn);
    times(W, turn, weighted);
    return dot(turn, weighted);
}

/* Whether the attitude of a pose is far from the predicted one. */
static int is_far(const Online *filter, const PredictedAttitude *predicted, const Pose *pose) {
    return attitude_square(filter, predicted, pose) > gate_of(filter);
}

/* Whether an attitude is predicted well enough to tell a large turn from none. */
static int is_foreseen(const PredictedAttitude *predicted) { return GATE * predicted->variance < LARGE * LARGE; }

/* The pose of a frame of which all points fit if two have exchanged their names, nearest to the predicted attitude; 0 if there
   is none that is not far from it. */
static int exchanged(const Online *filter, Frame *frame, const PredictedAttitude *predicted, Pose *pose) {
    int found = 0, first = 0, second = 0;
    double least = INFINITY;
    if (known_in(frame) == 3 && !is_foreseen(predicted)) return 0; /* most triangles fit some such attitude */
    for (int i = 0; i < frame->count; i++)
        for (int j = i + 1; j < frame->count; j++) {
            if (frame->slot[i] < 0 || frame->slot[j] < 0) continue;
            exchange(frame, i, j);
            weigh_all(frame, predicted->R);
            int fits = fits_as_a_whole(filter, frame, predicted, pose);
            set_apart(predicted, pose);
            if (fits && pose->apart < least && !is_far(filter, predicted, pose)) found = 1, least = pose->apart, first = i, second = j;
            exchange(frame, i, j);
        }
    if (!found) return 0;
    exchange(frame, first, second);
    weigh_all(frame, predicted->R);
    const int fits = fits_as_a_whole(filter, frame, predicted, pose);
    set_apart(predicted, pose);
    return fits;
}

/* How badly a pose fits its points and the predicted attitude, as a chi-square. */
static double badness(const Online *filter, const PredictedAttitude *predicted, const Pose *pose) {
    return pose->squares + attitude_square(filter, predicted, pose);
}

/* Whether three points, which fit a pose, fit another one about as well if two have exchanged their names: of a triangle with
   two sides alike, half a turn; and neither a prediction nor, where there is none, a small turn tells which. An attitude that noise
   alone may turn so tells little anyway. Where one is well predicted, other names have to fit better: a pose that hardly shows its
   own attitude is not far from any. Weights and marks are as of the pose afterwards. */
static int is_ambiguous(const Online *filter, Frame *frame, const PredictedAttitude *predicted, const Pose *pose) {
    const PredictedAttitude shown = {.variance = attitude_variance(filter, pose)};
    const int foreseen = is_foreseen(predicted);
    int known[MOST_FEATURES], n = 0, found = 0;
    for (int i = 0; i < frame->count; i++)
        if (frame->slot[i] >= 0) known[n++] = i;
    if (n != 3 || (foreseen ? pose->apart < ALIKE || is_far(filter, predicted, pose) : !is_foreseen(&shown))) return 0;
    if (!isfinite(predicted->variance) && pose->apart < LARGE) return 0;
    const double most = badness(filter, predicted, pose) + (foreseen ? 0.0 : GATE);
    for (int k = 0; k < 3; k++) {
        Pose other;
        const int one = known[k], two = known[(k + 1) % 3];
        exchange(frame, one, two);
        if (from_triple(filter, frame, known, &other)) {
            set_apart(predicted, &other);
            found = found || badness(filter, predicted, &other) < most;
        }
        exchange(frame, one, two);
    }
    weigh_all(frame, pose->R);
    find_squares(filter, frame, pose);
    sorted_out(frame, INFINITY);
    return found;
}

/* Points that do not fit the pose, but each other's places, have exchanged their names. */
static void exchange_misfits(const Online *filter, Frame *frame, const PredictedAttitude *predicted, Pose *pose) {
    int any = 0;
    for (int i = 0; i < frame->count; i++)
        for (int j = i + 1; j < frame->count; j++) {
            double arm[3], e[3], We[3];
            if (frame->slot[i] < 0 || frame->slot[j] < 0 || frame->fits[i] || frame->fits[j]) continue;
            exchange(frame, i, j);
            weighed(frame, i, pose->R), weighed(frame, j, pose->R);
            if (residual(filter, frame, pose, i, arm, e, We) < gate_of(filter) && residual(filter, frame, pose, j, arm, e, We) < gate_of(filter))
                frame->fits[i] = frame->fits[j] = any = 1;
            else exchange(frame, i, j), weighed(frame, i, pose->R), weighed(frame, j, pose->R);
        }
    if (any) adjusted(filter, frame, pose), set_apart(predicted, pose);
}

/* Give two features each other's names. */
static void rename_both(Online *filter, int f, int g) {
    long long name = filter->feature[f].name, other = filter->feature[g].name;
    filter->feature[f].name = other, filter->feature[g].name = name;
    for (int s = 0; s < (int)filter->node.used; s++) {
        FeatureSums *sum = &filter->node.seen[s];
        sum->name = sum->name == name ? other : sum->name == other ? name : sum->name;
    }
}

/* Two features that come under each other's names again and again have these from now on; names: of the points as they came. */
static void note_names(Online *filter, Frame *frame, const long long names[]) {
    for (int i = 0; i < frame->count; i++) {
        int f = frame->slot[i];
        if (f >= 0 && frame->fits[i])
            filter->feature[f].exchanged = frame->name[i] == names[i] ? 0.0 : filter->feature[f].exchanged + 1.0;
    }
    for (int i = 0; i < frame->count; i++)
        for (int j = i + 1; j < frame->count; j++) {
            if (frame->name[i] != names[j] || frame->name[j] != names[i]) continue;
            Feature *one = &filter->feature[frame->slot[i]], *other = &filter->feature[frame->slot[j]];
            if (one->exchanged < PATIENT || other->exchanged < PATIENT) continue;
            rename_both(filter, frame->slot[i], frame->slot[j]);
            frame->name[i] = names[i], frame->name[j] = names[j];
            one->exchanged = other->exchanged = 0.0;
        }
}
