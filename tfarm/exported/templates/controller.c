/* {{ facts[0][1]|comment }}: see controller.h */
#include "controller.h"

static const {{ real }} ABCD[{{ n + 1 }}][{{ n + m }}] = { /* of [x; e], to the next x, and to the output */
{% for row in table %}
    { {{- row|join(", ") -}} },
{% endfor %}
};

{% if fixed %}
static const int shifts[{{ n + 1 }}] = { {{- shifts|join(", ") -}} };

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
{% if step %}
    const double whole = 6755399441055744.0, exact = 2251799813685248.0; /* 1.5 2^52, 2^51 */
    double n = u / {{ dac[0] }};
    if (n > -exact && n < exact)
        n = n > 0 ? (n + whole) - whole : n < 0 ? -((whole - n) - whole) : n;
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
    int i, j;
    {{ wide }} z[{{ n + m }}], next[{{ n + 1 }}], total, u;
{{ "    double rate;\n" if hub }}
{% if not fixed %}
    *output = state->output;
    if (!({% for field in fields %}is_finite(input->{{ field.identifier }}){{ ")" if loop.last else " && " }}{% endfor %})
        return {{ name }}_INPUT_ERROR;
{% endif %}
{% if hub %}
    rate = state->begun ? (double)input->{{ hub[0] }} - state->angle : 0.0;
    rate = {{ hub[1] }} * state->rate + (1.0 - {{ hub[1] }}) * rate / {{ hub[2] }};
{% endif %}
{{ "    for (j = 0; j < %d; j++)\n        z[j] = state->x[j];\n"|format(n) if n -}}
{% for each in errors %}
    z[{{ n + loop.index0 }}] = {{ each }};
{% endfor %}
    for (i = 0; i < {{ n + 1 }}; i++) {
        total = i < {{ n }} ? 0 : input->feedforward{{ " * (INT64_C(1) << %d)"|format(shifts[-1]) if fixed }};
        for (j = 0; j < {{ n + m }}; j++)
            total += {{ cast }}ABCD[i][j] * z[j];
{% if fixed %}
        next[i] = shifted(total, shifts[i]);
{% else %}
        if (!is_finite(total))
            return {{ name }}_OVERFLOW;
        next[i] = total;
{% endif %}
    }
    u = next[{{ n }}];
{{ "    u = shifted(u, %s) * (INT64_C(1) << %s);\n"|format(dac[0], dac[0]) if fixed and step -}}
{% if n %}
    for (i = 0; i < {{ n }}; i++)
        state->x[i] = {{ "clipped(next[i], INT32_MIN, INT32_MAX)" if fixed else "next[i]" }};
{% endif %}
{% if hub %}
    state->angle = (double)input->{{ hub[0] }};
    state->rate = rate;
    state->begun = 1;
{% endif %}
{% set final = "clipped(u, %s, %s)"|format(dac[1], dac[2]) if fixed else "converted(u)" if converter else "u" %}
{% if delay %}
    state->output = state->line[0];
{{ "    for (i = 0; i < %d; i++)\n        state->line[i] = state->line[i + 1];\n"|format(delay - 1) if delay > 1 -}}
    state->line[{{ delay - 1 }}] = {{ final }};
{% else %}
    state->output = {{ final }};
{% endif %}
    *output = state->output;
    return 0;
}
