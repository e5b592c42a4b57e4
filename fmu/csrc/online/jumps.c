/* Jumps: an innovation that the most likely member expects once in ten thousand may be a burn of the chaser, or chance.

One more member takes as much acceleration since the node before as explains it, at the price of that probability; the
others go on without, and likelihoods tell. The large filter, and its shadow with it, jump only where that is clear: at
once, or nodes later, then by what the mixture says. */

#define JUMP (-9.2) /* logarithm of the likelihood of one, as that of GATE */
#define CLEAR 3.0   /* logarithm by which a jump is more likely than none, or one member than another, where that is clear */

/* The likeliest member, and the change that comes with a node. */
static void changed_likeliest(const Online *filter, const Measurement *measurement, Member *member) {
    unpack_member(&filter->bank[likeliest(filter->bank)], member);
    go_to_node(&filter->options, member, measurement);
}

/* The density of white acceleration since the node before that explains where the likeliest member, which has seen the change, does not
   expect a node; 0 where it may. */
static double jump_at(const Member *likely, const Measurement *measurement) {
    double e[3], L[9], B[3][ERRORS * ABREAST], span = measurement->span;
    if (!(span > 0.0) || !innovation(likely, measurement, e, L, B)) return 0.0;
    double square = dot(e, e), lag = (measurement->lag[0][0] + measurement->lag[1][1] + measurement->lag[2][2]) / 3.0;
    whiten(L, e);
    return dot(e, e) > GATE ? square / (3.0 * span * (span * span / 3.0 - lag * span + lag * lag)) : 0.0;
}

/* The likeliest member of a bank, `best`, as it is given, jumps by an acceleration of a density: in place of the least likely of those that have
   jumped. Returns its number. */
static int add_jump(PackedMember bank[MEMBERS], int best, const Member *likely, double density, double span) {
    int found = -1;
    for (int m = STEADY; m < MEMBERS; m++)
        if (m != best && (found < 0 || bank[m].weight < bank[found].weight)) found = m;
    Member from = *likely;
    add_noise(1, &density, span, &from.P[0][0], ERRORS);
    from.weight += JUMP;
    pack_member(&from, &bank[found]);
    return found;
}

/* The member that jumps at a node, or -1, by the likeliest one, which has seen the change, as
   has that which jumps; *jump is the density of its acceleration. */
static int jumped(Online *filter, const Member *likely, const Measurement *measurement, double *jump) {
    const int best = likeliest(filter->bank);
    const double density = jump_at(likely, measurement);
    if (density == 0.0) return -1;
    const int found = add_jump(filter->bank, best, likely, density, measurement->span);
    Jump *to = &filter->jump[found - STEADY];
    if (best >= STEADY) *to = filter->jump[best - STEADY];
    else *to = (Jump){0};
    for (int m = 0; m < STEADY && best < STEADY; m++) to->before[m] = filter->bank[m].weight;
    to->parent = best;
    *jump = density;
    return found;
}

/* Members without a jump that are less likely than the most likely one, which has jumped, was before it, go on from
   that, with the weights that they had then. */
