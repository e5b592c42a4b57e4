/* The tumbling target as a unit: parameters, state and outputs in one pointer-free struct.

   What depends on the number of features (sizes, names, starts, texts of the checks, the integrator's
   coefficients) is generated into tables.h, the equations into model.c. Nothing here knows of FMI. */

#ifndef BARYSCOPE_UNIT_H
#define BARYSCOPE_UNIT_H

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

/* Values in the order of the table of variables: inputs, parameters, outputs. */
typedef struct {
    double values[N_VALUES];
    double state[N_STATES];
    double scale[N_STATES];   /* sizes of the states that a relative tolerance refers to */
    double time;              /* s */
    double tolerance;         /* the smaller of the parameter's and the importer's */
    double experiment_tolerance;
    double step;              /* the integrator's next step, s; 0 when it has to be guessed */
    bool initialised;         /* state and scale belong to the parameters */
    bool outputs_current;     /* outputs belong to the state */
} Unit;

static inline double *unit_inputs(Unit *unit) { return unit->values; }
static inline double *unit_parameters(Unit *unit) { return unit->values + N_INPUTS; }
static inline double *unit_outputs(Unit *unit) { return unit->values + N_INPUTS + N_PARAMETERS; }

/* Back to the start values of the table. */
void unit_reset(Unit *unit);

/* Check the parameters and make the initial state. On failure says why in `message`. */
bool unit_initialise(Unit *unit, char message[MESSAGE_SIZE]);

/* Integrate to `time` with the inputs held. On failure the unit is as before and `message` says why. */
bool unit_advance(Unit *unit, double time, char message[MESSAGE_SIZE]);

/* Bring the outputs up to the state. */
void unit_update_outputs(Unit *unit);

#endif
