/*
{% for label, value in facts %}
 * {{ label|comment }}: {{ value|comment }}
{% endfor %}
 *
 * Inputs {{ "as fractions of their ranges, 2147483648 for each range" if fixed else "in SI units" }}:
{% for field in fields %}
 *   {{ field.identifier }}: {{ field.text|comment }}{{ ", within +-%r"|format(field.size) if bounds }}
{% endfor %}
 * Output: {{ output|comment }}
{% if bounds %}
 *
 * Arithmetic, and bounds for inputs within +- these ranges, from {{ name }}_init on ("-": not determined):
{% for label, value in bounds %}
 *   {{ label|comment }}: {{ value|comment }}
{% endfor %}
 * The error is the distance of *output from the discretised law in exact arithmetic{{ ", its output clipped to these limits" if "SATURATED" in statuses }}.
{% endif %}
 *
 * Call {{ name }}_init once and {{ name }}_step at each sample.  It returns 0, or
{% if not fixed %}
 *   {{ name }}_INPUT_ERROR for an input that is not finite, {{ name }}_OVERFLOW for such a result: it then holds the
 *   output and keeps the state.
{% endif %}
{% if "SATURATED" in statuses %}
 *   {{ name }}_SATURATED where it clipped the output{{ " that it returns %d samples later"|format(delay) if delay }}.
{% endif %}
{% if "STATE_SATURATED" in statuses %}
 *   {{ name }}_STATE_SATURATED where it clipped a state, and perhaps the output.
{% endif %}
{% if not fixed %}
 * Compile with -ffp-contract=off, without -ffast-math.
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

{% for status, number in statuses.items() %}
#define {{ name }}_{{ status }} {{ number }}
{% endfor %}

typedef {{ real }} {{ name }}_number;

typedef struct {
    {{ name }}_number {% for field in fields %}{{ field.identifier }}{{ ";" if loop.last else ", " }}{% endfor %}

} {{ name }}_input;

typedef struct {
{% block state %}
{{ "    %s_number x[%d];\n"|format(name, n) if n -}}
{{ "    %s_number line[%d]; /* delay of the controller */\n"|format(name, delay) if delay -}}
{{ "    %s_number ring[%d][%d]; /* references and feedforward, for the shaper */\n    int place;\n"|format(name, length, shaped|length) if shaped -}}
{{ "    double angle, rate; /* estimate of the hub rate */\n    int begun;\n" if hub -}}
{% endblock %}
    {{ name }}_number output;
} {{ name }}_state;

void {{ name }}_init({{ name }}_state *state);
int {{ name }}_step({{ name }}_state *state, const {{ name }}_input *input, {{ name }}_number *output);

#endif
