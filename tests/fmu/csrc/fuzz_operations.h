/* What fuzz_harness.c does: each operation makes one call, or a few, on a slot and judges what comes back. */

/* ---- life cycle ---- */

static void release(Slot *slot)
{
    for (int i = 0; i < SAVES; i++) {
        if (slot->saved[i]) TRY(slot, LEGAL, call_forget(slot->instance, &slot->saved[i]));
        if (slot->saved[i]) stop("free state", "the pointer is left");
    }
    CALL(FreeInstance)(slot->instance);
    slot->instance = NULL;
}

static void replace(Slot *slot)
{
    if (slot->instance) release(slot);
    while (!slot->instance) {
        scarce = one_in(3);
        const bool bad_name = one_in(8), bad_token = one_in(8);
        const Interface kind = one_in(2) ? FOR_CO_SIMULATION : FOR_MODEL_EXCHANGE;
        slot->instance = call_instantiate(bad_name ? (one_in(2) ? NULL : "") : one_in(3) ? "%s%n a name" : "x", kind,
                                          bad_token ? (one_in(2) ? NULL : "{no}") : MODEL_TOKEN, !one_in(5));
        calls++;
        if (slot->instance && (bad_name || bad_token)) stop("instantiate", "illegal, but accepted");
        if (!slot->instance && !bad_name && !bad_token && !scarce) stop("instantiate", "legal, but refused");
        scarce = false;
    }
}

static void outputs_of(Instance *instance, double *outputs)
{
    unit_update(&instance->core.unit, OUTPUT);
    memcpy(outputs, instance->core.unit.values + AT_OUTPUTS, N_OUTPUTS * sizeof *outputs);
}

/* From Instantiated through one and a half seconds of a run; the outputs then. */
static void ordinary_run(Instance *c, double *outputs)
{
    const bool stepping = c->core.interface == FOR_CO_SIMULATION;
    int status = 0;
    if (!ARRAYS) status |= (int)call_setup(c, 0, 0.0, 0.0, 0, 0.0);
    status |= (int)call_enter(c, 0, 0.0, 0.0, 0, 0.0);
    status |= (int)CALL(ExitInitializationMode)(c);
    if (stepping) status |= (int)call_step(c, 0.0, 1.0) | (int)call_step(c, 1.0, 0.5);
    else status |= (int)call_discrete(c, false) | (int)CALL(EnterContinuousTimeMode)(c);
    if (status != OK) stop("an ordinary run", "refused");
    calls += 5;
    outputs_of(c, outputs);
}

static void fresh_outputs(Interface kind, double *outputs)
{
    void *instance = call_instantiate("fresh", kind, MODEL_TOKEN, false);
    ordinary_run(instance, outputs);
    CALL(FreeInstance)(instance);
}

/* Whatever has happened: after a reset the instance is as good as new. */
static void rerun(Slot *slot)
{
    if (!one_in(20)) return;
    double outputs[N_OUTPUTS];
    TRY(slot, LEGAL, CALL(Reset)(slot->instance));
    ordinary_run(slot->instance, outputs);
    if (memcmp(outputs, reference_outputs[slot->instance->core.interface], sizeof outputs) != 0)
        stop("after a reset", "the outputs are not those of a new instance");
}

static void renew(Slot *slot)
{
    if (one_in(30)) replace(slot);
}

static void reset(Slot *slot)
{
    if (one_in(3)) TRY(slot, LEGAL, CALL(Reset)(slot->instance));
}

static void setup(Slot *slot)
{
    const bool tolerance_defined = one_in(2), stop_defined = one_in(2);
    const double tolerance = one_in(6) ? any_number() : pow(10.0, -3.0 - 10.0 * uniform());
    const double start = one_in(6) ? any_number() : uniform(), end = one_in(6) ? any_number() : start + 1e3 * uniform();
    const bool good = isfinite(start) && !(tolerance_defined && !(tolerance > 0.0 && isfinite(tolerance))) &&
                      !(stop_defined && !(end >= start));
    if (!ARRAYS)
        TRY(slot, both(in(slot, INSTANTIATED) ? LEGAL : ILLEGAL, good),
            call_setup(slot->instance, tolerance_defined, tolerance, start, stop_defined, end));
    TRY(slot, both(in(slot, INSTANTIATED) ? LEGAL : ILLEGAL, good || !ARRAYS),
        call_enter(slot->instance, tolerance_defined, tolerance, start, stop_defined, end));
}

