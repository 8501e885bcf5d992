"""The numbers behind the pictures of the sampled loop: a row a mode, the poles along the loci, and the strip chart."""

from __future__ import annotations

from tfarm.arm import PLANE
from tfarm.columns import Column, Table
from tfarm.digits import plain
from tfarm.dsp.chain import Chain
from tfarm.dsp.loci import SampledLoci
from tfarm.dsp.modes import SAMPLED_MODE_COLUMNS, ModeTable
from tfarm.dsp.sampled import Sampled
from tfarm.dsp.traces import StripChart, held_at, root_moment

MODE_TABLE = (
    "ln|z| is what a mode gains (+) or loses (−) per sample: its size is multiplied by |z| every {ms} ms. Own damping "
    "is what the arm does by itself, {gains} what the gains add to first order; the closed loop is the exact pole, "
    "which large gains move further than first order says. Band 0 lies below {half} Hz; from there on the mode is "
    "aliased, and the samples see it at the frequency given."
)


def mode_rows(loop: Sampled, table: ModeTable, stem: str) -> Table:
    """A row a mode that outlives a sample."""
    T = loop.chain.sampling.period
    return Table(
        stem=stem,
        title="The sampled loop, mode by mode",
        caption=MODE_TABLE.format(ms=plain(1e3 * T), half=plain(0.5 / T), gains=" and ".join(PLANE)),
        columns=SAMPLED_MODE_COLUMNS,
        record=table,
    )


def loci_table(data: SampledLoci, stem: str) -> Table:
    """Every pole of the three loci with Im z >= 0: a row a gain and a branch."""
    rows = []
    for name, locus in ((f"{data.alone.gain} alone", data.alone), *data.by.items()):
        for value, poles in zip(locus.values.tolist(), locus.z, strict=True):
            loop = locus.loop.having(**{locus.gain: value})
            across, up = (loop.number(each) for each in PLANE)
            each = zip(locus.mode.tolist(), poles, strict=True)
            rows += [(name, across, up, mode, z.real, z.imag) for mode, z in each if not z.imag < 0]
    titles = {"locus": "locus", **{name: name for name in PLANE}, "mode": "mode", "real": "Re z", "imaginary": "Im z"}
    columns = [
        Column(*title, of=list(cells)) for title, cells in zip(titles.items(), zip(*rows, strict=True), strict=True)
    ]
    return Table(stem=stem, title="Poles of the sampled loop", columns=tuple(columns))


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
    return Table(stem=stem, title="Strip chart", columns=columns)
