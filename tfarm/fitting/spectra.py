"""Frequency response of a record over time, by averaged cross-spectra, with coherence and the number of averages.

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

import math
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from tfarm.arrays import Complex, Real
from tfarm.errors import must_be_known, require
from tfarm.fitting.data import Measured, check_signal
from tfarm.fitting.recording import LEAST_SAMPLES, Recording
from tfarm.records import frozen
from tfarm.schema import Quantity, Table


@frozen(slots=True, kw_only=True)
class Estimate:
    """A response with what it was estimated by: `segments` of `segment` [s], `overlap` as a share of one.

    `independent` averages are in them, `note` is that of the record's sampling.
    """

    measured: Annotated[Measured, Quantity(flat=True, help="estimated response with its coherence")]
    estimator: Annotated[
        str, Quantity("estimator", help="H1 (noise on the output), H2 (on the input) or Hv (between them)")
    ]
    window: Annotated[str, Quantity("window", help="taper of each segment: hann or boxcar")]
    segment: Annotated[float, Quantity("segment", "s", help="length of one segment of the record")]
    segments: Annotated[int, Quantity("segments", help="number of segments that are averaged")]
    overlap: Annotated[
        float, Quantity("overlap", digits=3, help="share of a segment that it has in common with the next")
    ]
    independent: Annotated[
        float,
        Quantity(
            "independent averages",
            digits=4,
            key="independent_averages",
            help="segments that count as independent, by Welch (1967)",
        ),
    ]
    note: Annotated[
        str,
        Quantity(
            "sampling of the record", help="unevenness of the sampling; empty where the samples are even"
        ),
    ]

    @property
    def resolution(
        self,
    ) -> Annotated[
        float,
        Quantity("frequency resolution", "Hz", 4, "distance of the lines: one over the segment's length"),
    ]:
        """The distance of the lines [Hz]: 1/segment."""
        return 1.0 / self.segment

    @property
    def median_coherence(
        self,
    ) -> Annotated[float, Quantity("median coherence", digits=4, help="over all lines, from 0 to 1")]:
        """Over all lines."""
        return float(np.median(self.measured.coherence))  # type: ignore[arg-type]

    @property
    def response(
        self,
    ) -> Annotated[list[dict[str, Any]], Quantity(help="estimate with its coherence, a row a frequency")]:
        """A row a frequency."""
        return list(self.csv_table)

    @property
    def csv_table(self) -> Table:
        """The same, as `read_measured` reads it."""
        return self.measured.csv_table


def frequency_response(
    recording: Recording,
    output: str,
    input: str,
    *,
    estimator: str = "H1",
    window: str = "hann",
    segment: float | None = None,
    overlap: float | None = None,
    is_held: bool = False,
) -> Estimate:
    """Return the response `output`/`input` of a record, from its signals of these names.

    `segment` [s] is by default an eighth of the record, `overlap` half of it with a window that tapers, else none.
    An input that `is_held` from each sample to the next has the response of samples to it (`held`).
    Raises ParameterError for signals that are not there, for a segment that leaves no two of them, and for an input
    that does not move.
    """
    from scipy.signal import get_window

    check_signal(output, "--output")
    check_signal(input, "--input")
    must_be_known("--estimator", estimator, ("H1", "H2", "Hv"))
    must_be_known("--window", window, ("hann", "boxcar"))
    y = recording.signal(output, "--output")
    x = recording.signal(input, "--input")
    if overlap is None:
        overlap = 0.5 * (window == "hann")
    size, step = segment_size(recording, segment, overlap)
    how = {"window": window, "nperseg": size, "noverlap": size - step}
    lines, values, coherence = averaged_response(estimator, x, y, how)
    require(lines.size, "record", input, "does not move", recording.source)
    require(coherence.any(), "record", output, "does not move", recording.source)
    count = 1 + (recording.count - size) // step
    duration = size * recording.period
    averages = independent_averages(get_window(window, size), step, count)
    measured = Measured(
        output=output,
        input=input,
        omega=np.asarray(2 * np.pi * lines / duration, dtype=float),
        values=values,
        coherence=coherence,
        averages=max(1, math.floor(averages)),
        held=recording.period if is_held else None,
        source=recording.source,
        digest=recording.digest,
    )
    return Estimate(
        measured=measured,
        estimator=estimator,
        window=window,
        segment=duration,
        segments=count,
        overlap=1.0 - step / size,
        independent=averages,
        note=recording.note,
    )


def averaged_response(
    estimator: str, x: Real, y: Real, how: dict[str, Any]
) -> tuple[NDArray[np.intp], Complex, Real]:
    """Return the lines that the input has power in, the response and the coherence there.

    Without the line at 0 and the last one, at half the rate of sampling, which are real.
    """
    from scipy.signal import csd, welch

    _, S_xx = welch(x, **how)
    _, S_xy = csd(x, y, **how)
    _, S_yy = welch(y, **how)
    lines = np.arange(1, S_xx.size - 1)
    # of the largest line of the input: below it there are rounding errors alone
    lines = lines[S_xx[lines] > 1e-24 * S_xx.max()]
    S_xx = S_xx[lines]
    S_yy = S_yy[lines]
    cross = abs(S_xy[lines])
    with np.errstate(divide="ignore", invalid="ignore"):
        if estimator == "H1":
            size = cross / S_xx
        elif estimator == "H2":
            size = np.where(cross == 0, 0.0, S_yy / cross)
        else:
            size = np.sqrt(S_yy / S_xx)
        phase = np.where(cross == 0, 1.0, S_xy[lines] / cross)
        coherence = np.where(S_yy > 0, cross**2 / (S_xx * S_yy), 0.0)
    return lines, size * phase, np.clip(coherence, 0.0, 1.0)


def independent_averages(w: Real, step: int, count: int) -> float:
    """Return the number of independent averages in a number of overlapped segments (Welch 1967)."""
    j = np.arange(1, min(count, math.ceil(w.size / step)))
    rho = np.array([w[: w.size - lag] @ w[lag:] for lag in j * step]) / (w @ w)
    return float(count / (1 + 2 * (1 - j / count) @ rho**2))


def segment_size(recording: Recording, segment: float | None, overlap: float) -> tuple[int, int]:
    """Return samples of a segment, and from one to the next."""
    require(0 <= overlap < 1, "--overlap", overlap, "a share of a segment from 0 to below 1, such as 0.5")
    whole = recording.count * recording.period
    least = LEAST_SAMPLES * recording.period
    # by default 15 segments, half overlapped
    wanted = whole / 8 if segment is None else segment
    remedy = f"seconds between {least:.4g} and {whole / 2:.4g}, half the record: one average has no coherence"
    require(least <= wanted <= whole / 2 * (1 + 1e-9), "--segment", wanted, remedy)
    size = min(round(wanted / recording.period), recording.count // 2)
    return size, max(1, round(size * (1 - overlap)))
