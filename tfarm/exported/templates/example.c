/*
 * Main loop of a microcontroller: replace the four functions by those of its timer, ADC, encoder and DAC.
 * As they are, they end after ten samples, and the file compiles and runs on a host:
 *     cc -std=c99 -ffp-contract=off example.c controller.c && ./a.out
 */
#include "controller.h"

#include <stdio.h>

static int samples_left = 10;

static int wait_for_sample(void) /* until the timer of {{ period }} s; 0 ends the loop */
{
    return samples_left-- > 0;
}

static void read_inputs({{ name }}_input *input)
{
{% for field in fields %}
    input->{{ field.identifier }} = 0; /* {{ field.text|comment }} */
{% endfor %}
}

static void write_output({{ name }}_number output) /* {{ output|comment }} */
{
    printf("%.9g\n", (double)output);
}

static void stop(int status) /* a sensor has failed: brake, warn, or hold the output as here */
{
    fprintf(stderr, "error %d, output held\n", status);
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
        if (status)
            stop(status);
        write_output(output);
    }
    return 0;
}
