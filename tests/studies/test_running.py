"""Studies on processes and on a cluster: the same bytes by any workers, after any kill; one line for what cannot be."""

import json
import math
import os
import resource
import signal
import sys
from functools import partial

import numpy as np
import pytest

import tfarm
from tests.shared import refusal, sized
from tests.studies import kills
from tfarm.dsp import Chain
from tfarm.errors import ConvergenceError, ParameterError
from tfarm.files import locked_folder
from tfarm.studies import running
from tfarm.studies.declaration import load_study
from tfarm.studies.running import rows_a_chunk
from tfarm.studies.space import extra

LAB = tfarm.load("sasaki2012-lab")
STUDY = partial(tfarm.study, LAB, kills.OVER, ("modes",), None, Chain())


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """An undisturbed study by this process."""
    folder = tmp_path_factory.mktemp("studies") / "whole"
    kills.declare(folder)
    assert tfarm.study(**load_study(str(folder / "study.toml")), out=folder, workers=1).is_complete
    return kills.parts(folder)


def refused(pattern, call, *arguments, kind=ParameterError, **others):
    with pytest.raises(kind, match=pattern) as caught:
        call(*arguments, **others)
    assert "\n" not in str(caught.value)


def test_kills_on_this_machine_lose_one_chunk_a_worker_at_most(whole, tmp_path):
    """A worker, then the study itself, of the same study: the parts that were there stay, and the bytes are equal."""
    kills.declare(tmp_path)
    for kind, count in (("worker", 3), ("study", 9)):
        outcome = kills.killed(kind, tmp_path, count)
        assert kills.is_expected(kind, outcome), outcome
        assert len(kills.parts(tmp_path)) >= count
        assert kills.parts(tmp_path).items() <= whole.items()
    assert STUDY(out=tmp_path, draws=kills.DRAWS, workers=1).is_complete
    assert kills.parts(tmp_path) == whole


def test_kills_of_a_cluster_lose_one_chunk_a_worker_at_most(whole, tmp_path):
    """A worker's chunk goes to the other one; without the scheduler the study ends, and goes on without a cluster."""
    kills.declare(tmp_path)
    with kills.cluster() as (process, address, workers), running.cluster(address) as client:

        def kill(done, total, text):
            if done == 2:
                os.kill(workers[0], signal.SIGKILL)
            if done == len(whole) // 2:
                process.kill()

        call = partial(STUDY, out=tmp_path, draws=kills.DRAWS, client=client, progress=kill)
        refused("the cluster failed .*; run the study again", call, kind=ConvergenceError)
    kept = kills.parts(tmp_path)
    assert len(kept) >= len(whole) // 2
    assert kept.items() <= whole.items()
    assert STUDY(out=tmp_path, draws=kills.DRAWS, workers=1).is_complete
    assert kills.parts(tmp_path) == whole


@pytest.mark.parametrize("workers", sized(1, 2))
def test_any_processes_and_the_declared_study_have_the_same_bytes(whole, tmp_path, workers):
    """What two workers left when one was killed is compared above."""
    first = tmp_path / "first"
    STUDY(out=first, draws=kills.DRAWS, part=kills.PART, workers=workers)
    assert kills.parts(first) == whole
    again = tfarm.study(**load_study(str(first / "study.toml")), out=tmp_path / "again", part=kills.PART, workers=1)
    assert kills.parts(tmp_path / "again") == whole
    assert json.loads((first / "study.json").read_text())["inputs"]["versions"] == running.versions()
    assert again.table()["row"].tolist() == list(range(kills.DRAWS))


def test_csv_has_the_numbers_of_parquet(tmp_path, monkeypatch):
    """Progress has the time left from the first part on."""
    seen = []
    parquet = STUDY(out=tmp_path / "a", draws=6, part=4, workers=1, progress=lambda *each: seen.append(each)).table()
    assert [each[:2] for each in seen] == [(0, 2), (1, 2), (2, 2)]
    assert all("s left" in text for *_, text in seen[1:])
    monkeypatch.setattr(running.importlib.util, "find_spec", lambda _: None)
    csv = STUDY(out=tmp_path / "b", draws=6, part=4, workers=1)
    assert {path.suffix for path in (tmp_path / "b").glob("part-*")} == {".csv"}
    for name, values in csv.table().items():
        assert np.array_equal(values, parquet[name], equal_nan=values.dtype != object)
    refused("has a study with other parts", STUDY, out=tmp_path / "a", draws=6)


