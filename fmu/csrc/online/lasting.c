/* Errors of features that last: in how many frames they are the same, 1 + 2 sum of their autocorrelations.

The residuals of each feature in the best pose of each frame are added up over blocks of 1, 2, 4 ... sightings that follow one
another. The mean square of a block's sum is that of white noise times the number, where nothing lasts. Along the axes of C
and of B, as errors may be slow in either. */

#define PLENTY 4.0      /* sightings in the map for each of a block: its own error is the same in all of them */
#define SIGNIFICANT 4.0 /* standard deviations of white noise, beyond which errors last */
#define LEAST 1.25      /* and at least this */
#define GROWING 1.3     /* times what blocks of half the length show, from which longer ones will show more */
#define OTHERWISE 1.2   /* ratio from which on what is known is put right */
#define NOTICED 1.5     /* of the mean square of residuals: as long as the map is of few frames, its errors make one of 1.3, too */

/* z is the residual of a feature in standard deviations, along C and B. */
static void add_residual(Lasting *lasting, ResidualBlocks *series, double sightings, double z[2][3]) {
    double sum[2][3];
    for (int a = 0; a < 2; a++)
        for (int k = 0; k < 3; k++) sum[a][k] = z[a][k];
    for (int j = 0; j < SCALES && sightings >= PLENTY * (1 << j); j++) {
        lasting->blocks[j] += 1.0;
        for (int a = 0; a < 2; a++) lasting->power[a][j] += dot(sum[a], sum[a]) / (1 << j);
        if (sightings < PLENTY * (2 << j)) return;
        for (int a = 0; a < 2; a++)
            for (int k = 0; k < 3; k++) {
                double half = sum[a][k];
                sum[a][k] += series->half[j][a][k];
                series->half[j][a][k] = series->waits >> j & 1 ? 0.0 : half;
            }
        series->waits ^= 1LL << j;
        if (series->waits >> j & 1) return;
    }
}

/* Blocks that are shorter than a gap in the sightings do not go on after it. */
static void drop_halves(ResidualBlocks *series, double gap) {
    for (int j = 0; j < SCALES && (1 << j) <= gap; j++) {
        series->waits &= ~(1LL << j);
        for (int a = 0; a < 2; a++)
            for (int k = 0; k < 3; k++) series->half[j][a][k] = 0.0;
    }
}

static int are_equal(const double A[3][3], const double B[3][3]) {
    for (int k = 0; k < 9; k++)
        if (A[k / 3][k % 3] != B[k / 3][k % 3]) return 0;
    return 1;
}

/* The residuals of a registered frame. The noise of its points is mostly the same: so is the factor of that. */
static void note_residuals(Online *filter, const Frame *frame, const Pose *pose) {
    double L[9];
    int of = -1, sure = 0; /* the point whose noise L is the factor of, and whether it has one */
    for (int i = 0; i < frame->count; i++) {
        double arm[3], e[3], We[3], z[2][3];
        if (!frame->fits[i]) continue;
        ResidualBlocks *series = &filter->series[frame->slot[i]];
        drop_halves(series, filter->frames - series->last - 1.0);
        series->last = filter->frames;
        residual(filter, frame, pose, i, arm, e, We);
        if (of < 0 || !are_equal(frame->noise[i], frame->noise[of])) {
            for (int k = 0; k < 9; k++) L[k] = frame->noise[i][k / 3][k % 3];
            of = i, sure = factored(3, L);
        }
        if (!sure) continue;
        whitened(L, e);
        for (int k = 0; k < 3; k++) z[0][k] = e[k];
        transposed_times(pose->R, z[0], z[1]);
        add_residual(&filter->lasting, series, filter->feature[frame->slot[i]].sightings, z);
    }
}

/* How many frames have the same errors, 1 where that does not show: from the blocks for which it is surely most, and what
   those of half their length say of longer ones. Noise that was told too large counts less. */
static double frames_per_error(const Online *filter) {
    const Lasting *lasting = &filter->lasting;
    double most = 1.0, surely = 0.0;
    if (!(lasting->blocks[0] > 0.0)) return most;
    double square = filter->squares / filter->freedom, share = fmin(filter->freedom / (3.0 * filter->sightings), 1.0);
    for (int a = 0; a < 2; a++) {
        double before = 1.0;
        for (int j = 1; j < SCALES && lasting->blocks[j] > 0.0; j++) {
            double ratio = lasting->power[a][j] / lasting->blocks[j] * lasting->blocks[0] / lasting->power[a][0];
            double by_chance = sqrt(2.0 / (3.0 * share * lasting->blocks[j])), least = ratio * (1.0 - by_chance);
            if (ratio > LEAST && ratio > 1.0 + SIGNIFICANT * by_chance && least > surely)
                surely = least, most = ratio > GROWING * before ? 2.0 * ratio - before : ratio;
            before = ratio;
        }
    }
    return fmax(most * fmin(square, 1.0), 1.0);
}

/* All frames so far were taken for better than they are: what is known is that much less certain. What was before the first
   frame matters little by then. */
static void put_right(Online *filter, double factor) {
    int n = size_of(filter);
    for (int i = 0; i < n; i++) scale_block(filter->P[i], n, factor);
    for (int m = 0; m <= SHADOW; m++) {
        PackedMember *member = &filter->bank[m];
        if (!is_alive(member)) continue;
        scale_block(member->P, PAIRS, factor);
        member->weight /= factor;
    }
    for (int k = 0; k < (int)filter->stored_count; k++) {
        StoredNode *stored = &filter->stored[k];
        scale_block(stored->change[0], OF_MAP * OF_MAP, factor);
        scale_block(stored->noise[0], 9, factor);
        scale_block(stored->turn[0], 9, factor);
        scale_block(stored->both[0], 9, factor);
    }
    for (int f = 0; f < (int)filter->used; f++)
        scale_block(filter->feature[f].information[0], 9, 1.0 / factor), scale_block(filter->feature[f].spread[0], 9, factor);
    Tumble *tumble = &filter->tumble;
    for (int k = 0; k < (int)tumble->kept; k++) scale_block(tumble->attitude[k].noise[0], 9, factor);
    scale_block(tumble->P[0], SPIN * SPIN, factor);
    for (int c = 0; c < REFERENCES; c++) {
        ReferenceTumble *reference = &tumble->reference[c];
        scale_block(reference->N, 64, 1.0 / factor), scale_block(reference->rhs, 8, 1.0 / factor);
        for (int m = 0; m < TORQUES; m++) {
            for (int p = 0; p < SPIN_PAIRS; p++) reference->errors.P[p][m] *= factor;
            reference->errors.weight[m] /= factor;
        }
    }
}

static int is_within(double range, double factor) { return factor < range && factor * range > 1.0; }

/* Before a node: how large errors are, and how long they last, as is known by now. */
static void note_noise(Online *filter) {
    const double left = excess_of_noise(filter), excess = is_within(NOTICED, left) ? 1.0 : left;
    const double found = frames_per_error(filter), factor = excess * found / filter->frames_per_error;
    if (is_within(OTHERWISE, factor)) return;
    put_right(filter, factor);
    filter->frames_per_error = found;
    filter->noise_scale *= excess;
    filter->node.variance *= excess;
    for (int s = 0; s < (int)filter->node.used; s++) scale_block(filter->node.seen[s].noise[0], 9, excess);
}
