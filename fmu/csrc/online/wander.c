/* Thrusters that do not stay as they are: they warm up, their tanks empty, a valve sticks. Errors of them that are taken for constant
are soon known to parts of 1e-4, by all pushes since the first; where they change by more, the rest passes for an offset of the
centre of mass, which turns with the target as thrust does. So members of the bank, from the first manoeuvre on, have errors of the
thrusters in a random walk, of one size each: by a hundredth of what is told of them in 1000 s, which a flight hardly shows, up to as
much. Likelihoods weigh them as they weigh other process noise: thrusters that stay as they are cost nothing then. Such members
have no grades (thrust.c), of errors that are constant, or none. On an orbit only, where the bank has room for them.

Nor is one push like the next, each has an error of its own (execution errors, Gates 1963). Further members have as much more noise as pushes have
moved the chaser, of one size each: white acceleration of any density is too much while it coasts, or too little while it thrusts. */

/* A first manoeuvre: from now on it matters what thrusters are wrong by, and whether they stay so. */
static void heed_thrust(Online *filter) {
    const double variance = filter->options.thrust * filter->options.thrust;
    if (!(variance > 0.0) || filter->manoeuvred != 0.0) return;
    filter->manoeuvred = 1.0;
    begin_thrust(&filter->options, &filter->posterior);
    for (int a = 0; a < OF_THRUST; a++) filter->of_thrust[a][a] = variance;
    for (int m = 0; m <= SHADOW + 1; m++) {
        PackedMember *member = m > SHADOW ? &filter->first : &filter->bank[m];
        member->errors = ERRORS;
        for (int a = THRUST; a < ERRORS; a++) member->P[packed_index(a, a)] = variance;
    }
    const PackedMember best = filter->bank[likeliest(filter->bank)];
    for (int m = ON_ORBIT; m < count_of(filter) && filter->options.on_orbit != 0.0; m++) {
        go_on(&best, kind_of(filter, m), &filter->bank[m]);
        filter->bank[m].weight = best.weight + WANDER_ODDS;
    }
}
