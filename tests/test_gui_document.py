"""A pipeline edited as text: comments stay, what is invalid changes nothing, and every edit can be taken back."""

import pytest

from oatkit import Pipeline, ValidationError
from oatkit.gui.document import PipelineDocument
from oatkit.pipeline import presets


@pytest.mark.parametrize("name", presets())
def test_opening_and_saving_changes_no_byte(name, tmp_path):
    """A preset that is opened and saved is the same file, to the last byte."""
    document = PipelineDocument.of_preset(name)
    document.save(tmp_path / "mine.toml")
    assert (tmp_path / "mine.toml").read_bytes() == presets()[name].encode()
    assert PipelineDocument.open(tmp_path / "mine.toml").pipeline == Pipeline.load(name)


def test_an_edit_touches_one_line():
    """Setting a parameter changes the line of its key and no other; comments stay."""
    document = PipelineDocument.of_preset("maxent")
    document.set("grid", "pixels", 100)
    before, after = presets()["maxent"].splitlines(), document.text.splitlines()
    assert [line for line in after if line not in before] == ["pixels = 100"]
    assert document.pipeline.grid.pixels == 100


def test_what_is_invalid_changes_nothing():
    """A value out of range is refused with the sentence of the parameter; text and pipeline stay as they were."""
    document = PipelineDocument.of_preset("maxent")
    text, pipeline = document.text, document.pipeline
    with pytest.raises(ValidationError, match="pixels"):
        document.set("grid", "pixels", -1)
    assert (document.text, document.pipeline) == (text, pipeline)
    assert not document.can_undo


def test_another_plugin_drops_the_keys_of_the_old_one():
    """Taking another solver leaves none of the old one's parameters behind."""
    document = PipelineDocument.of_preset("maxent")
    document.set("reconstruct", "weight", 0.5)
    document.set("reconstruct", "use", "tv")
    assert document.pipeline.reconstruct.name == "tv"
    assert document.pipeline == Pipeline.loads(presets()["maxent"].replace("maxent-nlcg", "tv"))


def test_undo_and_redo_walk_through_the_edits():
    """Undo gives back each text before, redo each after; a new edit forgets what was taken back."""
    document = PipelineDocument.of_preset("lsqr")
    texts = [document.text]
    for pixels in (50, 60, 70):
        document.set("grid", "pixels", pixels)
        texts.append(document.text)
    for text in texts[-2::-1]:
        document.undo()
        assert document.text == text
    assert not document.can_undo
    document.redo()
    assert document.text == texts[1]
    document.set("grid", "pixels", 99)
    assert not document.can_redo
    assert document.pipeline.grid.pixels == 99
    assert document.changed


def test_steps_are_added_moved_and_removed():
    """Steps of preprocess and later ones come and go; the pipeline follows."""
    document = PipelineDocument.of_preset("lsqr")
    names = [step.name for step in document.pipeline.preprocess]
    document.add("preprocess", "offset")
    document.move(len(names), 0)
    assert [step.name for step in document.pipeline.preprocess] == ["offset", *names]
    document.set("preprocess", "low", 0.1, index=names.index("band-pass") + 1)
    document.remove("preprocess", 0)
    assert [step.name for step in document.pipeline.preprocess] == names
    document.add("segment", "radial")
    assert document.pipeline.segment.name == "radial"
    document.remove("segment")
    assert document.pipeline.segment is None


def test_a_part_of_a_plugin_is_set_within_it():
    """A solver's regularizer is chosen and changed inside the solver's table."""
    document = PipelineDocument.of_preset("l1")
    document.set("reconstruct", "basis", "pixel", part="regularizer")
    assert document.pipeline.reconstruct.regularizer.basis == "pixel"


def test_saved_elsewhere_a_pipeline_names_the_same_files(tmp_path):
    """In its own folder the bytes stay; in another one a relative path is written whole, and nothing else changes."""
    (tmp_path / "here").mkdir()
    (tmp_path / "there").mkdir()
    text = presets()["maxent"] + '\n[segment] # by hand\nuse = "mask"\npath = "masks/body.png"\n'
    own = tmp_path / "here" / "mine.toml"
    own.write_text(text)
    document = PipelineDocument.open(own)
    document.save(own)
    assert own.read_text() == text
    moved = tmp_path / "there" / "mine.toml"
    document.save(moved)
    assert moved.read_text() == text.replace("masks/body.png", str(tmp_path / "here" / "masks" / "body.png"))
    assert PipelineDocument.open(moved).pipeline == PipelineDocument.open(own).pipeline
