#include "unit.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

void unit_reset(Unit *unit)
{
    memset(unit, 0, sizeof *unit);
    memcpy(unit->values, STARTS, sizeof STARTS);
}

/* The first parameter check that does not hold, or N_CHECKS. */
static int failing_check(Unit *unit, double found[N_CHECKS])
{
    double margins[N_CHECKS];
    const double *arguments[] = {unit_parameters(unit)};
    double *to_margins[] = {margins}, *to_found[] = {found};
    target_margins(arguments, to_margins, NULL, NULL, 0);
    target_found(arguments, to_found, NULL, NULL, 0);
    int i = 0;
    while (i < N_CHECKS && margins[i] > 0.0) i++;
    return i;
}

bool unit_initialise(Unit *unit, char message[MESSAGE_SIZE])
{
    double found[N_CHECKS];
    const int failed = failing_check(unit, found);
    if (failed < N_CHECKS) {
        const Check *check = &CHECKS[failed];
        snprintf(message, MESSAGE_SIZE, "%s: found %s %g, expected %s", check->variable, check->quantity,
                 found[failed], check->expected);
        return false;
    }
    const double *arguments[] = {unit_parameters(unit)};
    double *to_state[] = {unit->state}, *to_scale[] = {unit->scale};
    target_initial(arguments, to_state, NULL, NULL, 0);
    target_nominals(arguments, to_scale, NULL, NULL, 0);

    const double tolerance = unit_parameters(unit)[PARAMETER_TOLERANCE];
    unit->tolerance = unit->experiment_tolerance > 0.0 ? fmin(tolerance, unit->experiment_tolerance) : tolerance;
    unit->step = 0.0;
    unit->initialised = true;
    unit->outputs_current = false;
    return true;
}

bool unit_advance(Unit *unit, double time, char message[MESSAGE_SIZE])
{
    const Unit before = *unit;
    const char *trouble = dop853_advance(unit, time - unit->time);
    if (trouble) {
        *unit = before;
        snprintf(message, MESSAGE_SIZE, "integration from %.17g s to %.17g s failed: %s", unit->time, time, trouble);
        return false;
    }
    unit->time = time;
    unit->outputs_current = false;
    return true;
}

void unit_update_outputs(Unit *unit)
{
    if (unit->outputs_current) return;
    const double *arguments[] = {unit->state, unit_parameters(unit)};
    double *results[] = {unit_outputs(unit)};
    target_outputs(arguments, results, NULL, NULL, 0);
    unit->outputs_current = true;
}
