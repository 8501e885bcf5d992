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
 * Call {{ name }}_init once and {{ name }}_step at each sample.
{% if fixed %}
 * {{ name }}_step returns 0.
{% else %}
 * {{ name }}_step returns 0, {{ name }}_INPUT_ERROR for an input that is not finite, or {{ name }}_OVERFLOW for such a
 * result: it then holds the output and keeps the state.  Compile with -ffp-contract=off, without -ffast-math.
{% endif %}
 */
#ifndef {{ name }}_CONTROLLER_H
#define {{ name }}_CONTROLLER_H

#include <float.h>
#include <stdint.h>

{% if not fixed %}
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0
#error "numbers are rounded to their type: compile for SSE2 or set -mfpmath=sse"
#endif
{% endif %}

#define {{ name }}_INPUT_ERROR 1
#define {{ name }}_OVERFLOW 2

typedef {{ real }} {{ name }}_number;

typedef struct {
    {{ name }}_number {% for field in fields %}{{ field.identifier }}{{ ";" if loop.last else ", " }}{% endfor %}

} {{ name }}_input;

typedef struct {
{% block state %}
{{ "    %s_number x[%d];\n"|format(name, n) if n -}}
{{ "    %s_number line[%d]; /* delay of the controller */\n"|format(name, delay) if delay -}}
{{ "    double angle, rate; /* estimate of the hub rate */\n    int begun;\n" if hub -}}
{% endblock %}
    {{ name }}_number output;
} {{ name }}_state;

void {{ name }}_init({{ name }}_state *state);
int {{ name }}_step({{ name }}_state *state, const {{ name }}_input *input, {{ name }}_number *output);

#endif
