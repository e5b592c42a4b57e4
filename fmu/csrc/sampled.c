#include "unit.h"

#include <string.h>

static void unit_reset(Unit *unit)
{
    memset(unit, 0, sizeof *unit);
    memcpy(unit->values, STARTS, sizeof STARTS);
}

static void unit_set(Unit *unit, int index, double value)
{
    if (unit->values[index] == value) return;
    unit->values[index] = value;
    if (index >= AT_PARAMETERS) unit->initialised = false;
}

static bool unit_check_states(Unit *unit, char message[MESSAGE_SIZE])
{
    (void)unit, (void)message;
    return true;
}

static void unit_update(Unit *unit, unsigned kinds)
{
    (void)kinds; /* outputs are those of the last step */
    unit->values[AT_TIME] = unit->time;
}

static bool unit_parameters_hold(const double parameters[N_PARAMETERS], char message[MESSAGE_SIZE])
{
    return all_hold(CHECKS, N_CHECKS, unit_margins, unit_found, parameters, message);
}

static bool unit_initialise(Unit *unit, char message[MESSAGE_SIZE])
{
    if (!unit_parameters_hold(unit->values + AT_PARAMETERS, message)) return false;
    memset(&unit->model, 0, sizeof unit->model);
    model_start(&unit->model, unit->values, unit->time);
    unit->initialised = true;
    return true;
}

static void unit_tune(Unit *unit)
{
    if (unit->initialised) return;
    model_tune(&unit->model, unit->values);
    unit->initialised = true;
}

static bool unit_advance(Unit *unit, double time, char message[MESSAGE_SIZE])
{
    if (!model_step(&unit->model, unit->values, unit->time, time, message)) return false;
    unit->time = time;
    return true;
}