static void exit_initialization(Slot *slot)
{
    TRY(slot, in(slot, INITIALIZATION) ? OPEN : ILLEGAL, CALL(ExitInitializationMode)(slot->instance));
}

static void terminate(Slot *slot)
{
    if (one_in(8)) TRY(slot, in(slot, RUN_MODES) ? LEGAL : ILLEGAL, CALL(Terminate)(slot->instance));
}

static void set_logging(Slot *slot)
{
    static const char *const names[] = {"logStatusError", "logStatusWarning", "logEvents", "logAll", NULL};
    const char *chosen[3];
    const size_t count = below(4);
    bool good = true;
    for (size_t i = 0; i < count; i++) {
        const unsigned which = one_in(4) ? 3 + below(2) : below(3);
        chosen[i] = names[which];
        good &= which < 3;
    }
    const bool null = one_in(10);
    good &= !(null && count);
    TRY(slot, good ? LEGAL : ILLEGAL, CALL(SetDebugLogging)(slot->instance, one_in(2), count, null ? NULL : chosen));
}

/* ---- stepping ---- */

static void step(Slot *slot)
{
    const Unit *unit = &slot->instance->core.unit;
    const double point = one_in(10) ? any_number() : unit->time * (one_in(10) ? 1.0 + 1e-13 : 1.0);
    const double length = one_in(10) ? any_number() : pow(10.0, 4.0 * uniform() - 3.0);
    const double slack = 1e-9 * fmax(1.0, fabs(unit->time)), end = slot->instance->core.stop_time, next = point + length;
    const bool good = length > 0.0 && isfinite(length) && fabs(point - unit->time) <= slack && next > unit->time &&
                      next <= end + 1e-9 * fmax(1.0, fabs(end));
    TRY(slot, both(in(slot, STEPPING) ? OPEN : ILLEGAL, good), call_step(slot->instance, point, length));
}

static void model_exchange(Slot *slot)
{
    void *c = slot->instance;
    const bool wrong_size = one_in(12), null = one_in(12);
    const size_t size = wrong_size ? below(N_STATES) : N_STATES;
    bool finite;
    double *values = numbers(size, &finite, 0.02);
    if (one_in(8) && finite && size >= 4) memset(values, 0, 4 * sizeof *values);
    const bool fits = !wrong_size && !null, readable = in(slot, INITIALIZATION | EVENT | CONTINUOUS | TERMINATED);
    const Verdict reading = both(in(slot, INITIALIZATION) ? OPEN : LEGAL, fits && readable);
    const double time = one_in(6) ? any_number() : 100.0 * uniform();
    switch (below(10)) {
    case 0: TRY(slot, in(slot, CONTINUOUS) ? LEGAL : ILLEGAL, CALL(EnterEventMode)(c)); break;
    case 1: TRY(slot, in(slot, EVENT) ? LEGAL : ILLEGAL, CALL(EnterContinuousTimeMode)(c)); break;
    case 2: TRY(slot, in(slot, EVENT) && !null ? LEGAL : ILLEGAL, call_discrete(c, null)); break;
    case 3: TRY(slot, in(slot, EVENT | CONTINUOUS) && isfinite(time) ? LEGAL : ILLEGAL, CALL(SetTime)(c, time)); break;
    case 4: TRY(slot, in(slot, CONTINUOUS) ? LEGAL : ILLEGAL, call_completed(c)); break;
    case 5: TRY(slot, reading, CALL(GetContinuousStates)(c, null ? NULL : values, size)); break;
    case 6: TRY(slot, both(reading, evaluable(slot)), call_rates(c, null ? NULL : values, size)); break;
    case 7: TRY(slot, reading, CALL(GetNominalsOfContinuousStates)(c, null ? NULL : values, size)); break;
    case 8: TRY(slot, both(in(slot, CONTINUOUS) ? LEGAL : ILLEGAL, fits && finite && directed(values)),
                CALL(SetContinuousStates)(c, null ? NULL : values, size)); break;
    default: TRY(slot, readable && !size ? LEGAL : ILLEGAL, CALL(GetEventIndicators)(c, values, size));
    }
    free(values);
}

/* ---- saved states ---- */

