"""The strip chart in words and numbers."""

from __future__ import annotations

from tfarm.columns import Column, Table
from tfarm.dsp.chain import Chain
from tfarm.dsp.curves import held_at, root_moment
from tfarm.dsp.strip_chart import StripChart


def example_words(ideal: Chain, coarse: Chain) -> str:
    """What of a coarse chain is an example, and what the arm's own file has."""
    parts = (
        ("ADC", ideal.converters.moment_bits is not None),
        ("delay", ideal.sampling.delay_samples > 0),
        ("motor limit", ideal.actuator.torque_limit == coarse.actuator.torque_limit),
    )
    own = [name for name, is_own in parts if is_own]
    made_up = [name for name, is_own in parts if not is_own]
    if not own:
        return "An example, and nobody's hardware"
    if not made_up:
        return f"The arm's own {', '.join(own)}"
    return f"The arm's own {' and '.join(own)}; {' and '.join(made_up)} an example"


def strip_table(data: StripChart, stem: str) -> Table:
    """The curve of the moment as it is drawn, and what is held from sample to sample at its times."""
    s, drawn = data.simulation, root_moment(data.simulation)
    columns = (
        Column("t_s", "time", "s", of=drawn.t),
        *drawn.columns("root_moment", "root moment", "N m"),
        Column("read_moment_N_m", "as the ADC reads it", "N m", of=held_at(s, data.read, drawn.t)),
        Column("torque_asked_N_m", "torque asked", "N m", of=held_at(s, data.asked, drawn.t)),
        Column("torque_given_N_m", "torque given, after the delay", "N m", of=held_at(s, s.torque, drawn.t)),
    )
    return Table(stem=stem, title="Strip chart", is_data=True, columns=columns)
