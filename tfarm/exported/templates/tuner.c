/* {{ facts[0][1]|comment }}: see tuner.h */
#include "tuner.h"

{% for key, number in scalars.items() %}
static const {{ real }} {{ key }} = {{ number }};
{% endfor %}
{% for key, numbers in tables.items() %}
static const {{ real }} {{ key }}[{{ numbers|length }}] = {
{% for row in numbers|batch(4) %}
    {{ row|join(", ") }},
{% endfor %}
};
{% endfor %}

static {{ real }} polynomial({{ real }} x, const {{ real }} *coefficients, int size)
{
    {{ real }} total = coefficients[size - 1];
    for (int n = size - 2; n >= 0; n--)
        total = total * x + coefficients[n];
    return total;
}

/* e^x for x <= 0, within 1.5 units in the last place: 2^k e^r, x = k ln 2 + r (Cody and Waite), Taylor */
static {{ real }} exponential({{ real }} x)
{
    {{ real }} k, result, power = half;
    if (!(x > lowest))
        return 0;
    k = (x * inverse + shift) - shift;
    result = polynomial((x - k * high) - k * low, taylor, {{ tables.taylor|length }});
    for (int n = (int)-k; n > 0; n /= 2) { /* at most ten times */
        if (n % 2 == 1)
            result *= power;
        power *= power;
    }
    return result;
}

static {{ real }} sigmoid({{ real }} z)
{
    const {{ real }} small = exponential(z > 0 ? -z : z);
    return (z > 0 ? 1 : small) / (1 + small);
}

static {{ real }} network(const {{ real }} *row)
{
    {{ real }} z = 0, net, gain;
    for (int j = 0; j < {{ of.w2|length }}; j++) {
        net = 0;
        for (int i = 0; i < {{ of.scales|length }}; i++)
            net += W1[{{ of.scales|length }} * j + i] * (row[i] / scales[i]);
        z += w2[j] * sigmoid(net);
    }
    gain = lo + (hi - lo) * sigmoid(z);
    return gain > hi ? hi : gain;
}

static int is_small({{ real }} value) /* not NaN, and so small that no sum overflows */
{
    return -largest <= value && value <= largest;
}

void {{ name }}_init({{ name }}_state *state)
{
    *state = ({{ name }}_state){ 0 };
}

int {{ name }}_step({{ name }}_state *state, const {{ name }}_input *input, {{ name }}_number *output)
{
    const {{ real }} x = input->y_root_moment{{ "" if of.is_total else " - input->r_root_moment" }};
    const {{ real }} servo = Kp * (input->r_hub_angle - input->y_hub_angle) + K1 * (input->r_hub_rate - input->y_hub_rate);
    const {{ real }} u = servo{{ " + input->feedforward" if of.is_total }};
    const {{ real }} row[] = { u, state->u, state->e, state->e_before, x, state->x, state->gain };
    const {{ real }} gain = network(row), e = u - gain * x, torque = (input->feedforward + servo) - gain * x;

    *output = state->output;
    if (!({% for field in fields %}is_small(input->{{ field.identifier }}){{ "" if loop.last else " && " }}{% endfor %}))
        return {{ name }}_INPUT_ERROR;
    if (!(is_small(u) && is_small(e) && is_small(x) && is_small(gain) && is_small(torque)))
        return {{ name }}_OVERFLOW;
    *state = ({{ name }}_state){ u, e, x, gain, state->e, torque };
    *output = torque;
    return 0;
}
