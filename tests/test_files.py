"""Written files are whole, in their own place, and leave no other file."""

import os
import signal
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from tests.shared import refusal
from tfarm.errors import ParameterError
from tfarm.files import locked_folder, place_in, read_file, temporary_folder, write_file


def write(path, content=b"new"):
    write_file(path, content, key="--csv")


def test_a_symbolic_link_stays_one(tmp_path):
    target = tmp_path / "folder" / "target"
    target.parent.mkdir()
    for content in (b"first", b"second"):  # the target is made, then replaced
        link = tmp_path / "link"
        link.unlink(missing_ok=True)
        link.symlink_to(target)
        write(link, content)
        assert link.is_symlink()
        assert target.read_bytes() == content
    assert list(target.parent.iterdir()) == [target]


def test_a_replaced_file_keeps_its_mode(tmp_path):
    file = tmp_path / "file"
    file.write_bytes(b"old")
    for mode in (0o640, 0o600, 0o755):
        file.chmod(mode)
        write(file)
        assert stat.S_IMODE(file.stat().st_mode) == mode


def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path):
    pipe, read = tmp_path / "pipe", []
    os.mkfifo(pipe)
    content = bytes(300_000)  # more than a pipe holds
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    deadline = time.monotonic() + 5
    while True:
        try:
            write(pipe, content)
            break
        except ParameterError:  # the reader is not there yet
            assert time.monotonic() < deadline
            time.sleep(0.01)
    reader.join()
    assert read == [content]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_a_pipe_without_a_reader_is_refused_and_not_waited_for(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert refusal(write, pipe).key == "--csv"
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_standard_output_by_its_path(tmp_path):
    """Through a pipe, and into a file that the shell keeps writing to."""
    script = "from pathlib import Path; from tfarm.files import write_file\n"
    script += "for name in ('/dev/stdout', '/dev/fd/1', '/proc/self/fd/1'): write_file(Path(name), b'a', key='k')"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    assert done.stdout == b"aaa"
    file = tmp_path / "file"
    with open(file, "wb") as output:
        output.write(b"before ")
        output.flush()
        subprocess.run([sys.executable, "-c", script], stdout=output, check=True)
        output.seek(0, os.SEEK_END)
        output.write(b" after")
    assert file.read_bytes() == b"before aaa after"


KILLED = """
import os, sys, time
from pathlib import Path
from tfarm import files
def hang(*_): print("writing", flush=True); time.sleep(60)
if sys.argv[1] == "file":
    os.replace = hang
    files.write_file(Path("table.csv"), b"new", key="--csv")
else:
    with files.temporary_folder(Path()) as folder:
        (folder / "half").write_bytes(b"half")
        hang()
"""


@pytest.mark.parametrize("what", ["file", "folder"])
def test_what_a_killed_run_left_is_removed_by_the_next_one(what, tmp_path, monkeypatch):
    """And what a living one is writing is not."""
    monkeypatch.chdir(tmp_path)
    Path("table.csv").write_bytes(b"old")
    others = [Path(".table.csv.mine"), Path(".writing-notes"), Path("table.csv")]
    for other in others:
        other.touch()
    command = [sys.executable, "-c", KILLED, what]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=os.environ) as process:
        try:
            process.stdout.readline()
            (half,) = set(Path().iterdir()) - set(others)
            again(what)
            assert half.exists()
        finally:
            process.send_signal(signal.SIGKILL)
    assert half.exists()
    again(what)
    assert sorted(Path().iterdir()) == sorted(others)
    assert Path("table.csv").read_bytes() == (b"new" if what == "file" else b"old")


def again(what):
    if what == "file":
        write(Path("table.csv"))
    else:
        with temporary_folder(Path()):
            pass


def test_a_failed_write_leaves_the_old_file_alone(tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.write_bytes(b"old")
    monkeypatch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    assert "No space left" in str(refusal(write, file))
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [b"old"]


def test_a_name_that_is_too_long_for_the_system_is_one_line(tmp_path):
    for place in (tmp_path / "a" / ("x" * 300), tmp_path / "a" / ("x" * 300) / "b"):
        refused = refusal(place_in(place, "--out").__enter__)
        assert "cannot be written to (File name too long); give a folder that can" in str(refused)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_a_failed_run_made_is_removed_and_no_other_one(tmp_path):
    (tmp_path / "mine").mkdir()
    for place in (tmp_path / "a" / "b", tmp_path / "mine"):
        with pytest.raises(ParameterError, match="no space"), locked_folder(place, key="--out"):
            raise ParameterError(key="--out", value="", remedy="no space")
    assert [each.name for each in tmp_path.iterdir()] == ["mine"]
    with locked_folder(tmp_path / "a" / "b", key="--out"):
        (tmp_path / "a" / "b" / "file").touch()
    assert (tmp_path / "a" / "b" / "file").exists()


@pytest.mark.parametrize(("name", "words"), [("pipe", "no regular file; give a tuner"), ("a\0b", "null")])
def test_only_regular_files_are_read(tmp_path, name, words):
    os.mkfifo(tmp_path / "pipe")
    assert words in str(refusal(read_file, f"{tmp_path}/{name}", 10, key="controller", what="a tuner's file"))
