"""The command line as a process: what it prints, what it leaves, and how it exits."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

import oatkit
from packages import run_oatkit

SMALL = ("--set", "grid.pixels=32", "--set", "grid.field_of_view_mm=9")
COMMANDS = (
    "demo",
    "paper",
    "info",
    "run",
    "motion",
    "focus",
    "pipeline",
    "plugins",
    "describe",
    "simulate",
    "convert",
    "export",
    "verify",
    "roi",
    "challenge",
    "kinetics",
    "report",
    "join",
    "cite",
    "new-plugin",
    "gui",
)


@pytest.fixture(scope="module")
def stored(small_scan_file, tmp_path_factory):
    """A result made by `oatkit run` as a process."""
    out = tmp_path_factory.mktemp("cli") / "out.zarr"
    done = run_oatkit("run", "lsqr", str(small_scan_file), "-o", str(out), *SMALL)
    assert done.returncode == 0, done.stderr
    return out, done.stdout


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name):
    """Each command has a help text that begins with a sentence, and exits with 0."""
    done = run_oatkit(name, "--help")
    assert done.returncode == 0
    sentence = done.stdout.split("\n\n")[1].strip()
    assert sentence[0].isupper()
    assert sentence.rstrip().endswith(".")


def test_run_writes_a_result_and_says_what_is_in_it(stored):
    """`run` reports each image with its negative pixels, and the folder opens in Python."""
    out, text = stored
    assert "pixels negative" in text
    assert "speed of sound 1500.0 m/s (simulation)" in text
    assert oatkit.load(out)["initial_pressure"].values.shape == (1, 32, 32)


def test_the_command_line_gives_the_numbers_of_the_script(stored, small_scan_file):
    """The same pipeline from the command line and from Python is equal to the last bit."""
    pipeline = oatkit.Pipeline.load("lsqr", ["grid.pixels=32", "grid.field_of_view_mm=9"])
    result = oatkit.run(pipeline, oatkit.read(small_scan_file))
    assert (oatkit.load(stored[0])["initial_pressure"].values == result["initial_pressure"].values).all()


def test_info_tells_what_a_scan_holds(small_scan_file):
    """`info --json` has the promised keys; the text names the source of the speed of sound."""
    table = json.loads(run_oatkit("info", str(small_scan_file), "--json").stdout)
    assert table["frames"] == 2
    assert table["wavelengths_nm"] == [700.0]
    assert (table["detectors"], table["samples"], table["sampling_rate_hz"]) == (48, 400, 20e6)
    assert table["speed_of_sound_m_s"] == 1500.0
    assert "(simulation)" in run_oatkit("info", str(small_scan_file)).stdout


def test_a_preset_printed_is_a_pipeline_that_runs(tmp_path):
    """What `pipeline maxent` prints is a file that loads as the preset."""
    path = tmp_path / "mine.toml"
    path.write_text(run_oatkit("pipeline", "maxent").stdout)
    assert oatkit.Pipeline.load(path) == oatkit.Pipeline.load("maxent")


def test_describe_shows_type_unit_range_and_default():
    """`describe` prints each parameter with its default, meaning, range and unit, and a reference."""
    text = run_oatkit("describe", "band-pass").stdout
    assert "high = 7.0" in text
    assert "MHz" in text
    assert "[Prakash2019]." in run_oatkit("describe", "maxent-nlcg").stdout


def test_describe_shows_the_tables_of_a_pipeline_that_are_no_plugins():
    """`describe grid` prints the keys of that table; a name that is neither is an error with the nearest one."""
    text = run_oatkit("describe", "grid").stdout
    assert "pixels = 200" in text
    assert "did you mean 'grid'?" in run_oatkit("describe", "gird").stderr


@pytest.mark.parametrize("suffix", [".png", ".ome.tif", ".h5"])
def test_export_writes_each_format(stored, tmp_path, suffix):
    """`export` writes a figure, an OME-TIFF and an HDF5 file, and refuses to replace one unasked."""
    file = tmp_path / f"picture{suffix}"
    assert run_oatkit("export", str(stored[0]), str(file)).returncode == 0
    assert file.stat().st_size > 1000
    again = run_oatkit("export", str(stored[0]), str(file))
    assert again.returncode == 2
    assert "exists" in again.stderr
    assert run_oatkit("export", str(stored[0]), str(file), "--overwrite").returncode == 0


def test_convert_writes_what_the_ending_asks_for(small_scan_file, tmp_path):
    """IPASC holds the same signals and says what it lacks; a file is not replaced unasked, nor an ending guessed."""
    file = tmp_path / "scan.hdf5"
    done = run_oatkit("convert", str(small_scan_file), str(file))
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"wrote {file}\nnote: ")
    ours, theirs = oatkit.read(small_scan_file), oatkit.read(file)
    assert theirs.reader == "ipasc"
    assert (np.asarray(theirs.signals[:]) == np.asarray(ours.signals[:])).all()
    again = run_oatkit("convert", str(small_scan_file), str(file))
    assert (again.returncode, "exists" in again.stderr) == (2, True)
    assert run_oatkit("convert", str(small_scan_file), str(file), "--overwrite").returncode == 0
    unknown = run_oatkit("convert", str(small_scan_file), str(tmp_path / "scan.mat"))
    assert unknown.returncode == 2
    assert ".h5" in unknown.stderr


def test_simulate_writes_the_frames_asked_for(tmp_path):
    """Each has noise of its own; the file holds the truth."""
    from oatkit.scanfile import read_truths

    file = tmp_path / "disc.h5"
    done = run_oatkit("simulate", "disc", "-o", str(file), "--frames", "2", "--snr", "20")
    assert done.returncode == 0, done.stderr
    signals = oatkit.read(file).signals
    assert signals.shape[0] == 2
    assert (signals[0] != signals[1]).any()
    assert list(read_truths(file)) == ["initial_pressure"]


def test_simulate_refuses_the_name_of_another_format(tmp_path):
    """A scan file under the ending of IPASC or MATLAB is not written."""
    for name in ("scan.hdf5", "scan.mat"):
        done = run_oatkit("simulate", "disc", "-o", str(tmp_path / name))
        assert (done.returncode, ".h5" in done.stderr, (tmp_path / name).exists()) == (2, True, False)


def test_simulate_oxygen_writes_scan_and_truths(tmp_path, monkeypatch):
    """Twelve wavelengths, and pressure, so2 and haemoglobin of the body of this seed, here in coarse light."""
    from functools import partial

    from typer.testing import CliRunner

    import oatkit.simulate
    from oatkit.cli import app
    from oatkit.scanfile import read_truths

    monkeypatch.setattr("oatkit.simulate.illuminate", partial(oatkit.simulate.illuminate, spacing_m=0.5e-3))
    file = tmp_path / "oxygen.h5"
    done = CliRunner().invoke(app, ["simulate", "oxygen", "-o", str(file), "--seed", "3"])
    assert done.exit_code == 0, done.output
    clear = [word for word in done.output.split() if word.startswith("fluence.")]
    fluence = oatkit.Pipeline.load("multispectral", clear).fluence
    assert (fluence.ring_radius, fluence.band_width) == (None, 1e3 * oatkit.simulate.multispectral.BAND.width_m)
    scan, truths = oatkit.read(file), read_truths(file)
    assert scan.wavelengths_nm == tuple(range(680, 901, 20))
    assert [image.values.shape for image in truths.values()] == [(12, 200, 200), (1, 200, 200), (1, 200, 200)]
    body, grid = oatkit.simulate.OxygenBody.draw(3), truths["so2"].grid
    assert grid == oatkit.Pipeline.load("multispectral").grid.grid()
    assert truths["so2"] == body.so2(grid)
    assert truths["total_haemoglobin"] == body.total_haemoglobin(grid)
    assert (truths["initial_pressure"].values[:, body.which(grid.y_m[:, None], grid.x_m[None, :]) >= 0] > 0).all()


def test_verify_finds_a_flipped_bit(stored, tmp_path):
    """`verify` exits with 0 for a sound result and with 4 for one with a flipped bit."""
    import shutil

    copy = tmp_path / "copy.zarr"
    shutil.copytree(stored[0], copy)
    assert run_oatkit("verify", str(copy)).returncode == 0
    chunk = max((p for p in copy.rglob("*") if p.is_file()), key=lambda p: p.stat().st_size)
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(data)
    done = run_oatkit("verify", str(copy))
    assert done.returncode == 4
    assert chunk.name in done.stderr


BAD_CALLS = {
    "no such command": (["dem"], 2),
    "no such scan": (["info", "nowhere.msot"], 4),
    "a text file": (["info", "text.txt"], 4),
    "an empty scan": (["info", "empty.msot"], 4),
    "a folder that is no result": (["verify", "."], 4),
    "export of nothing": (["export", "nowhere.zarr", "x.png"], 4),
    "no such preset": (["run", "maxnt", "SCAN", "-o", "x.zarr"], 2),
    "no such key": (["run", "maxent", "SCAN", "-o", "x.zarr", "--set", "reconstruct.wieght=1"], 2),
    "not a number": (["run", "maxent", "SCAN", "-o", "x.zarr", "--set", "grid.pixels=nan"], 2),
    "grid over the detectors": (["run", "maxent", "SCAN", "-o", "x.zarr", "--set", "grid.field_of_view_mm=40"], 2),
    "a list of steps": (["run", "maxent", "SCAN", "-o", "x.zarr", "--set", "preprocess.use=offset"], 2),
    "deep nesting": (["run", "maxent", "SCAN", "-o", "x.zarr", "--set", f"grid.pixels={'[' * 50_000}"], 2),
    "no such wavelength": (["run", "lsqr", "SCAN", "-o", "x.zarr", "--set", "scan.wavelengths_nm=[650]"], 2),
    "no such frame": (["run", "maxent", "SCAN", "-o", "x.zarr", "--frames", "9"], 2),
    "output exists": (["run", "maxent", "SCAN", "-o", "text.txt"], 2),
    "no such plugin": (["describe", "maxnt"], 2),
    "unknown suffix": (["export", "RESULT", "x.bmp"], 2),
    "a page that is no page": (["report", "RESULT", "-o", "x.txt"], 2),
    "a result as a scan": (["info", "RESULT"], 4),
    "a folder as a scan": (["info", "."], 4),
}


@pytest.mark.parametrize("what", BAD_CALLS)
def test_bad_input_gets_a_sentence_and_an_exit_code(what, small_scan_file, stored, tmp_path):
    """Each wrong call ends with the promised exit code, a sentence on stderr, no traceback, and no file left behind."""
    arguments, code = BAD_CALLS[what]
    (tmp_path / "text.txt").write_text("hello")
    (tmp_path / "empty.msot").write_text("")
    real = {"SCAN": str(small_scan_file), "RESULT": str(stored[0])}
    done = run_oatkit(*(real.get(a, a) for a in arguments), cwd=tmp_path)
    assert done.returncode == code, done.stderr
    assert done.stderr.strip()
    assert "Traceback" not in done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["empty.msot", "text.txt"]


def test_warnings_of_the_log_look_like_all_others_and_steer_no_terminal(stored, tmp_path):
    """A region that is left out is said on stderr behind the program's name, whatever the file is called."""
    path = tmp_path / "red\x1b[31m.iannotation"
    rois = [{"type": "Segment", "points": ["Point(0, 0)"]}, {"pos": "Point(0, 0)"}]
    path.write_text(json.dumps({"Annotations": [{"ROIList": rois}]}))
    done = run_oatkit("roi", str(stored[0]), "-r", str(path), "--json")
    assert done.returncode == 0
    assert {row["region"] for row in json.loads(done.stdout)} == {"iAnnotation_0/1"}
    (line,) = done.stderr.splitlines()
    assert line.startswith("oatkit: ")
    assert line.isprintable()
    assert "straight line" in line


