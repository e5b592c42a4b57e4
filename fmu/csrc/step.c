/* Stepping for Co-Simulation; time and continuous states for Model Exchange. */

#include "instance.h"

#include <math.h>
#include <string.h>

/* Communication points are computed by the importer, often by adding up: allow for its rounding. */
static double time_slack(double time) { return 1e-9 * larger(1.0, fabs(time)); }

static Status instance_step(void *component, const char *function, double point, double step)
{
    Instance *instance = enter(component, DO_STEP, function);
    if (!instance) return ERROR;
    Unit *unit = &instance->core.unit;
    const double time = unit->time, next = point + step, stop = instance->core.stop_time;
    if (!(step > 0.0 && isfinite(step)))
        return refuse(instance, "%s: communicationStepSize is %g, expected a finite value above 0", function, step);
    if (!(fabs(point - time) <= time_slack(time)))
        return refuse(instance, "%s: currentCommunicationPoint is %.17g, expected %.17g", function, point, time);
    if (next > stop + time_slack(stop))
        return refuse(instance, "%s: the step ends at %.17g, expected at most the stop time, %.17g", function, next, stop);
    if (!(next > time))
        return refuse(instance, "%s: communicationStepSize is %g, too small to move the time %.17g", function, step, time);
    char message[MESSAGE_SIZE];
    return unit_advance(unit, next, message) ? OK : refuse(instance, "%s: %s", function, message);
}

static Status instance_set_time(void *component, const char *function, double time)
{
    Instance *instance = enter(component, SET_TIME, function);
    if (!instance) return ERROR;
    if (!isfinite(time)) return refuse(instance, "%s: time is %g, expected a finite time", function, time);
    instance->core.unit.time = time; /* the equations do not depend on it */
    return OK;
}

/* Whether an array of continuous states fits; if not, says so. */
static bool states_fit(const Instance *instance, const char *function, const double *values, size_t count)
{
    if (count != N_STATES) refuse(instance, "%s: found %zu values, expected %d", function, count, N_STATES);
    else if (!values) refuse(instance, "%s: found a null pointer, expected %d values", function, N_STATES);
    return count == N_STATES && values;
}

static Status instance_set_states(void *component, const char *function, const double *states, size_t count)
{
    Instance *instance = enter(component, SET_STATES, function);
    if (!instance || !states_fit(instance, function, states, count)) return ERROR;
    for (int i = 0; i < N_STATES; i++)
        if (!isfinite(states[i])) return refuse(instance, "%s: state %d is %g, expected a finite value", function, i + 1, states[i]);
    char message[MESSAGE_SIZE];
    return unit_set_states(&instance->core.unit, states, message) ? OK : refuse(instance, "%s: %s", function, message);
}

static Status instance_get_states(void *component, const char *function, unsigned kind, double *values, size_t count)
{
    Instance *instance = enter(component, GET_STATES, function);
    if (!instance || !states_fit(instance, function, values, count)) return ERROR;
    if (instance->core.state == INITIALIZATION && initialise(instance, function) != OK) return ERROR;
    if (update(instance, function, kind) != OK) return ERROR;
    const int from = kind == DERIVATIVE ? AT_DERIVATIVES : AT_STATES;
    memcpy(values, instance->core.unit.values + from, N_STATES * sizeof *values);
    return OK;
}

static Status instance_get_nominals(void *component, const char *function, double *values, size_t count)
{
    Instance *instance = enter(component, GET_STATES, function);
    if (!instance || !states_fit(instance, function, values, count)) return ERROR;
    if (instance->core.state == INITIALIZATION && initialise(instance, function) != OK) return ERROR;
    memcpy(values, instance->core.unit.scale, sizeof instance->core.unit.scale);
    return OK;
}
