/* Self-test: {{ recorded|length }} samples with the recorded outputs of tfarm's arithmetic, equal bit for bit. */
#include "controller.h"

#include <stdio.h>
#include <string.h>

static const {{ real }} recorded[{{ recorded|length }}] = {
{% for row in recorded|batch(4) %}
    {{ row|join(", ") }},
{% endfor %}
};
static const int expected[{{ recorded|length }}] = {
{% for row in status|batch(40) %}
    {{ row|join(", ") }},
{% endfor %}
};
static uint32_t seed = {{ seed }}u;

static {{ real }} next({{ "void" if fixed else real + " size" }}) /* of a linear congruential generator */
{
    seed = 1664525u * seed + 1013904223u;
{% if fixed %}
    return (int32_t)((int64_t)seed - INT64_C(2147483648));
{% else %}
    return size * (({{ real }})(seed >> 8) / {{ half }} - {{ one }});
{% endif %}
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
        input.{{ field.identifier }} = next({{ sizes[loop.index0] if not fixed else "" }});
{% endfor %}
{% if not fixed %}
        if (k == {{ refused }})
            input.{{ fields[0].identifier }} = {{ zero }} / (input.feedforward - input.feedforward); /* NaN */
{% endif %}
        status = {{ name }}_step(&state, &input, &output);
        wrong += status != expected[k] || memcmp(&output, &recorded[k], sizeof output) != 0;
    }
    printf("%d of {{ recorded|length }} samples differ\n", wrong);
    return wrong != 0;
}
