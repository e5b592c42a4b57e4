/* Getting and setting values by value references. */

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
        for (int k = 0; k < one->size; k++) {
            if (type == BOOLEAN) *boolean++ = unit->values[one->offset + k] != 0.0;
            else *real++ = unit->values[one->offset + k];
        }
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

static double value_at(Type type, const void *values, size_t place)
{
    return type == REAL ? ((const double *)values)[place] : (double)((const bool *)values)[place];
}

/* Whether the parameters, with those that are about to be set, pass the checks; if not, says why. */
static bool tunable(const Instance *instance, const char *function, Type type, Selection selection, const void *values)
{
    double tuned[N_PARAMETERS];
    char message[MESSAGE_SIZE];
    size_t place = 0;
    memcpy(tuned, instance->core.unit.values + AT_PARAMETERS, sizeof tuned);
    for (size_t i = 0; i < selection.count; i++) {
        const Variable *one = &VARIABLES[selection.references[i]];
        for (int k = 0; k < one->size; k++, place++)
            if (one->kind & (PARAMETER | TUNABLE)) tuned[one->offset + k - AT_PARAMETERS] = value_at(type, values, place);
    }
    if (unit_parameters_hold(tuned, message)) return true;
    refuse(instance, "%s: %s", function, message);
    return false;
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
    if (tuning && !tunable(instance, function, type, selection, values)) return ERROR;
    size_t place = 0;
    for (size_t i = 0; i < selection.count; i++) {
        const Variable *one = &VARIABLES[selection.references[i]];
        const bool guess = one->kind == STATE && instance->core.state == INSTANTIATED; /* the parameters tell the states */
        for (int k = 0; k < one->size; k++, place++)
            if (!guess) unit_set(unit, one->offset + k, value_at(type, values, place));
    }
    if (tuning) unit_tune(unit);
    return OK;
}

static Status instance_none(void *component, Call call, const char *function, const char *type, size_t count)
{
    Instance *instance = enter(component, call, function);
    if (!instance) return ERROR;
    return count ? refuse(instance, "%s: the unit has no %s variables, %zu were asked for", function, type, count) : OK;
}
