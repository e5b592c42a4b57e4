/* The online estimator as one file to compile; dynamics.c is generated from baryscope.models. */
#define CASADI_SYMBOL_EXPORT static
#include "dynamics.c"
#include "whole.c"
