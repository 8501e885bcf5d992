/* FMI 2.0 co-simulation: {{ about | comment }}
   SHA-256 of the inputs: {{ sha256 }}.  It needs neither the mathematical library nor Python. */
#include <stdlib.h>
#include <string.h>
#include "fmi2.h"
{{ '#include "controller.h"\n' if law }}
#define PERIOD {{ period }} /* s */
#define SLACK 1e-4 /* of a period, in the times of a master */
#define WHOLE 4503599627370496.0 /* 2^52: a larger number has no fraction */
{% set names = variables|map(attribute="causality")|list %}
enum { INPUTS = {{ names.count("input") }}, GIVEN = INPUTS + {{ names.count("parameter") }}, OUTPUTS = {{ names.count("output") }} };
enum { POLES = {{ poles }}, PIECES = {{ pieces }}, RING = {{ ring }} }; /* pieces of a sample; a ring of torques */

typedef struct {
    fmi2CallbackFunctions callbacks;
    char name[64];
    double start, given[GIVEN]; /* s; inputs, then parameters */
    struct {
        double time, in[INPUTS], out[OUTPUTS]; /* s; inputs at the last sample */
        double a[POLES][2], integral[2]; /* amplitudes of the poles, the torque integrated twice and once */
        double held[RING], acting, angle, rate; /* outputs of the DAC, torque on the hub, readings of the encoder */
        long long sample;
        int is_running, is_held, is_stopped;
    } at;
{{ "    %s_state law;\n"|format(law.identifier) if law }}} model;

{% if has_plant %}
{% for name, rows in tables.items() %}
static const double {{ name }} = {{ rows }};
{% endfor %}

static double on_steps(double value, const double *of) { /* rounded to steps, half to even, and clipped */
    const double steps = of[0] > 0.0 ? value / of[0] : 0.0, big = steps < 0.0 ? -WHOLE : WHOLE;
    const volatile double sum = steps + big;
    if (of[0] > 0.0)
        value = (steps / big < 1.0 ? sum - big : steps) * of[0];
    return value < of[1] ? of[1] : value > of[2] ? of[2] : value;
}

static int measure(model *m) { /* 0 where the root moment is beyond its bound */
    double seen[OUTPUTS - 1];
    for (int o = 0; o < OUTPUTS - 1; o++) {
        seen[o] = rates[o][0] * m->at.integral[0] + rates[o][1] * m->at.integral[1];
        for (int i = 0; i < POLES; i++)
            seen[o] += weights[o][i][0] * m->at.a[i][0] - weights[o][i][1] * m->at.a[i][1];
        seen[o] += through[o] * m->at.acting;
    }
    if (!(seen[2] <= {{ bound }} && seen[2] >= -{{ bound }}))
        return 0;
    seen[0] = on_steps(seen[0], converters[0]);
    seen[2] = on_steps(seen[2], converters[1]);
    m->at.rate = {{ lag }} * m->at.rate + (1.0 - {{ lag }}) * (m->at.sample ? seen[0] - m->at.angle : 0.0) / PERIOD;
    m->at.angle = seen[0];
    {{ "seen[1] = m->at.rate;" if is_differenced }}
    memcpy(m->at.out, seen, sizeof seen);
    return 1;
}

