/* What the path is, besides what is known of it: filters of (r, v, offset) that take it for one thing each, weighed by their
likelihood.

Some take it for straight, or the orbit that is told, with white acceleration of one density each. The large filter goes with
the mean of the logarithms of these, which changes as the evidence grows. One more member, its shadow, does the same: by what
their mixture differs from the shadow, the large filter's estimate is corrected (mixture.c). Others take the path for bent, by
an acceleration in a random walk, which they estimate, too: gravity where no orbit is told, drag, light. They stand for themselves
(posterior.c). Others take thrusters for changing (wander.c), and further ones have jumped (jumps.c). A member sees where a frame
puts the map's centre of mass: r + R d + g s, d being what the map's offset is wrong by, and s its size: where depths are far less
precise than directions, as a stereo rig's are, a map that is too large is seen too far away, in all frames alike. Of the size a
member knows what the large filter does. */

/* What a member takes the path for: densities of white acceleration, m2/s3, and of white jerk, m2/s5, and the deviation of
   an acceleration at first, m/s2; by how much of the told variance thrusters change, 1/s; and how much of it errors have that each push has
   of its own. */
typedef struct {
    double white, jerk, bend, wander, execution;
} ProcessNoise;

#define UNLIKELY (-12.0)
#define UNIT_OF_DENSITIES 3.453877639491069 /* logarithm of 10^1.5: so many densities are as likely as one size of another kind */
#define BENT_ODDS (-2.0) /* logarithm of the odds that a path bends, by an acceleration of one size, where its orbit is told */
#define WANDER_ODDS BENT_ODDS /* that thrusters change, or that each push has an error of its own, by one size */
/* Where no orbit is told there is one, most likely, and gravity bends the path from the chaser by up to 3 n2 r, in m/s2: 1e-7
   6 m away in a geostationary orbit, 1e-4 30 m away in a low one. The eight members of such sizes are as likely as all others. */
#define LEAST_OF_GRAVITY 0.5e-7
#define MOST_OF_GRAVITY 2e-4
#define GRAVITY_ODDS 0.6931471805599453
#define SPAN_OF_BENDS 100.0 /* s, about as long as features are out of sight: white acceleration of 3/4 a2 T moves a path in T as an acceleration a does */

/* White acceleration of L members, of a density each, over T s: of covariances whose rows are `stride` numbers apart. */
static ALWAYS_INLINE void add_noise(int L, const double *density, double T, double *P, int stride) {
    for (int k = 0; k < 3; k++)
        for (int m = 0; m < L; m++) {
            const double q = density[m], both = q * T * T / 2.0;
            P[k * stride + k * L + m] += q * T * T * T / 3.0;
            P[(3 + k) * stride + (3 + k) * L + m] += q * T;
            P[k * stride + (3 + k) * L + m] += both;
            P[(3 + k) * stride + k * L + m] += both;
        }
}

#define LEAST_DENSITY 1e-16 /* m2/s3 */

/* A path that bends by so much at first, m/s2, and an acceleration in a random walk that is as much in T s. */
#define BENDS(deviation, T) {.white = LEAST_DENSITY, .jerk = (deviation) * (deviation) / (T), .bend = (deviation)}
#define BENDS_OF_ALL_SIZES(T) BENDS(1e-8, T), BENDS(1e-7, T), BENDS(1e-6, T), BENDS(1e-5, T), BENDS(1e-4, T), BENDS(1e-3, T), BENDS(1e-2, T), BENDS(1e-1, T)

/* On an orbit what bends a path is drag, light, J2 or an orbit that is told wrong. In the axes of LVLH that stays nearly as it is: a random walk makes another
   of it in five low orbits, and changes it by half of its deviation in one, as the air does from day to night. */
#define SPAN_OF_FORCES 30000.0 /* s */

/* Thrusters that change by a part of what is told of them in 1000 s. */
#define CHANGES(part) {.white = LEAST_DENSITY, .wander = (part) * (part) / 1000.0}

/* Pushes that are wrong by a part of what is told of thrusters. */
#define IS_WRONG(part) {.white = LEAST_DENSITY, .execution = (part) * (part)}

/* By kind. Densities: the offset's variance goes with the density while noise of the points is small beside it: a claim of three times less is confidently
   wrong. So large ones are nearer to each other than small ones. Bends of two spans. Thrusters that change from what the pushes of a flight hardly show on:
   densities of a random walk go by squares, a factor of three here is one of ten there. Errors of each push: over a flight pushes tell theirs to a few percent,
   so they are nearer to each other than densities. */
