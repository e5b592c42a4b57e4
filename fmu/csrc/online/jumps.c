/* Jumps: an innovation that the most likely member expects once in ten thousand may be a burn of the chaser, or chance.

One more member takes as much acceleration since the node before as explains it, at the price of that probability; the
others go on without, and likelihoods tell. The large filter, and its shadow with it, jump only where that is clear: at
once, or nodes later, then by what the mixture says. */

#define JUMP (-9.2) /* logarithm of the likelihood of one, as that of GATE */
#define CLEAR 3.0   /* logarithm by which a jump is more likely than none, or one member than another, where that is clear */

/* The density of white acceleration since the node before that explains where the likeliest member does not expect a node: its innovation, whitened, and the
   square of that in m2; 0 where it may. */
static double jump_by(const Measurement *measurement, const double off[3], double square) {
    const double span = measurement->span, lag = (measurement->lag[0][0] + measurement->lag[1][1] + measurement->lag[2][2]) / 3.0;
    return span > 0.0 && dot(off, off) > GATE ? square / (3.0 * span * (span * span / 3.0 - lag * span + lag * lag)) : 0.0;
}

/* The same, by the likeliest member, which has seen the change that comes with the node. */
static double jump_at(const Member *likely, const Measurement *measurement) {
    double e[3], C[9], B[3][ERRORS * ABREAST];
    if (!innovation(likely, measurement, e, C, B)) return 0.0;
    const double square = dot(e, e);
    whiten(C, e);
    return jump_by(measurement, e, square);
}

/* Where the next one jumps, if the likeliest member is `best`: in place of the least likely of those that have jumped. */
static int place_of_jump(const PackedMember bank[MEMBERS], int best) {
    int found = -1;
    for (int m = STEADY; m < MEMBERS; m++)
        if (m != best && (found < 0 || bank[m].weight < bank[found].weight)) found = m;
    return found;
}

/* The likeliest member of a bank, as it is given, jumps by an acceleration of a density. */
static void add_jump(const Member *likely, double density, double span, PackedMember *to) {
    Member from = *likely;
    add_noise(1, &density, span, &from.P[0][0], ERRORS);
    from.weight += JUMP;
    pack_member(&from, to);
}

/* Members without a jump that are less likely than the most likely one, which has jumped, was before it, go on from
   that, with the weights that they had then. */
static void adopt(Online *filter) {
    const int best = likeliest(filter->bank);
    const PackedMember from = filter->bank[best];
    if (best < STEADY || filter->jump[best - STEADY].pending != 0.0) return;
    const double *before = filter->jump[best - STEADY].before;
    const int steady = member_of((int)from.steady);
    for (int m = 0; m < count_of(filter); m++) {
        if (filter->bank[m].weight > from.weight + JUMP) continue;
        go_on(&from, kind_of(filter, m), &filter->bank[m]);
        filter->bank[m].weight = from.weight + fmax(before[m] - before[steady], UNLIKELY);
        if (m == steady) filter->bank[best].weight = -INFINITY;
    }
}

/* The end of the members without a jump that are of a kind with the one at `begin`, where they begin: densities, bends, thrusters that change, or errors
   of each push; else that of all members. */
static int end_of_kind(const Online *filter, int begin) {
    const int bent = filter->options.on_orbit != 0.0 ? ON_ORBIT : STEADY, ends[] = {DENSITIES, bent, bent + WANDERS, bent + WANDERS + EXECUTIONS};
    for (int k = 0; k < 4 && ends[k] <= count_of(filter); k++)
        if (begin < ends[k]) return ends[k];
    return MEMBERS;
}

/* Of the members from `begin` to `end`, without a jump: one far less likely than the best of them goes on from that, so that no
   evidence is older than it has to be; nor are all of them against the rest of the bank. */
static void refresh(Online *filter, int begin, int end, double highest) {
    PackedMember *bank = filter->bank;
    const PackedMember *first = &bank[likeliest_of(bank, begin, end)];
    const double least = first->weight + UNLIKELY;
    const double lift = fmax(highest + UNLIKELY - first->weight, 0.0);
    for (int m = begin; m < end; m++) {
        double weight = fmax(bank[m].weight, least);
        if (weight > bank[m].weight) go_on(first, kind_of(filter, m), &bank[m]);
        bank[m].weight = weight + lift;
    }
}

