"""What the pipeline widget rests on: fields and their texts, what is up to date, recipes, scripts. No window."""

import subprocess
import sys

import pytest

import oatkit
from gui_sessions import SMALL, small_session
from oatkit.api import KINDS, Solver
from oatkit.errors import ValidationError
from oatkit.gui.document import PipelineDocument
from oatkit.gui.parts.choices import choices
from oatkit.gui.parts.fields import Sort, parsed, sort_of, stepped, written
from oatkit.gui.pipeline.ledger import Ledger
from oatkit.gui.pipeline.recipe import recipe_toml
from oatkit.gui.pipeline.run_log import RunLog
from oatkit.gui.pipeline.script import script_of
from oatkit.gui.pipeline.slots import places
from oatkit.gui.session import Session
from oatkit.pipeline import presets
from oatkit.registry import installed

PLUGINS = [cls for kind in KINDS for cls in installed().of_kind(kind) if kind != "reader"]


@pytest.mark.parametrize("cls", PLUGINS, ids=lambda cls: f"{cls.kind}:{cls.name}")
def test_every_default_survives_its_text(cls):
    """The text that a form shows for a parameter reads back as the value that it stands for."""
    for name, field in cls.model_fields.items():
        if sort_of(field) not in (Sort.PART, Sort.FIXED, Sort.SWITCH):
            text = written(field.default)
            assert written(parsed(field, text)) == text, name


def test_what_no_number_is_gets_the_sentence_of_its_parameter():
    """Text in a field of numbers is refused by the parameter's own check, NaN and a comma for a point too."""
    field = oatkit.plugin("solver", "tv").model_fields["weight"]
    for text in ("abc", "nan", "inf", "0,5", "-1", "true"):
        document = PipelineDocument.of_preset("tv")
        with pytest.raises(ValidationError, match=r"\[reconstruct\].weight: must be a number above 0"):
            document.set("reconstruct", "weight", parsed(field, text))
    assert parsed(field, "1e-3") == 1e-3
    assert parsed(field, " l-curve ") == "l-curve"
    assert parsed(field, "") is None


def test_lists_are_read_with_and_without_brackets():
    """A list of words, of numbers and of pairs is read as the pipeline file would say it."""
    words = oatkit.plugin("unmixer", "nnls").model_fields["chromophores"]
    assert parsed(words, "water, lipid") == parsed(words, '["water", "lipid"]') == ["water", "lipid"]
    pairs = oatkit.plugin("segmenter", "polygon").model_fields["vertices"]
    assert parsed(pairs, "[1, 2], [3, 4.5]") == parsed(pairs, "[[1, 2], [3, 4.5]]") == [[1, 2], [3, 4.5]]
    assert parsed(pairs, written(((1.0, 2.0), (3.0, 4.5)))) == [[1.0, 2.0], [3.0, 4.5]]


def test_a_weight_goes_by_tenths_of_a_decade_and_stays_in_its_range():
    """Ten steps up make a decade, a whole number goes by ones, and no step leaves the range."""
    solver = oatkit.plugin("solver", "tv").model_fields
    text = "0.001"
    for _ in range(10):
        text = stepped(solver["weight"], text, 1)
    assert float(text) == pytest.approx(0.01, rel=0.01)
    assert stepped(solver["n_iterations"], "300", 1) == "301"
    assert stepped(solver["n_iterations"], "1", -1) == "1"
    assert stepped(solver["tolerance"], "0.9", 1) == "0.9"
    assert stepped(solver["weight"], "l-curve", 1) == "l-curve"


def test_choices_are_those_that_fit(monkeypatch):
    """A solver's regularizer is chosen among those of its ability; what is broken is listed with its reason."""
    quadratic = oatkit.plugin("solver", "lsqr").model_fields["regularizer"].annotation
    assert {choice.name for choice in choices(quadratic)} == {
        cls.name for cls in installed().of_kind("regularizer") if issubclass(cls, quadratic)
    }
    broken = installed().entries[0].__class__(None, "odd", "oatkit-odd", "1", "broken", "ImportError: no module x")
    monkeypatch.setattr(installed(), "entries", [*installed().entries, broken])
    last = choices(Solver)[-1]
    assert (last.name, last.about, last.usable) == ("oatkit-odd:odd", "ImportError: no module x", False)


