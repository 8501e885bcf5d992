% written by tfarm: the systems of a .mat file in this folder, for MATLAB (Control System Toolbox) and Octave (control)
{% for line in of.head %}
% {{ line | comment }}
{% endfor %}
here = fileparts(mfilename('fullpath'));
data = load(fullfile(here, {{ file }}));
if ~exist('ss') && exist('OCTAVE_VERSION', 'builtin')
    try, pkg('load', 'control'); catch, end
end
if ~exist('ss'), disp('No control package: no ss and frd are built.'); end
{% for name, each in of.systems.items() %}
% {{ name }}: {{ each.title | comment }}
this_system = {{ "data" if loop.first else "data." + name }};
if exist('ss')
    {{ name }} = ss(this_system.A, this_system.B, this_system.C, this_system.D, this_system.period, ...
        'InputName', this_system.input_name, 'OutputName', this_system.output_names, ...
        'StateName', this_system.state_names, 'Name', this_system.name);
end
{% endfor %}
{% if of.response %}
% exact: the exact frequency response of the arm
if exist('ss'), exact = frd(data.response, data.omega, 'InputName', data.exact_input, 'OutputName', data.exact_outputs); end
{% endif %}
clear here this_system
