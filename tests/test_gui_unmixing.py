"""The unmixing view: the right colours over the right image, and a display that leaves the data alone."""

# First, since it skips this module where napari is missing.
from gui_viewers import GRID, WAVELENGTHS_NM, bench_without_window, disc_boundary, pressure  # isort: split

from dataclasses import replace

import numpy as np
import pytest

from oatkit import Image
from oatkit.gui.images.layers import KEY, Layers
from oatkit.gui.images.looks import CHROMOPHORES, FRACTION, colours_of
from oatkit.gui.view.unmixing import BLOOD, Unmixing, in_blood, trust
from oatkit.gui.view.unmixing_panel import UnmixingPanel
from oatkit.result import Result
from oatkit.spectra import CHROMOPHORES as KNOWN

RAMP = np.tile(np.linspace(0.0, 1.0, GRID.shape[1]), (GRID.shape[0], 1))


def plane(values, quantity, unit="", **diagnostics):
    """An image of one plane that was fitted to the absorption."""
    shown = np.broadcast_to(values, GRID.shape).astype(np.float32)
    return Image(shown, quantity, unit, GRID, diagnostics={"fitted_to": "absorption", **diagnostics})


def result(seed=0):
    """A result with maps: haemoglobin rises from left to right, saturation from bottom to top."""
    so2 = np.linspace(0, 1, GRID.shape[0])[:, None] * np.ones(GRID.shape)
    so2[:, :2] = np.nan
    images = [
        pressure(seed),
        disc_boundary(),
        plane(2 * RAMP, "oxyhaemoglobin", "mol/m^3", notes=("the water is fitted badly.",)),
        plane(RAMP, "deoxyhaemoglobin", "mol/m^3"),
        plane(3 * RAMP, "total_haemoglobin", "mol/m^3"),
        plane(so2, "so2"),
        plane(0.25, "residual"),
    ]
    return Result({image.quantity: image for image in images})


@pytest.fixture
def bench():
    """A workbench with such a result."""
    made = bench_without_window()
    made.layers.show_result(result())
    return made


def seen(bench):
    """The keys of the layers that are visible."""
    return {layer.metadata[KEY]["key"] for layer in bench.viewer.layers if layer.visible}


def test_known_chromophores_have_their_colours():
    """Oxygenated blood is red, other blood blue, and each chromophore that the spectra know has a colour of its own."""
    assert set(KNOWN) <= set(CHROMOPHORES)
    full = {name: tuple(colours.map([1.0])[0]) for name, colours in CHROMOPHORES.items()}
    assert len(set(full.values())) == len(full)
    red, blue = full["oxyhaemoglobin"], full["deoxyhaemoglobin"]
    assert red[0] > 2 * max(red[1:3])
    assert blue[2] > 2 * max(blue[:2])
    for name, colours in CHROMOPHORES.items():
        assert colours.map([1e-6])[0][3] < 1e-5
        assert colours.map([np.nan])[0][3] == 0
        assert colours_of(plane(1.0, name)) is colours


def test_negative_concentrations_stand_out():
    """A negative pixel is red, and of what is red itself, green."""
    for name, colours in CHROMOPHORES.items():
        shown = tuple(Layers(bench_without_window().viewer).show(plane(1.0, name), name).colormap.low_color[:3])
        assert shown == ((0, 1, 0) if name == "oxyhaemoglobin" else (1, 0, 0))
        assert np.abs(colours.map([1.0])[0][:3] - shown).max() > 0.5


def test_saturation_goes_from_blue_to_red_in_even_steps():
    """The lowest saturation is blue, the highest orange red, and lightness rises all the way: no two look alike."""
    colours = FRACTION.map(np.linspace(0, 1, 50))[:, :3]
    assert colours[0].argmax() == 2
    assert colours[-1].argmax() == 0
    lightness = colours @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(lightness) > 0).all()


def test_one_map_lies_over_the_anatomy(bench):
    """Each button shows its map over the initial pressure and hides the other images, outlines stay; "" hides it."""
    view = Unmixing(bench)
    assert list(view.maps) == ["oxyhaemoglobin", "deoxyhaemoglobin", "total_haemoglobin", "so2"]
    view.opacity = 0.6
    for name in view.maps:
        view.show(name)
        assert seen(bench) == {"initial_pressure", "boundary", name}
        assert view.shown == name
        layer = bench.layers.find(name)
        assert bench.viewer.layers.index(layer) > bench.viewer.layers.index(bench.layers.find("initial_pressure"))
        assert layer.opacity == 0.6
        assert [one.name for one in bench.viewer.layers if getattr(one, "colorbar", None) and one.colorbar.visible] == [
            layer.name
        ]
    view.opacity = 0.3
    assert bench.layers.find("so2").opacity == 0.3
    view.show("")
    assert seen(bench) == {"initial_pressure", "boundary"}


def test_saturation_is_shown_in_blood_only(bench):
    """Above the chosen share of the most haemoglobin pixels are as they were, elsewhere they have no value."""
    so2, total = result()["so2"], result()["total_haemoglobin"]
    for percent in (0.0, 35.0, 99.0):
        shown = in_blood(so2, total, percent)
        blood = total.values > percent / 100 * total.values.max()
        assert np.array_equal(shown.values[blood], so2.values[blood], equal_nan=True)
        assert np.isnan(shown.values[~blood]).all()


