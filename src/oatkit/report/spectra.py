"""What the images hold in regions of interest: spectra, and tables."""

from collections.abc import Iterator, Sequence

from oatkit.drawing.plot import Plot
from oatkit.regions.spectra import spectra
from oatkit.regions.table import RegionRow, by_image
from oatkit.report.charts import Chart, chart
from oatkit.report.facts import Table, said, spaced
from oatkit.report.ticks import plain


def spectra_charts(rows: Sequence[RegionRow]) -> Iterator[Chart]:
    """Yield for each image of several wavelengths the mean in each region, with its standard deviation."""
    for name, unit, curves in spectra(rows):
        yield chart(Plot(f"{spaced(name)}, mean ± standard deviation", curves, "wavelength (nm)", unit))


def region_tables(rows: Sequence[RegionRow]) -> Iterator[Table]:
    """Yield the regions themselves, then mean ± standard deviation: a row for each plane, a column for each region."""
    if not rows:
        return
    regions = tuple(dict.fromkeys(row.region for row in rows))
    sizes = {row.region: (row.region, str(row.pixels), f"{said(row.area_mm2)} mm²") for row in rows[::-1]}
    yield Table("Regions", ("region", "pixels", "area"), tuple(sizes[region] for region in regions))
    alone = []
    for name, found in by_image(rows).items():
        lines = [(_plane(row[0]), *map(_value, row)) for row in _in_rows(found, len(regions))]
        unit = f" ({found[0].unit})" if found[0].unit else ""
        if len(lines) > 1:
            yield Table(f"{spaced(name)}{unit}", ("wavelength", *regions), tuple(lines))
        else:
            alone.append((f"{spaced(name)}{unit}", *lines[0][1:]))
    if alone:
        yield Table("Images of one plane", ("image", *regions), tuple(alone))


def _in_rows(rows: Sequence[RegionRow], count: int) -> list[Sequence[RegionRow]]:
    """Return the rows of each plane of one image: a table lists all regions of a plane, then the next plane."""
    return [rows[i : i + count] for i in range(0, len(rows), count)]


def _plane(row: RegionRow) -> str:
    return "" if row.wavelength_nm is None else f"{row.wavelength_nm:g} nm"


def _value(row: RegionRow) -> str:
    return "undefined" if row.mean is None or row.std is None else f"{plain(row.mean, 4)} ± {plain(row.std, 2)}"
