/* The tumbling target as a unit: parameters, state and outputs in one pointer-free struct.

   What depends on the number of features (sizes, names, starts, texts of the checks) is generated into tables.h, the
   equations into model.c. Nothing here knows of FMI. */

#ifndef BARYSCOPE_UNIT_H
#define BARYSCOPE_UNIT_H

#include "flow.h"

#include <stdbool.h>
#include <stddef.h>

typedef enum { INPUT, PARAMETER, OUTPUT } Kind;
typedef enum { REAL, BOOLEAN } Type;

typedef struct {
    const char *name;
    Kind kind;
    Type type;
} Variable;

typedef struct {
    const char *variable;
    const char *quantity;
    const char *expected;
} Check;

#include "tables.h"

#define MESSAGE_SIZE 512

/* Values in the order of the table of variables: inputs, parameters, outputs.

   The attitude (q, w, true anomaly) and the orbit (true anomaly, position, velocity) flow apart, each with steps of
   its own length; the attitude carries the true anomaly for the gravity gradient only. */
typedef struct {
    double values[N_VALUES];
    double constants[N_CONSTANTS];
    double state[N_STATES];
    Flow attitude, orbit;
    double time;                /* s */
    double started;             /* when the flows were started, s */
    double tolerance;           /* the smaller of the parameter's and the importer's */
    double experiment_tolerance;
    bool initialised;           /* constants, state and flows belong to the parameters */
    bool outputs_current;       /* outputs belong to the state */
    bool inputs_changed;        /* since the last step */
    bool inputs_busy;           /* they had changed before the last step, too */
} Unit;

static inline double *unit_inputs(Unit *unit) { return unit->values; }
static inline double *unit_parameters(Unit *unit) { return unit->values + N_INPUTS; }
static inline double *unit_outputs(Unit *unit) { return unit->values + N_INPUTS + N_PARAMETERS; }

/* Back to the start values of the table. */
static void unit_reset(Unit *unit);

/* Set one value, an input or a parameter. */
static void unit_set(Unit *unit, unsigned index, double value);

/* Check the parameters and make the initial state. On failure says why in `message`. */
static bool unit_initialise(Unit *unit, char message[MESSAGE_SIZE]);

/* Go to `time` with the inputs held. On failure the unit is as before and `message` says why. */
static bool unit_advance(Unit *unit, double time, char message[MESSAGE_SIZE]);

/* Bring the outputs up to the state. */
static void unit_update_outputs(Unit *unit);

#endif