/* Weights against the best's. One that has jumped and is far less likely than the best ends. And of the members whose path does not bend the mean density, in
   the logarithm; and by which density the large filter goes: the mean itself over all members, by which the path is as uncertain as their mixture, where no
   orbit is told with what gravity's bends amount to. By less, while more is possible, the large filter would learn of a path that it takes for too smooth an
   offset of the map, and tell all members. What has become so unlikely that it goes on from the best counts for nothing. */
static void weigh_members(Online *filter) {
    const int untold = filter->options.on_orbit == 0.0;
    const double highest = filter->bank[likeliest(filter->bank)].weight, least = exp(UNLIKELY);
    double sum = 0.0, mean = 0.0, all = 0.0, allowed = 0.0, last = 0.0, logarithm = 0.0;
    for (int begin = 0, end; begin < count_of(filter); begin = end) refresh(filter, begin, end = end_of_kind(filter, begin), highest);
    for (int m = 0; m < MEMBERS; m++) {
        PackedMember *member = &filter->bank[m];
        if (m >= STEADY && !(member->weight - highest > UNLIKELY)) member->weight = -INFINITY;
        if (!is_alive(member)) continue;
        member->weight -= highest;
        const double w = exp(member->weight), density = PROCESS_NOISE[(int)member->steady].white;
        all += w, allowed += fmax(w - least, 0.0) * density;
        if (untold && is_of_gravity((int)member->steady)) allowed += w * straightened(member);
        if (is_bending(member)) continue;
        if (density != last) last = density, logarithm = log(density);
        sum += w, mean += w * logarithm;
    }
    filter->density = exp(mean / sum);
    filter->allowed = fmax(allowed / all, filter->density);
}

/* What a node showed to the likeliest member: its place, and what the node was not where it was predicted, whitened, and the square of that in m2. */
typedef struct {
    int best;
    double off[3], square;
} Shown;

/* A node updates those members abreast that there are. 0 where rounding has left a covariance indefinite. */
static int take_those(Online *filter, Abreast *members, const Measurement *measurement, Curve curve, Shown *shown) {
    if (members->count == 0) return 1;
    const int sound = take_abreast(&filter->options, filter->bank, members, 0, measurement, curve, filter->widest);
    for (int k = 0; k < 3 && members->at[0] == shown->best; k++) shown->off[k] = members->off[k], shown->square = members->square;
    members->count = 0;
    return sound;
}

/* A node updates all members but the shadow. The likeliest comes first, and that of each kind before the others, as what is far less likely than that goes on
   from the best one anyway, and of such a member only how likely it is counts. 0 where rounding has left a covariance indefinite. */
static int take_all(Online *filter, const Measurement *measurement, Curve curve, Shown *shown) {
    double least[MEMBERS];
    Abreast members;
    int sound = 1, of_best = 0;
    members.count = 1, members.at[0] = shown->best;
    for (int begin = 0, end; begin < MEMBERS; begin = end) {
        end = end_of_kind(filter, begin), least[begin] = -INFINITY;
        if (begin <= shown->best) of_best = begin;
    }
    members.least[0] = of_best < count_of(filter) ? &least[of_best] : NULL;
    for (int begin = 0, end; begin < MEMBERS; begin = end) {
        end = end_of_kind(filter, begin);
        const int first = begin == of_best ? shown->best : likeliest_of(filter->bank, begin, end);
        for (int k = begin - 1; k < end; k++) {
            const int m = k < begin ? first : k;
            if (k == first || m == shown->best || !is_alive(&filter->bank[m])) continue;
            if (members.count == ABREAST) sound = take_those(filter, &members, measurement, curve, shown) && sound;
            members.least[members.count] = begin < count_of(filter) ? &least[begin] : NULL;
            members.at[members.count++] = m;
        }
    }
    return take_those(filter, &members, measurement, curve, shown) && sound;
}

