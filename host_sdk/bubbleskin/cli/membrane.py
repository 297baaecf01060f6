"""The verbs about the membrane: fit, table. Their options and readers serve `plot` too."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click

from bubbleskin import boards
from bubbleskin.cli.options import Real, Whole, device, gathered
from bubbleskin.connecting import connect
from bubbleskin.errors import InvalidInput

if TYPE_CHECKING:  # physics and plot load scipy and matplotlib, so a verb imports them when it runs
    from bubbleskin.membrane import Calibration, Measurements, SheetFit, YeohBalloon, YeohFit

F = TypeVar("F", bound=Callable[..., Any])
DATA = click.Path(dir_okay=False, path_type=Path)
HEIGHT = Real(above_zero=True, high=1000.0, unit="mm")


class TableForm(NamedTuple):
    """How tables are made: for which board, with how many knots, up to which height."""

    board: str
    knots: int
    up_to_mm: float


class Source(NamedTuple):
    """Where tables come from."""

    data: Path | None
    show: Path | None
    from_device: bool
    bubbles: int


class Use(NamedTuple):
    """What is done with tables."""

    output: Path | None
    upload: bool
    save: bool
    anyway: bool


class Sizes(NamedTuple):
    """Thickness and diameter of a bubble at rest."""

    wall: str
    thickness_mm: float
    diameter_mm: float
    diameter_is: str


def _options(*options: Callable[[F], F]) -> Callable[[F], F]:
    def decorate(function: F) -> F:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


def _above_zero(flag: str, high: float, unit: str, default: float, help_text: str) -> Callable[[F], F]:
    """An option for a number above zero, up to `high`."""
    kind = Real(above_zero=True, high=high, unit=unit)
    return click.option(flag, type=kind, default=default, show_default=True, help=help_text)


size_options = _options(
    click.option("--wall", type=click.Choice(["thin", "thick"]), default="thin", show_default=True),
    _above_zero("--thickness-mm", 100.0, "mm", 1.0, "Wall at rest."),
    _above_zero("--diameter-mm", 1000.0, "mm", 5.0, "Diameter at rest."),
    click.option(
        "--diameter-is",
        type=click.Choice(["mid", "inner", "outer"]),
        default="mid",
        show_default=True,
        help="The surface of a thick wall that has this diameter.",
    ),
)
fit_options = _options(
    size_options,
    _above_zero("--height-noise-mm", 100.0, "mm", 0.05, "One sigma."),
    _above_zero("--pressure-noise-kpa", 1000.0, "kPa", 0.15, "One sigma."),
    click.option("--pooled", is_flag=True, help="One curve through all bubbles of the file."),
    click.option("--skip-bad-rows", is_flag=True, help="Leave bad rows out and name them."),
    click.option(
        "--first",
        type=Whole(0, 1),
        default=0,
        show_default=True,
        help="The file's number of what is bubble 0 here.",
    ),
)
material_options = _options(
    click.option("--preset", default="paper", show_default=True, help="paper, ecoflex-00-30, ..."),
    click.option("--mu-kpa", type=Real(), help="Shear modulus, instead of the preset's."),
    click.option("--c1-kpa", type=Real(), help="C1 = mu / 2, the other way to give it."),
    click.option("--c2-pa", type=Real(), help="Instead of the preset's."),
    click.option("--c3-pa", type=Real(), help="Instead of the preset's."),
    size_options,
)
table_options = _options(
    click.option("--board", default=boards.DEFAULT, show_default=True, help="Name kept in the file."),
    click.option("--knots", type=Whole(2, 64), default=64, show_default=True, help="Knots per table, 64 at most."),
    click.option("--up-to-mm", type=HEIGHT, default=14.0, show_default=True, help="Where the tables end."),
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


def picture_option(name: str) -> Callable[[F], F]:
    """The option that says where a picture goes."""
    return click.option("-o", "--output", type=DATA, default=f"{name}.png", show_default=True, help="png, svg or pdf.")


@click.command()
@click.argument("data", type=DATA)
@fit_options
@table_options
@click.option("-o", "--output", type=DATA, help="Write the bubbles' tables as a calibration file.")
@click.option("--picture", type=DATA, help="Draw the fit.")
@json_option
@gathered(form=TableForm)
def fit(data: Path, form: TableForm, output: Path | None, picture: Path | None, as_json: bool, **options: Any) -> None:
    """Fit the membrane's constants to DATA, a CSV file with units in its header.

    Columns: height [mm], pressure [kPa]; also bubble and step (rows of one step are repeats).
    """
    measurements, found = fit_file(data, **options)
    click.echo(json.dumps(found.as_dict(), indent=2) if as_json else found.report())
    if options["first"] and not as_json:
        click.echo(
            f"numbers of bubbles are the wristband's: bubble 0 is number {options['first']} of {measurements.source}"
        )
    if output:
        _calibration(found, f"fit of {measurements.source}", form).save(output)
        click.echo(f"wrote {output}", err=True)
    if picture:
        draw_fit(found, measurements, picture)


@click.command()
@material_options
@table_options
@click.option("--data", type=DATA, help="Fit this CSV file first and make a table per bubble.")
@click.option("--show", type=DATA, help="Read a calibration file instead of making one.")
@click.option("--from-device", is_flag=True, help="Read the tables that the wristband uses instead of making some.")
@click.option("--compare", type=DATA, help="Say how this other calibration file differs; status 1 if so.")
@click.option("--bubbles", type=Whole(1, 1000), default=7, show_default=True, help="How many equal tables to make.")
@click.option("-o", "--output", type=DATA, help="Write a calibration file.")
@click.option("--upload", is_flag=True, help="Let the wristband use these tables, until it restarts.")
@click.option("--save", is_flag=True, help="With --upload: for good. The wristband must be vented.")
@click.option(
    "--anyway", is_flag=True, help="With --upload: tables that are none of rubber, or contradict each other, too."
)
@device
@json_option
@gathered(source=Source, use=Use, form=TableForm)
def table(
    source: Source, use: Use, form: TableForm, compare: Path | None, device: str | None, as_json: bool, **options: Any
) -> None:
    """Make the tables that the firmware runs on: height to pressure, one per bubble.

    They come from a preset, from --data, from a file (--show) or from a wristband (--from-device).
    """
    from bubbleskin.membrane import Calibration

    if use.save and not use.upload:
        raise InvalidInput("--save goes with --upload: it keeps the tables that are uploaded.")
    if use.anyway and not use.upload:
        raise InvalidInput("--anyway goes with --upload: it uploads what looks wrong.")
    calibration = _find_tables(source, form, device, **options)
    click.echo(json.dumps(calibration.as_dict(), indent=2) if as_json else calibration.report())
    if use.output:
        calibration.save(use.output)
        click.echo(f"wrote {use.output}", err=True)
    if use.upload:
        with connect(device) as skin:
            skin.upload_tables(calibration, use.save, anyway=use.anyway)
        until = "from now on" if use.save else "until it restarts"
        click.echo(f"{calibration.board} uses these tables, CRC {calibration.crc32:08x}, {until}", err=True)
    if compare:
        differences = calibration.differences(Calibration.load(compare))
        click.echo("\n".join(differences) or "no difference")
        if differences:
            raise SystemExit(1)


def _find_tables(source: Source, form: TableForm, device: str | None, preset: str, **options: Any) -> Calibration:
    """The tables of the one source that was named, or of a preset."""
    from bubbleskin.membrane import Calibration

    if (source.show is not None) + (source.data is not None) + source.from_device > 1:
        raise InvalidInput("The tables can come from one place: --data, --show or --from-device.")
    if source.show:
        return Calibration.load(source.show)
    if source.from_device:
        with connect(device) as skin:
            origin = f"read from {device or 'the wristband'}"
            return Calibration(skin.info.board, tuple(skin.read_tables()), origin)
    if source.data:
        sizes = {field: options[field] for field in Sizes._fields}
        measurements, found = fit_file(source.data, **sizes)
        return _calibration(found, f"fit of {measurements.source}", form)
    balloons = [balloon(preset, **options)] * source.bubbles
    return _calibration(balloons, balloons[0].describe() if balloons else "", form)


commands = [fit, table]


@contextmanager
def _said() -> Iterator[None]:
    """Say rows left out in one line each; the other warnings stand in the reports."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for warning in caught:
        if warning.category.__name__ == "BadRowWarning":
            click.echo(str(warning.message), err=True)


