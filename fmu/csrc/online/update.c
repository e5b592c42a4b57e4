/* The update with a node. */

/* By how much the variance of an attitude exceeds that of its registration before the update: nearly nothing is known. */
#define FREE 1e4

/* The errors dx are taken from the state, from the bank's offset and scale and from the points of the node; moved: by how
   much these two are corrected. */
static void correct(Online *filter, Frame *frame, double lag, const double dx[], double moved[OF_MAP]) {
    for (int k = 0; k < 6; k++) filter->x[k] += dx[POSITION + k];
    for (int i = 0; i < frame->count; i++) {
        Passage *passage = &frame->passage[i];
        double swept[3], since = lag - passage->later;
        cross(&dx[RATE], passage->y, swept);
        for (int k = 0; k < 3; k++) {
            passage->y[k] -= dx[TRANSLATION + k] + dx[POSITION + k] - since * dx[VELOCITY + k] + passage->swept * swept[k];
            frame->y[i][k] += lag * dx[VELOCITY + k];
        }
    }
    start_interval(filter);
    for (int k = 0; k < OF_MAP; k++) moved[k] = 0.0;
    for (int f = 0; f < (int)filter->used; f++) {
        for (int k = 0; k < 3; k++) filter->b[f][k] += dx[FEATURES + 3 * f + k];
        for (int k = 0; k < OF_MAP; k++) moved[k] += dot(filter->share[f][k], &dx[FEATURES + 3 * f]);
    }
    for (int m = 0; m <= SHADOW; m++)
        for (int k = 0; k < OF_MAP; k++) filter->bank[m].x[OFFSET + k] -= moved[k];
}

/* A node whose mean time is `lag` s ago, and what it says; afterwards its points are where they would have been seen from the
   centre of mass as it is known now. 0 where rounding has left the covariance indefinite. */
static int update_frame(Online *filter, Frame *frame, const Pose *pose, double lag, const Sweep *sweep,
                        const double share[MOST_FEATURES][OF_MAP][3], Measurement *measurement) {
    double dx[MOST_ERRORS] = {0}, dy[MOST_ERRORS] = {0}, common[3][3], free[3][3] = {{0}};
    double moved[OF_MAP], rate[3][3];
    int first = TRANSLATION, late;
    Measurement bare = *measurement;
    common_noise(filter, frame, pose, measurement, common);
    of_itself(filter, frame, pose, measurement, bare.noise);
    for (int k = 0; k < 3; k++) free[k][k] = fmin(1.0, FREE * turned_squares(measurement));
    copy(sweep->covariance, rate);
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < 3; k++) measurement->noise[j][k] += common[j][k];
    add_thrust_of_node(filter, measurement, common);
    measurement->span = filter->span;
    find_seeming(pose->R, measurement);
    const double jump = update_bank(filter, measurement, &late);
    add_noise(1, &jump, filter->span, &filter->P[POSITION][POSITION], MOST_ERRORS);
    filter->span = 0.0;
    for (int i = 0; i < frame->count; i++)
        if (frame->passage[i].swept != 0.0) first = RATE;
    renew(filter, RATE, rate);
    renew(filter, TRANSLATION, common);
    renew(filter, ATTITUDE, free);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) filter->R[i][j] = pose->R[i][j];
    for (int i = 0; i < frame->count; i++)
        if (frame->fits[i] && !update_point(filter, frame, i, lag, first, dx)) return 0;
    complete_covariance(filter);
    for (int f = 0; f < (int)filter->used; f++) copy_shares(share[f], filter->share[f]);
    if (late) take_mixture(filter, dx);
    correct(filter, frame, lag, dx, moved);
    turn_left(&dx[ATTITUDE], filter->R);
    take_back(filter, measurement);
    Member shadow;
    unpack_member(&filter->bank[SHADOW], &shadow);
    take_back_of_member(&shadow, measurement, filter->allowed, filter->widest);
    pack_member(&shadow, &filter->bank[SHADOW]);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) filter->seeming[i][j] += measurement->seems[i][j];
    keep(filter, &bare, moved);
    if (take_again(filter) && is_elsewhere(filter)) {
        take_mixture(filter, dy);
        correct(filter, frame, lag, dy, moved);
        for (int k = 0; k < OF_MAP; k++) filter->stored[(int)filter->stored_count - 1].moved[k] += moved[k];
    }
    know_scale_of_map(filter);
    learn_thrust(filter);
    return 1;
}
