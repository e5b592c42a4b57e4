/* Saved states: copies of the core, also as bytes for another process with the same library. */

#include "instance.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    char magic[8];
    char token[64];
    uint64_t size;
    uint64_t checksum;
    Core core;
} Saved;

#define MAGIC "barystat"

/* FNV-1a over the core. */
static uint64_t checksum_of(const Core *core)
{
    uint64_t hash = 14695981039346656037u;
    const unsigned char *bytes = (const unsigned char *)core;
    for (size_t i = 0; i < sizeof *core; i++) hash = (hash ^ bytes[i]) * 1099511628211u;
    return hash;
}

/* What is wrong with a saved state, or NULL. */
static const char *fault_of(const Saved *saved)
{
    if (memcmp(saved->magic, MAGIC, sizeof saved->magic) != 0) return "is no state of this unit, or was freed";
    if (strncmp(saved->token, MODEL_TOKEN, sizeof saved->token) != 0) return "is of another build of the unit";
    if (saved->size != sizeof *saved) return "has another size";
    if (saved->checksum != checksum_of(&saved->core)) return "is damaged";
    return NULL;
}

/* Whether a saved state can be used; if not, says why. */
static bool usable(const Instance *instance, const char *function, const void *saved)
{
    const char *fault = saved ? fault_of(saved) : "is a null pointer";
    if (fault) refuse(instance, "%s: the state %s", function, fault);
    return !fault;
}

static Status instance_save(void *component, const char *function, void **state)
{
    Instance *instance = enter(component, SAVE_STATE, function);
    if (!instance) return ERROR;
    if (!state) return refuse(instance, "%s: found a null pointer, expected a place for the state", function);
    if (*state && !usable(instance, function, *state)) return ERROR;
    Saved *saved = *state ? *state : calloc(1, sizeof *saved);
    if (!saved) return refuse(instance, "%s: out of memory", function);
    memcpy(saved->magic, MAGIC, sizeof saved->magic);
    strncpy(saved->token, MODEL_TOKEN, sizeof saved->token - 1);
    saved->size = sizeof *saved;
    memcpy(&saved->core, &instance->core, sizeof saved->core);
    saved->checksum = checksum_of(&saved->core);
    *state = saved;
    return OK;
}

static Status instance_restore(void *component, const char *function, const void *state)
{
    Instance *instance = enter(component, SAVE_STATE, function);
    if (!instance || !usable(instance, function, state)) return ERROR;
    const Saved *saved = state;
    if (saved->core.interface != instance->core.interface)
        return refuse(instance, "%s: the state is of the other interface (Co-Simulation, Model Exchange)", function);
    memcpy(&instance->core, &saved->core, sizeof saved->core);
    return OK;
}

static Status instance_free_state(void *component, const char *function, void **state)
{
    Instance *instance = enter(component, SAVE_STATE, function);
    if (!instance) return ERROR;
    if (!state || !*state) return OK;
    if (!usable(instance, function, *state)) return ERROR;
    memset(((Saved *)*state)->magic, 0, sizeof ((Saved *)*state)->magic);
    free(*state);
    *state = NULL;
    return OK;
}

static Status instance_saved_size(void *component, const char *function, const void *state, size_t *size)
{
    Instance *instance = enter(component, SAVE_STATE, function);
    if (!instance || !usable(instance, function, state)) return ERROR;
    if (!size) return refuse(instance, "%s: found a null pointer, expected a place for the size", function);
    *size = sizeof(Saved);
    return OK;
}

/* Whether an array of bytes can hold a saved state; if not, says so. */
static bool bytes_fit(const Instance *instance, const char *function, const unsigned char *bytes, size_t size)
{
    if (!bytes) refuse(instance, "%s: found a null pointer, expected %zu bytes", function, sizeof(Saved));
    else if (size != sizeof(Saved)) refuse(instance, "%s: found %zu bytes, expected %zu", function, size, sizeof(Saved));
    return bytes && size == sizeof(Saved);
}

static Status instance_serialise(void *component, const char *function, const void *state, unsigned char *bytes, size_t size)
{
    Instance *instance = enter(component, SAVE_STATE, function);
    if (!instance || !usable(instance, function, state) || !bytes_fit(instance, function, bytes, size)) return ERROR;
    memcpy(bytes, state, sizeof(Saved));
    return OK;
}

static Status instance_deserialise(void *component, const char *function, const unsigned char *bytes, size_t size, void **state)
{
    Instance *instance = enter(component, SAVE_STATE, function);
    if (!instance || !bytes_fit(instance, function, bytes, size)) return ERROR;
    if (!state) return refuse(instance, "%s: found a null pointer, expected a place for the state", function);
    Saved *saved = malloc(sizeof *saved);
    if (!saved) return refuse(instance, "%s: out of memory", function);
    memcpy(saved, bytes, sizeof *saved);
    if (!usable(instance, function, saved)) {
        free(saved);
        return ERROR;
    }
    *state = saved;
    return OK;
}
