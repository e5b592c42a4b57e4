/* Getting and setting values, and their derivatives, by value references. */

#include "instance.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#if FMI_VERSION == 3
#define REAL_NAME "Float64"
#else
#define REAL_NAME "Real"
#endif

static const char *type_name(Type type) { return type == REAL ? REAL_NAME : "Boolean"; }

/* The variable behind a value reference of the wanted type, or NULL, with a message. */
static const Variable *variable(const Instance *instance, const char *function, uint32_t reference, Type type)
{
    if (reference >= N_REFERENCES) {
        refuse(instance, "%s: found value reference %u, expected one below %d", function, (unsigned)reference, N_REFERENCES);
        return NULL;
    }
    if (VARIABLES[reference].type != type) {
        refuse(instance, "%s: %s is a %s", function, VARIABLES[reference].name, type_name(VARIABLES[reference].type));
        return NULL;
    }
    return &VARIABLES[reference];
}

/* Whether the references are of this type and have `n_values` values; collects their kinds. */
static bool request_fits(const Instance *instance, const char *function, Type type, Selection selection, const void *values,
                         size_t n_values, unsigned *kinds)
{
    const size_t count = selection.count;
    size_t size = 0;
    *kinds = 0;
    if ((count && !selection.references) || (n_values && !values)) {
        refuse(instance, "%s: found a null pointer, expected arrays for %zu variables", function, count);
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        const Variable *one = variable(instance, function, selection.references[i], type);
        if (!one) return false;
        size += (size_t)one->size;
        *kinds |= one->kind;
    }
    if (size != n_values) refuse(instance, "%s: found room for %zu values, expected %zu", function, n_values, size);
    return size == n_values;
}

static Status instance_get(void *component, const char *function, Type type, Selection selection, void *values, size_t n_values)
{
    Instance *instance = enter(component, GET_VALUES, function);
    unsigned kinds;
    if (!instance) return ERROR;
    if (!request_fits(instance, function, type, selection, values, n_values, &kinds)) return ERROR;
    if (instance->core.state == INSTANTIATED && kinds & ~(unsigned)(INPUT | PARAMETER | TUNABLE | STATE))
        return refuse(instance, "%s: in state Instantiated only inputs, parameters and states can be read", function);
    const bool computed = instance->core.state == INITIALIZATION || (instance->core.state == INSTANTIATED && kinds & STATE);
    if (computed && initialise(instance, function) != OK) return ERROR;
    if (update(instance, function, kinds) != OK) return ERROR;
    const Unit *unit = &instance->core.unit;
    double *real = values;
    bool *boolean = values;
    for (size_t i = 0; i < selection.count; i++) {
        const Variable *one = &VARIABLES[selection.references[i]];
        if (type == BOOLEAN) *boolean++ = unit->values[one->offset] != 0.0;
        else
            for (int k = 0; k < one->size; k++) *real++ = unit->values[one->offset + k];
    }
    return OK;
}

/* ---- setting ---- */

/* Whether a variable has these values already. */
static bool has_values(const Instance *instance, const Variable *one, const double *real, const bool *boolean)
{
    const double *present = instance->core.unit.values + one->offset;
    for (int k = 0; k < one->size; k++)
        if (present[k] != (one->type == REAL ? real[k] : (double)boolean[k])) return false;
    return true;
}

/* Whether a variable of this kind may be set now; if not, says why. Some importers set parameters whenever they set inputs:
   what stays as it is may be set in every state. */
static bool settable(const Instance *instance, const char *function, const Variable *one, const double *real, const bool *boolean)
{
    const unsigned state = instance->core.state;
    if (one->kind & (PARAMETER | TUNABLE) && has_values(instance, one, real, boolean)) return true;
    const bool early = state & (INSTANTIATED | INITIALIZATION);
    if (one->kind & (OUTPUT | DERIVATIVE | TIME))
        refuse(instance, "%s: %s is calculated and cannot be set", function, one->name);
    else if (one->kind == PARAMETER && !early)
        refuse(instance, "%s: %s is fixed after initialization", function, one->name);
    else if (one->kind == TUNABLE && state == CONTINUOUS)
        refuse(instance, "%s: %s can be tuned in Event Mode only", function, one->name);
    else if (one->kind == STATE && !(state & (INSTANTIATED | EVENT | CONTINUOUS)))
        refuse(instance, "%s: %s is a state, which can be set before initialization, as a guess, and in Model Exchange after it",
               function, one->name);
    else
        return true;
    return false;
}

/* Refuse a value of a variable or of an array's element, which is named as in FMI 2. */
static void refuse_value(const Instance *instance, const char *function, const Variable *one, int k, double value)
{
    char element[32] = "";
    const int row = k / one->columns + 1, column = k % one->columns + 1;
    if (one->columns > 1) snprintf(element, sizeof element, "[%d,%d]", row, column);
    else if (one->size > 1) snprintf(element, sizeof element, "[%d]", row);
    refuse(instance, "%s: %s%s is %g, expected a finite value", function, one->name, element, value);
}

static bool finite_values(const Instance *instance, const char *function, const Variable *one, const double *values)
{
    for (int k = 0; k < one->size; k++) {
        if (isfinite(values[k])) continue;
        refuse_value(instance, function, one, k, values[k]);
        return false;
    }
    return true;
}

/* Take over tuned parameters, or restore all values that this call has set. */
static Status tune(Instance *instance, const char *function, const Unit *former)
{
    char message[MESSAGE_SIZE];
    if (unit_tune(&instance->core.unit, message)) return OK;
    memcpy(&instance->core.unit, former, sizeof *former);
    return refuse(instance, "%s: %s", function, message);
}

/* All values are checked before the first one is set. */
static Status instance_set(void *component, const char *function, Type type, Selection selection, const void *values,
                           size_t n_values)
{
    Instance *instance = enter(component, SET_VALUES, function);
    unsigned kinds;
    if (!instance) return ERROR;
    if (!request_fits(instance, function, type, selection, values, n_values, &kinds)) return ERROR;
    const double *real = values;
    const bool *boolean = values;
    for (size_t i = 0; i < selection.count; i++) {
        const Variable *one = &VARIABLES[selection.references[i]];
        if (!settable(instance, function, one, real, boolean)) return ERROR;
        if (type == REAL && !finite_values(instance, function, one, real)) return ERROR;
        if (type == REAL) real += one->size;
        else boolean += one->size;
    }
    Unit *unit = &instance->core.unit;
    const bool tuning = kinds & TUNABLE && !(instance->core.state & (INSTANTIATED | INITIALIZATION));
    Unit former;
    if (tuning) memcpy(&former, unit, sizeof former);
    real = values, boolean = values;
    for (size_t i = 0; i < selection.count; i++) {
        const Variable *one = &VARIABLES[selection.references[i]];
        const bool guess = one->kind == STATE && instance->core.state == INSTANTIATED; /* the parameters tell the states */
        for (int k = 0; k < one->size; k++) {
            const double value = type == REAL ? *real++ : (double)*boolean++;
            if (!guess) unit_set(unit, one->offset + k, value);
        }
    }
    return tuning ? tune(instance, function, &former) : OK;
}

static Status instance_none(void *component, Call call, const char *function, const char *type, size_t count)
{
    Instance *instance = enter(component, call, function);
    if (!instance) return ERROR;
    return count ? refuse(instance, "%s: the unit has no %s variables, %zu were asked for", function, type, count) : OK;
}

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

/* Outputs change as the states do, with the inputs held: ẏ = ∂y/∂x ẋ. */
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
