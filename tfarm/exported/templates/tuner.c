/*
{% for label, value in facts.items() %}
 * {{ (label ~ ": " ~ value) | comment }}
{% endfor %}
 *
 * Equal to tfarm bit for bit without fused multiply-add (-ffp-contract=off) and where FLT_EVAL_METHOD is 0.
 */
#include "tuner.h"

{% set a = of.activation %}
static const {{ real }} W1[{{ of.W1 | length }}][{{ of.scales | length }}] = {
{% for row in of.W1 %}
    { {{ row | literals }} },
{% endfor %}
};
{% for array, values in {"w2": of.w2, "scales": of.scales, "taylor": a.taylor, "atanh_terms": a.atanh}.items() %}
{% if array != "atanh_terms" or of.is_free %}
static const {{ real }} {{ array }}[{{ values | length }}] = { {{ values | literals }} };
{% endif %}
{% endfor %}

static {{ real }} polynomial({{ real }} x, const {{ real }} *coefficients, int number)
{
    {{ real }} total = coefficients[number - 1];
    int n;
    for (n = number - 2; n >= 0; --n) total = total * x + coefficients[n];
    return total;
}

/* e^x for x <= 0, within {{ ulps.exp }} units in the last place; 0 up to {{ a.lowest | literal }}.
 * x = k ln 2 + r (Cody and Waite), e^r by Taylor's polynomial, coefficients 1/n!. */
static {{ real }} exponential({{ real }} x)
{
    {{ real }} k, result, power = {{ a.half | literal }};
    int n;
    if (!(x > {{ a.lowest | literal }})) return x == x ? {{ a.zero | literal }} : x;
    k = (x * {{ a.inverse | literal }} + {{ a.shift | literal }}) - {{ a.shift | literal }};
    result = polynomial((x - k * {{ a.high | literal }}) - k * {{ a.low | literal }}, taylor, {{ a.taylor | length }});
    for (n = (int)-k; n > 0; n /= 2) { /* at most ten times */
        if (n % 2 == 1) result *= power;
        power *= power;
    }
    return result;
}

static {{ real }} sigmoid({{ real }} z)
{
    const {{ real }} small = exponential(z > {{ a.zero | literal }} ? -z : z);
    return (z > {{ a.zero | literal }} ? {{ a.one | literal }} : small) / ({{ a.one | literal }} + small);
}
{% if of.is_free %}

/* ln(1 + y) for 0 <= y <= 1, within {{ ulps.log }} units in the last place: f - s (f - R), s = f/(2 + f), R the terms
 * of 2 atanh(s) from s^3 on over s, coefficients 2/(2 j + 1). */
static {{ real }} logarithm({{ real }} y)
{
    const {{ real }} f = y < {{ a.turn | literal }} ? y : {{ a.half | literal }} * (y - {{ a.one | literal }});
    const {{ real }} s = f / ({{ a.two | literal }} + f), square = s * s;
    const {{ real }} below = s * (f - square * polynomial(square, atanh_terms, {{ a.atanh | length }}));
    return y < {{ a.turn | literal }} ? f - below : {{ a.high | literal }} + (f - (below - {{ a.low | literal }}));
}
{% endif %}

static {{ real }} gain_of(const {{ real }} *row)
{
    {{ real }} z = {{ a.zero | literal }}, net, gain;
    int i, j;
    for (j = 0; j < {{ of.w2 | length }}; ++j) {
        net = {{ a.zero | literal }};
        for (i = 0; i < {{ of.scales | length }}; ++i) net += W1[j][i] * (row[i] / scales[i]);
        z += w2[j] * sigmoid(net);
    }
{% if of.is_free %}
    gain = logarithm(exponential(z > {{ a.zero | literal }} ? -z : z));
    return z > {{ a.zero | literal }} ? z + gain : gain;
{% else %}
    gain = {{ of.lo | literal }} + {{ of.span | literal }} * sigmoid(z);
    gain = gain < {{ of.lo | literal }} ? {{ of.lo | literal }} : gain;
    return gain > {{ of.hi | literal }} ? {{ of.hi | literal }} : gain;
{% endif %}
}

static int is_inside({{ real }} value)
{
    return -{{ of.largest | literal }} <= value && value <= {{ of.largest | literal }};
}

void {{ name }}_init({{ name }}_state *state)
{
    state->u = state->e = state->x = state->K = state->e_before = state->torque = {{ a.zero | literal }};
}

int {{ name }}_step({{ name }}_state *state, const {{ name }}_inputs *in, {{ real }} *torque)
{
    const {{ real }} x = in->root_moment{% if not of.is_total %} - in->rigid_moment{% endif %};
    const {{ real }} servo = {{ of.Kp | literal }} * (in->angle_reference - in->hub_angle)
        + {{ of.K1 | literal }} * (in->rate_reference - in->hub_rate);
    const {{ real }} u = servo{% if of.is_total %} + in->feedforward{% endif %};
    const {{ real }} row[] = { u, state->u, state->e, state->e_before, x, state->x{{ ", state->K" if of.scales | length == 7 }} };
    const {{ real }} gain = gain_of(row), e = u - gain * x, wanted = (in->feedforward + servo) - gain * x;
    const int is_fine = is_inside(u) && is_inside(e) && is_inside(x) && is_inside(gain) && is_inside(wanted);
    if (is_fine) {
        state->e_before = state->e;
        state->u = u;
        state->e = e;
        state->x = x;
        state->K = gain;
        state->torque = wanted;
    }
    *torque = state->torque;
    return !is_fine;
}
