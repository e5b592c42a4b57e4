#include "unit.h"

#include "philox.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define LARGEST_NUMBER 9e15 /* of a sample: whole numbers up to here are exact */

static void model_start(Model *model, double *values, double time)
{
    memset(values + AT_OUTPUTS, 0, N_OUTPUTS * sizeof *values);
    values[AT_CAMERA_MEASURED_ATTITUDE] = 1.0;
    values[AT_SAMPLE_TIME] = time;
    model->started = time;
}

static void model_tune(Model *model, const double *values) { (void)model, (void)values; /* samples read the parameters */ }

/* ---- one sample ---- */

/* Whether any of some inputs is not zero, as all are in the first step of some masters. */
static bool is_set(const double *values, int size)
{
    for (int i = 0; i < size; i++)
        if (values[i] != 0.0) return true;
    return false;
}

static bool all_finite(const double *values, int count)
{
    for (int i = 0; i < count; i++)
        if (!isfinite(values[i])) return false;
    return true;
}

/* Write the outputs of one feature, unless it is not seen, as one beyond all numbers is not: then they stay 0. */
static void sight(const double *values, const double *attitude, uint64_t number, int feature, double *outputs)
{
    double draws[3][4];
    const uint64_t seed = (uint64_t)values[AT_SEED], purposes[3] = {DRAW_NOISE, DRAW_FATE, DRAW_BLUNDER};
    for (int i = 0; i < 3; i++) uniform_draws(seed, purposes[i], number, (uint64_t)feature, draws[i]);
    double pixels[3], point[3], covariance[6], seen;
    const double *arguments[] = {values + AT_FEATURES + 3 * feature, values + AT_NORMALS + 3 * feature, attitude,
                                 values + AT_PARAMETERS, draws[0], draws[1], draws[2]};
    double *results[] = {pixels, point, covariance, &seen};
    rig_sight(arguments, results, NULL, NULL, 0);
    if (seen != 1.0 || !all_finite(pixels, 3) || !all_finite(point, 3) || !all_finite(covariance, 6)) return;
    memcpy(outputs + AT_PIXELS - AT_OUTPUTS + 3 * feature, pixels, sizeof pixels);
    memcpy(outputs + AT_POINTS - AT_OUTPUTS + 3 * feature, point, sizeof point);
    memcpy(outputs + AT_COVARIANCES - AT_OUTPUTS + 6 * feature, covariance, sizeof covariance);
    outputs[AT_SEEN - AT_OUTPUTS + feature] = 1.0;
}

/* Take a sample of inputs that are of some time. */
static void take_sample(const double *values, double number, double time, Sample *sample)
{
    memset(sample->outputs, 0, sizeof sample->outputs);
    sample->outputs[AT_SAMPLE_TIME - AT_OUTPUTS] = time;
    sample->outputs[AT_SAMPLE_NUMBER - AT_OUTPUTS] = number + 1.0;
    double uniform[4], lit;
    const double *attitude = values + AT_CAMERA_ATTITUDE;
    if (!is_set(attitude, 4)) { /* it looks nowhere */
        sample->outputs[AT_CAMERA_MEASURED_ATTITUDE - AT_OUTPUTS] = 1.0;
        return;
    }
    uniform_draws((uint64_t)values[AT_SEED], DRAW_ATTITUDE, (uint64_t)number, 0, uniform);
    const double *of_attitude[] = {attitude, values + AT_PARAMETERS, uniform};
    double *to_attitude[] = {sample->outputs + AT_CAMERA_MEASURED_ATTITUDE - AT_OUTPUTS}, *to_lit[] = {&lit};
    rig_attitude(of_attitude, to_attitude, NULL, NULL, 0);
    const double *of_light[] = {values + AT_ORBIT_POSITION, values + AT_SUN_DIRECTION, values + AT_SUN_SHADOW_RADIUS};
    rig_light(of_light, to_lit, NULL, NULL, 0);
    if (lit != 1.0) return;
    for (int feature = 0; feature < N_FEATURES; feature++) sight(values, attitude, (uint64_t)number, feature, sample->outputs);
}

/* ---- steps ---- */

/* Whether a vector of the inputs has a length that the equations can use; if not, `message` says so. */
static bool has_direction(const double *vector, int size, const char *name, char *message)
{
    double square = 0.0;
    for (int i = 0; i < size; i++) square += vector[i] * vector[i];
    if (square > 1e-100 && square < 1e100) return true;
    snprintf(message, MESSAGE_SIZE, "%s: found length %g, expected a direction", name, sqrt(square));
    return false;
}

/* Show the newest of the samples whose latency is over. */
static void show_samples(Model *model, double *values, double time)
{
    int out = 0;
    while (out < model->waiting && model->samples[out].time + values[AT_SAMPLING_LATENCY] <= time) out++;
    if (out == 0) return;
    memcpy(values + AT_OUTPUTS, model->samples[out - 1].outputs, N_OUTPUTS * sizeof *values);
    model->waiting -= out;
    memmove(model->samples, model->samples + out, (size_t)model->waiting * sizeof *model->samples);
}

/* Samples at or after `time` and before `next` are taken, with the inputs of the step's beginning, whose time they bear. Of those
   that would be out at its end only the newest is: the draws of the others are not missed. */
static bool model_step(Model *model, double *values, double time, double next, char *message)
{
    const double period = values[AT_SAMPLING_PERIOD], slack = time_slack(next, fmin(period, next - time)), started = model->started;
    const double last = ceil((next - slack - started) / period) - 1.0;
    if (is_set(values + AT_CAMERA_ATTITUDE, 4) && !has_direction(values + AT_CAMERA_ATTITUDE, 4, "camera.attitude", message)) return false;
    if (!has_direction(values + AT_SUN_DIRECTION, 3, "sun.direction", message)) return false;
    if (!(last < LARGEST_NUMBER)) {
        snprintf(message, MESSAGE_SIZE, "sampling.period: found %g s, expected a longer one at a time of %g s", period, next);
        return false;
    }
    show_samples(model, values, next + slack);
    const double newest_out = floor((next + slack - values[AT_SAMPLING_LATENCY] - started) / period);
    for (double number = fmax(model->next, fmin(newest_out, last)); number <= last; number += 1.0) {
        Sample *sample = &model->samples[model->waiting++];
        sample->time = started + number * period;
        take_sample(values, number, sample->time - time > slack ? time : sample->time, sample);
    }
    model->next = fmax(model->next, last + 1.0);
    show_samples(model, values, next + slack);
    return true;
}
