/* heatrun export: thermal_network.c behind the functions of FMI 3.0, co-simulation
 *
 * A communication step is taken in equal parts of at most HEATRUN_STEP_S; inputs hold over it.
 */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"
#include "thermal_network.h"

typedef struct {
    heatrun_parameters parameters;
    heatrun_inputs inputs;
    heatrun_state state;
    heatrun_real start_degC[HEATRUN_NUM_NODES];
    heatrun_real time_s;
    int is_started;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} machine;

typedef enum { PARAMETER, INPUT, OUTPUT, INDEPENDENT } causality;

/* By value reference: where it stands, what it is, least and largest value, value at the start. */
static const struct {
    size_t offset;
    causality kind;
    double low, high, start;
} VARIABLES[] = {
$rows
};
#define NUM_VARIABLES (sizeof VARIABLES/sizeof VARIABLES[0])

static fmi3Status said(const machine *self, const char *message)
{
    if (self->log != NULL) {
        self->log(self->environment, fmi3Error, "logStatusError", message);
    }
    return fmi3Error;
}

static heatrun_real *place(machine *self, size_t reference)
{
    return (heatrun_real *)(void *)((char *)self + VARIABLES[reference].offset);
}

static void reset(machine *self)
{
    size_t i;
    self->parameters = heatrun_identified;
    self->is_started = 0;
    for (i = 0; i < NUM_VARIABLES; ++i) {
        *place(self, i) = VARIABLES[i].start;
    }
}

static fmi3Status start(machine *self)
{
    if (heatrun_start(&self->state, self->start_degC) != HEATRUN_OK) {
        return said(self, "a start temperature is beyond its limits");
    }
    self->state.parameters = &self->parameters;
    return fmi3OK;
}

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate)
{
    machine *self;
    if (instantiationToken == NULL || strcmp(instantiationToken, "$token") != 0) {
        return NULL;
    }
    self = (machine *)calloc(1, sizeof(machine));
    if (self != NULL) {
        self->environment = instanceEnvironment;
        self->log = logMessage;
        reset(self);
    }
    return self;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    free(instance);
}

