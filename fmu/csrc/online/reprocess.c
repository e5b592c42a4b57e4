/* The first nodes, taken again. The offset may be metres when they come, of which the noise of an attitude makes a
   noise of centimetres. When it is known, that is far less: the bank takes them again, as if it had known it. */

#define FIRST_AGAIN 0.0625 /* of the variance of the offset before the first frame: when for the first time */
#define AGAIN 0.25         /* of that after they were taken again: when once more */
#define SEEMS 0.1          /* of what is known of the offset, what the noise of the attitudes may seem to show */

/* Keep a node: what it says, without noise of second order, and by what it moved offset and scale; the next begins. */
static void keep(Online *filter, const Measurement *measurement, const double moved[OF_MAP]) {
    if (filter->stored_count >= STORED_NODES) filter->stored_count = -1.0;
    if (filter->stored_count >= 0.0) {
        StoredNode *stored = &filter->stored[(int)filter->stored_count++];
        *stored = (StoredNode){.transition = filter->since_node};
        copy(measurement->lag, stored->lag), copy(measurement->offset, stored->offset);
        copy(measurement->noise, stored->noise), copy(measurement->turn, stored->turn), copy(measurement->both, stored->both);
        for (int k = 0; k < 3; k++) stored->c[k] = measurement->c[k], stored->scale[k] = measurement->scale[k];
        for (int a = 0; a < 3; a++)
            for (int k = 0; k < OF_THRUST; k++) stored->by_thrust[a][k] = measurement->by_thrust[a][k];
        for (int a = 0; a < OF_MAP; a++) {
            stored->moved[a] = moved[a];
            for (int b = 0; b < OF_MAP; b++) stored->change[a][b] = measurement->change[a][b], stored->follow[a][b] = measurement->follow[a][b];
        }
        stored->bend = measurement->bend;
    }
    start_transition(&filter->since_node);
}

/* What a node says if its map's offset was wrong by `wrong`, of the covariance P, in B: the error of the attitude moves
   that. */
static void measurement_again(const StoredNode *stored, const double wrong[3], double P[3][3], Measurement *measurement) {
    double off[3], K[3][3], spread[3][3], more[3][3], T[3][3];
    *measurement = (Measurement){.since = &stored->transition};
    copy(stored->lag, measurement->lag), copy(stored->offset, measurement->offset), copy(stored->turn, measurement->turn);
    for (int a = 0; a < OF_MAP; a++)
        for (int b = 0; b < OF_MAP; b++) measurement->change[a][b] = stored->change[a][b], measurement->follow[a][b] = stored->follow[a][b];
    measurement->bend = stored->bend, measurement->span = stored->transition.span;
    times(stored->offset, wrong, off);
    moved_by_turn(off, K);
    copy(P, spread);
    turned(stored->offset, spread);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) spread[a][b] += off[a] * off[b], T[a][b] = dot(stored->both[a], K[b]);
    of_cross(measurement->turn, spread, more);
    add_arc(measurement->turn, spread, more);
    for (int a = 0; a < 3; a++) {
        measurement->c[a] = stored->c[a], measurement->scale[a] = stored->scale[a];
        for (int k = 0; k < OF_THRUST; k++) measurement->by_thrust[a][k] = stored->by_thrust[a][k];
        for (int b = 0; b < 3; b++) measurement->noise[a][b] = stored->noise[a][b] + more[a][b] - T[a][b] - T[b][a];
    }
    find_seeming(measurement->offset, measurement);
}

/* The bank takes a node again, with its jumps. */
static int update_again(Online *filter, const StoredNode *stored, const Measurement *measurement) {
    double jump;
    Shown shown;
    int sound;
    update_members(filter, measurement, NULL, &shown, &jump, &sound);
    adopt(filter);
    weigh_members(filter);
    for (int m = 0; m < MEMBERS; m++)
        for (int a = 0; a < OF_MAP && is_alive(&filter->bank[m]); a++) filter->bank[m].x[OFFSET + a] -= stored->moved[a];
    return sound;
}

/* What the noise of the attitudes seems to show of the offset, as a part of what is known. */
static double part_of(const PackedMember *member, double seems[3][3]) {
    double trace = 0.0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) trace += packed(member, OFFSET + a, OFFSET + b) * seems[a][b];
    return trace;
}

/* Whether the noise of the attitudes may seem to show little where the first nodes are taken again; `seems` is what it does in all of them. No member of the
   bank then knows more of the offset than one of the least process noise of which nothing is taken back, as each has more noise, or more that it does not know:
   if what even that leaves open is too much, there is no need to take all members again. */
static int may_seem_little(const Online *filter, int count, const double wrong[STORED_NODES][3], double of_offset[3][3], double seems[3][3]) {
    PackedMember least = filter->first;
    Member member;
    int sound = 1;
    go_on(&filter->first, 0, &least);
    unpack_member(&least, &member);
    for (int k = 0; k < count; k++) {
        Measurement measurement;
        measurement_again(&filter->stored[k], wrong[k], of_offset, &measurement);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) seems[a][b] += measurement.seems[a][b];
        go_to_node(&filter->options, &member, &measurement);
        sound = sound && update_member(&member, &measurement);
        for (int a = 0; a < ERRORS; a++)
            for (int b = 0; b < a; b++) member.P[b][a] = member.P[a][b];
    }
    pack_member(&member, &least);
    return !sound || part_of(&least, seems) < SEEMS;
}

/* Take the first nodes again if all are kept and the offset is known so much better; 1 if the bank is another. */
static int take_again(Online *filter) {
    PackedMember before[MEMBERS];
    Jump jumps[JUMPS];
    const PackedMember known = filter->bank[likeliest(filter->bank)];
    double wrong[STORED_NODES][3], of_offset[3][3], seems[3][3] = {{0}}, density = filter->density, allowed = filter->allowed;
    double variance = offset_variance(&known);
    int count = (int)filter->stored_count, sound = 1;
    if (count < 1 || !(variance < filter->again)) return 0;
    filter->again = AGAIN * variance;
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++) of_offset[a][b] = packed(&known, OFFSET + a, OFFSET + b);
        for (int k = count - 1; k >= 0; k--)
            wrong[k][a] = filter->stored[k].moved[a] + (k + 1 < count ? wrong[k + 1][a] : known.x[OFFSET + a]);
    }
    if (!may_seem_little(filter, count, (const double(*)[3])wrong, of_offset, seems)) return 0;
    for (int j = 0; j < JUMPS; j++) jumps[j] = filter->jump[j];
    for (int m = 0; m < MEMBERS; m++) {
        before[m] = filter->bank[m];
        go_on(&filter->first, m < count_of(filter) ? kind_of(filter, m) : 0, &filter->bank[m]);
        filter->bank[m].weight = first_weight(filter, m);
    }
    for (int k = 0; k < count && sound; k++) {
        Measurement measurement;
        measurement_again(&filter->stored[k], wrong[k], of_offset, &measurement);
        sound = update_again(filter, &filter->stored[k], &measurement);
    }
    const PackedMember *found = &filter->bank[likeliest(filter->bank)];
    if (sound && part_of(found, seems) < SEEMS) {
        filter->again = AGAIN * fmin(variance, offset_variance(found));
        return 1;
    }
    for (int m = 0; m < MEMBERS; m++) filter->bank[m] = before[m];
    for (int j = 0; j < JUMPS; j++) filter->jump[j] = jumps[j];
    filter->density = density, filter->allowed = allowed;
    return 0;
}
