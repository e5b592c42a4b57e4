/* The calls for units with continuous states: derivatives, and time and states for Model Exchange. */

#include "instance.h"

#include <math.h>
#include <string.h>

/* ---- derivatives ---- */

/* Whether all references are Reals of these kinds; if not, names the first that is not. */
static bool of_kinds(const Instance *instance, const char *function, Selection selection, unsigned kinds, const char *expected)
{
    for (size_t i = 0; i < selection.count; i++) {
        const Variable *one = variable(instance, function, selection.references[i], REAL);
        if (!one) return false;
        if (one->kind & kinds) continue;
        refuse(instance, "%s: found %s, expected %s", function, one->name, expected);
        return false;
    }
    return true;
}

/* Copy what belongs to the selected variables from an array laid out as the unit's values, one after the other. */
static void pick(const double values[N_VALUES], Selection selection, double *to)
{
    for (size_t i = 0; i < selection.count; i++) {
        const Variable *one = &VARIABLES[selection.references[i]];
        for (int k = 0; k < one->size; k++) *to++ = values[one->offset + k];
    }
}

static Status instance_derivative(void *component, const char *function, bool reverse, Selection unknowns, Selection knowns,
                                  Seed seed, Image image)
{
    Instance *instance = enter(component, GET_DERIVATIVES, function);
    if (!instance) return ERROR;
    const bool at_start = instance->core.state == INITIALIZATION;
    const Selection from = reverse ? unknowns : knowns, to = reverse ? knowns : unknowns;
    unsigned kinds;
    if (!request_fits(instance, function, REAL, from, seed.values, seed.count, &kinds)) return ERROR;
    if (!request_fits(instance, function, REAL, to, image.values, image.count, &kinds)) return ERROR;
    if (!of_kinds(instance, function, knowns, at_start ? INPUT | PARAMETER | TUNABLE : INPUT | TUNABLE | STATE,
                  at_start ? "an input or a parameter among the knowns"
                           : "an input, a tunable parameter or a state among the knowns") ||
        !of_kinds(instance, function, unknowns, at_start ? OUTPUT | STATE | DERIVATIVE : OUTPUT | DERIVATIVE,
                  at_start ? "an output, state or derivative among the unknowns" : "an output or a derivative among the unknowns"))
        return ERROR;
    if ((at_start ? initialise : check_states)(instance, function) != OK) return ERROR;

    double seeds[N_VALUES] = {0.0}, images[N_VALUES];
    for (size_t i = 0; i < from.count; i++) {
        const Variable *one = &VARIABLES[from.references[i]];
        for (int k = 0; k < one->size; k++) seeds[one->offset + k] += *seed.values++;
    }
    unit_derivative(&instance->core.unit, at_start, reverse, seeds, images);
    pick(images, to, image.values);
    return OK;
}

/* Whether all orders are 1; if not, says so. */
static bool of_first_order(const Instance *instance, const char *function, const int32_t *orders, size_t count)
{
    if (count && !orders) refuse(instance, "%s: found a null pointer, expected %zu orders", function, count);
    for (size_t i = 0; i < count && orders; i++) {
        if (orders[i] == 1) continue;
        refuse(instance, "%s: found order %d, expected 1", function, (int)orders[i]);
        return false;
    }
    return !count || orders;
}

#if FMI_VERSION == 2
/* The inputs go on at these rates until they or their rates are set again. */
static Status instance_set_input_derivatives(void *component, const char *function, Selection selection, const int32_t *orders,
                                             const double *values)
{
    Instance *instance = enter(component, SET_INPUT_DERIVATIVES, function);
    const size_t count = selection.count;
    unsigned kinds;
    if (!instance) return ERROR;
    if (instance->core.interface != FOR_CO_SIMULATION)
        return refuse(instance, "%s: the instance is for Model Exchange, expected one for Co-Simulation", function);
    if (!request_fits(instance, function, REAL, selection, values, count, &kinds)) return ERROR;
    if (!of_kinds(instance, function, selection, INPUT, "an input") || !of_first_order(instance, function, orders, count))
        return ERROR;
    for (size_t i = 0; i < count; i++)
        if (!isfinite(values[i]))
            return refuse(instance, "%s: the derivative of %s is %g, expected a finite value", function,
                          VARIABLES[selection.references[i]].name, values[i]);
    for (size_t i = 0; i < count; i++)
        unit_set_rate(&instance->core.unit, VARIABLES[selection.references[i]].offset - AT_INPUTS, values[i]);
    return OK;
}
#endif

/* Outputs change as the states do, with the inputs held: y' = (dy/dx) x'. */
static Status instance_output_derivatives(void *component, const char *function, Selection selection, const int32_t *orders,
                                          double *values, size_t n_values)
{
    Instance *instance = enter(component, GET_OUTPUT_DERIVATIVES, function);
    const size_t count = selection.count;
    unsigned kinds;
    if (!instance) return ERROR;
    if (!request_fits(instance, function, REAL, selection, values, n_values, &kinds)) return ERROR;
    if (!of_kinds(instance, function, selection, OUTPUT, "an output")) return ERROR;
    if (!of_first_order(instance, function, orders, count)) return ERROR;
    if (update(instance, function, DERIVATIVE) != OK) return ERROR;
    Unit *unit = &instance->core.unit;
    double seeds[N_VALUES] = {0.0}, images[N_VALUES];
    memcpy(seeds + AT_STATES, unit->values + AT_DERIVATIVES, N_STATES * sizeof *seeds);
    unit_derivative(unit, false, false, seeds, images);
    pick(images, selection, values);
    return OK;
}

/* ---- time and states ---- */

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
    memcpy(values, unit_nominals(&instance->core.unit), N_STATES * sizeof *values);
    return OK;
}