def fit_file(
    data: Path,
    *,
    skip_bad_rows: bool = False,
    first: int = 0,
    pooled: bool = False,
    height_noise_mm: float = 0.05,
    pressure_noise_kpa: float = 0.15,
    **sizes: Any,
) -> tuple[Measurements, YeohFit | SheetFit]:
    """Read a file of measurements and fit it as its options say."""
    from bubbleskin.membrane import Noise, fit_measurements, read_csv

    size = Sizes(**sizes)
    with _said():
        measurements = read_csv(data, skip_bad_rows=skip_bad_rows, first=first)
        return measurements, fit_measurements(
            measurements,
            pooled=pooled,
            noise=Noise(height_noise_mm * 1e-3, pressure_noise_kpa * 1e3),
            thickness=size.thickness_mm * 1e-3,
            radius=size.diameter_mm * 0.5e-3,
            wall=size.wall,
            surface=size.diameter_is,
        )


def balloon(
    name: str,
    *,
    mu_kpa: float | None,
    c1_kpa: float | None,
    c2_pa: float | None,
    c3_pa: float | None,
    **sizes: Any,
) -> YeohBalloon:
    """The balloon that material options describe."""
    from bubbleskin.membrane import YeohBalloon, preset

    known = preset(name)
    if mu_kpa is None and c1_kpa is None:
        mu_kpa = known.mu / 1e3
    return YeohBalloon.with_units(
        mu_kpa=mu_kpa,
        c1_kpa=c1_kpa,
        c2_pa=known.c2 if c2_pa is None else c2_pa,
        c3_pa=known.c3 if c3_pa is None else c3_pa,
        **sizes,
    )


def _calibration(found: YeohFit | SheetFit | list[YeohBalloon], source: str, form: TableForm) -> Calibration:
    from bubbleskin.membrane import Calibration

    balloons = found if isinstance(found, list) else found.balloons
    if not balloons:
        raise InvalidInput("--bubbles must be 1 or more.")
    return Calibration.build(form.board, balloons, source=source, height_mm=(5.0, form.up_to_mm), knots=form.knots)


def draw_fit(found: YeohFit | SheetFit, measurements: Measurements, output: Path) -> None:
    """Draw a fit over its measurements into a file, and say so."""
    from bubbleskin.plot import membrane

    membrane.save(membrane.plot_fit(found, measurements), output)
    click.echo(f"wrote {output}", err=True)
