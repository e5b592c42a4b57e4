/* Members of the bank that take a node at once: each number of one stands beside the same of the others, so that compilers take them
together. What is done to them is in member.c, curve.c and seeming.c. Places that are left are those of the first again, and nothing of them is kept. */

typedef struct {
    int count, at[ABREAST]; /* their places in the bank */
    double *least[ABREAST]; /* of each, how likely it has to become to be kept; -INFINITY, and it is found by the first of them; or NULL */
    int manoeuvred, bent;   /* some of them have errors of thrusters, or bend */
    double off[3], square;  /* what a node is not where the first of them predicts it, whitened; and its square in m2 */
    ALIGNED double x[ERRORS * ABREAST];
    ALIGNED double P[ERRORS * ERRORS * ABREAST];
} Abreast;

/* Where one of n errors of members abreast is kept: before those of thrusters there is an acceleration, be it zero. */
static ALWAYS_INLINE int kept_at(int n, int a) { return n == UNBENT && a >= PATH_AND_MAP ? a + MOTION - PATH_AND_MAP : a; }

/* Of n errors: of each number all of them at once, as numbers that are put one by one are slow to read as one. */
static ALWAYS_INLINE void unpack_abreast(int n, const PackedMember *const from[ABREAST], Abreast *members) {
    const PackedMember *first = from[0], *second = from[1], *third = from[2], *last = from[3];
    for (int a = 0; a < n; a++) {
        const int row = kept_at(n, a);
        const double x[ABREAST] = {first->x[row], second->x[row], third->x[row], last->x[row]};
        for (int m = 0; m < ABREAST; m++) members->x[a * ABREAST + m] = x[m];
        for (int b = 0, p = packed_index(row, 0); b <= a; b++, p += kept_at(n, b) - kept_at(n, b - 1)) {
            const double P[ABREAST] = {first->P[p], second->P[p], third->P[p], last->P[p]};
            for (int m = 0; m < ABREAST; m++) members->P[ROW(ABREAST, a, b) + m] = P[m];
            for (int m = 0; m < ABREAST; m++) members->P[ROW(ABREAST, b, a) + m] = P[m];
        }
    }
}

/* The members as they are kept. */
static ALWAYS_INLINE void gather_members(const PackedMember *bank, Abreast *members) {
    const PackedMember *from[ABREAST];
    members->manoeuvred = members->bent = 0;
    for (int m = 0; m < ABREAST; m++) {
        from[m] = &bank[members->at[m < members->count ? m : 0]];
        members->manoeuvred = members->manoeuvred || from[m]->errors > MOTION;
        members->bent = members->bent || packed(from[m], PATH_AND_MAP, PATH_AND_MAP) != 0.0;
    }
    if (members->manoeuvred && members->bent) unpack_abreast(ERRORS, from, members);
    else if (members->manoeuvred) unpack_abreast(UNBENT, from, members);
    else if (members->bent) unpack_abreast(MOTION, from, members);
    else unpack_abreast(PATH_AND_MAP, from, members);
}

/* Numbers of members that are kept one after the other. */
static ALWAYS_INLINE void pack_run(int count, const double *restrict from, double *restrict first, double *restrict second, double *restrict third,
                                   double *restrict last) {
    for (int k = 0; k < count; k++) {
        const double *at = from + k * ABREAST;
        first[k] = at[0], second[k] = at[1], third[k] = at[2], last[k] = at[3];
    }
}

/* To where they are kept, `to`; of n errors, others are zero. */
static ALWAYS_INLINE void pack_abreast(int n, const Abreast *members, PackedMember *const to[ABREAST]) {
    PackedMember *first = to[0], *second = to[1], *third = to[2], *last = to[3];
    const int rest = kept_at(n, PATH_AND_MAP);
    for (int a = 0; a < n; a++) {
        const int row = kept_at(n, a), p = packed_index(row, 0), q = p + rest;
        const double *x = members->x + a * ABREAST, *P = members->P + ROW(ABREAST, a, 0), *of_rest = members->P + ROW(ABREAST, a, PATH_AND_MAP);
        first->x[row] = x[0], second->x[row] = x[1], third->x[row] = x[2], last->x[row] = x[3];
        pack_run(a < PATH_AND_MAP ? a + 1 : PATH_AND_MAP, P, first->P + p, second->P + p, third->P + p, last->P + p);
        if (a >= PATH_AND_MAP) pack_run(a + 1 - PATH_AND_MAP, of_rest, first->P + q, second->P + q, third->P + q, last->P + q);
    }
}

