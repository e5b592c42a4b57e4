/* What the chaser's thrusters are wrong by: a scale s and a rotation vector m in their axes D, so that an acceleration a that is
told is (1 + s) exp([R_C_D m]x) a in truth. Each member of the bank estimates both with its path, from the first manoeuvre on: thrust that
turns with the chaser round a target that turns too is wrong by what looks like an offset in the body, so that path, offset and
thrusters are known together or not at all. The large filter goes by what the bank said at the last node, and takes the rest for
noise, and so does its shadow: what the one knows more than the other is as true as before. But that is the same in each node: of
noise, new in each, the large filter would learn from its path the size of the map, which a rig's depths leave open, tell the bank,
and so count the nodes once more that the bank has learnt it from. So it counts as often as there are nodes in a flight: the large
filter learns sizes from what it sees of the features alone. */

#define NODES_OF_A_FLIGHT 1e5 /* those of a day, of a target that turns in 22 s */

/* Where the covariance of two errors is kept. */
static int packed_index(int a, int b) { return a < b ? b * (b + 1) / 2 + a : a * (a + 1) / 2 + b; }

/* How many covariances a member of so many errors has. */
static int packed_count(double errors) { return (int)errors * ((int)errors + 1) / 2; }

static double packed(const PackedMember *member, int a, int b) { return member->P[packed_index(a, b)]; }

/* A member, to work with it; of its covariance what is beyond MOTION only where it has such errors. */
static void unpack_member(const PackedMember *from, Member *member) {
    const int wide = from->errors > MOTION ? ERRORS : MOTION;
    const double *row = from->P;
    member->errors = from->errors, member->weight = from->weight, member->steady = from->steady, member->trend = from->trend;
    for (int a = 0; a < ERRORS; a++) member->x[a] = from->x[a];
    for (int a = 0; a < wide; row += ++a)
        for (int b = 0; b <= a; b++) member->P[a][b] = member->P[b][a] = row[b];
}

/* To where another one is kept: of the covariance what is beyond its errors is 0. */
static void pack_member(const Member *member, PackedMember *to) {
    const int n = (int)member->errors;
    const double *end = to->P + packed_count(to->errors);
    double *row = to->P;
    to->errors = n, to->weight = member->weight, to->steady = member->steady, to->trend = member->trend;
    for (int a = 0; a < ERRORS; a++) to->x[a] = a < n ? member->x[a] : 0.0;
    for (int a = 0; a < n; row += ++a)
        for (int b = 0; b <= a; b++) row[b] = member->P[a][b];
    for (; row < end; row++) *row = 0.0;
}

static int is_manoeuvre(const Manoeuvre *manoeuvre) {
    for (int i = 0; i < 6; i++)
        if (manoeuvre->moved[i] != 0.0 || manoeuvre->acceleration[i % 3] != 0.0) return 1;
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

/* The chaser manoeuvres: (r, v) goes to where the filter takes the thrusters for; with what errors of these, beyond that, add. */
static void add_manoeuvre(const Online *filter, const Manoeuvre *manoeuvre, double x[6], double errors[6][OF_THRUST]) {
    for (int half = 0; half < 6; half += 3) {
        double moved[3];
        truly_moved(filter->thrust, manoeuvre->axes, &manoeuvre->moved[half], moved, &errors[half]);
        for (int i = 0; i < 3; i++) {
            x[half + i] -= filter->options.thrust == 0.0 ? manoeuvre->moved[half + i] : moved[i];
            for (int k = 0; k < OF_THRUST; k++) errors[half + i][k] = filter->options.thrust == 0.0 ? 0.0 : -errors[half + i][k];
        }
    }
}

/* The covariance of (r, v) by that of what thrusters are wrong by, beyond what the filter goes by; added. */
static void add_thrust(const Online *filter, const Transition *transition, double *P, int stride) {
    if (filter->manoeuvred == 0.0) return;
    for (int i = 0; i < 6; i++) {
        double row[OF_THRUST] = {0.0};
        for (int a = 0; a < OF_THRUST; a++)
            for (int b = 0; b < OF_THRUST; b++) row[b] += NODES_OF_A_FLIGHT * transition->by_thrust[i][a] * filter->of_thrust[a][b];
        for (int j = 0; j < 6; j++)
            for (int b = 0; b < OF_THRUST; b++) P[i * stride + j] += row[b] * transition->by_thrust[j][b];
    }
}

/* The covariance of what a node says by that, which the large filter and its shadow do not know otherwise; added. */
static void add_thrust_of_node(const Online *filter, const Measurement *measurement, double found[3][3]) {
    if (filter->manoeuvred == 0.0) return;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int a = 0; a < OF_THRUST; a++)
                for (int b = 0; b < OF_THRUST; b++)
                    found[i][j] += NODES_OF_A_FLIGHT * measurement->by_thrust[i][a] * filter->of_thrust[a][b] * measurement->by_thrust[j][b];
}

