/* The functions of FMI 3.0 for co-simulation, on the graph of model.h. */
#include "fmi3Functions.h"
#include "model.h"

typedef fmi3Instance I;
typedef fmi3ValueReference V;

#define UNUSED { tell(c, SAYS_ERROR, "this FMU does not have this function"); return fmi3Error; }
#define NOTHING { (void)c; return fmi3OK; }

static void tell_3(model *self, int status, const char *text)
{
    fmi3LogMessageCallback log;
    memcpy(&log, &self->log, sizeof log);
    log(self->environment, (fmi3Status)status, status ? "logStatusError" : "logEvents", text);
}

const char *fmi3GetVersion(void) { return fmi3Version; }
fmi3Status fmi3SetDebugLogging(I c, fmi3Boolean on, size_t n, const fmi3String categories[])
{ (void)on, (void)n, (void)categories; NOTHING }

I fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                              fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const V intermediate[],
                              size_t n, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                              fmi3IntermediateUpdateCallback update)
{
    model *self = make_model(name, token);
    (void)resources, (void)visible, (void)events, (void)early, (void)intermediate, (void)n, (void)update;
    if (self && logging && log) {
        self->tell = tell_3;
        self->environment = environment;
        memcpy(&self->log, &log, sizeof self->log);
    }
    return self;
}
I fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                               fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    return NULL;
}
I fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                    fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                    fmi3LogMessageCallback log, fmi3ClockUpdateCallback clock,
                                    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    (void)clock, (void)lock, (void)unlock;
    return NULL;
}
void fmi3FreeInstance(I c) { free_model(c); }