/* Those of them that are kept, to the bank. */
static ALWAYS_INLINE void keep_members(const Abreast *members, const int kept[ABREAST], PackedMember *bank) {
    PackedMember none[ABREAST], *to[ABREAST];
    for (int m = 0; m < ABREAST; m++) to[m] = kept[m] ? &bank[members->at[m]] : &none[m];
    if (members->manoeuvred && members->bent) pack_abreast(ERRORS, members, to);
    else if (members->manoeuvred) pack_abreast(UNBENT, members, to);
    else if (members->bent) pack_abreast(MOTION, members, to);
    else pack_abreast(PATH_AND_MAP, members, to);
}

/* Members go on to a node, unless they have, by what has moved the path since the one before and its process noise. */
static ALWAYS_INLINE void go_to_node_abreast(const OnlineOptions *options, const PackedMember *bank, const Measurement *measurement, Abreast *members) {
    if (measurement->since) transit_abreast(ABREAST, members->manoeuvred, members->bent, measurement->since, members->x, members->P);
    NoiseAbreast noise;
    change_abreast(ABREAST, members->manoeuvred, members->bent, measurement, members->x, members->P);
    if (!measurement->since) return;
    for (int m = 0; m < ABREAST; m++) put_noise(noise_of(options, bank[members->at[m < members->count ? m : 0]].steady), m, &noise);
    add_noise_abreast(ABREAST, members->manoeuvred, members->bent, &noise, measurement->since, members->P);
}

/* Members of a bank go on to a node, `there` 0, or have, and take it along a curve, or NULL; what it only seems to show is taken back. Of one that becomes less
   likely than its *least, only how likely. 0 where rounding has left a covariance indefinite. */
WIDE static int take_abreast(const OnlineOptions *options, PackedMember *bank, Abreast *members, int there, const Measurement *measurement, Curve curve,
                             double widest) {
    double e[3 * ABREAST], C[9 * ABREAST], B[3][ERRORS * ABREAST], change[OF_THRUST * ABREAST], density[ABREAST];
    int kept[ABREAST], some = 0;
    gather_members(bank, members);
    const int manoeuvred = members->manoeuvred, bent = members->bent;
    const double *of_thrust = members->x + (bent ? THRUST : UNBENT - OF_THRUST) * ABREAST;
    if (!there) go_to_node_abreast(options, bank, measurement, members);
    innovate_abreast(ABREAST, manoeuvred, bent, measurement, members->x, members->P, e, C, B);
    if (!separated(ABREAST, C)) return 0;
    members->square = e[0] * e[0] + e[ABREAST] * e[ABREAST] + e[2 * ABREAST] * e[2 * ABREAST];
    separate(ABREAST, 1, C, e, e + ABREAST, e + 2 * ABREAST);
    for (int m = 0; m < ABREAST; m++) {
        PackedMember *member = &bank[members->at[m < members->count ? m : 0]];
        double off[3];
        for (int k = 0; k < 3; k++) off[k] = e[k * ABREAST + m] * sqrt(C[4 * k * ABREAST + m]);
        for (int k = 0; k < 3 && m == 0; k++) members->off[k] = off[k];
        density[m] = PROCESS_NOISE[(int)member->steady].white;
        kept[m] = 0;
        if (m >= members->count) continue;
        member->weight += log_likelihood(ABREAST, C + m, off);
        double *least = members->least[m];
        if (least && *least == -INFINITY) *least = member->weight + UNLIKELY;
        kept[m] = !least || !(member->weight < *least);
        if (kept[m]) note_innovation(off, &member->trend);
        some = some || kept[m];
    }
    if (!some) return 1;
    for (int k = 0; k < OF_THRUST * ABREAST && manoeuvred; k++) change[k] = -of_thrust[k];
    update_abreast(ABREAST, manoeuvred, bent, e, C, B, members->x, members->P);
    for (int k = 0; k < OF_THRUST * ABREAST && manoeuvred; k++) change[k] += of_thrust[k];
    if (manoeuvred && curve) follow_curve(ABREAST, bent, curve, change, members->x, members->P);
    take_back_abreast(ABREAST, manoeuvred, bent, measurement, density, widest, members->P);
    keep_members(members, kept, bank);
    return 1;
}
