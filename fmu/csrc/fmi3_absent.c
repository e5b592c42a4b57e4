/* The functions of FMI 3.0 for features that the unit neither has nor declares: variables of other types, Clocks,
   structural parameters, discrete states, Scheduled Execution, Event Mode in Co-Simulation. The library must still export
   them. They are refused, except for empty requests. */

#include "instance.h"

/* ---- variables of other types ---- */

static fmi3Status none(fmi3Instance c, Call call, const char *function, const char *type, size_t count, size_t n_values)
{
    return (fmi3Status)instance_none(c, call, function, type, count > n_values ? count : n_values);
}

#define NO_VARIABLES(TYPE)                                                                                          \
    fmi3Status fmi3Get##TYPE(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, fmi3##TYPE values[],         \
                             size_t n)                                                                               \
    {                                                                                                                \
        (void)vr, (void)values;                                                                                      \
        return none(c, GET_VALUES, "fmi3Get" #TYPE, #TYPE, nvr, n);                                                  \
    }                                                                                                                \
    fmi3Status fmi3Set##TYPE(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3##TYPE values[],   \
                             size_t n)                                                                               \
    {                                                                                                                \
        (void)vr, (void)values;                                                                                      \
        return none(c, SET_VALUES, "fmi3Set" #TYPE, #TYPE, nvr, n);                                                  \
    }

NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(String)

#undef NO_VARIABLES

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, size_t sizes[], fmi3Binary values[], size_t n)
{
    (void)vr, (void)sizes, (void)values;
    return none(c, GET_VALUES, "fmi3GetBinary", "Binary", nvr, n);
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const size_t sizes[],
                         const fmi3Binary values[], size_t n)
{
    (void)vr, (void)sizes, (void)values;
    return none(c, SET_VALUES, "fmi3SetBinary", "Binary", nvr, n);
}

/* ---- Clocks ---- */

static fmi3Status no_clock(fmi3Instance c, const char *function, size_t count) { return none(c, ASK, function, "Clock", count, 0); }

fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, fmi3Clock values[])
{
    (void)vr, (void)values;
    return no_clock(c, "fmi3GetClock", nvr);
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3Clock values[])
{
    (void)vr, (void)values;
    return no_clock(c, "fmi3SetClock", nvr);
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[])
{
    (void)vr, (void)intervals, (void)qualifiers;
    return no_clock(c, "fmi3GetIntervalDecimal", nvr);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
{
    (void)vr, (void)counters, (void)resolutions, (void)qualifiers;
    return no_clock(c, "fmi3GetIntervalFraction", nvr);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3Float64 intervals[])
{
    (void)vr, (void)intervals;
    return no_clock(c, "fmi3SetIntervalDecimal", nvr);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3UInt64 counters[],
                                   const fmi3UInt64 resolutions[])
{
    (void)vr, (void)counters, (void)resolutions;
    return no_clock(c, "fmi3SetIntervalFraction", nvr);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, fmi3Float64 shifts[])
{
    (void)vr, (void)shifts;
    return no_clock(c, "fmi3GetShiftDecimal", nvr);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[])
{
    (void)vr, (void)counters, (void)resolutions;
    return no_clock(c, "fmi3GetShiftFraction", nvr);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3Float64 shifts[])
{
    (void)vr, (void)shifts;
    return no_clock(c, "fmi3SetShiftDecimal", nvr);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t nvr, const fmi3UInt64 counters[],
                                const fmi3UInt64 resolutions[])
{
    (void)vr, (void)counters, (void)resolutions;
    return no_clock(c, "fmi3SetShiftFraction", nvr);
}

/* ---- modes, dependencies and Scheduled Execution ---- */

static fmi3Status absent(fmi3Instance c, const char *function, const char *reason)
{
    Instance *instance = enter(c, ASK, function);
    return instance ? (fmi3Status)refuse(instance, "%s: %s", function, reason) : fmi3Error;
}

static const char NO_STRUCTURE[] = "the unit has no structural parameters";
static const char NO_ELEMENTS[] = "not provided (providesPerElementDependencies is false), see modelDescription.xml";

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) { return absent(c, "fmi3EnterConfigurationMode", NO_STRUCTURE); }
fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) { return absent(c, "fmi3ExitConfigurationMode", NO_STRUCTURE); }

fmi3Status fmi3EnterStepMode(fmi3Instance c)
{
    return absent(c, "fmi3EnterStepMode", "the unit has no Event Mode to come from (hasEventMode is false)");
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c)
{
    return absent(c, "fmi3EvaluateDiscreteStates", "the unit has no discrete states (providesEvaluateDiscreteStates is false)");
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t *count)
{
    (void)vr, (void)count;
    return absent(c, "fmi3GetNumberOfVariableDependencies", NO_ELEMENTS);
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent, size_t elements[],
                                       fmi3ValueReference independents[], size_t elements_of_independents[],
                                       fmi3DependencyKind kinds[], size_t count)
{
    (void)dependent, (void)elements, (void)independents, (void)elements_of_independents, (void)kinds, (void)count;
    return absent(c, "fmi3GetVariableDependencies", NO_ELEMENTS);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time)
{
    (void)clock, (void)time;
    return absent(c, "fmi3ActivateModelPartition", "the unit is not for Scheduled Execution");
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                               fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                               fmi3LogMessageCallback logger, fmi3ClockUpdateCallback update,
                                               fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)update, (void)lock, (void)unlock;
    if (logger)
        logger(environment, fmi3Error, "logStatusError",
               "instantiation: Scheduled Execution was asked for, expected Co-Simulation or Model Exchange");
    return NULL;
}
