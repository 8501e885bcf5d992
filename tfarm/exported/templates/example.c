/*
 * Main loop of a microcontroller: replace the three functions by those of its timer, ADC, encoder and DAC.
 * As they are, they end after ten samples, and the file compiles and runs on a host:
 *     cc -std=c99 -ffp-contract=off example.c controller.c && ./a.out
 */
#include "controller.h"

#include <stdio.h>

static int wait_for_sample(void) /* until the timer of {{ period }} s; 0 ends the loop */
{
    static int samples_left = 10;
    samples_left--;
    return (samples_left >= 0) ? 1 : 0;
}

static void read_inputs({{ name }}_input *input)
{
{% for field in fields %}
    input->{{ field.identifier }} = 0; /* {{ field.text|comment }} */
{% endfor %}
}

static void write_output({{ name }}_number output, int status) /* {{ output|comment }} */
{
    const char *words = "";
{% for number, text in ((1, "held: a sensor has failed"), (2, "held: overflow"), (3, "clipped"), (4, "clipped, a state too")) if number in statuses.values() %}
    if (status == {{ number }}) {
        words = " {{ text }}";
    }
{% endfor %}
    (void)printf("%.9g%s\n", (double)output, words);
}

int main(void)
{
    {{ name }}_state state;
    {{ name }}_input input;
    {{ name }}_number output;
    int status;

    {{ name }}_init(&state);
    while (wait_for_sample() != 0) {
        read_inputs(&input);
        status = {{ name }}_step(&state, &input, &output);
        write_output(output, status);
    }
    return 0;
}
