/* {{ facts[0][1]|comment }}: see controller.h */
#include "controller.h"

#include <float.h>

{% if not fixed %}
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0
#error "numbers are rounded to their type: compile for SSE2 or set -mfpmath=sse"
#endif

{% endif %}
{% macro matrix(key, rows) %}
static const {{ real }} {{ key }}[{{ rows|length }}][{{ rows[0]|length }}] = {
{% for row in rows %}
    { {{- row|join(", ") -}} },
{% endfor %}
};
{% endmacro %}
{% if n %}
{{ matrix("A", A) }}
{{- matrix("B", B) }}
{{- matrix("C", C) }}
{%- endif %}
{{ matrix("D", D) }}
{% if fixed %}
{% if n %}
static const int shifts[{{ n }}] = { {{- shifts[:-1]|join(", ") -}} };
{% endif %}

static int64_t shifted(int64_t value, int shift) /* value/2^shift to the nearest, halves upwards */
{
    const uint64_t top = UINT64_C(1) << 63, half = UINT64_C(1) << (shift - 1);
    return (int64_t)(((uint64_t)value + top + half) >> shift) - (int64_t)(top >> shift);
}

static int32_t clipped(int64_t value, int32_t low, int32_t high)
{
    return value < low ? low : value > high ? high : (int32_t)value;
}
{% else %}
static int is_finite({{ real }} value)
{
    return value >= -{{ largest }} && value <= {{ largest }};
}
{% if converter %}

static {{ real }} converted(double u) /* on the steps of the DAC and within its limits */
{
{% if dac[0] %}
    const double whole = 6755399441055744.0, exact = 2251799813685248.0; /* 1.5 2^52, 2^51 */
    double n = u / {{ dac[0] }};
    if (n > -exact && n < exact)
        n = (n + whole) - whole;
    u = n * {{ dac[0] }};
{% endif %}
    return ({{ real }})(u < {{ dac[1] }} ? {{ dac[1] }} : u > {{ dac[2] }} ? {{ dac[2] }} : u);
}
{% endif %}
{% endif %}

void {{ name }}_init({{ name }}_state *state)
{
    static {{ name }}_state zero;
    *state = zero;
}

int {{ name }}_step({{ name }}_state *state, const {{ name }}_input *input, {{ name }}_number *output)
{
{% if n or delay %}
    int i;
{% endif %}
    int j;
    {{ wide }} e[{{ m }}], u;
{% if n %}
    {{ wide }} total;
    {{ name }}_number following[{{ n }}];
{% endif %}
{% if hub %}
    double rate;
{% endif %}

{% if not fixed %}
    *output = state->output;
    if (!({% for field in fields %}is_finite(input->{{ field.identifier }}){{ ")" if loop.last else " && " }}{% endfor %})
        return {{ name }}_INPUT_ERROR;
{% endif %}
{% if hub %}
    rate = {{ hub[1] }} * state->rate
        + (1.0 - {{ hub[1] }}) * ((double)input->{{ hub[0] }} - (state->begun ? state->angle : (double)input->{{ hub[0] }})) / {{ hub[2] }};
{% endif %}
{% for each in errors %}
    e[{{ loop.index0 }}] = {{ each }};
{% endfor %}
    u = {{ "input->feedforward * (INT64_C(1) << %d)"|format(shifts[-1]) if fixed else "input->feedforward" }};
{% if n %}
    for (i = 0; i < {{ n }}; i++)
        u += {{ cast }}C[0][i] * state->x[i];
{% endif %}
    for (j = 0; j < {{ m }}; j++)
        u += {{ cast }}D[0][j] * e[j];
{% if n %}
    for (i = 0; i < {{ n }}; i++) {
        total = 0;
        for (j = 0; j < {{ n }}; j++)
            total += {{ cast }}A[i][j] * state->x[j];
        for (j = 0; j < {{ m }}; j++)
            total += {{ cast }}B[i][j] * e[j];
{% if fixed %}
        following[i] = clipped(shifted(total, shifts[i]), INT32_MIN, INT32_MAX);
{% else %}
        following[i] = total;
        if (!is_finite(total))
            return {{ name }}_OVERFLOW;
{% endif %}
    }
{% endif %}
{% if fixed %}
    u = shifted(u, {{ shifts[-1] }});
{% if dac[0] %}
    u = shifted(u, {{ dac[0] }}) * (INT64_C(1) << {{ dac[0] }});
{% endif %}
{% else %}
    if (!is_finite(u))
        return {{ name }}_OVERFLOW;
{% endif %}
{% if n %}
    for (i = 0; i < {{ n }}; i++)
        state->x[i] = following[i];
{% endif %}
{% if hub %}
    state->angle = (double)input->{{ hub[0] }};
    state->rate = rate;
    state->begun = 1;
{% endif %}
{% set final = "clipped(u, %s, %s)"|format(dac[1], dac[2]) if fixed else "converted(u)" if converter else "u" %}
{% if delay %}
    state->output = state->line[0];
    for (i = 0; i < {{ delay - 1 }}; i++)
        state->line[i] = state->line[i + 1];
    state->line[{{ delay - 1 }}] = {{ final }};
{% else %}
    state->output = {{ final }};
{% endif %}
    *output = state->output;
    return 0;
}
