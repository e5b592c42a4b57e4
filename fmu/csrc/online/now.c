/* What is known now, from all frames: those of the open node, which the filter has not taken yet, too. */

/* The bank takes the open node; 0 if it can't. A node with a jump has to be closed first, and one that is not far beyond
   its noise would seem to show too much. */
static int take_open_node(const Online *filter, Member bank[MEMBERS]) {
    Frame frame;
    Pose pose;
    Sweep sweep;
    Level level;
    OnlineTumble tumble;
    Foreseen foreseen = {.variance = INFINITY};
    double share[MOST_FEATURES][3][3], common[3][3], M[3][3], e[3], L[9], B[LEVEL][3], beyond;
    if (!(turned_by(filter, foreseen.R, &beyond) > beyond)) return 0;
    online_tumble(filter, filter->time, &tumble);
    double lag = as_frame(filter, &tumble, foreseen.R, &frame, &sweep);
    if (!registered(filter, &frame, &foreseen, &pose)) return 0;
    add_second_order(filter, &frame, &pose, &sweep);
    level_of(filter, &frame, &pose, lag, &sweep, share, &level);
    common_noise(filter, &frame, &pose, &level, common);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) level.noise[a][b] += common[a][b];
    seeming(pose.R, level.turn, level.noise, M);
    if (!innovation(&bank[likeliest(bank)], &level, e, L, B)) return 0;
    whitened(L, e);
    if (dot(e, e) > GATE) return 0;
    for (int m = 0; m < MEMBERS; m++) {
        if (!is_alive(&bank[m])) continue;
        add_change(&bank[m], &level);
        if (!update_member(&bank[m], &level)) return 0;
        take_back_of_member(&bank[m], M, filter->widest);
    }
    return 1;
}

/* At the filter's time. */
static void look(const Online *filter, Now *now) {
    Member large = {0}, bank[MEMBERS + 1], further[MEMBERS + 1];
    double step[6], more[LEVEL][LEVEL];
    if (filter->looked != 0.0) {
        *now = filter->now;
        return;
    }
    step_since(filter, step);
    of_level(filter, large.P);
    for (int m = 0; m <= SHADOW; m++) bank[m] = filter->bank[m];
    if (filter->elapsed > 0.0) {
        advance_member(&large, filter->density, filter->elapsed, step, filter->F);
        advance_bank(bank, filter->density, filter->elapsed, step, filter->F);
    }
    int taken = 0;
    if (filter->node.count > 0.0) {
        for (int m = 0; m <= SHADOW; m++) further[m] = bank[m];
        taken = take_open_node(filter, further);
    }
    for (int a = 0; a < LEVEL; a++)
        for (int b = 0; b < LEVEL; b++) now->own[a][b] = large.P[a][b];
    mixture(taken ? further : bank, now->own, now->x, now->wider, more);
}

/* Look now, and go on from what is seen: far ahead of the open node there is no straight way back to it. */
static void look_and_keep(Online *filter) {
    look(filter, &filter->now);
    filter->looked = 1.0;
}
