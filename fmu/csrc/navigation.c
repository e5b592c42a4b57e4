#include "unit.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "whole.c"

/* ---- by what commands have moved the chaser ---- */

/* What has moved it, (r, v), goes on between two times, and so does what an acceleration a in C, m/s2, adds: see `displace`. */
static void displacement_by(const OnlineOptions *options, double begin, double end, const double a[3], double moved[6])
{
    double any = 0.0;
    for (int k = 0; k < 6; k++) any += fabs(moved[k]) + fabs(a[k % 3]);
    if (any == 0.0) return;
    const int count = steps_between(options, begin, end);
    const double T = (end - begin) / count;
    for (int s = 0; s < count; s++) {
        double F[6][6], x[6] = {0.0}, start = begin + s * T;
        go_plainly(options, start, s + 1 < count ? start + T : end, x, F);
        displace(T, F, a, moved);
    }
}

/* Until a time in the interval that ends at `now`, since its beginning: the cubic that fits what is known at both. */
static void moved_within(const Past *now, double time, double moved[6])
{
    const double length = now->time - now[-1].time, s = (time - now[-1].time) / length;
    for (int k = 0; k < 3; k++) {
        const double place = now->moved[k], speed = now->moved[3 + k];
        moved[k] = s * s * ((3.0 - 2.0 * s) * place + (s - 1.0) * length * speed);
        moved[3 + k] = s * (6.0 * (1.0 - s) * place / length + (3.0 * s - 2.0) * speed);
    }
}

/* Between two times with no communication point in between; nothing is known of what was before the first one. */
static Manoeuvre manoeuvre_between(const Model *model, double begin, double end, double axes[3][3])
{
    static const double none[3];
    Manoeuvre manoeuvre = {0};
    double *moved = manoeuvre.moved;
    int k = 0;
    copy(axes, manoeuvre.axes);
    while (k < model->count - 1 && model->past[k].time < end) k++;
    if (k == 0 || model->past[k].time < end) return manoeuvre;
    double until_end[6];
    if (begin > model->past[k - 1].time) moved_within(&model->past[k], begin, moved);
    displacement_by(&model->filter.options, begin, end, none, moved);
    moved_within(&model->past[k], end, until_end);
    for (int i = 0; i < 6; i++) moved[i] = until_end[i] - moved[i];
    return manoeuvre;
}

/* Make room for a communication point: forget the oldest if the filter is past it, else the one between neighbours that are
   nearest to each other: both intervals become one, with what commands do in both. */
static void make_room(Model *model)
{
    static const double none[3];
    Past *past = model->past;
    int least = 0;
    if (model->filter.frames == 0.0 || past[1].time > model->filter.time) {
        least = 1;
        for (int i = 2; i < model->count - 1; i++)
            if (past[i + 1].time - past[i - 1].time < past[least + 1].time - past[least - 1].time) least = i;
        displacement_by(&model->filter.options, past[least].time, past[least + 1].time, none, past[least].moved);
        for (int i = 0; i < 6; i++) past[least + 1].moved[i] += past[least].moved[i];
    }
    model->count--;
    memmove(past + least, past + least + 1, (size_t)(model->count - least) * sizeof *past);
}

/* Remember the step from `time` to `next` with its command, which turns with LVLH, of a target that moves freely, too. One
   constant acceleration would have the velocity of that at the end, but not the place: each half has its own, as the command
   is a sixth of the step from its outer end; so both are right to second order. */
static void remember(Model *model, const double command[3], double time, double next)
{
    if (model->count == MOST_PAST) make_room(model);
    Past *now = &model->past[model->count++];
    const double length = next - time, middle = time + 0.5 * length;
    const double moments[2] = {time + length / 6.0, next - length / 6.0}, ends[3] = {time, middle, next};
    now->time = next;
    memset(now->moved, 0, sizeof now->moved);
    for (int half = 0; half < 2; half++) {
        double acceleration[3];
        const double *arguments[] = {&moments[half], model->filter.options.orbit.elements, command};
        double *results[] = {acceleration};
        unit_push(arguments, results, NULL, NULL, 0);
        displacement_by(&model->filter.options, ends[half], ends[half + 1], acceleration, now->moved);
    }
}

