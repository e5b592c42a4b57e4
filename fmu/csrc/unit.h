/* The tumbling target as a unit: parameters, state and outputs in one pointer-free struct.

   What depends on the number of features (sizes, names, starts, texts of the checks) is generated into tables.h, and the
   equations into model.c. FMI plays no part in this file. */

#ifndef BARYSCOPE_UNIT_H
#define BARYSCOPE_UNIT_H

#include "integrator.h"

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

#define MESSAGE_SIZE 512

/* Values in the order of the table of variables: inputs, parameters, outputs, states, derivatives, time.

   The attitude (q, w, place) and the orbit (place, position, velocity) are integrated separately, each with steps of its own
   length. The place is where the target is on its orbit: the true anomaly, and with forces that change the orbit also the
   position and velocity. The attitude carries it only for torques that depend on it; then its integrator's state is in the
   axes of its series (models/target.py). */
typedef struct {
    double values[N_VALUES];
    double constants[N_CONSTANTS];
    double series_constants[N_SERIES_CONSTANTS];
    double series_torque[3];       /* the torque input in the axes of the attitude's series, N m */
    double input_rates[N_INPUTS];  /* time derivatives of the inputs, which go on until they are set again, 1/s */
    double first_inputs[N_INPUTS]; /* at time 0 of the integrators */
    double series_torque_rate[3];  /* N m/s */
    double attitude_ramp[WIDTH];   /* the time derivative of the attitude's rates by that of the torque */
    double weights[N_WEIGHTS];     /* of the products in the rates of the free attitude */
    double scale[N_STATES];        /* nominal sizes of the states */
    Integrator attitude, orbit;
    double time;                   /* s */
    double started;                /* time 0 of the integrators, s */
    double tolerance;              /* the smaller of the parameter's and the importer's */
    double experiment_tolerance;   /* 0 for none */
    bool initialised;              /* constants, state and integrators belong to the parameters */
    bool outputs_current;          /* outputs belong to the state */
    bool rates_current;            /* derivatives belong to the state and the inputs */
    bool states_unchecked;         /* some were set one by one: the equations may have no value */
    bool integrators_stale;        /* state or inputs were set since the last step */
    bool ramping;                  /* some input has a rate */
    bool inputs_changing;          /* they were set right before this step, and may be again after it */
} Unit;

/* Back to the start values of the table. */
static void unit_reset(Unit *unit);

/* Set one value, an input, a parameter or a state. */
static void unit_set(Unit *unit, int index, double value);

/* Set all states, or none if the equations have no value there: `message` holds the reason. */
static bool unit_set_states(Unit *unit, const double states[N_STATES], char message[MESSAGE_SIZE]);

/* Whether the equations have a value at states that were set one by one. If not, `message` holds the reason. */
static bool unit_check_states(Unit *unit, char message[MESSAGE_SIZE]);

/* Bring outputs, derivatives or both up to date, by their kinds; to be called before they are read. */
static void unit_update(Unit *unit, unsigned kinds);

/* Check the parameters and compute the initial state. On failure, `message` holds the reason. */
static bool unit_initialise(Unit *unit, char message[MESSAGE_SIZE]);

/* Take over parameters that were set during a run. On failure, `message` holds the reason; the caller restores them. */
static bool unit_tune(Unit *unit, char message[MESSAGE_SIZE]);

/* Set the time derivative of an input. */
static void unit_set_rate(Unit *unit, int index, double rate);

/* Advance to `time` with the inputs held, or changing at their rates. On failure the unit is unchanged and `message` holds the
   reason. */
static bool unit_advance(Unit *unit, double time, char message[MESSAGE_SIZE]);

/* Image of a seed under the Jacobian of (outputs, states, derivatives) by (inputs, parameters) at the start, or of
   (outputs, derivatives) by (inputs, tunable parameters, states) in a run; `reverse` takes its transpose. Both vectors are laid
   out as the unit's values; what is not a known or an unknown is left alone. */
static void unit_derivative(Unit *unit, bool at_start, bool reverse, const double seed[N_VALUES], double image[N_VALUES]);

#endif
