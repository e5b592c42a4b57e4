/* The Kalman filter of all errors: propagation, and updates with one feature after the other. */

static int size_of(const Online *filter) { return FEATURES + 3 * (int)filter->used; }

static void start_transition(Transition *transition) {
    *transition = (Transition){0};
    unit_transition(transition->F);
}

/* Count the transition from here. */
static void start_interval(Online *filter) {
    for (int i = 0; i < 6; i++) filter->from[i] = filter->x[i];
    start_transition(&filter->transition);
}

/* What thrusters are wrong by moves (r, v) so in a transition and another one after it. */
static void thrust_after(const Transition *before, const Transition *by, double by_thrust[6][OF_THRUST]) {
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < OF_THRUST; k++) {
            double sum = by->by_thrust[i][k];
            for (int j = 0; j < 6; j++) sum += by->F[i][j] * before->by_thrust[j][k];
            by_thrust[i][k] = sum;
        }
}

/* A transition, and another one after it. */
static void append_transition(Transition *transition, const Transition *by) {
    const Transition before = *transition;
    multiplied(by->F, before.F, transition->F);
    for (int i = 0; i < 6; i++) transition->step[i] = by->step[i] + dot(by->F[i], before.step) + dot(&by->F[i][3], &before.step[3]);
    thrust_after(&before, by, transition->by_thrust);
    const double T = by->span, *before_it = before.pushes;
    transition->pushes[0] = before_it[0] + T * (2.0 * before_it[2] + T * before_it[1]) + by->pushes[0];
    transition->pushes[1] = before_it[1] + by->pushes[1];
    transition->pushes[2] = before_it[2] + T * before_it[1] + by->pushes[2];
    for (int k = 0; k < 3; k++) transition->turn[k] += by->turn[k];
    transition->span += T;
}

/* What has moved the chaser, (r, v), goes on by T s and their transition F, and so does what an acceleration a in C, m/s2, adds: it acts in
   a straight line, and on what it displaces the gravity gradient G: F has G T2 / 2 and G T for that, of which a twelfth and a sixth
   of T2 are due. */
static void displace(double T, const double F[6][6], const double a[3], double moved[6]) {
    double from[6];
    for (int i = 0; i < 6; i++) from[i] = moved[i];
    for (int i = 0; i < 6; i++) moved[i] = dot(F[i], from) + dot(&F[i][3], &from[3]);
    for (int k = 0; k < 3; k++) {
        moved[k] += T * T * (0.5 * a[k] + (dot(F[k], a) - a[k]) / 12.0);
        moved[3 + k] += T * a[k] + T * T / 6.0 * dot(F[3 + k], a);
    }
}

/* The transition from the time of the covariances on. */
static Transition transition_since(const Online *filter) {
    Transition transition = filter->transition;
    for (int i = 0; i < 6; i++) {
        transition.step[i] = filter->x[i] - (dot(transition.F[i], filter->from) + dot(&transition.F[i][3], &filter->from[3]));
        for (int k = 0; k < OF_THRUST && filter->manoeuvred != 0.0; k++) transition.step[i] -= transition.by_thrust[i][k] * filter->thrust[k];
    }
    return transition;
}

/* Bring the covariances, but not the bank, to the time of the state: *gone is what the bank has still to go. */
static void settle(Online *filter, Transition *gone) {
    int n = size_of(filter);
    double A[6][MOST_ERRORS];
    const Transition transition = *gone = transition_since(filter);
    if (transition.span == 0.0) return;
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < n; j++) A[i][j] = 0.0;
        for (int k = 0; k < 6; k++)
            for (int j = 0; j < n; j++) A[i][j] += transition.F[i][k] * filter->P[POSITION + k][j];
    }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < n; j++) filter->P[POSITION + i][j] = filter->P[j][POSITION + i] = A[i][j];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k < 6; k++) sum += A[i][POSITION + k] * transition.F[j][k];
            if (i == j) sum += ROUNDING * sum;
            filter->P[POSITION + i][POSITION + j] = filter->P[POSITION + j][POSITION + i] = sum;
        }
    add_noise(1, &filter->allowed, transition.span, &filter->P[POSITION][POSITION], MOST_ERRORS);
    add_thrust(filter, &transition, &filter->P[POSITION][POSITION], MOST_ERRORS);
    append_transition(&filter->since_node, &transition);
    filter->span += transition.span;
    start_interval(filter);
}