/* The first communication point after one time and before another, which is meant if there is none. What is known goes
   through all of them, through each step with its own command. */
static double next_point(const Model *model, double begin, double end)
{
    for (int k = 0; k < model->count; k++)
        if (model->past[k].time > begin && model->past[k].time < end) return model->past[k].time;
    return end;
}

/* ---- samples ---- */

static void write_quaternion(const double R[3][3], double *quaternion)
{
    const double *rows[] = {R[0]};
    double *results[] = {quaternion};
    unit_attitude(rows, results, NULL, NULL, 0);
}

/* Say what is wrong with a sample, unless it was said of a fault of this kind before. */
static void tell(Model *model, Fault fault, char *message, const char *format, ...)
{
    const size_t length = strlen(message);
    if (model->told[fault]) return;
    model->told[fault] = true;
    va_list arguments;
    va_start(arguments, format);
    if (length > 0) snprintf(message + length, MESSAGE_SIZE - length, "; ");
    vsnprintf(message + strlen(message), MESSAGE_SIZE - strlen(message), format, arguments);
    va_end(arguments);
}

/* Whether a sample is news: its number is not that of the last one, and its time is later, but not of the future; a sample of that
   waits for its time. A number that goes back at a later time is of a rig that began again, or the one before was wrong. */
static bool is_due(Model *model, const double *values, double next, char *message)
{
    const double number = values[AT_SAMPLE_NUMBER], time = values[AT_SAMPLE_TIME], before = model->taken;
    const double last = model->filter.time + model->started;
    if (number == 0.0) return false; /* none yet */
    if (number == before) {
        if (time > model->taken_time)
            tell(model, SAME_NUMBER, message, "sample.time is %.17g s, later than before, but sample.number is that of the last "
                 "sample, %.17g, expected another: not taken", time, number);
        return false;
    }
    if (time > next) {
        tell(model, TIME_AHEAD, message, "sample.time is %.17g s, expected at most the end of the step, %.17g s: not taken "
             "before its time", time, next);
        return false;
    }
    model->taken = number, model->taken_time = time;
    if (model->samples != 0.0 && !(time > last)) {
        tell(model, OLD_TIME, message, "sample.time is %.17g s, expected more than that of the last one, %.17g s: not taken", time, last);
        return false;
    }
    if (number < before)
        tell(model, NUMBER_BACK, message, "sample.number is %.17g after %.17g, expected a greater one: taken as of a rig that began "
             "again, as its sample.time, %.17g s, is later", number, before, time);
    return true;
}

/* Whether any of the points that are seen has a covariance other than 0. */
static bool has_covariances(const double *values)
{
    for (int k = 0; k < 6 * N_FEATURES; k++)
        if (values[AT_SEEN + k / 6] != 0.0 && values[AT_COVARIANCES + k] != 0.0) return true;
    return false;
}

/* Whether all points that are seen are in range: beyond it numbers would overflow on their way to C. */
static bool are_in_range(const double *values)
{
    for (int feature = 0; feature < N_FEATURES; feature++)
        if (values[AT_SEEN + feature] != 0.0 && !are_within(FARTHEST, values + AT_POINTS + 3 * feature, 3)) return false;
    return true;
}

/* The command of a step, or none if it is out of range. */
static const double *command_of(Model *model, const double *values, double time, char *message)
{
    static const double none[3];
    if (are_within(FARTHEST, values + AT_CHASER_ACCELERATION, 3)) return values + AT_CHASER_ACCELERATION;
    tell(model, TOO_STRONG, message, "chaser.acceleration at %.17g s is not within %g m/s2: taken for none", time, FARTHEST);
    return none;
}

/* The axes of the camera by a quaternion; of one that is none, those of C. */
static void axes_of(const double quaternion[4], double R[3][3])
{
    const double square = quaternion[0] * quaternion[0] + dot(quaternion + 1, quaternion + 1);
    double q[4] = {1.0, 0.0, 0.0, 0.0};
    for (int k = 0; k < 4 && isnormal(square); k++) q[k] = quaternion[k] / sqrt(square);
    matrix_of(q, R);
}