/* Of thrusters that nothing has told of yet. */
static void begin_thrust(const OnlineOptions *options, Posterior *posterior) {
    if (options->thrust == 0.0 || posterior->errors == ERRORS) return;
    posterior->errors = ERRORS;
    for (int a = THRUST; a < ERRORS; a++) posterior->wider[a][a] = options->thrust * options->thrust;
}

/* Of (r, v, offset, scale) other things are known, x and P, than what the bank said, `before` and S: so are they of the thrusters,
   whose regression on these stays. */
static void follow_path_and_map(const double before[PATH_AND_MAP], double S[PATH_AND_MAP][PATH_AND_MAP], double x[ERRORS], double P[ERRORS][ERRORS]) {
    double L[PATH_AND_MAP * PATH_AND_MAP], H[OF_THRUST][PATH_AND_MAP];
    for (int k = 0; k < PATH_AND_MAP * PATH_AND_MAP; k++) L[k] = S[k / PATH_AND_MAP][k % PATH_AND_MAP];
    const int sure = factored(PATH_AND_MAP, L);
    for (int i = 0; i < OF_THRUST; i++) {
        for (int a = 0; a < PATH_AND_MAP; a++) H[i][a] = sure ? P[THRUST + i][a] : 0.0;
        if (sure) solved(PATH_AND_MAP, L, H[i]);
        for (int a = 0; a < PATH_AND_MAP; a++) x[THRUST + i] += H[i][a] * (x[a] - before[a]);
    }
    for (int i = 0; i < OF_THRUST; i++) {
        double row[PATH_AND_MAP], more[PATH_AND_MAP];
        for (int a = 0; a < PATH_AND_MAP; a++) {
            row[a] = more[a] = 0.0;
            for (int b = 0; b < PATH_AND_MAP; b++) row[a] += H[i][b] * P[b][a], more[a] += H[i][b] * (P[b][a] - S[b][a]);
            P[THRUST + i][a] = P[a][THRUST + i] = row[a];
        }
        for (int j = 0; j < OF_THRUST; j++)
            for (int a = 0; a < PATH_AND_MAP; a++) P[THRUST + i][THRUST + j] += more[a] * H[j][a];
    }
}

/* Thrusters may be better than told, and be exact, their scale and their pointing each by itself (Gates 1963 has them apart): parts of
   the told deviation, and how likely each is before they fire. What is told is likeliest: before manoeuvres show more a claim is to
   be hardly narrower, by a factor of 0.84. And it never is less likely than one in four against all others: errors of the size of
   what manoeuvres can tell are of no grade, and pass for none at first; with the told grade a claim allows for them. */
#define LEAST_TOLD 0.25
enum { GRADES = 4 };
static const double GRADE[GRADES] = {1.0, 0.1, 0.01, 0.0};
static const double LIKELY[GRADES] = {0.7, 0.1, 0.1, 0.1};

/* What another grade of scale and pointing makes of errors m that are known with the covariance S from what is told of them, and of
   `variance` before: as if they were measured, with the noise that makes a part of a deviation of it, and found to be 0. All that
   is known with them, x and P, is to be less P G m and P G P'. Covariances are `factor` times as large in truth. Returns the
   logarithm of how likely the grades are, or -INFINITY. */
static double graded(const double m[OF_THRUST], const double S[OF_THRUST][OF_THRUST], const double parts[2], double variance,
                     double factor, double G[OF_THRUST][OF_THRUST]) {
    double A[OF_THRUST * OF_THRUST], likely = 0.0, square = 0.0;
    for (int a = 0; a < OF_THRUST; a++) {
        const double part = parts[a > 0], noise = part < 1.0 ? variance * part * part / (1.0 - part * part) : INFINITY;
        for (int b = 0; b < OF_THRUST; b++) {
            const int told = !(part < 1.0 && parts[b > 0] < 1.0);
            A[OF_THRUST * a + b] = told ? a == b : S[a][b];
            G[a][b] = !told && a == b;
        }
        if (!(part < 1.0)) continue;
        A[(OF_THRUST + 1) * a] += noise / factor;
        likely += 0.5 * log((variance + noise) / factor);
    }
    if (!factored(OF_THRUST, A)) return -INFINITY;
    for (int a = 0; a < OF_THRUST; a++) {
        solved(OF_THRUST, A, G[a]);
        likely -= log(A[(OF_THRUST + 1) * a]);
        for (int b = 0; b < OF_THRUST; b++) square += m[a] * G[a][b] * m[b];
    }
    return likely - 0.5 * square / factor;
}

