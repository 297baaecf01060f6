"""What the pictures show: branches in their style, jumps where they are, bars, bands and tolerances."""

import numpy as np
import pytest

from bubbleskin.errors import InvalidInput
from bubbleskin.membrane import Table, YeohBalloon, build_table, fit_sheet, fit_yeoh, simulate_sheet
from bubbleskin.plot import membrane


def curves(axes):
    return [line for line in axes.lines if len(line.get_xdata()) > 50]


def test_branches_are_solid_dashed_solid_and_meet_at_the_limit_points():
    balloon = YeohBalloon(mu=79.24e3)
    (axes,) = membrane.plot_curve({"snaps": balloon}).axes
    low, unstable, high = curves(axes)
    assert [line.get_linestyle() for line in (low, unstable, high)] == ["-", "--", "-"]
    ends = [line.get_xdata()[-1] * 1e3 for line in (low, unstable)]
    np.testing.assert_allclose(ends, [point.pressure for point in balloon.limit_points()])
    for line in (low, unstable, high):
        np.testing.assert_allclose(
            line.get_xdata() * 1e3, balloon.pressure_at_height(np.maximum(line.get_ydata() * 1e-3, 5e-3)), atol=1e-6
        )


def test_jumps_are_marked_with_arrows():
    balloon = YeohBalloon(mu=79.24e3)
    (axes,) = membrane.plot_curve({"snaps": balloon}).axes
    arrows = [(text.xyann, text.xy) for text in axes.texts]
    jumps = [balloon.inflation_jump(), balloon.deflation_jump()]
    expected = [
        (
            (j.pressure / 1e3, balloon.height(j.from_stretch) * 1e3),
            (j.pressure / 1e3, balloon.height(j.to_stretch) * 1e3),
        )
        for j in jumps
    ]
    np.testing.assert_allclose(arrows, expected)


def test_monotonic_curve_is_one_solid_line():
    (axes,) = membrane.plot_curve({"paper": YeohBalloon()}).axes
    (line,) = curves(axes)
    assert line.get_linestyle() == "-"
    assert not axes.texts


def test_fit_shows_the_mean_of_repeats_and_the_band():
    measured, _ = simulate_sheet(1, spread=0.0, seed=4)
    fit = fit_yeoh(measured.height, measured.pressure, step=measured.step)
    axes = membrane.plot_fit(fit, measured).axes[0]
    (bars,) = axes.containers
    x, y = bars.lines[0].get_data()
    assert x.size == 14
    assert y[3] == pytest.approx(measured.height[measured.step == 3].mean() * 1e3)
    spread = measured.pressure[measured.step == 3].std(ddof=1) / 1e3
    ends = bars.lines[2][0].get_segments()[3][:, 0]
    np.testing.assert_allclose(ends, [x[3] - spread, x[3] + spread])
    assert any(label == "95 % confidence" for label in axes.get_legend_handles_labels()[1])


def test_sheet_has_a_curve_per_bubble():
    measured, _ = simulate_sheet(3, seed=0)
    (axes,) = membrane.plot_fit(fit_sheet(measured.bubble, measured.height, measured.pressure), measured).axes
    assert len(curves(axes)) == 3
    assert len(axes.containers) == 3


@pytest.mark.medium
def test_single_points_get_the_noise_found():
    measured, _ = simulate_sheet(1, spread=0.0, seed=4, repeats=1)
    bare = type(measured)(measured.height, measured.pressure, measured.bubble)
    fit = fit_yeoh(bare.height, bare.pressure)
    (bars,) = membrane.plot_fit(fit, bare).axes[0].containers
    x = bars.lines[0].get_xdata()
    np.testing.assert_allclose(bars.lines[2][0].get_segments()[0][:, 0] - x[0], [-0.15 * fit.scale, 0.15 * fit.scale])


def test_table_picture_shows_knots_and_error_within_tolerance():
    table = build_table(YeohBalloon(mu=60e3))
    above, below = membrane.plot_table(table).axes
    np.testing.assert_allclose(above.lines[1].get_xdata(), table.height_um / 1e3)
    (error,) = below.collections
    extent = error.get_paths()[0].get_extents()
    assert -1 < extent.y0 < -0.1
    assert 0.1 < extent.y1 < 1


@pytest.mark.medium
def test_figures_say_that_they_are_simulated(tmp_path):
    for figure, measured in (membrane.figure_4(), membrane.figure_6()):
        assert "simulated" in figure.axes[0].get_title(loc="left")
        assert measured.source.startswith("simulated")
        membrane.save(figure, tmp_path / "figure.svg")
        assert (tmp_path / "figure.svg").stat().st_size > 5000


def test_what_cannot_be_drawn_is_said(tmp_path):
    with pytest.raises(InvalidInput, match="without its balloon"):
        membrane.plot_table(Table([5000, 6000], [0, 7]))
    figure = membrane.plot_curve({"paper": YeohBalloon()})
    with pytest.raises(InvalidInput, match="cannot write the picture"):
        membrane.save(figure, tmp_path / "figure.nonsense")
