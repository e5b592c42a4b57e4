/* What the chaser's thrusters are wrong by: a scale s and a rotation vector m in their axes D, so that an acceleration a that is
told is (1 + s) exp([R_C_D m]x) a in truth. Each member of the bank estimates both with its path, from the first push on: thrust that
turns with the chaser round a target that turns too is wrong by what looks like an offset in the body, so that path, offset and
thrusters are known together or not at all. The large filter goes by what the bank said at the last node, and takes the rest for
noise, and so does its shadow: what the one knows more than the other is as true as before. But that is the same in each node: of
noise, new in each, the large filter would learn from its path the size of the map, which a rig's depths leave open, tell the bank,
and so count the nodes once more that the bank has learnt it from. So it counts as often as there are nodes in a flight: the large
filter learns sizes from what it sees of the features alone. */

#define NODES_OF_A_FLIGHT 1e5 /* those of a day, of a target that turns in 22 s */

/* Where the covariance of two errors is kept. */
static int pair(int a, int b) { return a < b ? b * (b + 1) / 2 + a : a * (a + 1) / 2 + b; }

static double kept(const Kept *member, int a, int b) { return member->P[pair(a, b)]; }

/* A member, to work with it; of its covariance what is beyond MOTION only where it has such errors. */
static void take_member(const Kept *from, Member *member) {
    const int wide = from->errors > MOTION ? ERRORS : MOTION;
    const double *row = from->P;
    member->errors = from->errors, member->weight = from->weight, member->steady = from->steady;
    for (int a = 0; a < ERRORS; a++) member->x[a] = from->x[a];
    for (int a = 0; a < wide; row += ++a)
        for (int b = 0; b <= a; b++) member->P[a][b] = member->P[b][a] = row[b];
}

static void keep_member(const Member *member, Kept *to) {
    const int n = (int)member->errors;
    double *row = to->P;
    to->errors = n, to->weight = member->weight, to->steady = member->steady;
    for (int a = 0; a < ERRORS; a++) to->x[a] = a < n ? member->x[a] : 0.0;
    for (int a = 0; a < n; row += ++a)
        for (int b = 0; b <= a; b++) row[b] = member->P[a][b];
    while (row < to->P + PAIRS) *row++ = 0.0;
}

static int is_push(const Push *push) {
    for (int i = 0; i < 6; i++)
        if (push->moved[i] != 0.0) return 1;
    return 0;
}

/* By what thrusters move that are wrong by a scale and a rotation vector in the axes R_C_D, where they are told to move by `told`;
   and what errors of scale and rotation vector add. */
static void truly_moved(const double wrong[OF_THRUST], const double axes[3][3], const double told[3], double moved[3],
                        double errors[3][OF_THRUST]) {
    double turn[3], turned[3][3], back[3], J[3][3], K[3][3], T[3][3];
    times(axes, &wrong[1], turn);
    rotation(turn, turned);
    times(turned, told, back);
    for (int k = 0; k < 3; k++) moved[k] = (1.0 + wrong[0]) * back[k];
    moved_by_turn(turn, J); /* -[turn]x: the rotation is 1 + [turn + (1 + [turn]x / 2) error]x, to second order */
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) J[i][k] = (i == k) - 0.5 * J[i][k];
    moved_by_turn(moved, K);
    product(K, J, T);
    product(T, axes, K);
    for (int i = 0; i < 3; i++) {
        errors[i][0] = back[i];
        for (int k = 0; k < 3; k++) errors[i][1 + k] = K[i][k];
    }
}

/* The chaser is pushed: (r, v) goes to where the filter takes the thrusters for; with what errors of these, beyond that, add. */
static void pushed_by(const Online *filter, const Push *push, double x[6], double errors[6][OF_THRUST]) {
    for (int half = 0; half < 6; half += 3) {
        double moved[3];
        truly_moved(filter->thrust, push->axes, &push->moved[half], moved, &errors[half]);
        for (int i = 0; i < 3; i++) {
            x[half + i] -= filter->options.thrust == 0.0 ? push->moved[half + i] : moved[i];
            for (int k = 0; k < OF_THRUST; k++) errors[half + i][k] = filter->options.thrust == 0.0 ? 0.0 : -errors[half + i][k];
        }
    }
}

