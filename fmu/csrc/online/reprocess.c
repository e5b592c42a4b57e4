/* The first nodes, taken again. The offset may be metres when they come, of which the noise of an attitude makes a
   noise of centimetres. When it is known, that is far less: the bank takes them again, as if it had known it. */

#define FIRST_AGAIN 0.0625 /* of the variance of the offset before the first frame: when for the first time */
#define AGAIN 0.25         /* of that when they were taken again: when once more */
#define SEEMS 0.1          /* of what is known of the offset, what the noise of the attitudes may seem to show */

/* Keep a node: what it says, without noise of second order, and by what it moved offset and scale; the next begins. */
static void keep(Online *filter, const Level *level, const double moved[OF_MAP]) {
    if (filter->stages >= STAGES) filter->stages = -1.0;
    if (filter->stages >= 0.0) {
        Stage *stage = &filter->stage[(int)filter->stages++];
        *stage = (Stage){.transition = filter->since_node};
        copy(level->lag, stage->lag), copy(level->offset, stage->offset);
        copy(level->noise, stage->noise), copy(level->turn, stage->turn), copy(level->both, stage->both);
        for (int k = 0; k < 3; k++) stage->c[k] = level->c[k], stage->scale[k] = level->scale[k];
        for (int a = 0; a < 3; a++)
            for (int k = 0; k < OF_THRUST; k++) stage->push[a][k] = level->push[a][k];
        for (int a = 0; a < OF_MAP; a++) {
            stage->moved[a] = moved[a];
            for (int b = 0; b < OF_MAP; b++) stage->change[a][b] = level->change[a][b], stage->follow[a][b] = level->follow[a][b];
        }
        stage->bend = level->bend;
    }
    start_transition(&filter->since_node);
}

/* What a node says if its map's offset was wrong by `wrong`, of the covariance P, in B: the error of the attitude moves
   that. */
static void level_again(const Stage *stage, const double wrong[3], double P[3][3], Level *level) {
    double off[3], K[3][3], spread[3][3], more[3][3], T[3][3];
    *level = (Level){0};
    copy(stage->lag, level->lag), copy(stage->offset, level->offset), copy(stage->turn, level->turn);
    for (int a = 0; a < OF_MAP; a++)
        for (int b = 0; b < OF_MAP; b++) level->change[a][b] = stage->change[a][b], level->follow[a][b] = stage->follow[a][b];
    level->bend = stage->bend;
    times(stage->offset, wrong, off);
    moved_by_turn(off, K);
    copy(P, spread);
    turned(stage->offset, spread);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) spread[a][b] += off[a] * off[b], T[a][b] = dot(stage->both[a], K[b]);
    of_cross(level->turn, spread, more);
    add_arc(level->turn, spread, more);
    for (int a = 0; a < 3; a++) {
        level->c[a] = stage->c[a], level->scale[a] = stage->scale[a];
        for (int k = 0; k < OF_THRUST; k++) level->push[a][k] = stage->push[a][k];
        for (int b = 0; b < 3; b++) level->noise[a][b] = stage->noise[a][b] + more[a][b] - T[a][b] - T[b][a];
    }
}

/* The bank takes a node again, with its jumps; `seems` adds up what the noise of the attitudes seems to show. */
static int update_again(Online *filter, const Stage *stage, Level *level, double seems[3][3]) {
    double jump, M[3][3];
    Member member;
    int sound;
    for (int m = 0; m < MEMBERS; m++) {
        if (!is_alive(&filter->bank[m])) continue;
        unpack_member(&filter->bank[m], &member);
        advance_member(&member, process_noise_of((int)member.steady), &stage->transition);
        pack_member(&member, &filter->bank[m]);
    }
    seeming(level->offset, level->turn, level->noise, M);
    update_members(filter, level, M, stage->transition.span, &jump, &sound);
    adopt(filter);
    weigh_members(filter);
    for (int m = 0; m < MEMBERS; m++)
        for (int a = 0; a < OF_MAP && is_alive(&filter->bank[m]); a++) filter->bank[m].x[OFFSET + a] -= stage->moved[a];
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) seems[a][b] += M[a][b];
    return sound;
}

/* What the noise of the attitudes seems to show of the offset, as a part of what is known. */
static double part_of(const PackedMember *member, double seems[3][3]) {
    double trace = 0.0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) trace += packed(member, OFFSET + a, OFFSET + b) * seems[a][b];
    return trace;
}

/* Take the first nodes again if all are kept and the offset is known so much better; 1 if the bank is another. */
static int take_again(Online *filter) {
    PackedMember before[MEMBERS];
    Jump jumps[JUMPS];
    const PackedMember known = filter->bank[likeliest(filter->bank)];
    double wrong[STAGES][3], of_offset[3][3], seems[3][3] = {{0}}, density = filter->density;
    double variance = offset_variance(&known);
    int count = (int)filter->stages, sound = 1;
    if (count < 1 || !(variance < filter->again)) return 0;
    filter->again = AGAIN * variance;
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++) of_offset[a][b] = packed(&known, OFFSET + a, OFFSET + b);
        for (int k = count - 1; k >= 0; k--)
            wrong[k][a] = filter->stage[k].moved[a] + (k + 1 < count ? wrong[k + 1][a] : known.x[OFFSET + a]);
    }
    for (int j = 0; j < JUMPS; j++) jumps[j] = filter->jump[j];
    for (int m = 0; m < MEMBERS; m++) {
        before[m] = filter->bank[m];
        filter->bank[m] = going_on(&filter->first, m < STEADY ? m : 0);
        filter->bank[m].weight = first_weight(filter, m);
    }
    for (int k = 0; k < count && sound; k++) {
        Level level;
        level_again(&filter->stage[k], wrong[k], of_offset, &level);
        sound = update_again(filter, &filter->stage[k], &level, seems);
    }
    if (sound && part_of(&filter->bank[likeliest(filter->bank)], seems) < SEEMS) return 1;
    for (int m = 0; m < MEMBERS; m++) filter->bank[m] = before[m];
    for (int j = 0; j < JUMPS; j++) filter->jump[j] = jumps[j];
    filter->density = density;
    return 0;
}
