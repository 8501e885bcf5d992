/*
{% for label, value in facts.items() %}
 * {{ (label ~ ": " ~ value) | comment }}
{% endfor %}
 */
#ifndef {{ name | upper }}_H
#define {{ name | upper }}_H

/* Inputs of a sample. */
typedef struct {
{% for input, meaning in inputs.items() %}
    {{ real }} {{ input }}; /* {{ meaning }} */
{% endfor %}
} {{ name }}_inputs;

/* State: u, e, x [N m] and gain K of the last sample, e of the one before, and the torque. */
typedef struct {
    {{ real }} u, e, x, K, e_before, torque;
} {{ name }}_state;

void {{ name }}_init({{ name }}_state *state);

/* Advance by one sample: return 0, or 1 where an input or a result is NaN, infinite or beyond
 * {{ of.largest | literal }}.  The torque is then that of the sample before, and the state is kept. */
int {{ name }}_step({{ name }}_state *state, const {{ name }}_inputs *in, {{ real }} *torque);

#endif