/* The covariance of (r, v) by that of what thrusters are wrong by, beyond what the filter goes by; added. */
static void add_thrust(const Online *filter, const Way *way, double *P, int stride) {
    if (filter->pushed == 0.0) return;
    for (int i = 0; i < 6; i++) {
        double row[OF_THRUST] = {0.0};
        for (int a = 0; a < OF_THRUST; a++)
            for (int b = 0; b < OF_THRUST; b++) row[b] += NODES_OF_A_FLIGHT * way->push[i][a] * filter->of_thrust[a][b];
        for (int j = 0; j < 6; j++)
            for (int b = 0; b < OF_THRUST; b++) P[i * stride + j] += row[b] * way->push[j][b];
    }
}

/* The covariance of what a node says by that, which the large filter and its shadow do not know otherwise; added. */
static void add_thrust_of_node(const Online *filter, const Level *level, double found[3][3]) {
    if (filter->pushed == 0.0) return;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int a = 0; a < OF_THRUST; a++)
                for (int b = 0; b < OF_THRUST; b++)
                    found[i][j] += NODES_OF_A_FLIGHT * level->push[i][a] * filter->of_thrust[a][b] * level->push[j][b];
}

/* Of thrusters that nothing has told of yet. */
static void begin_thrust(const OnlineOptions *options, Now *now) {
    if (options->thrust == 0.0 || now->errors == ERRORS) return;
    now->errors = ERRORS;
    for (int a = THRUST; a < ERRORS; a++) now->wider[a][a] = options->thrust * options->thrust;
}

/* A first push: from now on it matters what thrusters are wrong by. */
static void heed_thrust(Online *filter) {
    const double variance = filter->options.thrust * filter->options.thrust;
    if (!(variance > 0.0) || filter->pushed != 0.0) return;
    filter->pushed = 1.0;
    begin_thrust(&filter->options, &filter->now);
    for (int a = 0; a < OF_THRUST; a++) filter->of_thrust[a][a] = variance;
    for (int m = 0; m <= SHADOW + 1; m++) {
        Kept *member = m > SHADOW ? &filter->first : &filter->bank[m];
        member->errors = ERRORS;
        for (int a = THRUST; a < ERRORS; a++) member->P[pair(a, a)] = variance;
    }
}

/* Of (r, v, offset, scale) other things are known, x and P, than what the bank said, `before` and S: so are they of the thrusters,
   whose regression on these stays. */
static void follow_level(const double before[LEVEL], double S[LEVEL][LEVEL], double x[ERRORS], double P[ERRORS][ERRORS]) {
    double L[LEVEL * LEVEL], H[OF_THRUST][LEVEL];
    for (int k = 0; k < LEVEL * LEVEL; k++) L[k] = S[k / LEVEL][k % LEVEL];
    const int sure = factored(LEVEL, L);
    for (int i = 0; i < OF_THRUST; i++) {
        for (int a = 0; a < LEVEL; a++) H[i][a] = sure ? P[THRUST + i][a] : 0.0;
        if (sure) solved(LEVEL, L, H[i]);
        for (int a = 0; a < LEVEL; a++) x[THRUST + i] += H[i][a] * (x[a] - before[a]);
    }
    for (int i = 0; i < OF_THRUST; i++) {
        double row[LEVEL], more[LEVEL];
        for (int a = 0; a < LEVEL; a++) {
            row[a] = more[a] = 0.0;
            for (int b = 0; b < LEVEL; b++) row[a] += H[i][b] * P[b][a], more[a] += H[i][b] * (P[b][a] - S[b][a]);
            P[THRUST + i][a] = P[a][THRUST + i] = row[a];
        }
        for (int j = 0; j < OF_THRUST; j++)
            for (int a = 0; a < LEVEL; a++) P[THRUST + i][THRUST + j] += more[a] * H[j][a];
    }
}