/* All grades together: how likely they are, as a logarithm, and the mean of G m and of the matrices G, less the covariance of G m:
   by these a mixture has mean and covariance. */
static double all_graded(const Member *member, double variance, double factor, double mean[OF_THRUST], double M[OF_THRUST][OF_THRUST]) {
    enum { ALL = GRADES * GRADES };
    double S[OF_THRUST][OF_THRUST], likely[ALL], u[ALL][OF_THRUST], G[ALL][OF_THRUST][OF_THRUST], best = -INFINITY, sum = 0.0;
    for (int a = 0; a < OF_THRUST; a++) {
        mean[a] = 0.0;
        for (int b = 0; b < OF_THRUST; b++) M[a][b] = 0.0, S[a][b] = member->P[THRUST + a][THRUST + b];
    }
    for (int k = 0; k < ALL; k++) {
        const int scale = k / GRADES, pointing = k % GRADES;
        const double parts[2] = {GRADE[scale], GRADE[pointing]};
        likely[k] = log(LIKELY[scale] * LIKELY[pointing]) + graded(&member->x[THRUST], S, parts, variance, factor, G[k]);
        best = fmax(best, likely[k]);
        for (int a = 0; a < OF_THRUST; a++) {
            u[k][a] = 0.0;
            for (int b = 0; b < OF_THRUST; b++) u[k][a] += G[k][a][b] * member->x[THRUST + b];
        }
    }
    for (int k = 0; k < ALL; k++) sum += likely[k] = exp(likely[k] - best);
    const double told = likely[0] / sum, least = fmax(told, LEAST_TOLD), others = told < 1.0 ? (1.0 - least) / (1.0 - told) : 0.0;
    for (int k = 0; k < ALL; k++) likely[k] = k == 0 ? least : others * likely[k] / sum;
    for (int k = 0; k < ALL; k++)
        for (int a = 0; a < OF_THRUST; a++) mean[a] += likely[k] * u[k][a];
    for (int k = 0; k < ALL; k++)
        for (int a = 0; a < OF_THRUST; a++)
            for (int b = 0; b < OF_THRUST; b++)
                M[a][b] += likely[k] * (G[k][a][b] - (u[k][a] - mean[a]) * (u[k][b] - mean[b]) / factor);
    return best + log(sum);
}

/* Whether a kind of member takes thrusters for changing. */
static int wanders(int kind) { return kind >= STEADY && kind < STEADY + WANDERS; }

/* A member becomes what all grades together say: mean and covariance of their mixture, and its likelihood. The bank itself goes on
   with what is told: from what exact thrusters say of the size of the map the large filter would learn it, tell the bank, and so
   confirm that they are exact. */
static void grade(const OnlineOptions *options, double factor, PackedMember *one) {
    double mean[OF_THRUST], M[OF_THRUST][OF_THRUST], before[ERRORS][OF_THRUST];
    Member member;
    if (one->errors != ERRORS || wanders((int)one->steady)) return;
    unpack_member(one, &member);
    member.weight += all_graded(&member, options->thrust * options->thrust, factor, mean, M);
    for (int i = 0; i < ERRORS; i++)
        for (int a = 0; a < OF_THRUST; a++) before[i][a] = member.P[i][THRUST + a];
    for (int i = 0; i < ERRORS; i++) {
        double less[OF_THRUST] = {0.0};
        for (int a = 0; a < OF_THRUST; a++) {
            member.x[i] -= before[i][a] * mean[a];
            for (int b = 0; b < OF_THRUST; b++) less[a] += before[i][b] * M[b][a];
        }
        member.P[i][i] += ROUNDING * member.P[i][i];
        for (int j = 0; j <= i; j++)
            for (int a = 0; a < OF_THRUST; a++) member.P[i][j] -= less[a] * before[j][a];
        for (int j = 0; j < i; j++) member.P[j][i] = member.P[i][j];
    }
    pack_member(&member, one);
}