def test_a_failed_first_frame_leaves_the_second(small_scan, tmp_path):
    """A run whose first frame fails exits with 3, keeps the second, and both summary and figure show that one."""
    from oatkit.scanfile import write_scan

    scan = replace(small_scan, pulse_energy=np.array([[0.0], [1.0]]))
    write_scan(scan, tmp_path / "scan.h5")
    done = run_oatkit("run", "lsqr", "scan.h5", "-o", "out.zarr", *SMALL, cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    assert "wrote out.zarr" in done.stdout
    assert "1 of 2 frames failed" in done.stderr
    assert list(oatkit.load(tmp_path / "out.zarr").failed) == [0]
    assert run_oatkit("export", "out.zarr", "picture.png", cwd=tmp_path).returncode == 0


def test_ctrl_c_ends_a_run_and_leaves_nothing(small_scan_file, tmp_path):
    """An interrupt ends a long run within seconds with exit code 130 and no file under any name."""
    code = "from oatkit.cli import main; main()"
    long = [
        "--set",
        "grid.pixels=512",
        "--set",
        "reconstruct.n_iterations=100000",
        "--set",
        "reconstruct.tolerance=1e-15",
    ]
    command = [sys.executable, "-c", code, "run", "nnls", str(small_scan_file), "-o", "out.zarr", *SMALL[2:], *long]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, env=dict(os.environ))
    deadline = time.perf_counter() + 60
    while not list(tmp_path.iterdir()) and time.perf_counter() < deadline:
        time.sleep(0.1)
    time.sleep(1)  # from the hidden folder into the reconstruction
    assert process.poll() is None, "the run ended before it could be interrupted"
    process.send_signal(signal.SIGINT)
    start = time.perf_counter()
    _, errors = process.communicate(timeout=30)
    assert time.perf_counter() - start < 5
    assert process.returncode == 130
    assert "interrupted" in errors
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