/* The axes of the thrusters, which are fixed to the chaser as the camera is, in the middle between the last sample and this one, at a time:
   by the parabola through the rotation vectors of the last three, or halfway where there is no sample before or it was long ago. */
static void axes_between(Model *model, const double *values, double time, double axes[3][3])
{
    double now[3][3], turn[3], middle[3];
    axes_of(values + AT_CAMERA_ATTITUDE, now);
    if (model->filter.frames == 0.0) copy(now, model->axes), model->turned_in = 0.0, model->axes_at = time;
    const double span = time - model->axes_at, before = model->turned_in;
    const bool bent = before > 0.0 && span <= 2.0 * before;
    angle_between(now, model->axes, turn);
    for (int k = 0; k < 3; k++) {
        middle[k] = 0.5 * turn[k];
        if (bent) middle[k] -= 0.25 * span * (turn[k] - model->turned[k] * span / before) / (span + before);
        model->turned[k] = turn[k];
    }
    copy(model->axes, axes);
    turn_left(middle, axes);
    copy(now, model->axes);
    model->turned_in = span, model->axes_at = time;
}

/* Hand the points that are seen to the filter, in C. A point that has a covariance which is none is left out, if others have one. A
   sample without points tells of the axes of the thrusters. False if the sample is refused. */
static bool take_sample(Model *model, const double *values, char *message)
{
    long long names[N_FEATURES];
    double points[N_FEATURES][3], covariances[N_FEATURES][6], full[3][3];
    const bool own = has_covariances(values);
    int count = 0;
    if (!are_in_range(values)) return false;
    for (int feature = 0; feature < N_FEATURES; feature++) {
        if (values[AT_SEEN + feature] == 0.0) continue;
        const double *covariance = values + AT_COVARIANCES + 6 * feature;
        const double *arguments[] = {values + AT_CAMERA_ATTITUDE, values + AT_CAMERA_LEVER_ARM, values + AT_POINTS + 3 * feature, covariance};
        double *results[] = {points[count], covariances[count]};
        const bool within = are_within(FARTHEST * FARTHEST, covariance, 6);
        if (within) unit_point(arguments, results, NULL, NULL, 0);
        if (own && !(within && covariance_of(covariances[count], full)))
            tell(model, SINGULAR, message, "the covariance of point %d at %.17g s is not positive definite, or beyond %g m2: the point "
                 "is left out", feature + 1, values[AT_SAMPLE_TIME], FARTHEST * FARTHEST);
        else
            names[count++] = feature;
    }
    if (count == 0 && model->filter.frames == 0.0) return true;
    const double time = values[AT_SAMPLE_TIME] - model->started;
    double next;
    double axes[3][3];
    Manoeuvre manoeuvre;
    axes_between(model, values, time, axes);
    while (model->filter.frames > 0.0 && (next = next_point(model, model->filter.time, time)) < time) {
        manoeuvre = manoeuvre_between(model, model->filter.time, next, axes);
        advance(&model->filter, next, &manoeuvre);
    }
    manoeuvre = manoeuvre_between(model, model->filter.time, time, axes);
    if (take_frame(&model->filter, time, count, names, points[0], own ? covariances[0] : NULL, &manoeuvre) != ACCEPTED) return false;
    if (count == 0) return true;
    model->samples += 1.0, model->sighted = values[AT_SAMPLE_TIME];
    for (int k = 0; k < 3; k++) {
        model->sight[k] = 0.0;
        for (int i = 0; i < count; i++) model->sight[k] += points[i][k] / count;
    }
    if (model->filter.frames > 0.0 && model->filter.registered == time) write_quaternion(model->filter.attitude, model->attitude);
    return true;
}

/* ---- outputs ---- */

/* The upper triangle, row by row, of a block (3, 3) of a covariance whose rows have `stride` numbers. */
static void write_upper(const double *block, int stride, double *upper)
{
    for (int i = 0; i < 3; i++)
        for (int j = i; j < 3; j++) *upper++ = block[stride * i + j];
}

