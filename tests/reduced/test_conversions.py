"""The MATLAB file and its script, and the state space."""

import os
import re

import numpy as np
import pytest
import scipy.io

import tfarm
from tfarm import ParameterError
from tfarm.reduced import reduce, save_mat

POINTS = np.array([3j, 60j, 0.5 + 200j])


@pytest.fixture(scope="module")
def reduced():
    return reduce(tfarm.load("sasaki2012"), ["root_moment", "hub_rate"], order=10)


def test_state_space(reduced):
    system = reduced.state_space()
    np.testing.assert_allclose(system(POINTS)[:, 0], reduced(POINTS), rtol=1e-9)
    assert system.output_labels == ["root_moment", "hub_rate"]
    assert system.name == "sasaki2012, aaa, order 10"


def test_mat_file_and_its_script(reduced, tmp_path):
    mat, script = save_mat(reduced, tmp_path / "my-arm.mat")
    assert (mat.name, script.name) == ("my-arm.mat", "load_my_arm.m")
    data = scipy.io.loadmat(mat, squeeze_me=True)
    for name, matrix in zip("ABCD", reduced.matrices(), strict=True):
        np.testing.assert_array_equal(data[name], matrix.squeeze())
    assert list(data["output_names"]) == ["root_moment", "hub_rate"]
    assert len(data["state_names"]) == 10
    w = data["omega"]
    np.testing.assert_array_equal(data["response"], tfarm.transfer(reduced.arm, reduced.outputs)(1j * w))
    text = script.read_text()
    assert "load(fullfile(here, 'my-arm.mat'))" in text
    used = set(re.findall(r"data\.(\w+)", text))
    assert used <= set(data)
    assert {"A", "B", "C", "D", "omega", "response"} <= used
    assert sorted(path.name for path in tmp_path.iterdir()) == ["load_my_arm.m", "my-arm.mat"]


def test_same_inputs_same_bytes(reduced, tmp_path):
    first, _ = save_mat(reduced, tmp_path / "a.mat")
    content = first.read_bytes()
    assert save_mat(reduced, tmp_path / "a")[0].read_bytes() == content


@pytest.mark.parametrize("name", ["none/a.mat", "a" * 300, "b" * 252])
def test_a_folder_that_is_not_there_and_a_name_that_is_too_long(reduced, tmp_path, name):
    with pytest.raises(ParameterError, match="cannot be written"):
        save_mat(reduced, tmp_path / name)


def test_a_script_that_is_another_files_is_left_alone(reduced, tmp_path):
    """load_a_b.m is the script of a-b.mat and would be that of a_b.mat; one written by hand belongs to no file."""
    save_mat(reduced, tmp_path / "a-b.mat")
    save_mat(reduced, tmp_path / "a-b.mat")
    (tmp_path / "load_c.m").write_text("x = 1;\n")
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    for name in ("a_b.mat", "c.mat"):
        with pytest.raises(ParameterError, match="is not its script"):
            save_mat(reduced, tmp_path / name)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_a_matlab_file_goes_to_no_pipe(reduced, tmp_path):
    os.mkfifo(tmp_path / "pipe.mat")
    with pytest.raises(ParameterError, match="no regular file"):
        save_mat(reduced, tmp_path / "pipe.mat")
    assert [file.name for file in tmp_path.iterdir()] == ["pipe.mat"]
