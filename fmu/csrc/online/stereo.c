/* Covariances of a stereo rig. It evaluates them at the measured point: what is measured too near has too small a one, and a
   lateral error turns its long axis. Both draw the path towards the rig, and the mean range is too long. Once a point fits
   the map, its covariance is that at the place where the map has it, and its range is shortened. */

#define RANGE 4.0   /* power of the range that the variance along the line of sight of a rig goes with */
#define ENOUGH 20.0 /* pairs of sightings, from which on they tell what covariances these are */

static double length(const double v[3]) { return sqrt(dot(v, v)); }

/* Where the map has a point of the frame, in C. */
static void place_of(const Online *filter, const Frame *frame, int i, const Pose *pose, double there[3]) {
    times(pose->R, filter->b[frame->slot[i]], there);
    for (int k = 0; k < 3; k++) there[k] += pose->c[k];
}

/* How the variance along the line of sight changes with the error of the range, from each sighting to the feature's next:
   as its RANGE-th power where it is evaluated at the measured point, not at all where at the true one, or where it is
   fixed. What of it goes with the true range is fitted, too. */
static void note_kind(Online *filter, const Frame *frame, const Pose *pose) {
    for (int i = 0; i < frame->count; i++) {
        double there[3], u[3], T[3];
        if (!frame->fits[i]) continue;
        Feature *feature = &filter->feature[frame->slot[i]];
        place_of(filter, frame, i, pose, there);
        double r = length(frame->y[i]), far = length(there);
        if (!(r > 0.0) || !(far > 0.0)) continue;
        for (int k = 0; k < 3; k++) u[k] = there[k] / far;
        times(frame->noise[i], u, T);
        double now[3] = {log(r / far), log(far), log(dot(u, T))}, d[3];
        for (int k = 0; k < 3; k++) d[k] = now[k] - feature->last_stereo[k], feature->last_stereo[k] = now[k];
        if (feature->stereo_sightings++ == 0.0) continue;
        filter->kind[0] += d[0] * d[0], filter->kind[1] += d[0] * d[1], filter->kind[2] += d[1] * d[1];
        filter->kind[3] += d[0] * d[2], filter->kind[4] += d[1] * d[2];
        filter->pairs += 1.0;
    }
}

/* Whether covariances are those of a stereo rig at the measured points; as long as nothing tells, they are. */
static int is_stereo(const Online *filter) {
    const double *s = filter->kind, determinant = s[0] * s[2] - s[1] * s[1];
    if (filter->pairs < ENOUGH) return 1;
    if (!(determinant > 1e-9 * s[0] * s[2])) return s[3] > RANGE / 2.0 * s[0];
    return s[3] * s[2] - s[4] * s[1] > RANGE / 2.0 * determinant;
}

/* The covariance of a measured point y, as it is at another place, and y with its range shortened: with s the ratio of the
   ranges it goes by s^4 along the line of sight and by s^2 across it, and turns with it; the mean range is too long by the
   variance over the range. */
static void carried(const double there[3], double y[3], double noise[3][3]) {
    double r = length(y), far = length(there), a[3], u[3], v[3], T[3], A[3][3], found[3][3] = {{0}};
    if (!(r > 0.0) || !(far > 0.0)) return;
    for (int k = 0; k < 3; k++) a[k] = y[k] / r, u[k] = there[k] / far;
    double s = fmin(fmax(far / r, 0.5), 2.0), cosine = dot(a, u);
    if (!(cosine > 0.0)) return;
    times(noise, a, T);
    double along = dot(a, T);
    cross(a, u, v);
    moved_by_turn(v, A); /* -[v]x */
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double turn = (i == j ? cosine : 0.0) - A[i][j] + v[i] * v[j] / (1.0 + cosine);
            A[i][j] = s * (turn + (s - 1.0) * u[i] * a[j]);
        }
    add_congruent(A, noise, found);
    copy(found, noise);
    for (int k = 0; k < 3; k++) y[k] *= 1.0 - fmin(s * s * along / (r * r), 0.5);
}

/* A registered frame whose points have covariances: those that fit get them where the map has them, if a rig gave them. */
static void carry_covariances(Online *filter, Frame *frame, const Pose *pose) {
    note_kind(filter, frame, pose);
    if (!is_stereo(filter)) return;
    for (int i = 0; i < frame->count; i++) {
        double there[3];
        if (!frame->fits[i]) continue;
        place_of(filter, frame, i, pose, there);
        carried(there, frame->y[i], frame->noise[i]);
    }
}
