"""A pipeline reads and writes TOML without loss, and says at once all that is wrong with a file."""

import pickle

import pytest

from oatkit import Pipeline, ValidationError, plugin, run
from oatkit.pipeline import presets

BAD = """
version = 2
colour = "red"

[grd]
pixels = 1

[grid]
pixel = 3
pixels = true
field_of_view_mm = nan
centre_mm = [1.0]

[[preprocess]]
use = "band-pass"
high = -7.0

[[preprocess]]
use = "bandpass"

[forward]
use = "arc"

[reconstruct]
use = "maxent-nlcg"
wieght = 0.1
prior = -1.0
"""

SENTENCES = [
    "p.toml version: must be 1, got 2",
    "p.toml: a pipeline has no table 'colour'",
    "p.toml: a pipeline has no table 'grd'; did you mean 'grid'?",
    "p.toml [grid]: this table has no parameter 'pixel'; did you mean 'pixels'?",
    "p.toml [grid].pixels: must be a whole number at least 2 and at most 8192, got true",
    "p.toml [grid].field_of_view_mm: must be a number above 0 mm and at most 1000 mm, got nan",
    "p.toml [grid].centre_mm: must be a list of 2 numbers at least -1000 mm and at most 1000 mm, got (1.0,)",
    "p.toml [preprocess.band-pass].high: must be a number above 0 MHz, got -7.0",
    "p.toml [preprocess.bandpass]: no preprocessor named 'bandpass'; did you mean 'band-pass'?",
    "p.toml [reconstruct]: 'maxent-nlcg' has no parameter 'wieght'; did you mean 'weight'?",
    'p.toml [reconstruct].prior: must be a number above 0 or "structural", got -1.0',
]


@pytest.mark.parametrize("name", presets())
def test_a_preset_survives_writing_and_reading(name):
    """Each preset loads, equals what is read back from its own TOML, hashes, and comes back from pickle."""
    pipeline = Pipeline.load(name)
    again = Pipeline.loads(pipeline.to_toml())
    assert again == pipeline
    assert hash(again) == hash(pipeline)
    assert pickle.loads(pickle.dumps(pipeline)) == pipeline


def test_the_promised_presets_are_there():
    """The presets that DESIGN promises for the acoustic half load by name."""
    assert {"lsqr", "lsqr-threshold", "maxent"} <= set(presets())


def test_all_errors_of_a_file_are_reported_at_once():
    """Eleven mistakes give eleven lines, each with file, table, key, unit, value and the nearest known name."""
    with pytest.raises(ValidationError) as caught:
        Pipeline.loads(BAD, "p.toml")
    lines = str(caught.value).splitlines()
    assert len(lines) == len(SENTENCES)
    for sentence in SENTENCES:
        assert any(line.startswith(sentence) for line in lines), (sentence, lines)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a = ", "p.toml: not valid TOML"),
        ("version = true\n[forward]\nuse = 'arc'\n[reconstruct]\nuse = 'lsqr'", "p.toml version: must be 1, got true"),
        ("[forward]\nuse = 'arc'\n[reconstruct]\nuse = 'lsqr'\n[grid]\npixels = 2", "p.toml [grid]: pixel_size_m"),
        ("reconstruct = 'lsqr'", "write { use = "),
        ("a = " + "9" * 5000, "p.toml: not valid TOML"),
        ("a = " + "[" * 50_000, "p.toml: not valid TOML"),
        ("version = 1\nversion = 1", "p.toml: not valid TOML: Cannot overwrite a value"),
        ("version = 1\n[reconstruct]\nuse = 'lsqr'", "p.toml [forward]: is missing: a pipeline needs a forward model"),
        ("forward = 3\n[reconstruct]\nuse = 'lsqr'", "p.toml forward: must be a forward model, got 3"),
        ("[forward]\nuse = 'arc'\n[reconstruct]\nweight = 1.0", "needs use = "),
        ("[forward]\nuse = 'arc'\n[reconstruct]\nuse = 7", "needs use = "),
        (
            "[forward]\nuse = 'arc'\n[reconstruct]\nuse = 'lsqr'\nregularizer = {use = 'entropy'}",
            "quadratic regularizer",
        ),
        ("[forward]\nuse = 'arc'\n[reconstruct]\nuse = 'lsqr'\nregularizer = {use = 'laplacien'}", "'laplacian'"),
        ("[scan]\nspeed_of_sound_m_s = 1.5\n[forward]\nuse='arc'\n[reconstruct]\nuse='lsqr'", "at least 300 m/s"),
    ],
)
def test_a_broken_file_gets_a_sentence(text, sentence):
    """Text that is no TOML, a duplicate key, a missing table, a wrong part: each is said in a sentence."""
    with pytest.raises(ValidationError) as caught:
        Pipeline.loads(text, "p.toml")
    assert sentence in str(caught.value)