def told(session, ledger, up_to=None):
    """Run a session and tell a ledger of it."""
    ledger.begin(session.pipeline, session.scan, session.frame)
    job = session.run(up_to)
    assert job.wait(60)
    for item in job.drain():
        ledger.take(item)
    return job, ledger.end(job.failure.sentence if job.failure else "")


def words(session, ledger):
    """How each table stands, by its slot."""
    return {
        place.slot.name: ledger.state(place, session.pipeline, session.scan, session.frame).word
        for place in places(session.pipeline)
    }


def test_a_change_makes_stale_what_builds_on_it_and_nothing_else(small_scan):
    """After a change of the solver its step and the later ones are stale, those before it are not; undo mends it."""
    session, ledger = small_session(small_scan), Ledger()
    session.document.add("segment", "radial")
    assert set(words(session, ledger).values()) == {""}
    told(session, ledger)
    assert all(words(session, ledger)[slot] == "fresh" for slot in ("preprocess", "grid", "reconstruct", "segment"))
    session.document.set("reconstruct", "weight", 0.5)
    now = words(session, ledger)
    assert [now[slot] for slot in ("scan", "preprocess", "grid", "forward")] == ["fresh"] * 4
    assert (now["reconstruct"], now["segment"]) == ("stale", "stale")
    session.document.undo()
    assert words(session, ledger)["segment"] == "fresh"
    session.go_to_frame(1)
    assert words(session, ledger)["preprocess"] == "stale"


def test_a_window_that_does_not_look_keeps_one_image(small_scan):
    """However long nobody looks, of all iterates' images only the newest waits; their numbers all do."""
    session = small_session(small_scan, "maxent")
    job = session.run()
    assert job.wait(60)
    log, items = RunLog(), job.drain()
    log.take(items)
    assert not any(hasattr(item, "iterate") for item in items)
    assert job.newest.iterate.image.shape == (32, 32)
    iterations = [int(x) for x, _ in log.curve.series("relative_gap")]
    assert iterations == sorted(set(iterations))
    assert len(iterations) >= 3
    assert log.curve.points[-1].iteration == items[-1].result["initial_pressure"].diagnostics["iteration"][0]


def test_the_script_gives_the_same_numbers(small_scan_file, tmp_path):
    """The exported script, run by a fresh interpreter, writes the image of `oatkit.run` to the last bit."""
    session = Session(PipelineDocument.of_preset("lsqr"))
    session.open_scan(small_scan_file)
    for key, value in SMALL.items():
        session.document.set("grid", key, value)
    script, output = tmp_path / "pipeline.py", tmp_path / "out.zarr"
    script.write_text(script_of(session.document, small_scan_file, frame=1))
    subprocess.run([sys.executable, script, small_scan_file, output], check=True, capture_output=True)
    expected = oatkit.run(session.pipeline, session.scan, frame=1)
    assert (oatkit.load(output)["initial_pressure"].values == expected["initial_pressure"].values).all()


def test_any_text_of_a_pipeline_survives_the_script():
    """Backslashes and quotes of all sorts in a comment are in the script as they are in the pipeline."""
    text = presets()["lsqr"] + '# C:\\new """ \'\'\' {x}"\n'
    scope = {"__name__": "not main"}
    exec(script_of(PipelineDocument(text), "a b/scan's.h5"), scope)
    assert scope["PIPELINE"] == text
    assert scope["DEFAULTS"][0].endswith("a b/scan's.h5")


def test_a_recipe_is_what_ran(small_scan):
    """The recipe of an image, read as a pipeline, is the one that made it, whatever was edited later."""
    session = small_session(small_scan)
    told(session, Ledger())
    ran = session.pipeline
    session.document.set("grid", "pixels", 10)
    result = session.result
    assert oatkit.Pipeline.loads(recipe_toml(result["initial_pressure"], result)) == ran
    assert 'use = "lsqr"' in recipe_toml(result["initial_pressure"])


def test_moving_and_adding_steps_keeps_the_comments():
    """Steps of preprocess take their comments with them, and the text stays as neat as it was."""
    document = PipelineDocument.of_preset("maxent")
    before = document.text
    document.move(4, 0)
    assert "low = 0.02 # MHz: below it scanners drift" in document.text
    assert document.pipeline.preprocess[0].name == "band-pass"
    assert sorted(document.text.splitlines()) == sorted(before.splitlines())
    document.move(0, 4)
    assert document.text == before
    document.add("preprocess", "offset")
    document.remove("preprocess", 5)
    assert document.text == before