/* Attitude, rate and inertia at a time; zeros, and the attitude of the last sample, if no tumble is known. */
static void write_tumble(const Model *model, double *values, double time)
{
    OnlineTumble now, ahead;
    memcpy(values + AT_TARGET_ATTITUDE, model->attitude, sizeof model->attitude);
    memcpy(values + AT_PREDICTED_ATTITUDE, model->attitude, sizeof model->attitude);
    online_tumble(&model->filter, time, &now); /* all zeros if it is not known */
    online_tumble(&model->filter, time + values[AT_PREDICTION_HORIZON], &ahead);
    values[AT_TUMBLE_KNOWN] = now.known;
    if (now.known != 0.0) write_quaternion(now.R, values + AT_TARGET_ATTITUDE);
    if (now.known != 0.0) write_quaternion(ahead.known != 0.0 ? ahead.R : now.R, values + AT_PREDICTED_ATTITUDE);
    memcpy(values + AT_TARGET_ANGULAR_RATE, now.rate, sizeof now.rate);
    write_upper(now.turn[0], 3, values + AT_TARGET_ATTITUDE_COVARIANCE);
    write_upper(now.of_rate[0], 3, values + AT_TARGET_ANGULAR_RATE_COVARIANCE);
    const double inertia[6] = {now.inertia[0][0], now.inertia[1][1], now.inertia[2][2],
                               now.inertia[0][1], now.inertia[0][2], now.inertia[1][2]};
    memcpy(values + AT_TARGET_INERTIA, inertia, sizeof inertia);
}

static void write_features(const Online *filter, const Posterior *posterior, double *values)
{
    long long names[MOST_FEATURES];
    double places[MOST_FEATURES][3], covariances[MOST_FEATURES][9];
    const int known = map_of(filter, posterior, names, places[0], covariances[0]);
    memset(values + AT_BODY_FEATURES, 0, 3 * N_FEATURES * sizeof *values);
    memset(values + AT_BODY_COVARIANCES, 0, 6 * N_FEATURES * sizeof *values);
    memset(values + AT_BODY_KNOWN, 0, N_FEATURES * sizeof *values);
    for (int k = 0; k < known; k++) {
        memcpy(values + AT_BODY_FEATURES + 3 * names[k], places[k], sizeof places[k]);
        write_upper(covariances[k], 3, values + AT_BODY_COVARIANCES + 6 * names[k]);
        values[AT_BODY_KNOWN + names[k]] = 1.0;
    }
}

static void write_residuals(const Online *filter, double *values)
{
    long long names[MOST_FEATURES];
    double residuals[MOST_FEATURES][3];
    int fits[MOST_FEATURES];
    const int count = online_residuals(filter, names, residuals[0], fits);
    memset(values + AT_SIGHT_RESIDUALS, 0, 3 * N_FEATURES * sizeof *values);
    memset(values + AT_SIGHT_FITS, 0, N_FEATURES * sizeof *values);
    memset(values + AT_SIGHT_REJECTED, 0, N_FEATURES * sizeof *values);
    for (int i = 0; i < count; i++) {
        values[(fits[i] ? AT_SIGHT_FITS : AT_SIGHT_REJECTED) + names[i]] = 1.0;
        if (isfinite(residuals[i][0])) memcpy(values + AT_SIGHT_RESIDUALS + 3 * names[i], residuals[i], sizeof residuals[i]);
    }
}

