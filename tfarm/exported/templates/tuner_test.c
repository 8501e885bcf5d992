/* Self-test: recorded samples of a slew, then NaN in each input.  The exit status is 0 without deviations. */
#include "tuner.h"
#include <stdio.h>

enum { SAMPLES = {{ rows | length }}, INPUTS = {{ inputs | length }} };

/* A row: {{ inputs | join(", ") }}, torque. */
static const {{ real }} samples[SAMPLES][INPUTS + 1] = {
{% for row in rows %}
    { {{ row | literals }} },
{% endfor %}
};

int main(void)
{
    {{ name }}_state state;
    {{ name }}_inputs in;
    {{ real }} torque, away, largest = 0, *const fields[] = { &in.{{ inputs | join(", &in.") }} };
    const volatile {{ real }} zero = 0;
    int k, i, deviations = 0;

    {{ name }}_init(&state);
    for (k = 0; k < SAMPLES; ++k) {
        for (i = 0; i < INPUTS; ++i) *fields[i] = samples[k][i];
        deviations += {{ name }}_step(&state, &in, &torque) != 0 || torque != samples[k][INPUTS];
        away = torque > samples[k][INPUTS] ? torque - samples[k][INPUTS] : samples[k][INPUTS] - torque;
        largest = away > largest ? away : largest;
    }
    for (i = 0; i < INPUTS; ++i) {
        *fields[i] = zero / zero;
        deviations += {{ name }}_step(&state, &in, &torque) != 1 || torque != samples[SAMPLES - 1][INPUTS];
        *fields[i] = samples[SAMPLES - 1][i];
    }
    printf("%d deviations, the largest of a torque %g\n", deviations, (double)largest);
    return deviations != 0;
}