def test_missing_and_unreadable_files_are_validation_errors(tmp_path):
    """A pipeline file that is not there, is a folder, or is no text is refused by its name."""
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00\xd8")
    for name in ("gone.toml", "folder.toml", "binary.toml"):
        with pytest.raises(ValidationError, match=name):
            Pipeline.load(tmp_path / name)
    with pytest.raises(ValidationError, match="did you mean 'maxent'"):
        Pipeline.load("maxnt")


def test_set_changes_a_value_and_reads_toml_or_a_bare_word():
    """`--set` reads its right side as TOML, else as a word, and reaches preprocess steps by their plugin's name."""
    changes = ["grid.pixels=64", "preprocess.band-pass.high=6.5", "reconstruct.weight=l-curve", "grid.centre_mm=[1, 2]"]
    pipeline = Pipeline.load("maxent", changes)
    assert pipeline.grid.pixels == 64
    assert pipeline.grid.centre_mm == (1, 2)
    assert pipeline.reconstruct.weight == "l-curve"
    assert next(step for step in pipeline.preprocess if step.name == "band-pass").high == 6.5


def test_changing_use_drops_the_keys_of_the_old_plugin():
    """After `reconstruct.use=lsqr` no key of the old solver is left to be refused."""
    pipeline = Pipeline.load("maxent", ["reconstruct.prior=0.1", "reconstruct.use=lsqr", "reconstruct.weight=0.5"])
    assert pipeline.reconstruct == plugin("solver", "lsqr")(weight=0.5)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ("weight=1", "expected slot.key=value"),
        ("reconstruct.weight", "expected slot.key=value"),
        ("preprocess.band-pas.high=1", "did you mean 'band-pass'"),
        ("grid.pixels.deep=1", "is a value, not a table"),
        ("preprocess.offset=1", "is a list of steps"),
        ("grid.pixels=" + "9" * 5000, "too long a number"),
        ("reconstruct.wieght=1", "did you mean 'weight'"),
    ],
)
def test_a_change_that_fits_nowhere_is_refused(change, sentence):
    """A `--set` that names no key is refused with the nearest name or the form that was expected."""
    with pytest.raises(ValidationError) as caught:
        Pipeline.load("maxent", [change])
    assert sentence in str(caught.value)


def test_a_nested_table_without_use_keeps_the_plugin():
    """A part whose table names no plugin changes the parameters of the one that is there."""
    lsqr = plugin("solver", "lsqr")
    text = "[forward]\nuse='arc'\n[reconstruct]\nuse='lsqr'\nregularizer={}"
    assert Pipeline.loads(text).reconstruct == lsqr()
    other = Pipeline.loads(text.replace("{}", "{use='identity'}")).reconstruct
    assert other.regularizer.name == "identity"
    assert Pipeline.loads(Pipeline.loads(text.replace("{}", "{use='identity'}")).to_toml()).reconstruct == other


def test_a_wrong_parameter_in_python_is_the_same_error():
    """Making a plugin in Python with wrong values raises this package's error, with all of them."""
    with pytest.raises(ValidationError) as caught:
        plugin("solver", "maxent-nlcg")(weight=-1.0, prior=float("nan"), wieght=2)
    assert len(str(caught.value).splitlines()) == 3


def test_an_empty_right_side_takes_a_key_out():
    """`--set slot.key=` leaves the default of the plugin in force, whether or not the preset had a value."""
    there, absent = (Pipeline.load("maxent-absorption", [f"fluence.{key}="]) for key in ("ring_radius", "index_body"))
    assert there.fluence.ring_radius is None
    assert absent == Pipeline.load("maxent-absorption")


def test_a_results_pipeline_makes_the_pipeline_again(small_scan):
    """What a result keeps of its pipeline is enough to have the pipeline back."""
    pipeline = Pipeline.load("lsqr", ["grid.pixels=24", "grid.field_of_view_mm=9"])
    assert Pipeline.of_table(run(pipeline, small_scan).pipeline) == pipeline
