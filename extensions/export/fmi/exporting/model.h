/* The graph inside an FMU, for both versions of FMI: values at communication points.
 *
 * The outputs at a time are those of the tick at that time. The tick is computed when an output is asked for
 * or the next step is made; where an input changes after that, it is computed again from what was before. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "variables.h"

enum { SAYS_OK, SAYS_WARNING, SAYS_DISCARD, SAYS_ERROR };

typedef struct model {
    uint64_t memory[(LIB_MEMORY + 7) / 8]; /* the instance of the library */
    uint64_t before[(LIB_STATE + 7) / 8];  /* its state before the tick of this communication point */
    lib_inputs inputs;
    lib_outputs outputs;
    int computed, fresh; /* whether that tick was computed, and with the present inputs */
    int32_t said_code, said_block;
    double time;
    void (*tell)(struct model *, int, const char *);
    void *environment;
    void *log;
    char *name;
} model;

/* What an FMU remembers, always as many bytes. */
typedef struct {
    uint64_t before[(LIB_STATE + 7) / 8];
    lib_inputs inputs;
    double parameters[LIB_PARAMETERS + 1];
    double time;
} model_state;

static lib *library_of(model *self) { return (lib *)self->memory; }

static void tell(model *self, int status, const char *text)
{
    if (self->log)
        self->tell(self, status, text);
}

static unsigned char *place_of(model *self, const variable *which)
{
    return (which->of == 'i' ? (unsigned char *)&self->inputs : (unsigned char *)&self->outputs) + which->place;
}

static double number_of(model *self, const variable *which, size_t element)
{
    double value;
    if (which->of == 't')
        return self->time;
    if (which->of == 'p')
        return LIB(get)(library_of(self), which->place);
    memcpy(&value, place_of(self, which) + 8 * element, 8);
    return value;
}

static int64_t integer_of(model *self, const variable *which, size_t element)
{
    int64_t value;
    if (which->type == 'b')
        return place_of(self, which)[element];
    memcpy(&value, place_of(self, which) + 8 * element, 8);
    return value;
}

static void reset(model *self)
{
    const double *next = starts;
    LIB(init)(self->memory, sizeof self->memory);
    LIB(save)(library_of(self), self->before);
    memset(&self->inputs, 0, sizeof self->inputs);
    for (size_t k = 0; k < VARIABLES; ++k)
        for (int32_t element = 0; variables[k].of == 'i' && element < variables[k].count; ++element, ++next) {
            unsigned char *at = place_of(self, &variables[k]);
            int64_t integer = (int64_t)*next;
            if (variables[k].type == 'b')
                at[element] = *next != 0.0;
            else
                memcpy(at + 8 * element, variables[k].type == 'f' ? (const void *)next : &integer, 8);
        }
    self->computed = self->fresh = 0;
    self->said_code = 0;
    self->said_block = -1;
    self->time = 0.0;
}

static model *make_model(const char *name, const char *token)
{
    model *self = strcmp(token ? token : "", LIB_TOKEN) ? NULL : calloc(1, sizeof *self);
    if (!self)
        return NULL;
    self->name = malloc(strlen(name ? name : "") + 1);
    if (self->name)
        strcpy(self->name, name ? name : "");
    reset(self);
    return self;
}

static void free_model(model *self)
{
    if (self)
        free(self->name);
    free(self);
}

/* One tick of the library; whether the simulation can go on. */
static int tick(model *self)
{
    char text[256];
    lib *library = library_of(self);
    int32_t status = LIB(step)(library, &self->inputs, &self->outputs), block = LIB(last_block)(library);
    if (status != self->said_code || block != self->said_block) {
        if (status) {
            snprintf(text, sizeof text, "a step returns %d%s%s: %s", (int)status, block >= 0 ? ", block " : "",
                     LIB(block_name)(block), text_of(status));
            tell(self, status < 0 ? SAYS_ERROR : SAYS_WARNING, text);
        }
        self->said_code = status;
        self->said_block = block;
    }
    return status >= 0;
}

/* The tick of this communication point with the present inputs; whether the simulation can go on. */
static int compute(model *self)
{
    if (self->fresh)
        return 1;
    if (self->computed)
        LIB(restore)(library_of(self), self->before);
    self->computed = 1;
    self->fresh = tick(self);
    return self->fresh;
}

