/* The functions of FMI 2.0 for co-simulation, on the graph of model.h. */
#include "fmi2Functions.h"
#include "model.h"

#define UNUSED { tell(c, SAYS_ERROR, "this FMU does not have this function"); return fmi2Error; }

static void tell_2(model *self, int status, const char *text)
{
    fmi2CallbackLogger logger;
    memcpy(&logger, &self->log, sizeof logger);
    logger(self->environment, self->name, (fmi2Status)status, status ? "logStatusError" : "logEvents", "%s", text);
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)c, (void)on, (void)n, (void)categories;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    model *self = type == fmi2CoSimulation ? make_model(name, guid) : NULL;
    (void)resources, (void)visible;
    if (self && logging && functions && functions->logger) {
        self->tell = tell_2;
        self->environment = functions->componentEnvironment;
        memcpy(&self->log, &functions->logger, sizeof self->log);
    }
    return self;
}

void fmi2FreeInstance(fmi2Component c) { free_model(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean ends, fmi2Real stop)
{
    (void)tolerant, (void)tolerance, (void)ends, (void)stop;
    ((model *)c)->time = start;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { reset(c); return fmi2OK; }

/* each variable of FMI 2.0 is one number */
#define ACCESS(Name, type, read)                                                                               \
    static int get_##Name(model *self, const fmi2ValueReference references[], size_t count, fmi2##Name values[]) \
    {                                                                                                          \
        const size_t room = count;                                                                             \
        GET_VALUES(type, read, fmi2##Name)                                                                     \
    }                                                                                                          \
    static int set_##Name(model *self, const fmi2ValueReference references[], size_t count,                    \
                          const fmi2##Name values[])                                                           \
    {                                                                                                          \
        const size_t room = count;                                                                             \
        SET_VALUES(type)                                                                                       \
    }                                                                                                          \
    fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2##Name value[])     \
    {                                                                                                          \
        return (fmi2Status)get_##Name(c, vr, n, value);                                                        \
    }                                                                                                          \
    fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2##Name value[]) \
    {                                                                                                          \
        return (fmi2Status)set_##Name(c, vr, n, value);                                                        \
    }
ACCESS(Real, 'f', number_of)
ACCESS(Integer, 'i', integer_of)
ACCESS(Boolean, 'b', integer_of)

#define IGNORE_ACCESS (void)vr, (void)value; if (!n) return fmi2OK;
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[])
{ IGNORE_ACCESS UNUSED }
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[])
{ IGNORE_ACCESS UNUSED }

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    *state = keep(c, *state);
    return *state ? fmi2OK : fmi2Error;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    return take_back(c, state) ? fmi2OK : fmi2Error;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c, (void)state;
    *size = sizeof(model_state);
    return fmi2OK;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    (void)c;
    if (size < sizeof(model_state))
        return fmi2Error;
    memcpy(bytes, state, sizeof(model_state));
    return fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    *state = state_from_bytes(c, bytes, size);
    return *state ? fmi2OK : fmi2Error;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real period, fmi2Boolean without_return)
{
    model *self = c;
    (void)without_return;
    if (!go_on(self, period))
        return fmi2Error;
    self->time = time + period;
    return fmi2OK;
}
fmi2Status fmi2CancelStep(fmi2Component c) UNUSED

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t unknowns,
                                        const fmi2ValueReference known[], size_t knowns, const fmi2Real seed[],
                                        fmi2Real result[])
{ (void)unknown, (void)unknowns, (void)known, (void)knowns, (void)seed, (void)result; UNUSED }
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[])
{ (void)order; IGNORE_ACCESS UNUSED }
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[])
{ (void)order; IGNORE_ACCESS UNUSED }

/* steps are never pending */
#define STATUS(Name, Type)                                                                                     \
    fmi2Status fmi2Get##Name(fmi2Component c, const fmi2StatusKind kind, Type *value)                          \
    {                                                                                                          \
        (void)c, (void)kind, (void)value;                                                                      \
        return fmi2Discard;                                                                                    \
    }
STATUS(Status, fmi2Status)
STATUS(RealStatus, fmi2Real)
STATUS(IntegerStatus, fmi2Integer)
STATUS(BooleanStatus, fmi2Boolean)
STATUS(StringStatus, fmi2String)
