"""The control of wavelength: nm on one side, the slider on the other."""

from gui_viewers import WAVELENGTHS_NM, bench_without_window, pressure
from oatkit.gui.view.wavelength import WavelengthWidget


def test_control_and_slider_move_each_other(qtbot):
    """A wavelength chosen in nm moves the slider, a moved slider changes the choice, and the ends have no further."""
    bench = bench_without_window()
    widget = WavelengthWidget(bench.viewer)
    qtbot.addWidget(widget)
    assert not widget.choice.isEnabled()
    bench.layers.show(pressure(), "initial_pressure")
    assert [widget.choice.itemText(i) for i in range(3)] == ["700 nm", "715 nm", "900 nm"]
    for index, _ in enumerate(WAVELENGTHS_NM):
        widget.choice.activated.emit(index)
        assert bench.viewer.dims.current_step[0] == index
        bench.viewer.dims.set_current_step(0, 2 - index)
        assert widget.choice.currentIndex() == 2 - index
    assert (widget.previous.isEnabled(), widget.next.isEnabled()) == (False, True)
    widget.next.click()
    assert bench.viewing.wavelength_nm == 715.0
    widget.held.setChecked(False)
    assert not bench.viewing.contrast_held


def test_a_control_that_is_gone_is_told_nothing_more(qtbot):
    """After the control is destroyed the viewer goes on without it."""
    bench = bench_without_window()
    widget = WavelengthWidget(bench.viewer)
    with qtbot.waitSignal(widget.destroyed):
        widget.deleteLater()
    assert len(bench.viewing.changed) == 0
    bench.layers.show(pressure(), "initial_pressure")