static int go_on(model *self, double period)
{
    double ticks = floor(period / LIB_PERIOD + 0.5);
    if (ticks < 1.0 || fabs(ticks * LIB_PERIOD - period) > 1e-6 * LIB_PERIOD) {
        char text[128];
        snprintf(text, sizeof text, "a step of %.9g s is no whole number of the graph's ticks of %.9g s", period,
                 LIB_PERIOD);
        tell(self, SAYS_ERROR, text);
        return 0;
    }
    if (!compute(self))
        return 0;
    for (; ticks > 1.0; ticks -= 1.0)
        if (!tick(self))
            return 0;
    LIB(save)(library_of(self), self->before);
    self->computed = self->fresh = 0;
    return 1;
}

/* A variable of a type with room for its elements; none with a line in the log. */
static const variable *find(model *self, uint32_t reference, char type, size_t room)
{
    if (reference < VARIABLES && variables[reference].type == type && (size_t)variables[reference].count <= room)
        return &variables[reference];
    tell(self, SAYS_ERROR, "there is no variable of this type and size with this value reference");
    return NULL;
}

static int set_element(model *self, const variable *which, size_t element, double number, int64_t integer)
{
    unsigned char *at = place_of(self, which) + element * (which->type == 'b' ? 1 : 8);
    unsigned char flag = integer != 0;
    const void *from = which->type == 'f' ? (const void *)&number : (const void *)&integer;
    if (which->of == 'p') {
        if (LIB(set)(library_of(self), which->place, number)) {
            tell(self, SAYS_ERROR, "a value is outside the bounds of its parameter");
            return 0;
        }
        self->fresh = 0;
        return 1;
    }
    if (which->of != 'i') {
        tell(self, SAYS_ERROR, "an output cannot be set");
        return 0;
    }
    if (which->type == 'b' ? *at != flag : memcmp(at, from, 8) != 0)
        self->fresh = 0;
    if (which->type == 'b')
        *at = flag;
    else
        memcpy(at, from, 8);
    return 1;
}

/* The bodies of the functions that get and set all variables of a type. */
#define GET_VALUES(type, read, c_type)                                                                         \
    size_t at = 0;                                                                                             \
    for (size_t k = 0; k < count; ++k) {                                                                       \
        const variable *which = find(self, references[k], type, room - at);                                    \
        if (!which || (which->of == 'o' && !compute(self)))                                                    \
            return SAYS_ERROR;                                                                                 \
        for (int32_t element = 0; element < which->count; ++element)                                           \
            values[at++] = (c_type)read(self, which, (size_t)element);                                         \
    }                                                                                                          \
    return SAYS_OK;
#define SET_VALUES(type)                                                                                       \
    size_t at = 0;                                                                                             \
    for (size_t k = 0; k < count; ++k) {                                                                       \
        const variable *which = find(self, references[k], type, room - at);                                    \
        for (int32_t element = 0; which && element < which->count; ++element, ++at)                            \
            if (!set_element(self, which, (size_t)element, (double)values[at], (int64_t)values[at]))           \
                return SAYS_ERROR;                                                                             \
        if (!which)                                                                                            \
            return SAYS_ERROR;                                                                                 \
    }                                                                                                          \
    return SAYS_OK;

static model_state *keep(model *self, model_state *state)
{
    if (!state && !(state = calloc(1, sizeof *state)))
        return NULL;
    memcpy(state->before, self->before, sizeof state->before);
    state->inputs = self->inputs;
    state->time = self->time;
    for (int32_t k = 0; k < LIB_PARAMETERS; ++k)
        state->parameters[k] = LIB(get)(library_of(self), k);
    return state;
}

static int take_back(model *self, const model_state *state)
{
    if (LIB(restore)(library_of(self), state->before)) {
        tell(self, SAYS_ERROR, "this is no state of this FMU");
        return 0;
    }
    memcpy(self->before, state->before, sizeof self->before);
    self->inputs = state->inputs;
    self->time = state->time;
    for (int32_t k = 0; k < LIB_PARAMETERS; ++k)
        LIB(set)(library_of(self), k, state->parameters[k]);
    self->computed = self->fresh = 0;
    return 1;
}

static model_state *state_from_bytes(model *self, const void *bytes, size_t size)
{
    model_state *state = size == sizeof *state ? malloc(sizeof *state) : NULL;
    if (state)
        memcpy(state, bytes, size);
    else
        tell(self, SAYS_ERROR, "this is no state of this FMU");
    return state;
}
