/* What the points of the last frame are off the map by, for who watches the filter: nothing in it reads this. */

/* Of a frame's points that are in the map, and its pose, or NULL where none was found; names: of the points as they came. */
static void keep_residuals(Online *filter, const Frame *frame, const Pose *pose, const long long names[]) {
    filter->residuals = 0.0;
    for (int i = 0; i < frame->count; i++) {
        if (frame->slot[i] < 0) continue;
        PointResidual *point = &filter->residual[(int)filter->residuals++];
        double arm[3], We[3];
        point->name = names[i];
        point->fits = pose && frame->fits[i];
        if (pose) residual(filter, frame, pose, i, arm, point->e, We);
        for (int k = 0; k < 3 && !pose; k++) point->e[k] = NAN;
    }
}

int online_residuals(const Online *filter, long long *names, double *residuals, int *fits) {
    const int count = (int)filter->residuals;
    for (int i = 0; i < count; i++) {
        const PointResidual *point = &filter->residual[i];
        names[i] = point->name, fits[i] = point->fits != 0.0;
        for (int k = 0; k < 3; k++) residuals[3 * i + k] = point->e[k];
    }
    return count;
}
