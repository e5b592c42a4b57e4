/* The tumbling target: its state, and how it is integrated. */

#ifndef BARYSCOPE_TARGET_H
#define BARYSCOPE_TARGET_H

#include "integrator.h"

/* The attitude (q, w, place) and the orbit (place, position, velocity) are integrated separately, each with steps of its own
   length. The place is where the target is on its orbit: the true anomaly, and with forces that change the orbit also the
   position and velocity. The attitude carries it only for torques that depend on it; then its integrator's state is in the
   axes of its series (models/target.py). */
typedef struct {
    double values[N_VALUES];
    double time;                   /* s */
    double tolerance;              /* the smaller of the parameter's and the importer's */
    double experiment_tolerance;   /* 0 for none */
    bool initialised;              /* constants, state and integrators belong to the parameters */
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
    double started;                /* time 0 of the integrators, s */
    bool outputs_current;          /* outputs belong to the state */
    bool rates_current;            /* derivatives belong to the state and the inputs */
    bool states_unchecked;         /* some were set one by one: the equations may have no value */
    bool integrators_stale;        /* state or inputs were set since the last step */
    bool ramping;                  /* some input has a rate */
    bool inputs_changing;          /* they were set right before this step, and may be again after it */
} Unit;

/* ---- what shells of units with continuous states ask for, besides what unit.h declares ---- */

/* Set all N_STATES states, or none if the equations have no value there: `message` holds the reason. */
static bool unit_set_states(Unit *unit, const double *states, char message[MESSAGE_SIZE]);

#if FMI_VERSION == 2
/* Set the time derivative of an input. */
static void unit_set_rate(Unit *unit, int index, double rate);
#endif

/* Nominal sizes of the states. */
static const double *unit_nominals(const Unit *unit);

/* Image of a seed under the Jacobian of (outputs, states, derivatives) by (inputs, parameters) at the start, or of
   (outputs, derivatives) by (inputs, tunable parameters, states) in a run; `reverse` takes its transpose. Both vectors are laid
   out as the unit's values; what is not a known or an unknown is left alone. */
static void unit_derivative(Unit *unit, bool at_start, bool reverse, const double seed[N_VALUES], double image[N_VALUES]);

#endif
