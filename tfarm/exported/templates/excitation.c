/*
 * Excitation of {{ found.arm_name|comment }}: {{ found.best|comment }}.
 * {{ found.arm.input|comment }} [{{ found.arm.input_unit|comment }}], each sample held for {{ found.period }} s; 0 before and after.
 */
#define TFARM_EXCITATION_SAMPLES {{ numbers|length }}L

double tfarm_excitation(long k);

static const double samples[TFARM_EXCITATION_SAMPLES] = {
{% for number in numbers %}
    {{ number }},
{% endfor %}
};

double tfarm_excitation(long k)
{
    return (k >= 0 && k < TFARM_EXCITATION_SAMPLES) ? samples[k] : 0.0;
}