def test_another_study_and_its_parts_are_refused(tmp_path, monkeypatch):
    STUDY(out=tmp_path / "a", draws=6, part=4, workers=1)
    refused("has a study with other draws, seed", STUDY, out=tmp_path / "a", draws=7, seed=1)
    refused("has a study with other over", tfarm.study, LAB, dict(reversed(kills.OVER.items())), ("modes",), None,
            Chain(), out=tmp_path / "a", draws=6)  # fmt: skip
    refused("other arm.toml", tfarm.study, LAB, kills.OVER, ("modes",), tfarm.HubFeedback(K1=0.2, K2=0.3), Chain(),
            out=tmp_path / "a", draws=6)  # fmt: skip
    (part, *_) = (tmp_path / "a").glob("part-*")
    STUDY(out=tmp_path / "b", draws=5, part=4, workers=1)
    (tmp_path / "b" / part.name).write_bytes(part.read_bytes())
    refused(f"{part.name}'. is a part of another study", STUDY, out=tmp_path / "b", draws=5)
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / part.name).write_bytes(part.read_bytes())
    refused("is a part of another study|has parts, and no study.json", STUDY, out=tmp_path / "c", draws=6)
    other = {**running.versions(), "numpy": "1.0"}
    monkeypatch.setattr(running, "versions", lambda: other)
    refused("has a study with other versions", STUDY, out=tmp_path / "a", draws=6)
    assert part in (tmp_path / "a").glob("part-*")  # nothing was lost by any refusal
    assert not [*(tmp_path / "c").glob("study.*")]
    (tmp_path / "a" / "study.json").write_text("{}")
    refused("a study.json of tfarm study", STUDY, out=tmp_path / "a", draws=6)


def test_a_folder_has_one_run_at_a_time(tmp_path):
    with locked_folder(tmp_path, key="--out"):
        refused("another run has it", STUDY, out=tmp_path, draws=2)
    (tmp_path / "file").touch()
    refused("cannot be made", STUDY, out=tmp_path / "file" / "x", draws=2)
    illegal = {"payload.mass": {"uniform": [-0.1, 0.1]}}
    refused("arms are illegal", tfarm.study, LAB, illegal, ("modes",), out=tmp_path / "none", draws=9)
    unknown = {"payload.mas": {"uniform": [0.0, 0.1]}}
    refused("'payload.mas': did you mean", tfarm.study, LAB, unknown, ("modes",), out=tmp_path / "none", draws=9)
    assert not (tmp_path / "none").exists()


RATE = "modes.natural_frequency_rad_s.1"
SAMPLED = partial(tfarm.study, LAB, {"payload.mass": {"uniform": [0.0, 0.2]}, "hub.inertia": {"uniform": [0.1, 0.3]}},
                  (RATE,), None, Chain(), draws=6, part=4, worst=RATE, sobol=8, workers=1)  # fmt: skip


def counted(monkeypatch, most=math.inf):
    """The rows that are computed from now on; after `most` of them the study is interrupted."""
    rows, values = [], running.values_of

    def count(*arguments):
        if len(rows) >= most:
            raise KeyboardInterrupt
        rows.append(arguments)
        return values(*arguments)

    monkeypatch.setattr(running, "values_of", count)
    return rows


def findings(found):
    """Without the intervals of Sobol' indices, which are SciPy's by chance."""
    return (
        [(each.quantity, each.key, each.first, each.total) for each in found.sobol],
        found.worst._replace(file=""),
        found.shares,
        found.spreads,
    )