static const ProcessNoise PROCESS_NOISE[STEADY + WANDERS + EXECUTIONS] = {
    {.white = LEAST_DENSITY}, {.white = 1e-14}, {.white = 1e-12}, {.white = 1e-11}, {.white = 1e-10}, {.white = 1e-9},
    {.white = 1e-8}, {.white = 3.1622776601683794e-8}, {.white = 1e-7}, {.white = 3.1622776601683794e-7}, {.white = 1e-6}, {.white = 3.1622776601683794e-6},
    BENDS_OF_ALL_SIZES(1000.0), BENDS_OF_ALL_SIZES(30.0),
    CHANGES(0.01), CHANGES(0.03), CHANGES(0.1), CHANGES(0.3), CHANGES(1.0),
    IS_WRONG(0.0625), IS_WRONG(0.125), IS_WRONG(0.25), IS_WRONG(0.5), IS_WRONG(1.0), IS_WRONG(2.0)};

/* The kind of process noise of a member without a jump, and the other way round. */
static int kind_of(const Online *filter, int m) {
    return filter->options.on_orbit != 0.0 && m >= ON_ORBIT ? m - ON_ORBIT + STEADY : m;
}

static int member_of(int kind) { return kind >= STEADY ? kind - STEADY + ON_ORBIT : kind; }

/* How many errors members abreast have that have those of thrusters but whose paths do not bend: no acceleration is before these, which are the last ones. */
enum { UNBENT = ERRORS - (MOTION - PATH_AND_MAP) };

#define ROW(L, a, b) (((a) * ERRORS + (b)) * (L)) /* where a covariance of the first of L members abreast is (member.c) */

/* Errors of pushes of L members, of a variance each, as a part of these, in every direction alike. */
static ALWAYS_INLINE void add_execution(int L, const double *variance, const double pushes[3], double *P) {
    for (int k = 0; k < 3; k++)
        for (int m = 0; m < L; m++) {
            P[ROW(L, k, k) + m] += variance[m] * pushes[0];
            P[ROW(L, 3 + k, 3 + k) + m] += variance[m] * pushes[1];
            P[ROW(L, k, 3 + k) + m] += variance[m] * pushes[2];
            P[ROW(L, 3 + k, k) + m] += variance[m] * pushes[2];
        }
}

/* White jerk of L members over T s: of (r, v) and the acceleration. */
static ALWAYS_INLINE void add_white_jerk(int L, const double *jerk, double T, double *P) {
    const int AT[3] = {0, 3, PATH_AND_MAP};
    const double square = T * T, Q[3][3] = {{square * square * T / 20.0, square * square / 8.0, square * T / 6.0},
                                            {square * square / 8.0, square * T / 3.0, square / 2.0},
                                            {square * T / 6.0, square / 2.0, T}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                for (int m = 0; m < L; m++) P[ROW(L, AT[i] + k, AT[j] + k) + m] += jerk[m] * Q[i][j];
}

/* What the large filter's errors from `first` to n are with a coordinate of the offset that the last node saw, or, the fourth, with the scale. */
WIDE static void with_map(const Online *filter, int a, int first, int n, double with[MOST_ERRORS]) {
    for (int j = first; j < n; j++) with[j] = 0.0;
    for (int f = 0; f < (int)filter->used; f++) {
        const double *x = filter->P[FEATURES + 3 * f], *y = x + MOST_ERRORS, *z = y + MOST_ERRORS, *part = filter->share[f][a];
        for (int j = first; j < n; j++) with[j] += part[0] * x[j] + part[1] * y[j] + part[2] * z[j];
    }
}

/* What the large filter's errors are with those of (r, v, offset, scale), the offset being what the last node saw: its share
   of each feature's error. */
static void with_path_and_map(const Online *filter, int n, double G[PATH_AND_MAP][MOST_ERRORS]) {
    for (int a = 0; a < 6; a++)
        for (int j = 0; j < n; j++) G[a][j] = filter->P[POSITION + a][j];
    for (int a = 0; a < OF_MAP; a++) with_map(filter, a, 0, n, G[OFFSET + a]);
}

/* The covariance of (r, v, offset, scale) from what they are with all errors. */
static void among_path_and_map(const Online *filter, double G[PATH_AND_MAP][MOST_ERRORS], double P[ERRORS][ERRORS]) {
    for (int a = 0; a < PATH_AND_MAP; a++)
        for (int b = 0; b <= a; b++) {
            double sum = b < OFFSET ? G[a][POSITION + b] : 0.0;
            for (int f = 0; f < (int)filter->used && b >= OFFSET; f++)
                sum += dot(filter->share[f][b - OFFSET], &G[a][FEATURES + 3 * f]);
            P[a][b] = P[b][a] = sum;
        }
}

/* The large filter's covariance of (r, v, offset, scale). */
static void of_path_and_map(const Online *filter, double P[ERRORS][ERRORS]) {
    double G[PATH_AND_MAP][MOST_ERRORS];
    with_path_and_map(filter, FEATURES + 3 * (int)filter->used, G);
    among_path_and_map(filter, G, P);
}

static const double NO_SHARE[OF_MAP][3];

static void copy_shares(const double from[OF_MAP][3], double to[OF_MAP][3]) {
    for (int a = 0; a < OF_MAP; a++)
        for (int k = 0; k < 3; k++) to[a][k] = from[a][k];
}

/* What the error of the map's centroid is with all errors from `first` on; weight: of each feature in it. */
WIDE static void with_centroid(const Online *filter, const double weight[MOST_FEATURES], int first, double G[3][MOST_ERRORS]) {
    int used = (int)filter->used, n = FEATURES + 3 * used;
    for (int a = 0; a < 3; a++)
        for (int j = first; j < n; j++) G[a][j] = 0.0;
    for (int f = 0; f < used; f++)
        for (int a = 0; a < 3; a++)
            for (int j = first; j < n; j++) G[a][j] += weight[f] * filter->P[FEATURES + 3 * f + a][j];
}

/* The covariance of the centroid of G, in B. */
static void of_centroid(const Online *filter, const double weight[MOST_FEATURES], const double G[3][MOST_ERRORS], double P[3][3]) {
    copy(NOTHING, P);
    for (int f = 0; f < (int)filter->used; f++)
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) P[a][b] += weight[f] * G[a][FEATURES + 3 * f + b];
}

