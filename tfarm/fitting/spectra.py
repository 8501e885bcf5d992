"""A frequency response from a record over time: averaged cross-spectra, with coherence and what it is an average of.

The record is cut into K segments of n samples, each begun S samples after the one before, less its mean, times a window
w; their transforms X, Y give  S_xx = mean |X|^2,  S_xy = mean conj(X) Y,  S_yy = mean |Y|^2  (Welch 1967), and

    H1 = S_xy/S_xx,    H2 = S_yy/conj(S_xy),    coherence  g^2 = |S_xy|^2/(S_xx S_yy).

H1 is right where the noise is on the output, H2 where it is on the input; Hv, from the largest eigenvector of the
matrix of the spectra, each scaled to the same noise, lies between them: |Hv|^2 = |H1| |H2|.  H1 is low by the factor
1/(1 + N_xx/S_xx) where the input has noise N_xx.  Real and imaginary part each scatter by |H| sqrt((1 - g^2)/(2 N g^2))
(Bendat and Piersol 2010, section 9.2), where N counts independent averages.  Overlapped segments are not: by Welch

    N = K/(1 + 2 sum_j (1 - j/K) rho(j)),    rho(j) = (sum_i w_i w_{i + j S})^2/(sum_i w_i^2)^2.

Random excitation wants a window that tapers ("hann"); a sine that is swept again and again wants segments as long as
its sweep, "boxcar" and no overlap, and no window leaks.  A resonance narrower than 1/T of the segment is flattened.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import ParameterError, must_be_known
from tfarm.records import record

from .data import Measured
from .reading import check_signal
from .recording import Recording

Estimator = Literal["H1", "H2", "Hv"]
Taper = Literal["hann", "boxcar"]

USUAL_SEGMENTS = 15  # of a record whose segments are not given: 8 lengths, half overlapped
LEAST_POWER = 1e-24  # of the largest line of the input: below it there are rounding errors alone


@dataclass(frozen=True, slots=True, kw_only=True)
@record
class Estimate:
    """A response with what it was estimated by: `segment` [s] each, `segments` of them, `overlap` as a share of one.

    `independent` averages are in them, `resolution` [Hz] is 1/segment, `clock` says what is wrong with the times.
    """

    measured: Measured
    estimator: Estimator
    window: Taper
    segment: float
    segments: int
    overlap: float
    independent: float
    clock: str

    @property
    def resolution(self) -> float:
        """The distance of the lines [Hz]."""
        return 1.0 / self.segment


def frequency_response(
    recording: Recording,
    output: str,
    input: str,
    *,
    columns: tuple[str, str] | None = None,
    estimator: str = "H1",
    window: str = "hann",
    segment: float | None = None,
    overlap: float | None = None,
) -> Estimate:
    """The response `output`/`input` of a record, from its signals of these names or of those in `columns`.

    `segment` [s] is by default an eighth of the record, `overlap` half of it with a window that tapers, else none.
    Raises ParameterError for signals that are not there, for a segment that leaves no two of them, and for an input
    that does not move.
    """
    check_signal(output, "--output")
    check_signal(input, "--input")
    names = columns or (output, input)
    y, x = recording.signal(names[0], "--output"), recording.signal(names[1], "--input")
    kind, taper = _one_of("--estimator", estimator, Estimator), _one_of("--window", window, Taper)
    size, step = _cut(recording, segment, (0.5 if taper == "hann" else 0.0) if overlap is None else overlap)
    w = np.hanning(size + 1)[:-1] if taper == "hann" else np.ones(size)
    kept, values, coherence = _estimated(kind, cross_spectra(x, y, w, step), names, recording)
    count = 1 + (recording.count - size) // step
    averages = independent_averages(w, step, count)
    measured = Measured(
        output=output,
        input=input,
        omega=np.asarray(2 * np.pi * kept / (size * recording.period), dtype=float),
        values=values,
        coherence=coherence,
        averages=max(1, math.floor(averages)),
        source=recording.source,
        digest=recording.digest,
    )
    return Estimate(
        measured=measured,
        estimator=kind,
        window=taper,
        segment=size * recording.period,
        segments=count,
        overlap=1.0 - step / size,
        independent=averages,
        clock=recording.said,
    )


def cross_spectra(x: Real, y: Real, w: Real, step: int) -> tuple[Real, Complex, Real]:
    """S_xx, S_xy and S_yy (lines,) of segments as long as w, begun `step` samples apart; up to a common factor."""
    cuts = (sliding_window_view(each, w.size)[::step] for each in (x, y))
    X, Y = (np.fft.rfft((cut - cut.mean(axis=1, keepdims=True)) * w, axis=1) for cut in cuts)
    return (abs(X) ** 2).mean(0), (X.conj() * Y).mean(0), (abs(Y) ** 2).mean(0)


def _estimated(
    kind: Estimator, spectra: tuple[Real, Complex, Real], names: tuple[str, str], recording: Recording
) -> tuple[NDArray[np.intp], Complex, Real]:
    """The lines that the input has power in, the response and the coherence there; refused where a signal has none.

    Without the line at 0 and the last one, at half the rate of sampling, which are real.
    """
    lines = np.arange(1, spectra[0].size - 1)
    kept = lines[spectra[0][lines] > LEAST_POWER * spectra[0].max()]
    if not kept.size or not spectra[2].any():
        still = names[1] if not kept.size else names[0]
        raise ParameterError(key="record", value=still, remedy="does not move", file=recording.source)
    Sxx, Sxy, Syy = spectra[0][kept], spectra[1][kept], spectra[2][kept]
    with np.errstate(divide="ignore", invalid="ignore"):
        phase = np.where(Sxy == 0, 1.0, Sxy / abs(Sxy))
        sizes = {"H1": abs(Sxy) / Sxx, "H2": np.where(Sxy == 0, 0.0, Syy / abs(Sxy)), "Hv": np.sqrt(Syy / Sxx)}
        coherence = np.where(Syy > 0, abs(Sxy) ** 2 / (Sxx * Syy), 0.0)
    return kept, np.asarray(sizes[kind] * phase, dtype=complex), np.clip(coherence, 0.0, 1.0)


def independent_averages(w: Real, step: int, count: int) -> float:
    """How many independent averages so many overlapped segments are worth (Welch 1967)."""
    power = float(w @ w)
    shared = 0.0
    for j in range(1, min(count, math.ceil(w.size / step))):
        rho = (float(w[: w.size - j * step] @ w[j * step :]) / power) ** 2
        shared += 2 * (1 - j / count) * rho
    return count / (1 + shared)


def _cut(recording: Recording, segment: float | None, overlap: float) -> tuple[int, int]:
    """Samples of a segment, and from one to the next."""
    if not 0 <= overlap < 1:
        raise ParameterError(
            key="--overlap", value=overlap, remedy="a share of a segment from 0 to below 1, such as 0.5"
        )
    whole = recording.count * recording.period
    wanted = 2 * whole / (USUAL_SEGMENTS + 1) if segment is None else segment
    if not 8 * recording.period <= wanted <= whole / 2 * (1 + 1e-9):
        remedy = (
            f"seconds between {8 * recording.period:.4g} and {whole / 2:.4g}, half the record: one average says nothing"
        )
        raise ParameterError(key="--segment", value=wanted, remedy=remedy)
    size = min(round(wanted / recording.period), recording.count // 2)
    return size, max(1, round(size * (1 - overlap)))


def _one_of(key: str, word: str, kind: Any) -> Any:
    must_be_known(key, word, get_args(kind))
    return word