def test_sobol_samples_and_the_search_for_the_worst_arm_are_resumed(tmp_path, monkeypatch):
    """Interrupted again and again: at most a part is lost each time, and a complete folder computes nothing."""
    whole = SAMPLED(out=tmp_path / "whole")
    pilot = 1 + 3  # arms whose cost is measured, at each run with missing parts of Sobol' indices
    expected = 6 + 8 * 4 + pilot + whole.worst.evaluations
    with monkeypatch.context() as patch:
        rows = counted(patch)
        assert findings(SAMPLED(out=tmp_path / "whole")) == findings(whole)
        assert rows == []
        assert findings(SAMPLED(out=tmp_path / "once")) == findings(whole)
        assert len(rows) == expected
    SAMPLED(out=tmp_path / "late", worst="", sobol=0)
    with monkeypatch.context() as patch:
        rows = counted(patch)
        found = SAMPLED(out=tmp_path / "late", stop_after=0.0)  # begins no part of any kind
        assert (found.sobol, found.worst, len(rows)) == ((), None, pilot)
    total, runs = 0, 0
    while runs < 40:
        with monkeypatch.context() as patch:
            rows = counted(patch, most=17)
            try:
                found = SAMPLED(out=tmp_path / "parts")
                break
            except KeyboardInterrupt:
                runs += 1
            finally:
                total += len(rows)
    assert findings(found) == findings(whole)
    assert runs >= 4
    assert total <= expected + runs * (3 + pilot)  # of a part of 4 rows three at most are lost, and none of a search
    files = [{path.name: path.read_bytes() for path in (tmp_path / name).glob("_*")} for name in ("parts", "whole")]
    assert files[0] == files[1]
    assert {name[:6] for name in files[0]} == {"_sobol", "_worst"}


def full(call, most):
    """The error of a call while this process's files have at most that many bytes, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
    try:
        with pytest.raises(ParameterError) as caught:
            call()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    return str(caught.value)


def test_a_full_disk_is_one_line_and_loses_nothing(tmp_path):
    def stop(done, *_):
        if done == 3:
            raise KeyboardInterrupt

    kills.declare(tmp_path, draws=400, part=40)
    with pytest.raises(KeyboardInterrupt):
        STUDY(out=tmp_path, draws=400, workers=1, progress=stop)
    kept, files = kills.parts(tmp_path), sorted(os.listdir(tmp_path))
    assert len(kept) == 3
    call = partial(STUDY, out=tmp_path, draws=400, workers=1)
    new = tmp_path.with_name("new")
    begun = partial(STUDY, out=new / "folder", draws=4, workers=1)
    assert "cannot be written (File too large); choose another" in full(call, 1000)
    assert (kills.parts(tmp_path), sorted(os.listdir(tmp_path))) == (kept, files)
    assert "cannot be written (File too large)" in full(begun, 100)
    assert not new.exists()
    assert call().is_complete


def test_chunks_last_5_to_30_s_and_workers_end_together():
    for workers in (1, 2, 7, 100):
        for cost in (1e-3, 0.1, 3.0):
            for count in (1, 10, 1000, 10**6):
                rows = rows_a_chunk(cost, count, workers)
                rounds = -(-count // (rows * workers))
                seconds = rows * cost
                assert seconds <= max(1.5 * 30, 2 * cost)  # half a round more, where rounds are few
                if count * cost > 2 * workers * 5 and cost < 1:
                    assert seconds >= 5 / 1.5
                last = -(-count // rows) - (rounds - 1) * workers
                if rounds < 10 and count > 100 * workers:
                    assert last == workers  # chunks in the last round


def test_a_law_of_matrices_is_kept_with_its_delay_and_references(tmp_path):
    law = tfarm.Law.of_matrices(
        [[-1.0, 0.5], [0.0, -2.0]], [[1.0, 0.0], [0.0, 1.0]], [[0.3, 0.1]], [[0.2, 0.1]], ["hub_rate", "root_moment"],
        delay=0.001, sign=1, references=("hub_rate",),
    )  # fmt: skip
    tfarm.study(LAB, {"law.gain": {"uniform": [0.5, 1.0]}}, ("modes",), law, out=tmp_path, draws=2, stop_after=0.0)
    found = load_study(str(tmp_path / "study.toml"))["law"]
    s = 1j * np.geomspace(0.1, 100, 7)
    assert np.allclose(found.values(s), law.values(s), rtol=1e-14)
    assert (found.delay, found.references, found.signals) == (0.001, ("hub_rate",), law.signals)


def test_missing_extras_and_silent_schedulers_are_one_line(monkeypatch):
    for place in ("tcp://127.0.0.1:9", "nowhere"):
        assert "no scheduler with a worker answers" in str(refusal(running.cluster, place, 0.5))
    for name, needed in (("distributed", "cluster"), ("pyarrow", "study")):
        monkeypatch.setitem(sys.modules, name, None)
        assert f"needs {name}: pip install 'tfarm[{needed}]'" in str(refusal(extra, name, needed, "key", "value"))