fmi3Status fmi3EnterInitializationMode(I c, fmi3Boolean tolerant, fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean ends, fmi3Float64 stop)
{
    (void)tolerant, (void)tolerance, (void)ends, (void)stop;
    ((model *)c)->time = start;
    return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(I c) NOTHING
fmi3Status fmi3EnterEventMode(I c) UNUSED
fmi3Status fmi3EnterStepMode(I c) UNUSED
fmi3Status fmi3EnterConfigurationMode(I c) UNUSED
fmi3Status fmi3ExitConfigurationMode(I c) UNUSED
fmi3Status fmi3Terminate(I c) NOTHING
fmi3Status fmi3Reset(I c) { reset(c); return fmi3OK; }

#define ACCESS(Name, type, read)                                                                               \
    static int get_##Name(model *self, const V references[], size_t count, fmi3##Name values[], size_t room)   \
    {                                                                                                          \
        GET_VALUES(type, read, fmi3##Name)                                                                     \
    }                                                                                                          \
    static int set_##Name(model *self, const V references[], size_t count, const fmi3##Name values[],          \
                          size_t room)                                                                         \
    {                                                                                                          \
        SET_VALUES(type)                                                                                       \
    }                                                                                                          \
    fmi3Status fmi3Get##Name(I c, const V vr[], size_t n, fmi3##Name values[], size_t size)                    \
    {                                                                                                          \
        return (fmi3Status)get_##Name(c, vr, n, values, size);                                                 \
    }                                                                                                          \
    fmi3Status fmi3Set##Name(I c, const V vr[], size_t n, const fmi3##Name values[], size_t size)              \
    {                                                                                                          \
        return (fmi3Status)set_##Name(c, vr, n, values, size);                                                 \
    }
ACCESS(Float64, 'f', number_of)
ACCESS(Int64, 'i', integer_of)
ACCESS(Boolean, 'b', integer_of)

/* there are no variables of these types */
#define IGNORE (void)vr, (void)values; if (!n) return fmi3OK;
#define NO_ACCESS(Name)                                                                                        \
    fmi3Status fmi3Get##Name(I c, const V vr[], size_t n, fmi3##Name values[], size_t size)                    \
    { (void)size; IGNORE UNUSED }                                                                              \
    fmi3Status fmi3Set##Name(I c, const V vr[], size_t n, const fmi3##Name values[], size_t size)              \
    { (void)size; IGNORE UNUSED }
NO_ACCESS(Float32)
NO_ACCESS(Int8)
NO_ACCESS(UInt8)
NO_ACCESS(Int16)
NO_ACCESS(UInt16)
NO_ACCESS(Int32)
NO_ACCESS(UInt32)
NO_ACCESS(UInt64)
NO_ACCESS(String)
fmi3Status fmi3GetBinary(I c, const V vr[], size_t n, size_t sizes[], fmi3Binary values[], size_t size)
{ (void)sizes, (void)size; IGNORE UNUSED }
fmi3Status fmi3SetBinary(I c, const V vr[], size_t n, const size_t sizes[], const fmi3Binary values[], size_t size)
{ (void)sizes, (void)size; IGNORE UNUSED }
fmi3Status fmi3GetClock(I c, const V vr[], size_t n, fmi3Clock values[]) { IGNORE UNUSED }
fmi3Status fmi3SetClock(I c, const V vr[], size_t n, const fmi3Clock values[]) { IGNORE UNUSED }

fmi3Status fmi3GetFMUState(I c, fmi3FMUState *state)
{
    *state = keep(c, *state);
    return *state ? fmi3OK : fmi3Error;
}
fmi3Status fmi3SetFMUState(I c, fmi3FMUState state) { return take_back(c, state) ? fmi3OK : fmi3Error; }
fmi3Status fmi3FreeFMUState(I c, fmi3FMUState *state)
{
    free(*state);
    *state = NULL;
    NOTHING
}
fmi3Status fmi3SerializedFMUStateSize(I c, fmi3FMUState state, size_t *size)
{
    (void)state;
    *size = sizeof(model_state);
    NOTHING
}
fmi3Status fmi3SerializeFMUState(I c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    if (size < sizeof(model_state))
        return fmi3Error;
    memcpy(bytes, state, sizeof(model_state));
    NOTHING
}
fmi3Status fmi3DeserializeFMUState(I c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    *state = state_from_bytes(c, bytes, size);
    return *state ? fmi3OK : fmi3Error;
}

fmi3Status fmi3DoStep(I c, fmi3Float64 time, fmi3Float64 period, fmi3Boolean without_return, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached)
{
    model *self = c;
    (void)without_return;
    *event = *terminate = *early = false;
    *reached = time;
    if (!go_on(self, period))
        return fmi3Error;
    *reached = self->time = time + period;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfVariableDependencies(I c, V vr, size_t *n) { (void)vr, (void)n; UNUSED }
fmi3Status fmi3GetVariableDependencies(I c, V vr, size_t own[], V others[], size_t theirs[],
                                       fmi3DependencyKind kinds[], size_t n)
{ (void)vr, (void)own, (void)others, (void)theirs, (void)kinds, (void)n; UNUSED }
#define DERIVATIVE(Name)                                                                                       \
    fmi3Status fmi3Get##Name(I c, const V unknowns[], size_t n, const V knowns[], size_t m,                    \
                             const fmi3Float64 seed[], size_t seeds, fmi3Float64 result[], size_t results)     \
    { (void)unknowns, (void)n, (void)knowns, (void)m, (void)seed, (void)seeds, (void)result, (void)results; UNUSED }
DERIVATIVE(DirectionalDerivative)
DERIVATIVE(AdjointDerivative)
fmi3Status fmi3GetOutputDerivatives(I c, const V vr[], size_t n, const fmi3Int32 orders[], fmi3Float64 values[],
                                    size_t size)
{ (void)orders, (void)size; IGNORE UNUSED }

/* clocks, model exchange and scheduled execution */
#define CLOCK(vr, n) (void)vr, (void)n
fmi3Status fmi3GetIntervalDecimal(I c, const V vr[], size_t n, fmi3Float64 a[], fmi3IntervalQualifier b[])
{ CLOCK(vr, n), (void)a, (void)b; UNUSED }
fmi3Status fmi3GetIntervalFraction(I c, const V vr[], size_t n, fmi3UInt64 a[], fmi3UInt64 b[],
                                   fmi3IntervalQualifier q[])
{ CLOCK(vr, n), (void)a, (void)b, (void)q; UNUSED }
fmi3Status fmi3GetShiftDecimal(I c, const V vr[], size_t n, fmi3Float64 a[]) { CLOCK(vr, n), (void)a; UNUSED }
fmi3Status fmi3GetShiftFraction(I c, const V vr[], size_t n, fmi3UInt64 a[], fmi3UInt64 b[])
{ CLOCK(vr, n), (void)a, (void)b; UNUSED }
fmi3Status fmi3SetIntervalDecimal(I c, const V vr[], size_t n, const fmi3Float64 a[])
{ CLOCK(vr, n), (void)a; UNUSED }
fmi3Status fmi3SetIntervalFraction(I c, const V vr[], size_t n, const fmi3UInt64 a[], const fmi3UInt64 b[])
{ CLOCK(vr, n), (void)a, (void)b; UNUSED }
fmi3Status fmi3SetShiftDecimal(I c, const V vr[], size_t n, const fmi3Float64 a[]) { CLOCK(vr, n), (void)a; UNUSED }
fmi3Status fmi3SetShiftFraction(I c, const V vr[], size_t n, const fmi3UInt64 a[], const fmi3UInt64 b[])
{ CLOCK(vr, n), (void)a, (void)b; UNUSED }
fmi3Status fmi3EvaluateDiscreteStates(I c) UNUSED
fmi3Status fmi3UpdateDiscreteStates(I c, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *d, fmi3Boolean *e,
                                    fmi3Boolean *f, fmi3Float64 *g)
{ (void)a, (void)b, (void)d, (void)e, (void)f, (void)g; UNUSED }
fmi3Status fmi3EnterContinuousTimeMode(I c) UNUSED
fmi3Status fmi3CompletedIntegratorStep(I c, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *d)
{ (void)a, (void)b, (void)d; UNUSED }
fmi3Status fmi3SetTime(I c, fmi3Float64 time) { (void)time; UNUSED }
fmi3Status fmi3SetContinuousStates(I c, const fmi3Float64 x[], size_t n) { (void)x, (void)n; UNUSED }
fmi3Status fmi3GetContinuousStateDerivatives(I c, fmi3Float64 x[], size_t n) { (void)x, (void)n; UNUSED }
fmi3Status fmi3GetEventIndicators(I c, fmi3Float64 x[], size_t n) { (void)x, (void)n; UNUSED }
fmi3Status fmi3GetContinuousStates(I c, fmi3Float64 x[], size_t n) { (void)x, (void)n; UNUSED }
fmi3Status fmi3GetNominalsOfContinuousStates(I c, fmi3Float64 x[], size_t n) { (void)x, (void)n; UNUSED }
fmi3Status fmi3GetNumberOfEventIndicators(I c, size_t *n) { *n = 0; NOTHING }
fmi3Status fmi3GetNumberOfContinuousStates(I c, size_t *n) { *n = 0; NOTHING }
fmi3Status fmi3ActivateModelPartition(I c, V clock, fmi3Float64 time) { (void)clock, (void)time; UNUSED }
