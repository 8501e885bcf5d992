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
    return samples_left-- > 0;
}

static void read_inputs({{ name }}_input *input)
{
{% for field in fields %}
    input->{{ field.identifier }} = 0; /* {{ field.text|comment }} */
{% endfor %}
}

static void write_output({{ name }}_number output, int status) /* {{ output|comment }} */
{
    printf("%.9g%s\n", (double)output, status ? " held: a sensor has failed" : "");
}

int main(void)
{
    {{ name }}_state state;
    {{ name }}_input input;
    {{ name }}_number output;
    int status;

    {{ name }}_init(&state);
    while (wait_for_sample()) {
        read_inputs(&input);
        status = {{ name }}_step(&state, &input, &output);
        write_output(output, status);
    }
    return 0;
}