static int is_alive(const PackedMember *member) { return member->weight > -INFINITY; }

/* Of a coordinate of the offset, m2. */
static double offset_variance(const PackedMember *member) {
    return (packed(member, OFFSET, OFFSET) + packed(member, OFFSET + 1, OFFSET + 1) + packed(member, OFFSET + 2, OFFSET + 2)) / 3.0;
}

/* Whether a kind is that of a path that gravity bends where no orbit is told. */
static int is_of_gravity(int kind) {
    const double bend = PROCESS_NOISE[kind].bend;
    return bend > LEAST_OF_GRAVITY && bend < MOST_OF_GRAVITY;
}

/* The white acceleration by which a path that is taken for straight is as uncertain as that of a member of gravity's: m2/s3. */
static double straightened(const PackedMember *member) {
    double square = 0.0;
    for (int a = PATH_AND_MAP; a < MOTION; a++) square += member->x[a] * member->x[a] + packed(member, a, a);
    return 0.75 * SPAN_OF_BENDS * square / 3.0;
}

static int is_bending(const PackedMember *member) { return PROCESS_NOISE[(int)member->steady].bend > 0.0; }

/* A member, `to`, goes on with a process noise from where another one is, which it may be: of an acceleration it knows what that one does, or nothing
   yet. One of which it would be more than three deviations is not its own: it would take that for as steady as a small one. Where it begins
   with an acceleration, or without, so does what its innovations have in common. */
static void go_on(const PackedMember *from, int steady, PackedMember *to) {
    const double bend = PROCESS_NOISE[steady].bend, square = dot(&from->x[PATH_AND_MAP], &from->x[PATH_AND_MAP]) / 3.0;
    const int fresh = (bend > 0.0) != is_bending(from) || (bend > 0.0 && square > 9.0 * bend * bend);
    const int known = packed_count(from->errors), before = packed_count(to->errors);
    for (int a = 0; a < ERRORS; a++) to->x[a] = from->x[a];
    for (int k = 0; k < known; k++) to->P[k] = from->P[k];
    for (int k = known; k < before; k++) to->P[k] = 0.0;
    to->errors = from->errors == ERRORS ? ERRORS : bend > 0.0 ? MOTION : PATH_AND_MAP;
    to->weight = from->weight, to->steady = steady;
    to->trend = fresh ? (Trend){0} : from->trend;
    for (int a = PATH_AND_MAP; a < MOTION && fresh; a++) {
        to->x[a] = 0.0;
        for (int b = 0; b < ERRORS; b++) to->P[packed_index(a, b)] = 0.0;
        to->P[packed_index(a, a)] = bend * bend;
    }
}

/* How many members without a jump there are. */
static int count_of(const Online *filter) {
    return filter->options.on_orbit == 0.0 ? STEADY : filter->manoeuvred != 0.0 ? ON_ORBIT + WANDERS + EXECUTIONS : ON_ORBIT;
}

