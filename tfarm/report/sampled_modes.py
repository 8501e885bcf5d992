"""The numbers behind the pictures of the sampled loop's poles: a row a mode, and the poles along the loci."""

from __future__ import annotations

from tfarm.arm import PLANE
from tfarm.columns import Column, Table
from tfarm.digits import plain
from tfarm.dsp.law import SAMPLED_MODE_COLUMNS, ModeTable
from tfarm.dsp.loci import SampledLoci
from tfarm.dsp.loop import SampledLoop

MODE_TABLE = (
    "ln|z| is what a mode gains (+) or loses (−) per sample: its size is multiplied by |z| every {ms} ms. Own damping "
    "is what the arm does by itself, {gains} what the gains add to first order; the closed loop is the exact pole, "
    "which large gains move further than first order says. Band 0 lies below {half} Hz; from there on the mode is "
    "aliased, and the samples see it at the frequency given."
)


def mode_rows(loop: SampledLoop, table: ModeTable, stem: str) -> Table:
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
            law = locus.law.having(locus.gain, value)
            each = zip(locus.mode.tolist(), poles, strict=True)
            rows += [(name, *law.point, mode, z.real, z.imag) for mode, z in each if not z.imag < 0]
    titles = {"locus": "locus", **{name: name for name in PLANE}, "mode": "mode", "real": "Re z", "imaginary": "Im z"}
    columns = [
        Column(*title, of=list(cells)) for title, cells in zip(titles.items(), zip(*rows, strict=True), strict=True)
    ]
    return Table(stem=stem, title="Poles of the sampled loop", is_data=True, columns=tuple(columns))