static bool same_interface(const Slot *slot, const void *state)
{
    return ((const Saved *)state)->core.interface == slot->instance->core.interface;
}

static void states(Slot *slot)
{
    void **place = &slot->saved[below(SAVES)], *none = NULL, *foreign = slots[below(SLOTS)].saved[below(SAVES)];
    size_t size;
    switch (below(5)) {
    case 0:
        scarce = one_in(10);
        TRY(slot, scarce ? OPEN : LEGAL, call_save(slot->instance, place));
        scarce = false;
        break;
    case 1:
        if (*place) {
            TRY(slot, LEGAL, call_restore(slot->instance, *place));
            if (memcmp(&((Saved *)*place)->core, &slot->instance->core, sizeof(Core)) != 0) stop("restore", "is not what was saved");
        } else TRY(slot, ILLEGAL, call_restore(slot->instance, NULL));
        break;
    case 2:
        if (foreign) TRY(slot, same_interface(slot, foreign) ? LEGAL : ILLEGAL, call_restore(slot->instance, foreign));
        break;
    case 3:
        TRY(slot, LEGAL, call_forget(slot->instance, one_in(4) ? &none : place));
        TRY(slot, LEGAL, call_forget(slot->instance, NULL));
        break;
    default:
        TRY(slot, ILLEGAL, call_save(slot->instance, NULL));
        TRY(slot, *place ? LEGAL : ILLEGAL, call_saved_size(slot->instance, *place, &size));
        TRY(slot, ILLEGAL, call_saved_size(slot->instance, *place, NULL));
    }
}

/* A round through bytes; they may be damaged or cut short. */
static void serialise(Slot *slot)
{
    void **place = &slot->saved[below(SAVES)], *copy = NULL;
    if (!*place) return;
    const bool cut = one_in(6), null = one_in(10), damaged = !cut && one_in(3);
    const size_t size = cut ? below((unsigned)sizeof(Saved)) : sizeof(Saved);
    BYTE *bytes = malloc(size ? size : 1);
    TRY(slot, cut || null ? ILLEGAL : LEGAL, call_serialise(slot->instance, *place, null ? NULL : bytes, size));
    if (!null && !cut) {
        const size_t at = below((unsigned)sizeof(Saved));
        const size_t padding = offsetof(Saved, token) + strlen(MODEL_TOKEN) + 1;
        const bool harmless = at >= padding && at < offsetof(Saved, size); /* after the end of the token */
        if (damaged) bytes[at] ^= (BYTE)(1 << below(8));
        scarce = one_in(10);
        TRY(slot, damaged && !harmless ? ILLEGAL : scarce ? OPEN : LEGAL,
            call_deserialise(slot->instance, bytes, size, &copy));
        scarce = false;
        TRY(slot, ILLEGAL, call_deserialise(slot->instance, bytes, size, NULL));
    }
    if (copy) {
        TRY(slot, same_interface(slot, copy) ? LEGAL : ILLEGAL, call_restore(slot->instance, copy));
        TRY(slot, LEGAL, call_forget(slot->instance, &copy));
    }
    free(bytes);
}

/* ---- what the unit does not have ---- */

/* Components that are none. */
static void no_instance(Slot *slot)
{
    static double junk[sizeof(Instance) / sizeof(double) + 1];
    void *component = one_in(2) ? NULL : junk;
    (void)slot;
    if ((int)CALL(Reset)(component) == OK || (int)CALL(Terminate)(component) == OK ||
        (int)call_step(component, 0.0, 1.0) == OK)
        stop("no instance", "accepted");
    CALL(FreeInstance)(component);
    calls += 4;
}

static void ask(Slot *slot)
{
    const Core before = slot->instance->core;
    call_rest(slot->instance, below(160), one_in(3));
    calls++;
    if (memcmp(&before, &slot->instance->core, sizeof before) != 0) stop("a question", "it changed the instance");
}

typedef void Operation(Slot *slot);

static Operation *const OPERATIONS[] = {
    renew, reset, rerun, setup, setup, exit_initialization, exit_initialization, terminate, set_logging, get_reals, get_reals,
    set_reals, set_reals, booleans, other_types, step, step, step, model_exchange, model_exchange, model_exchange, states,
    states, serialise, derivatives, output_derivatives, input_derivatives,
    no_instance, ask,
};
