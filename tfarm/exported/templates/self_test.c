/* Self-test: {{ recorded|length }} samples with the recorded outputs of tfarm's arithmetic, equal bit for bit. */
#include "{{ header }}"

#include <stdio.h>
#include <string.h>

{% for kind, key, values, width in ((real, "recorded", recorded, 4), ("int", "expected", status, 40)) %}
static const {{ kind }} {{ key }}[{{ values|length }}] = {
{% for row in values|batch(width) %}
    {{ row|join(", ") }},
{% endfor %}
};
{% endfor %}
static uint32_t seed = {{ seed }}u;

static {{ real }} next({{ "void" if fixed else real + " size" }}) /* of a linear congruential generator */
{
{% set share = "((%s)(seed >> 8) / 8388608.0%s - 1.0%s)"|format(real, suffix, suffix) %}
    seed = 1664525u * seed + 1013904223u;
    return {{ "(int32_t)((int64_t)seed - INT64_C(2147483648))" if fixed else "size * " + share }};
}

int main(void)
{
    {{ name }}_state state;
    {{ name }}_input input;
    {{ real }} output;
    int k, status, wrong = 0;

    {{ name }}_init(&state);
    for (k = 0; k < {{ recorded|length }}; k++) {
{% for field in fields %}
        input.{{ field.identifier }} = next({{ sizes[loop.index0] if not fixed }});
{% endfor %}
{% if not fixed %}
        if (k == {{ refused }}) {
            input.{{ fields[0].identifier }} = 0.0{{ suffix }} / (input.feedforward - input.feedforward); /* NaN */
        }
{% endif %}
        status = {{ name }}_step(&state, &input, &output);
        if ((status != expected[k]) || (memcmp(&output, &recorded[k], sizeof output) != 0)) {
            wrong++;
        }
    }
    (void)printf("%d of {{ recorded|length }} samples differ\n", wrong);
    return (wrong == 0) ? 0 : 1;
}