fmi3Status fmi3EnterInitializationMode(
    fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
    fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    ((machine *)instance)->time_s = startTime;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    machine *self = (machine *)instance;
    self->is_started = 1;
    return start(self);
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    reset((machine *)instance);
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, fmi3Float64 values[], size_t nValues)
{
    machine *self = (machine *)instance;
    size_t i;
    if (nValues != nValueReferences || (!self->is_started && start(self) != fmi3OK)) {
        return fmi3Error;
    }
    for (i = 0; i < nValues; ++i) {
        if (valueReferences[i] >= NUM_VARIABLES) {
            return said(self, "there is no variable of this value reference");
        }
        values[i] = *place(self, valueReferences[i]);
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, const fmi3Float64 values[], size_t nValues)
{
    machine *self = (machine *)instance;
    size_t i;
    for (i = 0; i < nValues && nValues == nValueReferences; ++i) {
        const size_t reference = valueReferences[i];
        if (reference >= NUM_VARIABLES || VARIABLES[reference].kind > INPUT
            || (VARIABLES[reference].kind == PARAMETER && self->is_started)) {
            return said(self, "only inputs can be set, and parameters before the start");
        }
        if (!(values[i] >= VARIABLES[reference].low && values[i] <= VARIABLES[reference].high)) {
            return said(self, "a value is not a number, or beyond min and max of its variable");
        }
        *place(self, reference) = values[i];
    }
    return nValues == nValueReferences ? fmi3OK : fmi3Error;
}

fmi3Status fmi3DoStep(
    fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
    fmi3Float64 communicationStepSize, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
    fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn,
    fmi3Float64 *lastSuccessfulTime)
{
    machine *self = (machine *)instance;
    double num_steps = 1.0, step;
    *eventHandlingNeeded = fmi3False;
    *terminateSimulation = fmi3False;
    *earlyReturn = fmi3False;
    *lastSuccessfulTime = currentCommunicationPoint;
    if (!(communicationStepSize > 0.0 && communicationStepSize <= 1e9*HEATRUN_STEP_S)) {
        return said(self, "expected a communication step above 0 s");
    }
    while (communicationStepSize > num_steps*HEATRUN_STEP_S*(1.0 + 1e-9)) {
        num_steps += 1.0;
    }
    step = communicationStepSize/num_steps;
    step = step < HEATRUN_STEP_S ? step : HEATRUN_STEP_S;
    for (; num_steps > 0.5; num_steps -= 1.0) {
        if (heatrun_step_of(&self->state, &self->inputs, step) != HEATRUN_OK) {
            return said(self, "a node would leave -100 to 500 degC");
        }
    }
    self->time_s = currentCommunicationPoint + communicationStepSize;
    *lastSuccessfulTime = self->time_s;
    return fmi3OK;
}

/* What there is nothing to do for, and what modelDescription.xml does not promise. */
#define RETURNS(status, name, arguments) \
    fmi3Status name arguments \
    { \
        return status; \
    }
#define ABSENT(name, arguments) RETURNS(fmi3Error, name, arguments)
#define IT fmi3Instance it
#define MANY IT, const fmi3ValueReference references[], size_t num
RETURNS(fmi3OK, fmi3Terminate, (IT))
RETURNS(fmi3OK, fmi3EnterStepMode, (IT))
RETURNS(fmi3OK, fmi3SetDebugLogging, (IT, fmi3Boolean on, size_t n, const fmi3String categories[]))
#define NO_VALUES(Type) \
    ABSENT(fmi3Get##Type, (MANY, fmi3##Type values[], size_t num_values)) \
    ABSENT(fmi3Set##Type, (MANY, const fmi3##Type values[], size_t num_values))
NO_VALUES(Float32)
NO_VALUES(Int8)
NO_VALUES(UInt8)
NO_VALUES(Int16)
NO_VALUES(UInt16)
NO_VALUES(Int32)
NO_VALUES(UInt32)
NO_VALUES(Int64)
NO_VALUES(UInt64)
NO_VALUES(Boolean)
NO_VALUES(String)
ABSENT(fmi3GetBinary, (MANY, size_t sizes[], fmi3Binary values[], size_t num_values))
ABSENT(fmi3SetBinary, (MANY, const size_t sizes[], const fmi3Binary values[], size_t num_values))
ABSENT(fmi3GetClock, (MANY, fmi3Clock values[]))
ABSENT(fmi3SetClock, (MANY, const fmi3Clock values[]))
ABSENT(fmi3GetIntervalDecimal, (MANY, fmi3Float64 at[], fmi3IntervalQualifier how[]))
ABSENT(fmi3SetIntervalDecimal, (MANY, const fmi3Float64 at[]))
ABSENT(fmi3GetIntervalFraction, (MANY, fmi3UInt64 a[], fmi3UInt64 b[], fmi3IntervalQualifier how[]))
ABSENT(fmi3SetIntervalFraction, (MANY, const fmi3UInt64 a[], const fmi3UInt64 b[]))
ABSENT(fmi3GetShiftDecimal, (MANY, fmi3Float64 at[]))
ABSENT(fmi3SetShiftDecimal, (MANY, const fmi3Float64 at[]))
ABSENT(fmi3GetShiftFraction, (MANY, fmi3UInt64 a[], fmi3UInt64 b[]))
ABSENT(fmi3SetShiftFraction, (MANY, const fmi3UInt64 a[], const fmi3UInt64 b[]))
ABSENT(fmi3GetOutputDerivatives, (MANY, const fmi3Int32 orders[], fmi3Float64 values[], size_t n))
#define DERIVATIVE(name) \
    ABSENT(name, (MANY, const fmi3ValueReference knowns[], size_t num_knowns, \
                  const fmi3Float64 seed[], size_t num_seed, fmi3Float64 values[], size_t n))
DERIVATIVE(fmi3GetDirectionalDerivative)
DERIVATIVE(fmi3GetAdjointDerivative)
ABSENT(fmi3GetNumberOfVariableDependencies, (IT, fmi3ValueReference reference, size_t *num))
ABSENT(fmi3GetVariableDependencies,
       (IT, fmi3ValueReference reference, size_t elements[], fmi3ValueReference independents[],
        size_t of_independents[], fmi3DependencyKind kinds[], size_t num))
ABSENT(fmi3GetFMUState, (IT, fmi3FMUState *state))
ABSENT(fmi3SetFMUState, (IT, fmi3FMUState state))
ABSENT(fmi3FreeFMUState, (IT, fmi3FMUState *state))
ABSENT(fmi3SerializedFMUStateSize, (IT, fmi3FMUState state, size_t *size))
ABSENT(fmi3SerializeFMUState, (IT, fmi3FMUState state, fmi3Byte bytes[], size_t size))
ABSENT(fmi3DeserializeFMUState, (IT, const fmi3Byte bytes[], size_t size, fmi3FMUState *state))
ABSENT(fmi3EnterEventMode, (IT))
ABSENT(fmi3EnterConfigurationMode, (IT))
ABSENT(fmi3ExitConfigurationMode, (IT))
ABSENT(fmi3EvaluateDiscreteStates, (IT))
ABSENT(fmi3UpdateDiscreteStates, (IT, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *c,
                                  fmi3Boolean *d, fmi3Boolean *e, fmi3Float64 *time))
ABSENT(fmi3EnterContinuousTimeMode, (IT))
ABSENT(fmi3CompletedIntegratorStep, (IT, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *c))
ABSENT(fmi3SetTime, (IT, fmi3Float64 time))
ABSENT(fmi3SetContinuousStates, (IT, const fmi3Float64 states[], size_t num))
ABSENT(fmi3GetContinuousStates, (IT, fmi3Float64 values[], size_t num))
ABSENT(fmi3GetContinuousStateDerivatives, (IT, fmi3Float64 values[], size_t num))
ABSENT(fmi3GetNominalsOfContinuousStates, (IT, fmi3Float64 values[], size_t num))
ABSENT(fmi3GetEventIndicators, (IT, fmi3Float64 values[], size_t num))
ABSENT(fmi3GetNumberOfEventIndicators, (IT, size_t *num))
ABSENT(fmi3GetNumberOfContinuousStates, (IT, size_t *num))
ABSENT(fmi3ActivateModelPartition, (IT, fmi3ValueReference reference, fmi3Float64 time))
#define NO_INSTANCE(name, arguments) \
    fmi3Instance name arguments \
    { \
        return NULL; \
    }
#define WORDS \
    fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible, fmi3Boolean logging, \
        fmi3InstanceEnvironment environment, fmi3LogMessageCallback log
NO_INSTANCE(fmi3InstantiateModelExchange, (WORDS))
NO_INSTANCE(fmi3InstantiateScheduledExecution,
            (WORDS, fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
             fmi3UnlockPreemptionCallback unlock))
