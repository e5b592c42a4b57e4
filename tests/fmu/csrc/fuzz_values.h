/* What fuzz_harness.c does with values: get, set, derive them; as in fuzz_operations.h. */

/* ---- values ---- */

/* Whether a quaternion has a direction. */
static bool directed(const double *q)
{
    const double length = hypot(hypot(q[0], q[1]), hypot(q[2], q[3]));
    return length > 1e-50 && length < 1e50;
}

/* Whether there are outputs at the present states; before initialization has computed them, nobody can tell. */
static bool evaluable(const Slot *slot)
{
    return in(slot, INSTANTIATED | INITIALIZATION) || directed(slot->instance->core.unit.values + AT_STATES);
}

static void get_reals(Slot *slot)
{
    uint32_t references[MOST];
    size_t size;
    bool fit, finite;
    const unsigned readable = ARRAYS && in(slot, INSTANTIATED) ? SETTABLE_EARLY | STATE : ~0u;
    const size_t count = references_of(references, &size, &fit, readable, REAL), length = told(size, &fit);
    double *values = numbers(length, &finite, 1.0);
    const bool null = one_in(20) && length;
    const unsigned modes = INITIALIZATION | RUN_MODES | TERMINATED | (ARRAYS ? INSTANTIATED : 0);
    const bool computed = in(slot, INITIALIZATION) || (in(slot, INSTANTIATED) && has_kind(references, count, STATE));
    const bool possible = evaluable(slot) || !has_kind(references, count, OUTPUT | DERIVATIVE);
    TRY(slot, both(!in(slot, modes) ? ILLEGAL : computed ? OPEN : LEGAL, fit && !null && possible),
        call_get_real(slot->instance, references, count, null ? NULL : values, length));
    free(values);
}

/* The kinds that may be set now. */
static unsigned settable_kinds(const Slot *slot)
{
    if (in(slot, INSTANTIATED)) return SETTABLE_EARLY | STATE;
    if (in(slot, INITIALIZATION)) return SETTABLE_EARLY;
    if (in(slot, STEPPING)) return INPUT | TUNABLE;
    if (in(slot, EVENT)) return INPUT | TUNABLE | STATE;
    return in(slot, CONTINUOUS) ? INPUT | STATE : 0;
}

/* Whether all references may be set to these values: those of some kinds, and parameters to what they are. */
static bool may_set(const Slot *slot, const uint32_t *references, size_t count, unsigned kinds, const double *values)
{
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= N_REFERENCES || VARIABLES[references[i]].type != REAL) return false;
        const Variable *one = &VARIABLES[references[i]];
        bool same = one->kind & (PARAMETER | TUNABLE);
        for (int e = 0; e < one->size; e++) same &= slot->instance->core.unit.values[one->offset + e] == *values++;
        if (!same && !(one->kind & kinds)) return false;
    }
    return true;
}

static void set_reals(Slot *slot)
{
    uint32_t references[MOST];
    size_t size;
    bool fit, finite, whole = true;
    const unsigned kinds = settable_kinds(slot);
    const size_t count = references_of(references, &size, &fit, kinds ? kinds : INPUT, REAL);
    const size_t length = told(size, &whole);
    double *values = numbers(length, &finite, 0.1);
    /* Near the values there are, so that parameters stay possible, mostly. */
    for (size_t i = 0, k = 0; i < count && fit && length == size; i++)
        for (int e = 0; e < VARIABLES[references[i]].size; e++, k++)
            if (!one_in(8) && isfinite(values[k]))
                values[k] = slot->instance->core.unit.values[VARIABLES[references[i]].offset + e] * (1.0 + 1e-4 * uniform());
    finite = true;
    for (size_t k = 0; k < length; k++) finite &= isfinite(values[k]) != 0;
    const bool null = one_in(20) && length, modes = in(slot, INSTANTIATED | INITIALIZATION | RUN_MODES);
    const bool tuning = in(slot, RUN_MODES) && has_kind(references, count, TUNABLE);
    fit = whole && length == size && may_set(slot, references, count, kinds, values);
    TRY(slot, both(tuning ? OPEN : modes ? LEGAL : ILLEGAL, fit && finite && !null),
        call_set_real(slot->instance, references, count, null ? NULL : values, length));
    free(values);
}

