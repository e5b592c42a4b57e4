/* A unit as FMI's shell sees it. The shell (instance.c, values.c, step.c, saved.c, *_calls.c, fmi*.c) is the same for all units;
   a unit's core defines the struct and the functions below (target.*, or sampled.* with another file).

   Sizes, names and texts of checks are generated into tables.h, and the equations into model.c; core.h, core.c and calls.c
   include the files of one unit; scenario.c has a scenario's own. FMI plays no part in this file. */

#ifndef BARYSCOPE_UNIT_H
#define BARYSCOPE_UNIT_H

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>

typedef enum { INPUT = 1, PARAMETER = 2, TUNABLE = 4, OUTPUT = 8, STATE = 16, DERIVATIVE = 32, TIME = 64 } Kind;
typedef enum { REAL, BOOLEAN } Type;

/* What a value reference stands for: a scalar, or in FMI 3 an array, of the unit's values. */
typedef struct {
    const char *name;
    Kind kind;
    Type type;
    int offset;
    int size;
    int columns; /* of an array: 1 for a vector */
} Variable;

typedef struct {
    const char *variable;
    const char *quantity;
    const char *expected;
} Check;

#include "tables.h"

/* A scenario's own. Where it is compiled by itself, all else is the same for every scenario with this tables.h and model.c. */
#ifdef SCENARIO_APART
extern const char MODEL_TOKEN[];
extern const double STARTS[N_INPUTS + N_PARAMETERS];
#else
#define SCENARIO_LINKAGE static
#include "scenario.c"
#endif

#define MESSAGE_SIZE 512

/* The unit's own struct, Unit: parameters, state and outputs without pointers, so that a copy is a saved state. It begins with

       double values[N_VALUES];     in the order of the table of variables: inputs, parameters, outputs, states, derivatives, time
       double time;                 s
       double tolerance;            of its integrators; 0 if it has none
       double experiment_tolerance; the importer's; 0 for none
       bool initialised;            what follows from the parameters is computed */
#include "core.h"

/* What two times may differ by that are meant to be the same: importers add up their communication points, which rounds; but not by
   more than a hundredth of what is between two of them, as a time far from 0, of a calendar, would allow. */
static inline double time_slack(double time, double between)
{
    return fmax(8.0 * DBL_EPSILON * fabs(time), fmin(1e-9 * fmax(1.0, fabs(time)), 0.01 * between));
}

/* Back to the start values of the table. */
static void unit_reset(Unit *unit);

/* Set one value, an input, a parameter or a state. */
static void unit_set(Unit *unit, int index, double value);

/* Whether the equations have a value at states that were set one by one. If not, `message` holds the reason. */
static bool unit_check_states(Unit *unit, char message[MESSAGE_SIZE]);

/* Bring outputs, derivatives or both up to date, by their kinds; to be called before they are read. */
static void unit_update(Unit *unit, unsigned kinds);

/* Check the parameters and compute the initial state. On failure, `message` holds the reason. */
static bool unit_initialise(Unit *unit, char message[MESSAGE_SIZE]);

/* Whether parameters pass the checks. If not, `message` holds the reason. */
static bool unit_parameters_hold(const double parameters[N_PARAMETERS], char message[MESSAGE_SIZE]);

/* Take over parameters that were set during a run and pass the checks. */
static void unit_tune(Unit *unit);

/* Advance to `time` with the inputs held, or changing at their rates. On failure the unit is unchanged and `message`, empty before,
   holds the reason; else it may hold what was left out. */
static bool unit_advance(Unit *unit, double time, char message[MESSAGE_SIZE]);

#endif