/* What is known goes on by a transition without a step. */
static void propagate_posterior(Posterior *posterior, const Transition *transition) {
    const int n = (int)posterior->errors;
    Member own = {.errors = n}, wider = {.errors = n};
    for (int a = 0; a < n; a++) {
        wider.x[a] = posterior->x[a];
        for (int b = 0; b < n; b++) own.P[a][b] = posterior->own[a][b], wider.P[a][b] = posterior->wider[a][b];
    }
    advance_member(&own, (ProcessNoise){.white = posterior->white}, transition);
    advance_member(&wider, (ProcessNoise){.jerk = posterior->jerk, .wander = posterior->wander, .execution = posterior->execution}, transition);
    for (int a = 0; a < n; a++) {
        posterior->x[a] = wider.x[a];
        for (int b = 0; b < n; b++) posterior->own[a][b] = own.P[a][b], posterior->wider[a][b] = wider.P[a][b];
    }
}

/* (r, v) and what is known go on by one step of a manoeuvre, whose last one ends with it; the transition is without its step. */
static void step_on(const Online *filter, OnlineOrbit *orbit, double begin, double end, Manoeuvre *manoeuvre, double x[6], Posterior *posterior,
                    Transition *transition) {
    *transition = (Transition){.span = end - begin};
    turn_of_lvlh(&filter->options, orbit, begin, end, transition->turn);
    propagate(&filter->options, orbit, begin, end, x, transition->F);
    displace(transition->span, transition->F, manoeuvre->acceleration, manoeuvre->pushed);
    if (end == manoeuvre->end) {
        for (int i = 0; i < 6; i++) manoeuvre->moved[i] += manoeuvre->pushed[i];
        const double *place = manoeuvre->moved, *speed = &manoeuvre->moved[3];
        add_manoeuvre(filter, manoeuvre, x, transition->by_thrust);
        transition->pushes[0] = dot(place, place), transition->pushes[1] = dot(speed, speed), transition->pushes[2] = dot(place, speed);
    }
    if (posterior) propagate_posterior(posterior, transition);
}

/* The state at a later time, until which manoeuvres have moved the chaser; the covariances follow where the noise's would no longer
   be that of a straight line. */
static void advance(Online *filter, double end, const Manoeuvre *manoeuvre) {
    int count = steps_between(&filter->options, filter->time, end);
    double begin = filter->time, T = (end - begin) / count;
    Manoeuvre now = *manoeuvre;
    now.end = end;
    if (is_manoeuvre(manoeuvre)) heed_thrust(filter);
    Posterior *posterior = filter->posterior_valid != 0.0 ? &filter->posterior : NULL;
    for (int s = 0; s < count; s++) {
        const int last = s + 1 == count;
        double from = begin + s * T;
        Transition transition;
        step_on(filter, &filter->options.orbit, from, last ? end : from + T, &now, filter->x, posterior, &transition);
        append_transition(&filter->transition, &transition);
        if (filter->manoeuvred != 0.0) advance_curve(filter, &transition, last ? &now : NULL);
        if (!last || steps_between(&filter->options, end - filter->transition.span, end) > 1) {
            settle(filter, &transition);
            advance_bank(filter, &transition, filter->bank);
        }
    }
    filter->time = end;
}

/* Errors that every frame has of its own: none is known of them but a covariance. */
static void renew(Online *filter, int begin, double covariance[3][3]) {
    int n = size_of(filter);
    for (int j = 0; j < n; j++)
        for (int a = 0; a < 3; a++) filter->P[j][begin + a] = 0.0;
    for (int a = 0; a < 3; a++)
        for (int j = 0; j < n; j++) filter->P[begin + a][j] = 0.0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) filter->P[begin + a][begin + b] = covariance[a][b];
}

/* Of the covariances among features, those above the diagonal are put below it, too. */
static void complete_covariance(Online *filter) {
    for (int k = FEATURES; k < size_of(filter); k++)
        for (int j = 0; j < k; j++) filter->P[k][j] = filter->P[j][k];
}

enum { AT_ONCE = 4 }; /* rows that are updated together, and the number of numbers that loops over them go by */

/* From rows of the covariance, of `count` errors, B' D B of a diagonal D is taken from the column `begin` to `end`; 0 where a variance becomes negative. */
static ALWAYS_INLINE int less_in_rows(int count, int k, int begin, int end, const double D[3], const double B[3][MOST_ERRORS],
                                      double (*restrict P)[MOST_ERRORS]) {
    double before[AT_ONCE], by[AT_ONCE][3];
    int sound = 1;
    for (int r = 0; r < count; r++) {
        before[r] = P[k + r][k + r];
        for (int c = 0; c < 3; c++) by[r][c] = D[c] * B[c][k + r];
    }
    for (int j = begin; j < end; j++)
        for (int r = 0; r < count; r++) P[k + r][j] -= by[r][0] * B[0][j] + by[r][1] * B[1][j] + by[r][2] * B[2][j];
    for (int r = 0; r < count; r++) {
        P[k + r][k + r] += ROUNDING * before[r];
        sound = sound && P[k + r][k + r] >= 0.0;
    }
    return sound;
}

