/* Stepping for Co-Simulation. */

#include "instance.h"

#include <math.h>

static Status instance_step(void *component, const char *function, double point, double step)
{
    Instance *instance = enter(component, DO_STEP, function);
    if (!instance) return ERROR;
    Unit *unit = &instance->core.unit;
    const double time = unit->time, next = point + step, stop = instance->core.stop_time;
    if (!(step > 0.0 && isfinite(step)))
        return refuse(instance, "%s: communicationStepSize is %g, expected a finite value above 0", function, step);
    if (!(fabs(point - time) <= time_slack(time, step)))
        return refuse(instance, "%s: currentCommunicationPoint is %.17g, expected %.17g", function, point, time);
    if (next > stop + time_slack(stop, step))
        return refuse(instance, "%s: the step ends at %.17g, expected at most the stop time, %.17g", function, next, stop);
    if (!(next > time))
        return refuse(instance, "%s: communicationStepSize is %g, too small to move the time %.17g", function, step, time);
    char message[MESSAGE_SIZE] = "";
    if (!unit_advance(unit, next, message)) return refuse(instance, "%s: %s", function, message);
    if (*message) remark(instance, "%s: %s", function, message);
    return OK;
}
