{% extends "controller.h" %}
{% block state %}
    {{ name }}_number u, e, x, gain, e_before; /* of the sample before, and e of the one before that [N m] */
{% endblock %}