/* The outputs at a time. False if the filter has no finite state there. */
static bool write_outputs(const Model *model, double *values, double time)
{
    double axes[3][3];
    OnlineState now, then;
    Ahead ahead;
    static const OnlineThrust none;
    const Online *filter = &model->filter;
    values[AT_STATUS] = WAITING;
    values[AT_SAMPLES] = model->samples;
    values[AT_SIGHT_TIME] = model->sighted;
    memcpy(values + AT_SIGHT_POSITION, model->sight, sizeof model->sight);
    write_residuals(filter, values);
    write_tumble(model, values, time);
    if (filter->frames == 0.0) return true;
    copy(model->axes, axes);
    start_ahead(filter, &ahead);
    write_features(filter, &ahead.posterior, values);
    while (ahead.time < time) {
        const double next = next_point(model, ahead.time, time);
        const Manoeuvre manoeuvre = manoeuvre_between(model, ahead.time, next, axes);
        go_ahead(filter, &ahead, next, &manoeuvre);
    }
    state_there(filter, &ahead, &now);
    manoeuvre_ahead(filter, &ahead, time + values[AT_PREDICTION_HORIZON], &none);
    state_there(filter, &ahead, &then);
    memcpy(values + AT_TARGET_POSITION, now.r, sizeof now.r);
    memcpy(values + AT_TARGET_VELOCITY, now.v, sizeof now.v);
    write_upper(now.covariance[0], 6, values + AT_TARGET_POSITION_COVARIANCE);
    write_upper(now.covariance[3] + 3, 6, values + AT_TARGET_VELOCITY_COVARIANCE);
    values[AT_STATUS] = now.status;
    values[AT_NAVIGATION_VALID] = now.status == TRACKING;
    values[AT_PROCESS_NOISE] = now.density;
    values[AT_NOISE_RATIO] = now.noise_ratio;
    values[AT_NOISE_LASTING] = now.lasting;
    values[AT_THRUST_EXECUTION] = now.execution;
    for (int k = 0; k < OF_THRUST; k++) {
        values[AT_THRUST_ERROR + k] = now.thrust[k];
        values[AT_THRUST_DEVIATION + k] = sqrt(now.of_thrust[k][k]);
    }
    memcpy(values + AT_PREDICTED_POSITION, then.r, sizeof then.r);
    write_upper(then.covariance[0], 6, values + AT_PREDICTED_POSITION_COVARIANCE);
    for (int k = AT_OUTPUTS; k < AT_OUTPUTS + N_OUTPUTS; k++)
        if (!isfinite(values[k])) return false;
    return true;
}

/* ---- the unit ---- */

/* Begin again with nothing known but what commands have done. */
static void begin_again(Model *model, double *values, double time)
{
    const OnlineOptions options = model->filter.options;
    online_start(&model->filter, &options);
    memset(values + AT_OUTPUTS, 0, N_OUTPUTS * sizeof *values);
    write_outputs(model, values, time);
}

static void model_start(Model *model, double *values, double time)
{
    OnlineOptions *options = &model->filter.options;
    const OnlineOrbit orbit = {{0.0}, values[AT_ORBIT_J2], values[AT_ORBIT_EQUATORIAL_RADIUS], 0.0};
    const double longest_gap = INFINITY; /* the end of the step bounds the time of a sample */
    *options = (OnlineOptions){values[AT_FILTER_SIGMA], values[AT_FILTER_OFFSET], values[AT_FILTER_SPEED],
                               values[AT_CAMERA_ATTITUDE_NOISE], values[AT_FILTER_THRUST], longest_gap, values[AT_ON_ORBIT], orbit};
    memcpy(options->orbit.elements, values + AT_ORBIT_SEMI_MAJOR_AXIS, sizeof options->orbit.elements); /* and those that follow */
    model->started = time;
    model->attitude[0] = 1.0;
    model->count = 1;
    begin_again(model, values, 0.0);
}

static void model_tune(Model *model, const double *values) { (void)model, (void)values; /* steps read the horizon */ }

/* Where the filter ends with numbers that are none, as on an open orbit, it begins again: a unit on board goes on. */
static bool model_step(Model *model, double *values, double time, double next, char *message)
{
    remember(model, command_of(model, values, time, message), time - model->started, next - model->started);
    if (is_due(model, values, next, message) && !take_sample(model, values, message))
        tell(model, UNUSABLE, message, "the sample at %.17g s is not within %g m in frame C and %g s: not taken",
             values[AT_SAMPLE_TIME], FARTHEST, is_oblate(&model->filter.options) ? FARTHEST_UNDER_J2 : LATEST);
    if (write_outputs(model, values, next - model->started)) return true;
    tell(model, NO_STATE, message, "the filter has no finite state at %.17g s: it begins again", next);
    begin_again(model, values, next - model->started);
    return true;
}
