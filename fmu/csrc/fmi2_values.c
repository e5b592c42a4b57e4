/* FMI 2.0: getting and setting values. */

#include "fmi2.h"

#include <math.h>

/* The variable behind a value reference of the wanted type, or NULL, with a message. */
static const Variable *variable(const Instance *instance, const char *function, fmi2ValueReference reference, Type type)
{
    if (reference >= N_VALUES) {
        refuse(instance, "%s: found value reference %u, expected one below %d", function, reference, N_VALUES);
        return NULL;
    }
    if (VARIABLES[reference].type != type) {
        refuse(instance, "%s: %s is a %s", function, VARIABLES[reference].name, type == REAL ? "Boolean" : "Real");
        return NULL;
    }
    return &VARIABLES[reference];
}

static fmi2Status get(fmi2Component component, const char *function, Type type, const fmi2ValueReference references[],
                      size_t count, fmi2Real reals[], fmi2Boolean booleans[])
{
    Instance *instance = enter(component, GET_VALUES, function);
    if (!instance) return fmi2Error;
    if (count && (!references || !(reals || booleans)))
        return refuse(instance, "%s: found a null pointer, expected arrays of %zu", function, count);
    if (instance->state == INITIALIZATION && initialise(instance, function) != fmi2OK) return fmi2Error;
    for (size_t i = 0; i < count; i++)
        if (!variable(instance, function, references[i], type)) return fmi2Error;
    unit_update_outputs(&instance->unit);
    for (size_t i = 0; i < count; i++) {
        const double value = instance->unit.values[references[i]];
        if (reals) reals[i] = value;
        else booleans[i] = value != 0.0 ? fmi2True : fmi2False;
    }
    return fmi2OK;
}

/* Whether a variable may be set now to `value`; if not, says why. */
static bool settable(const Instance *instance, const char *function, const Variable *target, double value)
{
    if (target->kind == OUTPUT)
        refuse(instance, "%s: %s is an output and cannot be set", function, target->name);
    else if (target->kind == PARAMETER && instance->state == STEPPING)
        refuse(instance, "%s: %s is fixed after initialization", function, target->name);
    else if (!isfinite(value))
        refuse(instance, "%s: %s is %g, expected a finite value", function, target->name, value);
    else
        return true;
    return false;
}

/* All values are checked before the first is set. */
static fmi2Status set(fmi2Component component, const char *function, Type type, const fmi2ValueReference references[],
                      size_t count, const fmi2Real reals[], const fmi2Boolean booleans[])
{
    Instance *instance = enter(component, SET_VALUES, function);
    if (!instance) return fmi2Error;
    if (count && (!references || !(reals || booleans)))
        return refuse(instance, "%s: found a null pointer, expected arrays of %zu", function, count);
    for (size_t i = 0; i < count; i++) {
        const Variable *target = variable(instance, function, references[i], type);
        if (!target || !settable(instance, function, target, reals ? reals[i] : 0.0)) return fmi2Error;
    }
    for (size_t i = 0; i < count; i++)
        unit_set(&instance->unit, references[i], reals ? reals[i] : (booleans[i] ? 1.0 : 0.0));
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    return get(component, "fmi2GetReal", REAL, vr, nvr, value, NULL);
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    return get(component, "fmi2GetBoolean", BOOLEAN, vr, nvr, NULL, value);
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    return set(component, "fmi2SetReal", REAL, vr, nvr, value, NULL);
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    return set(component, "fmi2SetBoolean", BOOLEAN, vr, nvr, NULL, value);
}

/* The unit has no Integers and no Strings: only the empty request can be met. */
static fmi2Status none_of_type(fmi2Component component, Call call, const char *function, const char *type, size_t count)
{
    Instance *instance = enter(component, call, function);
    if (!instance) return fmi2Error;
    return count ? refuse(instance, "%s: the unit has no %s variables, %zu were asked for", function, type, count) : fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    (void)vr, (void)value;
    return none_of_type(component, GET_VALUES, "fmi2GetInteger", "Integer", nvr);
}

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    (void)vr, (void)value;
    return none_of_type(component, GET_VALUES, "fmi2GetString", "String", nvr);
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    (void)vr, (void)value;
    return none_of_type(component, SET_VALUES, "fmi2SetInteger", "Integer", nvr);
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    (void)vr, (void)value;
    return none_of_type(component, SET_VALUES, "fmi2SetString", "String", nvr);
}