static void adopt(Online *filter) {
    const int best = likeliest(filter->bank);
    const PackedMember from = filter->bank[best];
    if (best < STEADY || filter->jump[best - STEADY].pending != 0.0) return;
    const double *before = filter->jump[best - STEADY].before;
    const int steady = member_of(filter, (int)from.steady);
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

/* Weights against the best's. One that has jumped and is far less likely than the best ends. And of the members whose path does not bend the mean density, in the
   logarithm; and by which density the large filter goes: the mean itself over all members, by which the path is as uncertain as their mixture, where no orbit is told with
   what gravity's bends amount to. By less, while more is possible, the large filter would learn of a path that it takes for too smooth an offset of the map, and tell all
   members. What has become so unlikely that it goes on from the best counts for nothing. */
static void weigh_members(Online *filter) {
    const int untold = filter->options.on_orbit == 0.0;
    const double highest = filter->bank[likeliest(filter->bank)].weight, least = exp(UNLIKELY);
    double sum = 0.0, mean = 0.0, all = 0.0, allowed = 0.0;
    for (int begin = 0, end; begin < count_of(filter); begin = end) refresh(filter, begin, end = end_of_kind(filter, begin), highest);
    for (int m = 0; m < MEMBERS; m++) {
        PackedMember *member = &filter->bank[m];
        if (m >= STEADY && !(member->weight - highest > UNLIKELY)) member->weight = -INFINITY;
        if (!is_alive(member)) continue;
        member->weight -= highest;
        const double w = exp(member->weight), density = process_noise_of((int)member->steady).white;
        all += w, allowed += fmax(w - least, 0.0) * density;
        if (untold && is_of_gravity((int)member->steady)) allowed += w * straightened(member);
        if (!is_bending(member)) sum += w, mean += w * log(density);
    }
    filter->density = exp(mean / sum);
    filter->allowed = fmax(allowed / all, filter->density);
}

/* A node updates those members abreast that there are; `fresh` has jumped there. 0 where rounding has left a covariance indefinite. */
static int take_those(Online *filter, Abreast *members, int fresh, const Measurement *measurement, Curve curve) {
    if (members->count == 0) return 1;
    const int sound = take_abreast(&filter->options, filter->bank, members, members->at[0] == fresh, measurement, curve, filter->widest);
    members->count = 0;
    return sound;
}

/* A node updates all members but the shadow; likely: the likeliest, which has seen the change. The likeliest of each kind comes first, as what is far less
   likely than that goes on from the best one anyway, and of such a member only how likely it is counts. Returns the one that jumps there, or -1;
   0 in *sound where rounding has left a covariance indefinite. */
static int update_members(Online *filter, const Member *likely, const Measurement *measurement, Curve curve, double *jump, int *sound) {
    const int fresh = jumped(filter, likely, measurement, jump);
    double least[MEMBERS];
    Abreast members;
    members.count = 0, *sound = 1;
    for (int begin = 0, end; begin < MEMBERS; begin = end) {
        end = end_of_kind(filter, begin);
        const int first = likeliest_of(filter->bank, begin, end), jumps = begin >= count_of(filter);
        least[begin] = -INFINITY;
        for (int k = begin - 1; k < end; k++) {
            const int m = k < begin ? first : k;
            if (k == first || !is_alive(&filter->bank[m])) continue;
            if (members.count == ABREAST || m == fresh || (members.count > 0 && members.at[0] == fresh))
                *sound = take_those(filter, &members, fresh, measurement, curve) && *sound;
            members.least[members.count] = jumps ? NULL : &least[begin];
            members.at[members.count++] = m;
        }
    }
    *sound = take_those(filter, &members, fresh, measurement, curve) && *sound;
    return fresh;
}

/* What successive innovations of the most likely member have in common: nothing, where the path is as that takes it for.
   What they had before it was known that the path bends is forgotten then. And how large they are since that one has the largest density: larger
   than it expects where that is too small. */
static void note_likeliest(Online *filter, const Member *likely, const Measurement *measurement) {
    double e[3], L[9], B[3][ERRORS * ABREAST];
    const int bent = process_noise_of((int)likely->steady).bend > 0.0;
    if (!innovation(likely, measurement, e, L, B)) return;
    whiten(L, e);
    if (likeliest(filter->bank) == DENSITIES - 1) filter->excess += dot(e, e) - 3.0, filter->noisiest += 1.0;
    else filter->excess = filter->noisiest = 0.0;
    if (dot(e, e) > GATE) return;
    if (bent > filter->likely) filter->trend = (Trend){.last = {filter->trend.last[0], filter->trend.last[1], filter->trend.last[2]}};
    filter->likely = bent;
    note_innovation(e, &filter->trend);
}

/* Returns the density of a jump that is clear at once, else 0; *late: one is clear by now that the large filter has not
   taken. */
static double update_bank(Online *filter, const Measurement *measurement, int *late) {
    double jump = 0.0;
    Member likely, shadow;
    changed_likeliest(filter, measurement, &likely);
    note_likeliest(filter, &likely, measurement);
    update_curve(filter, &likely, measurement);
    int sound, parent = likeliest(filter->bank);
    int fresh = update_members(filter, &likely, measurement, filter->curve, &jump, &sound);
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