def test_the_blood_is_a_matter_of_display(bench):
    """With the switch a layer of its own is seen, its caption says the threshold, and the data stay untouched."""
    view, so2 = Unmixing(bench), bench.layers.find("so2").metadata[KEY]["image"]
    data = bench.layers.find("so2").data.copy()
    view.show("so2")
    view.blood_percent = 50.0
    assert seen(bench) == {"initial_pressure", "boundary", BLOOD}
    assert view.shown == "so2"
    layer = bench.layers.find(BLOOD)
    assert np.isfinite(layer.data).sum() == (RAMP > 0.5).sum()
    assert tuple(layer.contrast_limits) == (0, 1)
    assert "total Hb > 50 % of maximum" in bench.viewer.canvas.overlays.text.text
    assert bench.layers.find("so2").metadata[KEY]["image"] is so2
    assert np.array_equal(bench.layers.find("so2").data, data, equal_nan=True)
    other = result(3)
    half = replace(other["total_haemoglobin"], values=(other["total_haemoglobin"].values[:, :, ::-1]))
    bench.layers.show_result(replace(other, images={**other.images, "total_haemoglobin": half}))
    assert np.isfinite(layer.data[:, 2:]).sum() == (RAMP[:, ::-1][:, 2:] > 0.5).sum()
    view.blood_percent = None
    assert seen(bench) == {"initial_pressure", "boundary", "so2"}
    assert bench.layers.find(BLOOD) is None


def test_maps_lie_side_by_side_and_everything_comes_back(bench):
    """All maps get a tile with a colour bar; afterwards what was seen is seen, as opaque as it was."""
    view = Unmixing(bench)
    view.opacity = 0.4
    view.show("oxyhaemoglobin")
    view.show_side_by_side()
    assert seen(bench) == set(view.maps)
    assert all(layer.colorbar.visible and layer.opacity == 1 for layer in view.maps.values())
    assert view.is_beside
    bench.side_by_side.leave()
    assert seen(bench) == {"initial_pressure", "boundary", "oxyhaemoglobin"}
    assert bench.layers.find("oxyhaemoglobin").opacity == 0.4
    assert not bench.layers.find("so2").colorbar.visible


def test_what_is_to_be_known_of_a_map_is_said(bench):
    """To what it was fitted, how much of the data the fit misses, and what the method noted, in sentences."""
    view = Unmixing(bench)
    view.show("")
    assert view.trust == ""
    view.show("oxyhaemoglobin")
    assert view.trust == (
        "Fitted to the absorption. The fit misses 25.0 % of the data in the median. The water is fitted badly."
    )
    light = replace(plane(1.0, "so2"), diagnostics={"fitted_to": "initial_pressure"})
    assert "which the light colours" in trust(light, [light])[0]
    astray = replace(plane(1.0, "so2"), diagnostics={"fitted_to": "absorption", "settled": False})
    assert "The light had not settled." in trust(astray, [astray])


def test_the_panel_has_a_button_for_each_map(bench, qtbot):
    """Buttons follow the result, name units, and press only one map; a result without maps is told of."""
    bench.layers.show_result(Result({"initial_pressure": pressure(1)}), "plain")
    panel = UnmixingPanel(Unmixing(bench))
    qtbot.addWidget(panel)
    panel.show()
    assert [button.text() for button in panel.buttons.values()] == [
        "oxyHb, mol/m³", "deoxyHb, mol/m³", "total Hb, mol/m³", "so2",
    ]  # fmt: skip
    panel.buttons["so2"].setChecked(False)
    panel.buttons["so2"].click()
    assert seen(bench) == {"initial_pressure", "boundary", "so2"}
    panel.buttons["oxyhaemoglobin"].click()
    assert seen(bench) == {"initial_pressure", "boundary", "oxyhaemoglobin"}
    assert [name for name, button in panel.buttons.items() if button.isChecked()] == ["oxyhaemoglobin"]
    assert "Fitted to the absorption" in panel.trust.text()
    panel.opacity.setValue(25)
    assert bench.layers.find("oxyhaemoglobin").opacity == 0.25
    panel.percent.setValue(70)
    panel.blood.click()
    assert np.isfinite(bench.layers.find(BLOOD).data).sum() == (RAMP > 0.7).sum()
    panel.beside.click()
    assert bench.viewer.canvas.grid.enabled
    panel.beside.click()
    assert not bench.viewer.canvas.grid.enabled
    bench.layers.remove_group("")
    panel.show_state()
    assert panel.absent.isVisible()
    assert not panel.buttons


def test_wavelengths_do_not_matter_to_maps(bench):
    """At each wavelength the same map is seen, and the anatomy below it changes."""
    view = Unmixing(bench)
    view.show("so2")
    for wavelength in WAVELENGTHS_NM:
        bench.viewing.go_to(wavelength)
        assert view.shown == "so2"
