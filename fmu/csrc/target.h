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

#endif