def test_focus_prints_the_pick_and_what_the_scan_says(small_scan_file, tmp_path):
    """`focus --json` holds pick, header and curves and draws its figure; half a range is a usage error."""
    figure = tmp_path / "focus.png"
    arguments = ("focus", str(small_scan_file), *SMALL, "--lowest", "1450", "--highest", "1550")
    done = run_oatkit(*arguments, "--json", "-o", str(figure))
    assert done.returncode == 0, done.stderr
    table = json.loads(done.stdout)
    assert table["header_m_s"] == 1500.0
    assert abs(table["speed_m_s"] - 1500.0) < 15
    assert len(table["scores"]["variance"]) == len(table["speeds_m_s"])
    assert figure.read_bytes().startswith(b"\x89PNG")
    text = run_oatkit(*arguments).stdout
    assert text.startswith(f"speed of sound      {table['speed_m_s']:.1f} m/s by focus (variance)")
    assert run_oatkit(*arguments[:-2]).returncode == 2


def test_paper_lists_its_experiments_and_refuses_others(tmp_path):
    """`paper` without a name lists all experiments; an unknown one is a usage error that names the nearest."""
    listed = run_oatkit("paper").stdout
    assert all(name in listed for name in ("fig1", "fig2", "fig6", "figS1", "table1", "ranking"))
    done = run_oatkit("paper", "fig11", "-o", str(tmp_path / "out"))
    assert done.returncode == 2
    assert "did you mean 'fig1'" in done.stderr
    assert not (tmp_path / "out").exists()


def test_run_says_what_the_chain_found(small_scan_file, tmp_path):
    """`run` with a preset that goes on to the absorption reports body, light and that the scale is not known."""
    out = tmp_path / "out.zarr"
    ring = ("--set", "fluence.ring_radius=14")
    done = run_oatkit("run", "lsqr-threshold-absorption", str(small_scan_file), "-o", str(out), *SMALL, *ring)
    assert done.returncode == 0, done.stderr
    assert "boundary: a body of " in done.stdout
    assert "of the incident light" in done.stdout
    assert "in arbitrary units: no calibration" in done.stdout
