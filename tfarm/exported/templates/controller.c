/* {{ facts[0][1]|comment }}: see controller.h */
#include "controller.h"

static const {{ real }} ABCD[{{ n + 1 }}][{{ n + m }}] = { /* of [x; e], to the next x, and to the output */
{% for row in table %}
    { {{- row|join(", ") -}} },
{% endfor %}
};

{% if back %}
static const {{ real }} BACK[{{ n }}] = { {{- back[2:]|join(", ") -}} }; /* back-calculation from a clipped output */

{% endif %}
{% if shaped %}
static const int LAGS[{{ lags|length }}] = { {{- lags|join(", ") -}} }; /* of the impulses of the shaper, in samples */
static const {{ real }} SIZES[{{ lags|length }}] = { {{- impulses|join(", ") -}} };{{ " /* over 2^%d */"|format(shift) if fixed }}

{% endif %}
{% if fixed %}
static const unsigned int shifts[{{ n + 1 }}] = { {{- shifts|join("U, ") -}} U};

static int64_t shifted(int64_t value, unsigned int shift) /* value/2^shift to the nearest, halves upwards */
{
    const uint64_t top = UINT64_C(1) << 63U, half = UINT64_C(1) << (shift - 1U);
    const uint64_t sum = ((uint64_t)value + top + half) >> shift, offset = top >> shift;
    return (int64_t)sum - (int64_t)offset;
}

static int32_t clipped(int64_t value, int64_t low, int64_t high, int event, int *status)
{
    const int64_t within = (value < low) ? low : ((value > high) ? high : value);
    if (within != value) {
        *status = event;
    }
    return (int32_t)within;
}
{% else %}
static int is_finite({{ real }} value)
{
    return ((value >= -{{ largest }}) && (value <= {{ largest }})) ? 1 : 0;
}
{% if converter %}

static {{ real }} converted(double u, int *status) /* on the steps of the DAC and within its limits */
{
    double value = u;
{% if step %}
    const double whole = 6755399441055744.0, exact = 2251799813685248.0; /* 1.5 2^52, 2^51 */
    double n = u / {{ dac[0] }};
    if ((n > 0.0) && (n < exact)) {
        n = (n + whole) - whole;
    } else if ((n < 0.0) && (n > -exact)) {
        n = -((whole - n) - whole);
    } else {
        /* 0, or without a fraction */
    }
    value = n * {{ dac[0] }};
{% endif %}
    if (value < {{ dac[1] }}) {
        value = {{ dac[1] }};
        *status = {{ name }}_SATURATED;
    }
    if (value > {{ dac[2] }}) {
        value = {{ dac[2] }};
        *status = {{ name }}_SATURATED;
    }
    return ({{ real }})value;
}
{% endif %}
{% endif %}

void {{ name }}_init({{ name }}_state *state)
{
    static const {{ name }}_state zero;
    *state = zero;
}

int {{ name }}_step({{ name }}_state *state, const {{ name }}_input *input, {{ name }}_number *output)
{
    int i, j, status = 0;
    {{ wide }} z[{{ n + m }}], next[{{ n + 1 }}], total;
{{ "    double rate;\n" if hub }}{{ "    %s r[%d];\n"|format(wide, shaped|length) if shaped }}
{% if not fixed %}
    *output = state->output;
    if ({% for field in fields %}(is_finite(input->{{ field.identifier }}) == 0){{ ") {" if loop.last else " || " }}{% endfor %}

        return {{ name }}_INPUT_ERROR;
    }
{% endif %}
{% if hub %}
    rate = (state->begun != 0) ? ((double)input->{{ hub[0] }} - state->angle) : 0.0;
    rate = ({{ hub[1] }} * state->rate) + (((1.0 - {{ hub[1] }}) * rate) / {{ hub[2] }});
{% endif %}
{% if shaped %}
{% for field in shaped %}
    state->ring[state->place][{{ loop.index0 }}] = input->{{ field.identifier }};
{% endfor %}
    for (i = 0; i < {{ shaped|length }}; i++) {
        r[i] = 0{{ ".0" + suffix if not fixed }};
        for (j = 0; j < {{ lags|length }}; j++) {
            r[i] += {{ cast }}SIZES[j] * state->ring[((state->place + {{ length }}) - LAGS[j]) % {{ length }}][i];
        }
{% if fixed %}
        r[i] = shifted(r[i], {{ shift }}U);
{% endif %}
    }
{% endif %}
{% if n %}
    for (j = 0; j < {{ n }}; j++) {
        z[j] = state->x[j];
    }
{% endif %}
{% for each in errors %}
    z[{{ n + loop.index0 }}] = {{ each }};
{% endfor %}
    for (i = 0; i < {{ n + 1 }}; i++) {
        total = 0{{ ".0" + suffix if not fixed }};
        if (i == {{ n }}) {
            total = {{ feedforward }}{{ " * INT64_C(%d)"|format(2**shifts[-1]) if fixed }};
        }
        for (j = 0; j < {{ n + m }}; j++) {
            total += {{ cast }}ABCD[i][j] * z[j];
        }
{% if fixed %}
        next[i] = shifted(total, shifts[i]);
{% else %}
        if (is_finite(total) == 0) {
            return {{ name }}_OVERFLOW;
        }
        next[i] = total;
{% endif %}
    }
{% if back %}
    total = next[{{ n }}];
    total = ((total < {{ back[0] }}) ? {{ back[0] }} : ((total > {{ back[1] }}) ? {{ back[1] }} : total)) - total;
    if ((total < 0.0{{ suffix }}) || (total > 0.0{{ suffix }})) {
        for (i = 0; i < {{ n }}; i++) {
            next[i] += BACK[i] * total;
            if (is_finite(next[i]) == 0) {
                return {{ name }}_OVERFLOW;
            }
        }
    }
{% endif %}
{% if fixed and step %}
    next[{{ n }}] = shifted(next[{{ n }}], {{ dac[0] }}U) * INT64_C({{ 2**step }});
{% endif %}
{% set u = "next[%d]"|format(n) %}
{% set final = "clipped(%s, %s, %s, %s_SATURATED, &status)"|format(u, dac[1], dac[2], name) if fixed else "converted(%s, &status)"|format(u) if converter else u %}
{% if delay %}
    state->output = state->line[0];
{% if delay > 1 %}
    for (i = 0; i < {{ delay - 1 }}; i++) {
        state->line[i] = state->line[i + 1];
    }
{% endif %}
    state->line[{{ delay - 1 }}] = {{ final }};
{% else %}
    state->output = {{ final }};
{% endif %}
{% if n %}
    for (i = 0; i < {{ n }}; i++) {
        state->x[i] = {{ "clipped(next[i], INT32_MIN, INT32_MAX, %s_STATE_SATURATED, &status)"|format(name) if fixed else "next[i]" }};
    }
{% endif %}
{% if hub %}
    state->angle = (double)input->{{ hub[0] }};
    state->rate = rate;
    state->begun = 1;
{% endif %}
{% if shaped %}
    state->place = (state->place + 1) % {{ length }};
{% endif %}
    *output = state->output;
    return status;
}