static void booleans(Slot *slot)
{
    uint32_t references[MOST];
    size_t size;
    bool fit;
    BOOLEAN_TYPE values[MOST * 64];
    const size_t count = references_of(references, &size, &fit, one_in(3) ? ~0u : TUNABLE, BOOLEAN), length = told(size, &fit);
    if (length > sizeof values / sizeof *values) return;
    for (size_t i = 0; i < length; i++) values[i] = one_in(2);
    const bool null = one_in(20) && length;
    const unsigned readable = INITIALIZATION | RUN_MODES | TERMINATED | (ARRAYS ? INSTANTIATED : 0);
    if (one_in(2)) {
        TRY(slot, both(in(slot, INITIALIZATION) ? OPEN : in(slot, readable) ? LEGAL : ILLEGAL, fit && !null),
            call_get_bool(slot->instance, references, count, null ? NULL : values, length));
        return;
    }
    bool now = in(slot, INSTANTIATED | INITIALIZATION | STEPPING | EVENT);
    if (in(slot, CONTINUOUS) && fit) {
        now = true;
        for (size_t i = 0; i < count; i++)
            now &= slot->instance->core.unit.values[VARIABLES[references[i]].offset] == (double)(values[i] != 0);
    }
    const bool tuning = in(slot, RUN_MODES) && count;
    TRY(slot, both(tuning ? OPEN : now ? LEGAL : ILLEGAL, fit && !null && now),
        call_set_bool(slot->instance, references, count, null ? NULL : values, length));
}

static void other_types(Slot *slot)
{
    const uint32_t reference = below(N_REFERENCES);
    const size_t count = below(2);
    const unsigned readable = INITIALIZATION | RUN_MODES | TERMINATED | (ARRAYS ? INSTANTIATED : 0);
    TRY(slot, !count && in(slot, readable) ? LEGAL : ILLEGAL, call_get_other(slot->instance, &reference, count));
    TRY(slot, !count && in(slot, INSTANTIATED | INITIALIZATION | RUN_MODES) ? LEGAL : ILLEGAL,
        call_set_other(slot->instance, &reference, count));
}

/* ---- derivatives ---- */

static void derivatives(Slot *slot)
{
    uint32_t unknowns[MOST], knowns[MOST];
    size_t n_result, n_seed;
    bool fit, other, finite;
    const bool early = in(slot, INITIALIZATION);
    const unsigned known_kinds = early ? SETTABLE_EARLY : INPUT | TUNABLE | STATE;
    const unsigned unknown_kinds = early ? OUTPUT | STATE | DERIVATIVE : OUTPUT | DERIVATIVE;
    const size_t count = references_of(unknowns, &n_result, &fit, unknown_kinds, REAL);
    const size_t n_knowns = references_of(knowns, &n_seed, &other, known_kinds, REAL);
    fit &= other;
    n_result = told(n_result, &fit);
    n_seed = told(n_seed, &fit);
    double *seed = numbers(n_seed, &finite, 0.1), *result = numbers(n_result, &finite, 1.0);
    const bool null = one_in(20) && n_seed;
    const Verdict verdict = both(early ? OPEN : in(slot, RUN_MODES | TERMINATED) ? LEGAL : ILLEGAL,
                                 fit && !null && evaluable(slot));
    TRY(slot, verdict, call_derivative(slot->instance, unknowns, count, knowns, n_knowns, null ? NULL : seed, n_seed, result,
                                       n_result));
#if ARRAYS
    TRY(slot, verdict, call_adjoint(slot->instance, unknowns, count, knowns, n_knowns, result, n_result, null ? NULL : seed,
                                    n_seed));
#endif
    free(seed);
    free(result);
}

static void output_derivatives(Slot *slot)
{
    uint32_t references[MOST];
    int32_t orders[MOST];
    size_t size;
    bool fit, finite, first = true;
    const size_t count = references_of(references, &size, &fit, OUTPUT, REAL), length = told(size, &fit);
    for (size_t i = 0; i < count; i++) {
        orders[i] = one_in(20) ? (int32_t)below(4) - 1 : 1;
        first &= orders[i] == 1;
    }
    double *values = numbers(length, &finite, 1.0);
    const bool null = one_in(20) && count;
    TRY(slot, both(in(slot, STEPPING | TERMINATED) ? LEGAL : ILLEGAL, fit && first && !null && evaluable(slot)),
        call_output_derivatives(slot->instance, references, count, null ? NULL : orders, values, length));
    free(values);
}

static void input_derivatives(Slot *slot)
{
#if !ARRAYS
    uint32_t references[MOST];
    int32_t orders[MOST];
    size_t size;
    bool fit, finite, first = true;
    const size_t count = references_of(references, &size, &fit, INPUT, REAL);
    for (size_t i = 0; i < count; i++) {
        orders[i] = one_in(20) ? (int32_t)below(4) - 1 : 1;
        first &= orders[i] == 1;
    }
    double *values = numbers(count, &finite, 0.1);
    const bool null = one_in(20) && count, stepping = slot->instance->core.interface == FOR_CO_SIMULATION;
    TRY(slot, both(in(slot, INSTANTIATED | INITIALIZATION | STEPPING) && stepping ? LEGAL : ILLEGAL, fit && first && finite && !null),
        fmi2SetRealInputDerivatives(slot->instance, references, count, null ? NULL : orders, values));
    free(values);
#else
    (void)slot;
#endif
}