/* The same, and one jumps where the likeliest member does not expect the node. Returns it, or -1; *jump is the density of its acceleration; 0 in *sound where
   rounding has left a covariance indefinite. */
static int update_members(Online *filter, const Measurement *measurement, Curve curve, Shown *shown, double *jump, int *sound) {
    *shown = (Shown){.best = likeliest(filter->bank)};
    const PackedMember from = filter->bank[shown->best];
    const int fresh = place_of_jump(filter->bank, shown->best);
    double weights[STEADY];
    for (int m = 0; m < STEADY; m++) weights[m] = filter->bank[m].weight;
    *sound = take_all(filter, measurement, curve, shown);
    const double density = jump_by(measurement, shown->off, shown->square);
    if (density == 0.0) return -1;
    Member likely;
    Abreast members;
    Jump *to = &filter->jump[fresh - STEADY];
    unpack_member(&from, &likely);
    go_to_node(&filter->options, &likely, measurement);
    add_jump(&likely, density, measurement->span, &filter->bank[fresh]);
    if (shown->best >= STEADY) *to = filter->jump[shown->best - STEADY];
    else *to = (Jump){0};
    for (int m = 0; m < STEADY && shown->best < STEADY; m++) to->before[m] = weights[m];
    to->parent = shown->best;
    *jump = density;
    members.count = 1, members.at[0] = fresh, members.least[0] = NULL;
    *sound = take_abreast(&filter->options, filter->bank, &members, 1, measurement, curve, filter->widest) && *sound;
    return fresh;
}

/* What successive innovations of the most likely member have in common: nothing, where the path is as that takes it for.
   What they had before it was known that the path bends is forgotten then. And how large they are since that one has the largest density: larger
   than it expects where that is too small. */
static void note_likeliest(Online *filter, const Shown *shown) {
    const int bent = is_bending(&filter->bank[shown->best]);
    const double square = dot(shown->off, shown->off);
    if (shown->best == DENSITIES - 1) filter->excess += square - 3.0, filter->noisiest += 1.0;
    else filter->excess = filter->noisiest = 0.0;
    if (square > GATE) return;
    if (bent > filter->likely) filter->trend = (Trend){.last = {filter->trend.last[0], filter->trend.last[1], filter->trend.last[2]}};
    filter->likely = bent;
    note_innovation(shown->off, &filter->trend);
}

/* Returns the density of a jump that is clear at once, else 0; *late: one is clear by now that the large filter has not
   taken. */
static double update_bank(Online *filter, const Measurement *measurement, int *late) {
    double jump = 0.0;
    Member shadow;
    Shown shown;
    int sound;
    update_curve(filter, measurement);
    const int fresh = update_members(filter, measurement, filter->curve, &shown, &jump, &sound), parent = shown.best;
    if (sound) note_likeliest(filter, &shown);
    int best = likeliest(filter->bank);
    const PackedMember *first = &filter->bank[best];
    const Jump *jumped = best < STEADY ? NULL : &filter->jump[best - STEADY];
    int clear = fresh >= 0 && filter->bank[parent].weight < first->weight - CLEAR;
    if (fresh >= 0) filter->jump[fresh - STEADY].pending = clear ? 0.0 : 1.0;
    if (!clear) jump = 0.0;
    *late = jumped && jumped->pending != 0.0 && filter->bank[(int)jumped->parent].weight < first->weight - CLEAR;
    if (!*late) adopt(filter);
    Measurement of_shadow = *measurement;
    unpack_member(&filter->bank[SHADOW], &shadow);
    if (measurement->since) advance_large(filter, &shadow, measurement->since);
    add_change(&shadow, measurement);
    add_noise(1, &jump, measurement->span, &shadow.P[0][0], ERRORS);
    add_thrust_of_node(filter, measurement, of_shadow.noise);
    sound = update_member(&shadow, &of_shadow) && sound;
    shadow.weight = 0.0;
    pack_member(&shadow, &filter->bank[SHADOW]);
    if (!sound) start_bank(filter), *late = 0;
    weigh_members(filter);
    return jump;
}
