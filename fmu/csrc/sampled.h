/* A unit without continuous states: its outputs change in communication steps only.

   Its own header declares the struct `Model`, its state without pointers, and its own file defines three functions. Values are in
   the order of the table of variables: inputs at AT_INPUTS, parameters at AT_PARAMETERS, outputs at AT_OUTPUTS, and each variable
   at a constant of its name, sample.time at AT_SAMPLE_TIME. The parameters pass the checks, all inputs are finite. A step starts
   with the inputs of its beginning. */

#ifndef BARYSCOPE_SAMPLED_H
#define BARYSCOPE_SAMPLED_H

typedef struct {
    double values[N_VALUES];
    double time, tolerance, experiment_tolerance;
    bool initialised;
    Model model;
} Unit;

/* Start a run at a time in s: the model is all zeros. Writes the outputs of the start, which depend on nothing. */
static void model_start(Model *model, double *values, double time);

/* Tunable parameters have changed in mid-run. */
static void model_tune(Model *model, const double *values);

/* Step from `time` to `next`, s, and write the outputs. On failure, `message`, empty before, holds the reason, and nothing has
   changed; else it may hold which inputs were left out. */
static bool model_step(Model *model, double *values, double time, double next, char *message);

#endif
