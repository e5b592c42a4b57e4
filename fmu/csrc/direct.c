#include "unit.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void model_start(Model *model, double *values, double time)
{
    memset(values + AT_OUTPUTS, 0, N_OUTPUTS * sizeof *values);
    model->started = time;
}

static void model_tune(Model *model, const double *values) { (void)model, (void)values; /* steps read the parameters */ }

static bool model_step(Model *model, double *values, double time, double next, char *message)
{
    double outputs[N_OUTPUTS], keep[N_KEPT];
    const double step[2] = {time - model->started, next - time};
    const double *arguments[] = {step, model->kept, values + AT_INPUTS, values + AT_PARAMETERS};
    double *results[] = {outputs, keep};
    unit_outputs(arguments, results, NULL, NULL, 0);
    for (int i = 0; i < N_OUTPUTS; i++) {
        if (isfinite(outputs[i])) continue;
        snprintf(message, MESSAGE_SIZE, "at %.17g s the inputs give no finite outputs: a vector without length, or out of bounds", time);
        return false;
    }
    memcpy(values + AT_OUTPUTS, outputs, sizeof outputs);
    memcpy(model->kept, keep, sizeof keep);
    return true;
}