/* Logarithm of the odds of a density: it stands for those around it, of which a factor of 10^1.5 is as likely as one size of a bend. So densities that
   are nearer to each other are not likelier for that. */
static double density_odds(int m) {
    const double ratio = PROCESS_NOISE[m < DENSITIES - 1 ? m + 1 : m].white / PROCESS_NOISE[m > 0 ? m - 1 : m].white;
    return log(log(ratio) / ((m > 0) + (m < DENSITIES - 1)) / UNIT_OF_DENSITIES);
}

/* What a member weighs before the first frame. */
static double first_weight(const Online *filter, int m) {
    if (m >= count_of(filter)) return -INFINITY;
    double bend = PROCESS_NOISE[m].bend;
    if (m < DENSITIES) return density_odds(m);
    if (filter->options.on_orbit != 0.0) return m >= ON_ORBIT ? WANDER_ODDS : bend > 0.0 ? BENT_ODDS : 0.0;
    return is_of_gravity(m) ? GRAVITY_ODDS : 0.0;
}

/* The large filter as a member, at x: of the thrusters it knows what the bank said last. */
static Member large_at(const Online *filter, const double x[6]) {
    Member large = {.errors = filter->manoeuvred != 0.0 ? ERRORS : PATH_AND_MAP};
    for (int k = 0; k < 6; k++) large.x[k] = x[k];
    of_path_and_map(filter, large.P);
    for (int a = 0; a < OF_THRUST; a++) {
        large.x[THRUST + a] = filter->thrust[a];
        for (int b = 0; b < OF_THRUST; b++) large.P[THRUST + a][THRUST + b] = filter->of_thrust[a][b];
    }
    return large;
}

/* All members as the large filter is, with the weights that they have; none has jumped. */
static void start_bank(Online *filter) {
    const Member large = large_at(filter, filter->x);
    PackedMember first = {0};
    pack_member(&large, &first);
    for (int m = 0; m < MEMBERS; m++) {
        double weight = m < count_of(filter) ? fmax(filter->bank[m].weight, UNLIKELY) : -INFINITY;
        go_on(&first, m < count_of(filter) ? kind_of(filter, m) : 0, &filter->bank[m]);
        filter->bank[m].weight = weight;
    }
    filter->bank[SHADOW] = first;
    for (int a = 0; a < PATH_AND_MAP; a++)
        for (int p = 0; p < PRODUCTS; p++) filter->curve[a][p] = 0.0;
}

/* Of n errors, the size of the map is known to be right, but for a variance. */
static ALWAYS_INLINE void learn_scale(int n, double variance, PackedMember *member) {
    const double own = packed(member, SCALE, SCALE), off = member->x[SCALE];
    double gain[ERRORS], *restrict P = member->P;
    for (int a = 0; a < n; a++) gain[a] = packed(member, a, SCALE) / own;
    UNROLL
    for (int a = 0; a < n; a++) {
        const double less = gain[a] * (variance - own);
        member->x[a] -= gain[a] * off;
        for (int b = 0; b <= a; b++) P[packed_index(a, b)] += less * gain[b];
    }
}

/* Of the map's size a member knows what the large filter does, unless it knows more. */
WIDE static void know_scale(PackedMember *member, double variance) {
    if (!(packed(member, SCALE, SCALE) > variance)) return;
    if (member->errors > MOTION) learn_scale(ERRORS, variance, member);
    else if (member->errors > PATH_AND_MAP) learn_scale(MOTION, variance, member);
    else learn_scale(PATH_AND_MAP, variance, member);
}

/* All members know of the map's size what the large filter does. */
static void know_scale_of_map(Online *filter) {
    const int used = (int)filter->used, a = SCALE - OFFSET;
    double with[MOST_ERRORS], variance = 0.0;
    with_map(filter, a, FEATURES, FEATURES + 3 * used, with);
    for (int f = 0; f < used; f++) variance += dot(filter->share[f][a], &with[FEATURES + 3 * f]);
    for (int m = 0; m <= SHADOW; m++)
        if (is_alive(&filter->bank[m])) know_scale(&filter->bank[m], variance);
}

/* The likeliest of the members from `begin` to `end`. */
static int likeliest_of(const PackedMember bank[MEMBERS], int begin, int end) {
    int best = begin;
    for (int m = begin + 1; m < end; m++)
        if (bank[m].weight > bank[best].weight) best = m;
    return best;
}

static int likeliest(const PackedMember bank[MEMBERS]) { return likeliest_of(bank, 0, MEMBERS); }