{% endif %}
static int advance(model *m) { /* by one sample; 0 where it cannot */
{% if law %}
    const {{ law.identifier }}_input input = { {% for each in law.inputs %}({{ law.identifier }}_number)m->at.{{ each }}{{ ", " if not loop.last }}{% endfor %} };
    {{ law.identifier }}_number output;
    if ({{ law.identifier }}_step(&m->law, &input, &output))
        return 0;
{% endif %}
    double u = {{ "output" if law else "m->at.in[0]" }};
{% if has_plant %}
    const double old = m->at.held[(m->at.sample + 1) % RING];
    double impulse = m->at.sample ? 0.0 : m->given[INPUTS];
    m->at.held[m->at.sample % RING] = u = on_steps(u, converters[2]);
    m->at.integral[1] += impulse;
    for (int s = 0; s < PIECES; s++, impulse = 0.0) {
        const double dt = piece[s][0];
        m->at.acting = (piece[s][1] > 0.5 ? m->at.held[(m->at.sample + 2) % RING] : old) + m->at.in[INPUTS - 1];
        for (int i = 0; i < POLES; i++) {
            const double re = m->at.a[i][0] + impulse, im = m->at.a[i][1];
            m->at.a[i][0] = turn[s][i][0] * re - turn[s][i][1] * im + push[s][i][0] * m->at.acting;
            m->at.a[i][1] = turn[s][i][0] * im + turn[s][i][1] * re + push[s][i][1] * m->at.acting;
        }
        m->at.integral[0] += dt * m->at.integral[1] + 0.5 * dt * dt * m->at.acting;
        m->at.integral[1] += dt * m->at.acting;
    }
{% endif %}
    m->at.sample++;
    m->at.out[OUTPUTS - 1] = u;
    return {{ "measure(m)" if has_plant else "1" }};
}

static fmi2Status begin(model *m, double start) {
    memset(&m->at, 0, sizeof m->at);
    m->at.time = m->start = start;
{{ "    %s_init(&m->law);\n"|format(law.identifier) if law }}{% if has_plant %}
    m->at.is_stopped = !measure(m);
{% endif %}
    return fmi2OK;
}

static fmi2Status report(model *m, fmi2Status status, fmi2String text) {
    if (m->callbacks.logger)
        m->callbacks.logger(m->callbacks.environment, m->name, status, "logStatusError", text);
    return status;
}

FMI2 fmi2String fmi2GetTypesPlatform(void) { return "default"; }
FMI2 fmi2String fmi2GetVersion(void) { return "2.0"; }
FMI2 void fmi2FreeInstance(fmi2Component c) { free(c); }

FMI2 fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *functions, fmi2Boolean is_visible, fmi2Boolean is_logging) {
    model *m = type == fmi2CoSimulation && strcmp(guid, "{{ guid }}") == 0 ? calloc(1, sizeof *m) : NULL;
    (void)resources, (void)is_visible, (void)is_logging;
    if (!m)
        return NULL;
    m->callbacks = *functions;
    strncpy(m->name, name, sizeof m->name - 1);
    begin(m, 0.0);
    return m;
}

FMI2 fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference *at, size_t n, fmi2Real *value) {
    model *m = c;
    for (size_t i = 0; i < n; i++) {
        if (at[i] >= GIVEN + OUTPUTS)
            return report(m, fmi2Error, "fmi2GetReal: unknown variable");
        value[i] = at[i] < GIVEN ? m->given[at[i]] : m->at.out[at[i] - GIVEN];
    }
    return fmi2OK;
}

FMI2 fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference *at, size_t n, const fmi2Real *value) {
    model *m = c;
    for (size_t i = 0; i < n; i++)
        if (at[i] >= (m->at.is_running ? INPUTS + 0U : GIVEN + 0U) || !(value[i] - value[i] == 0.0))
            return report(m, fmi2Error, "fmi2SetReal: no finite value of an input, or of a parameter before the start");
    for (size_t i = 0; i < n; i++)
        m->given[at[i]] = value[i];
    return m->at.is_running ? fmi2OK : begin(m, m->start);
}

FMI2 fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean is_settled) {
    model *m = c;
    const double off = (time - m->at.time) / PERIOD, end = (time + step - m->start) / PERIOD; /* in samples */
    (void)is_settled;
    if (!m->at.is_running || m->at.is_stopped || !(step > 0.0 && end < 1e15 && off < SLACK && off > -SLACK))
        return report(m, fmi2Error, "fmi2DoStep: not started, stopped, or no step on from the last one");
    while (end - (double)m->at.sample > SLACK) {
        if (!m->at.is_held)
            memcpy(m->at.in, m->given, sizeof m->at.in);
        m->at.is_held = end - (double)m->at.sample < {{ "1.0 - SLACK" if has_plant else "SLACK" }}; /* it ends later */
        if (m->at.is_held)
            break;
        m->at.time = m->start + (double)m->at.sample * PERIOD;
        m->at.is_stopped = !advance(m);
        if (m->at.is_stopped)
            return report(m, fmi2Discard, "stopped: the root moment or the controller is beyond its bound");
    }
    m->at.time = time + step;
    return fmi2OK;
}

