/* The calls for derivatives, time and states, which sampled units refuse. */

#include "instance.h"

/* Refuse a call for what only a unit with continuous states has. */
static Status no_states(void *component, Call call, const char *function)
{
    Instance *instance = enter(component, call, function);
    return instance ? refuse(instance, "%s: the unit is sampled: it has no states and no derivatives", function) : ERROR;
}

static Status instance_derivative(void *component, const char *function, bool reverse, Selection unknowns, Selection knowns,
                                  Seed seed, Image image)
{
    (void)reverse, (void)unknowns, (void)knowns, (void)seed, (void)image;
    return no_states(component, GET_DERIVATIVES, function);
}

#if FMI_VERSION == 2
static Status instance_set_input_derivatives(void *component, const char *function, Selection selection, const int32_t *orders,
                                             const double *values)
{
    (void)selection, (void)orders, (void)values;
    return no_states(component, SET_INPUT_DERIVATIVES, function);
}
#endif

static Status instance_output_derivatives(void *component, const char *function, Selection selection, const int32_t *orders,
                                          double *values, size_t n_values)
{
    (void)selection, (void)orders, (void)values, (void)n_values;
    return no_states(component, GET_OUTPUT_DERIVATIVES, function);
}

static Status instance_set_time(void *component, const char *function, double time)
{
    (void)time;
    return no_states(component, SET_TIME, function);
}

static Status instance_set_states(void *component, const char *function, const double *states, size_t count)
{
    (void)states, (void)count;
    return no_states(component, SET_STATES, function);
}

static Status instance_get_states(void *component, const char *function, unsigned kind, double *values, size_t count)
{
    (void)kind, (void)values, (void)count;
    return no_states(component, GET_STATES, function);
}

static Status instance_get_nominals(void *component, const char *function, double *values, size_t count)
{
    (void)values, (void)count;
    return no_states(component, GET_STATES, function);
}
