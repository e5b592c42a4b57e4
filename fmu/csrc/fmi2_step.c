/* FMI 2.0 Co-Simulation: stepping, and its status. */

#include "fmi2.h"

#include <math.h>

/* Communication points are computed by the importer, often by adding up: allow for its rounding. */
static double time_slack(double time) { return 1e-9 * fmax(1.0, fabs(time)); }

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real point, fmi2Real step, fmi2Boolean no_rollback)
{
    (void)no_rollback;
    Instance *instance = enter(component, DO_STEP, "fmi2DoStep");
    if (!instance) return fmi2Error;
    const double time = instance->unit.time, next = point + step;
    if (!(step > 0.0 && isfinite(step)))
        return refuse(instance, "fmi2DoStep: communicationStepSize is %g, expected a finite value above 0", step);
    if (!(fabs(point - time) <= time_slack(time)))
        return refuse(instance, "fmi2DoStep: currentCommunicationPoint is %.17g, expected %.17g", point, time);
    if (next > instance->stop_time + time_slack(instance->stop_time))
        return refuse(instance, "fmi2DoStep: the step ends at %.17g, expected at most the stop time, %.17g", next,
                      instance->stop_time);
    if (!(next > time))
        return refuse(instance, "fmi2DoStep: communicationStepSize is %g, too small to move the time %.17g", step, time);
    char message[MESSAGE_SIZE];
    if (!unit_advance(&instance->unit, next, message)) return refuse(instance, "fmi2DoStep: %s", message);
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component component)
{
    enter(component, CANCEL_STEP, "fmi2CancelStep");
    return fmi2Error;
}

/* Steps are never pending: of all the statuses only the last time and "not terminated" exist. */
static fmi2Status no_status(fmi2Component component, const char *function)
{
    return enter(component, GET_STATUS, function) ? fmi2Discard : fmi2Error;
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value)
{
    Instance *instance = enter(component, GET_STATUS, "fmi2GetRealStatus");
    if (!instance || !value) return fmi2Error;
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = instance->unit.time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value)
{
    Instance *instance = enter(component, GET_STATUS, "fmi2GetBooleanStatus");
    if (!instance || !value) return fmi2Error;
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)kind, (void)value;
    return no_status(component, "fmi2GetStatus");
}

fmi2Status fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)kind, (void)value;
    return no_status(component, "fmi2GetIntegerStatus");
}

fmi2Status fmi2GetStringStatus(fmi2Component component, const fmi2StatusKind kind, fmi2String *value)
{
    (void)kind, (void)value;
    return no_status(component, "fmi2GetStringStatus");
}