{# of FMI in one statement: name, types of arguments, status #}
{% set at = ["const fmi2ValueReference *", "size_t"] %}
{% set absent = "report(c, fmi2Error, __func__)" %}
{% set none_of_a_kind = "a2 ? " ~ absent ~ " : fmi2OK" %}
{% set functions = [
    ("SetDebugLogging", ["fmi2Boolean", "size_t", "const fmi2String *"], "fmi2OK"),
    ("SetupExperiment", ["fmi2Boolean", "fmi2Real", "fmi2Real", "fmi2Boolean", "fmi2Real"], "begin(c, a3)"),
    ("EnterInitializationMode", [], "fmi2OK"),
    ("ExitInitializationMode", [], "((model *)c)->at.is_running = 1, fmi2OK"),
    ("Terminate", [], "fmi2OK"),
    ("Reset", [], "memset(((model *)c)->given, 0, sizeof ((model *)c)->given), begin(c, 0.0)"),
    ("GetInteger", at + ["fmi2Integer *"], none_of_a_kind),
    ("SetInteger", at + ["const fmi2Integer *"], none_of_a_kind),
    ("GetBoolean", at + ["fmi2Boolean *"], none_of_a_kind),
    ("SetBoolean", at + ["const fmi2Boolean *"], none_of_a_kind),
    ("GetString", at + ["fmi2String *"], none_of_a_kind),
    ("SetString", at + ["const fmi2String *"], none_of_a_kind),
    ("GetFMUstate", ["fmi2FMUstate *"], absent),
    ("SetFMUstate", ["fmi2FMUstate"], absent),
    ("FreeFMUstate", ["fmi2FMUstate *"], absent),
    ("SerializedFMUstateSize", ["fmi2FMUstate", "size_t *"], absent),
    ("SerializeFMUstate", ["fmi2FMUstate", "fmi2Byte *", "size_t"], absent),
    ("DeSerializeFMUstate", ["const fmi2Byte *", "size_t", "fmi2FMUstate *"], absent),
    ("GetDirectionalDerivative", at + at + ["const fmi2Real *", "fmi2Real *"], absent),
    ("SetRealInputDerivatives", at + ["const fmi2Integer *", "const fmi2Real *"], absent),
    ("GetRealOutputDerivatives", at + ["const fmi2Integer *", "fmi2Real *"], absent),
    ("CancelStep", [], absent),
    ("GetStatus", ["fmi2StatusKind", "fmi2Status *"], "fmi2Discard"),
    ("GetIntegerStatus", ["fmi2StatusKind", "fmi2Integer *"], "fmi2Discard"),
    ("GetStringStatus", ["fmi2StatusKind", "fmi2String *"], "fmi2Discard"),
    ("GetRealStatus", ["fmi2StatusKind", "fmi2Real *"],
     "*a2 = ((model *)c)->at.time, a1 == fmi2LastSuccessfulTime ? fmi2OK : fmi2Discard"),
    ("GetBooleanStatus", ["fmi2StatusKind", "fmi2Boolean *"],
     "*a2 = ((model *)c)->at.is_stopped, a1 == fmi2Terminated ? fmi2OK : fmi2Discard"),
] %}
{% for name, types, result in functions %}
FMI2 fmi2Status fmi2{{ name }}(fmi2Component c{% for type in types %}, {{ type }} a{{ loop.index }}{% endfor %}) {
    (void)c{% for type in types %}, (void)a{{ loop.index }}{% endfor %};
    return {{ result }};
}
{% endfor %}
