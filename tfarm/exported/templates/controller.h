/*
{% for label, value in facts %}
 * {{ label|comment }}: {{ value|comment }}
{% endfor %}
 *
 * Inputs {{ "as fractions of their ranges, 2147483648 for each range" if fixed else "in SI units" }}:
{% for field in fields %}
 *   {{ field.identifier }}: {{ field.text|comment }}
{% endfor %}
 * Output: {{ output|comment }}
 *
 * Call {{ name }}_init once and {{ name }}_step at each sample.  {{ name }}_step returns 0, or
 * {{ name }}_INPUT_ERROR for an input that is not finite and {{ name }}_OVERFLOW for a result
 * that is not: it then holds the output and keeps the state.
 * Compile with -ffp-contract=off and without -ffast-math.
 */
#ifndef {{ name }}_CONTROLLER_H
#define {{ name }}_CONTROLLER_H

#include <stdint.h>

#define {{ name }}_INPUT_ERROR 1
#define {{ name }}_OVERFLOW 2

typedef {{ real }} {{ name }}_number;

typedef struct {
{% for field in fields %}
    {{ name }}_number {{ field.identifier }};
{% endfor %}
} {{ name }}_input;

typedef struct {
{% if n %}
    {{ name }}_number x[{{ n }}];
{% endif %}
{% if delay %}
    {{ name }}_number line[{{ delay }}]; /* delay of the controller */
{% endif %}
{% if hub %}
    double angle, rate; /* estimate of the hub rate */
    int begun;
{% endif %}
    {{ name }}_number output;
} {{ name }}_state;

void {{ name }}_init({{ name }}_state *state);
int {{ name }}_step({{ name }}_state *state, const {{ name }}_input *input, {{ name }}_number *output);

#endif