/* The update with one point of a node whose mean time is `lag` s ago; dx are the errors found so far in this node, and
   errors before `first` are none. 0 where rounding has left the covariance indefinite. The rows of features are updated from about the
   diagonal on: `complete_covariance` has to follow the last point. Rows begin and end where compilers take as many numbers at once as processors do: B is
   zero for what is no error. */
WIDE static int update_point(Online *filter, const Frame *frame, int i, double lag, int first, double dx[]) {
    const Passage *passage = &frame->passage[i];
    const int n = size_of(filter), at = FEATURES + 3 * frame->slot[i];
    const int begin = first - first % AT_ONCE, end = (n + AT_ONCE - 1) / AT_ONCE * AT_ONCE;
    double arm[3], bent[3], there[3], A[3][3], T[3][3], K[3][3], S[3][3], B[3][MOST_ERRORS], of_feature[3][MOST_ERRORS], C[9], e[3];
    const double since = lag - passage->later;
    for (int c = 0; c < 3; c++) {
        for (int j = begin; j < at + c; j++) of_feature[c][j] = filter->P[j][at + c];
        for (int j = at + c; j < end; j++) of_feature[c][j] = filter->P[at + c][j];
    }
    times(filter->R, filter->b[frame->slot[i]], arm);
    for (int k = 0; k < 3; k++) bent[k] = arm[k] + frame->bent[i][k];
    times(passage->M, bent, there);
    moved_by_turn(there, S);
    times(passage->M, arm, there);
    product(passage->M, filter->R, A);
    moved_by_turn(bent, T);
    product(passage->M, T, K);
    for (int c = 0; c < 3; c++) {
        const double *p = filter->P[TRANSLATION + c], *q = filter->P[POSITION + c], *v = filter->P[VELOCITY + c];
        const double *t0 = filter->P[ATTITUDE], *t1 = filter->P[ATTITUDE + 1], *t2 = filter->P[ATTITUDE + 2];
        const double *b0 = of_feature[0], *b1 = of_feature[1], *b2 = of_feature[2];
        double *out = B[c];
        for (int k = 0; k < 3; k++) S[c][k] *= passage->swept;
        for (int j = begin; j < end; j++)
            out[j] = p[j] + q[j] - since * v[j] + K[c][0] * t0[j] + K[c][1] * t1[j] + K[c][2] * t2[j] + A[c][0] * b0[j] +
                     A[c][1] * b1[j] + A[c][2] * b2[j];
        e[c] = passage->y[c] - there[c] - dx[TRANSLATION + c] - dx[POSITION + c] + since * dx[VELOCITY + c];
        e[c] -= dot(K[c], &dx[ATTITUDE]) + dot(A[c], &dx[at]);
        for (int j = n; j < end; j++) out[j] = 0.0;
        if (first != RATE) continue;
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < n; j++) out[j] += S[c][k] * filter->P[RATE + k][j];
        e[c] -= dot(S[c], &dx[RATE]);
    }
    for (int c = 0; c < 3; c++)
        for (int d = 0; d <= c; d++) {
            C[3 * c + d] = B[c][TRANSLATION + d] + B[c][POSITION + d] - since * B[c][VELOCITY + d] + dot(K[d], &B[c][ATTITUDE]) + dot(A[d], &B[c][at]) +
                           frame->noise[i][c][d];
            if (first == RATE) C[3 * c + d] += dot(S[d], &B[c][RATE]);
        }
    if (!separated(1, C)) return 0;
    const double D[3] = {C[0], C[4], C[8]};
    separate(1, 1, C, &e[0], &e[1], &e[2]);
    separate(1, end - begin, C, &B[0][begin], &B[1][begin], &B[2][begin]);
    for (int c = 0; c < 3; c++) e[c] *= D[c];
    for (int j = begin; j < end; j++) dx[j] += B[0][j] * e[0] + B[1][j] * e[1] + B[2][j] * e[2];
    int k = begin;
    for (; k + AT_ONCE <= n; k += AT_ONCE)
        if (!less_in_rows(AT_ONCE, k, k < FEATURES ? begin : k, end, D, (const double(*)[MOST_ERRORS])B, filter->P)) return 0;
    for (; k < n; k++)
        if (!less_in_rows(1, k, k < FEATURES ? begin : k - k % AT_ONCE, end, D, (const double(*)[MOST_ERRORS])B, filter->P)) return 0;
    return 1;
}
