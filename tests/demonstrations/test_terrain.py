"""The topographic mouse: what is felt at a place, and that the wristband follows."""

import json

import numpy as np
import pytest
from PIL import Image, TiffImagePlugin

import bubbleskin as bs
from bubbleskin.demonstrations.landscapes import LANDSCAPES
from bubbleskin.demonstrations.pointer import PATHS, Pointer, follow
from bubbleskin.demonstrations.terrain import MODES, Terrain

CELLS = 201  # a cell of a terrain 200 mm wide is 1 mm


def field(function):
    """A terrain of 200 by 200 mm, `function` of x and y in mm."""
    y, x = np.mgrid[0:CELLS, 0:CELLS].astype(float)
    return function(x, y)


def test_a_ramp_is_felt_where_the_bubbles_are(layout):
    """5.5 mm at the left edge and 12 mm at the right one: 0.0325 mm for each mm between."""
    terrain = Terrain(field(lambda x, y: x), layout, width_mm=200)
    for x, y in ((100, 100), (60, 130), (140.5, 33)):
        wanted = 5.5 + 6.5 * (x + layout.positions_mm[:, 0]) / 200
        np.testing.assert_allclose(terrain.patch(x, y), wanted, atol=1e-3)


def test_a_bubble_feels_the_mean_of_its_footprint(layout):
    """Held against the mean over a disc as wide as the pitch, which is another filter of the same width."""
    terrain = Terrain(field(lambda x, y: np.cos(2 * np.pi * x / 25)), layout, width_mm=200)
    x, y = np.mgrid[-5:5:201j, -5:5:201j]
    disc = np.hypot(x, y) <= 5
    for at in (100.0, 106.0, 93.2):
        under = [np.mean(np.cos(2 * np.pi * (at + bubble + x[disc]) / 25)) for bubble in layout.positions_mm[:, 0]]
        np.testing.assert_allclose(terrain.patch(at, 100), 8.75 + 3.25 * np.array(under), atol=0.1)


def test_slope_is_how_steep_it_is(layout):
    """A roof: both sides are equally steep, its ridge is level."""
    terrain = Terrain(field(lambda x, y: -abs(x - 100)), layout, width_mm=200)
    np.testing.assert_allclose(terrain.patch(50, 100, "slope"), 12, atol=0.01)
    np.testing.assert_allclose(terrain.patch(150, 100, "slope"), 12, atol=0.01)
    assert terrain.patch(100, 100, "slope")[0] < 6


def test_stretched_raises_the_contrast_and_never_more_than_fivefold(layout):
    hills = Terrain(field(lambda x, y: np.cos(x / 30) + np.cos(y / 35)), layout, width_mm=200)
    plain, stretched = hills.patch(60, 70), hills.patch(60, 70, "stretched")
    assert np.ptp(stretched) == pytest.approx(min(6.5, 5 * np.ptp(plain)))
    assert np.argsort(plain).tolist() == np.argsort(stretched).tolist()
    faint = Terrain(field(lambda x, y: x + 1e4 * (y > 199)), layout, width_mm=200)
    assert np.ptp(faint.patch(100, 100, "stretched")) == pytest.approx(5 * np.ptp(faint.patch(100, 100)))
    level = Terrain(field(lambda x, y: 0 * x), layout, width_mm=200)
    assert level.patch(3, 9, "stretched").tolist() == [8.75] * 7


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", LANDSCAPES)
def test_every_terrain_stays_within_the_range_to_its_edges_and_beyond(name, mode):
    terrain = Terrain.named(name, bs.Layout.hexagon(2))
    for x, y in ((80, 80), (0, 0), (160, 20), (-500, 900)):
        heights = terrain.patch(x, y, mode)
        assert heights.shape == (19,)
        assert heights.min() >= 5.5 - 1e-9
        assert heights.max() <= 12 + 1e-9


def test_a_look_says_what_can_be_felt(layout):
    """Ridges 10 mm apart are too fine for bubbles 10 mm apart; ones 80 mm apart are not."""
    state = bs.connect("sim://wristband7").state()
    wide, fine = (
        Terrain(field(lambda x, y, apart=apart: np.cos(2 * np.pi * x / apart)), layout, width_mm=200).look(
            100, 100, state=state
        )
        for apart in (80, 10)
    )
    assert wide.lost_mm < 0.15 < 1 < fine.lost_mm
    assert wide.apart_mm == pytest.approx(2 * np.sqrt(2) * np.median(state.sd_mm))
    assert wide.steps == pytest.approx(np.ptp(wide.heights_mm) / wide.apart_mm)
    assert str(wide).startswith(f"contrast {wide.contrast_mm:.1f} mm, {wide.steps:.0f} steps of ")
    assert Terrain(field(lambda x, y: x), layout).look(1, 1).steps is None, "nobody knows without a state"


def test_the_upper_edge_of_a_picture_is_up(layout, tmp_path):
    picture = np.zeros((80, 80, 3), np.uint8)
    picture[:40] = 255
    Image.fromarray(picture).save(tmp_path / "half.png")
    terrain = Terrain.load(tmp_path / "half.png", layout)
    assert terrain.name == "half"
    assert terrain.patch(80, 140).min() == pytest.approx(12)
    assert terrain.patch(80, 20).max() == pytest.approx(5.5)


@pytest.mark.parametrize("kind", ["float32", "int16", "uint16", "int32"])
def test_a_tiff_with_numbers_is_read_as_they_are(layout, tmp_path, kind):
    """As GeoTIFF has them: elevations in m, one number for what is not known, named by GDAL's tag."""
    elevation = np.linspace(0, 3000, 80)[None, :].repeat(80, axis=0).astype(kind)
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    tags[42113] = "0"
    path = tmp_path / "alps.tif"
    Image.fromarray(elevation).save(path, tiffinfo=tags)
    with pytest.raises(bs.InvalidInput, match=r"is not known at \(0, 0\), .*fill='nearest'"):
        Terrain.load(path, layout)
    terrain = Terrain.load(path, layout, fill="nearest")
    wanted = 5.5 + 6.5 * (80 + layout.positions_mm[:, 0]) / 160
    np.testing.assert_allclose(terrain.patch(80, 80), wanted, atol=0.05)


def test_arrays_and_tables_are_read_as_heightfields_are(layout, tmp_path):
    ramp = np.arange(50.0)[:, None].repeat(60, axis=1)
    np.save(tmp_path / "ramp.npy", ramp)
    np.savetxt(tmp_path / "ramp.csv", ramp, delimiter=",")
    from_npy, from_csv = (Terrain.load(tmp_path / f"ramp.{kind}", layout) for kind in ("npy", "csv"))
    assert (from_npy.relief_mm == from_csv.relief_mm).all()
    assert from_npy.patch(80, 100).mean() > from_npy.patch(80, 20).mean(), "row 0 has the lowest y"


def broken(path, kind):
    """A file that is no terrain."""
    if kind == "text":
        path.write_text("no picture")
    elif kind == "half":
        Image.fromarray(np.random.default_rng(1).integers(0, 255, (90, 90), np.uint8)).save(path)
        path.write_bytes(path.read_bytes()[:3000])
    else:
        Image.new("1", (4000, 4000)).save(path)
    return path


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("text", "is not a picture that can be read"),
        ("half", "cannot be read"),
        ("large", "4000 by 4000 pixels"),
    ],
)
def test_what_is_no_picture_is_refused_in_a_sentence(layout, tmp_path, kind, words):
    with pytest.raises(bs.InvalidInput, match=words):
        Terrain.load(broken(tmp_path / "it.png", kind), layout)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda layout: Terrain([1, 2, 3], layout), "two rows and two columns"),
        (lambda layout: Terrain([[1, np.nan], [1, 2]], layout), r"nan at index \(0, 1\)"),
        (lambda layout: Terrain(np.eye(3), layout, low_mm=9, high_mm=8), "low_mm must be below"),
        (lambda layout: Terrain(np.eye(3), 7), "give a Layout"),
        (lambda layout: Terrain(np.eye(3), layout, width_mm=0), "above zero"),
        (lambda layout: Terrain.named("moon", layout), "'volcano', 'islands', 'ridges'"),
        (lambda layout: Terrain(np.eye(3), layout).patch(np.nan, 0), "x_mm is nan"),
        (lambda layout: Terrain(np.eye(3), layout).patch(0, 0, "rough"), "'plain', 'slope', 'stretched'"),
        (lambda layout: Pointer([[1, 2]]), "two or more places"),
        (lambda layout: Pointer([[1, 2], [1, 2]]), "somewhere to go"),
        (lambda layout: Pointer([[1, 2], [3, 4]], 0), "above zero"),
    ],
)
def test_what_cannot_be_meant_is_refused(layout, make, words):
    with pytest.raises(bs.InvalidInput, match=words):
        make(layout)


@pytest.mark.parametrize("path", PATHS)
def test_a_pointer_moves_at_its_speed_and_stays_on_the_terrain(layout, path):
    terrain = Terrain.named("volcano", layout)
    pointer = Pointer(PATHS[path](terrain), 50)
    places = np.array([pointer.at(t) for t in np.arange(0, pointer.duration, 0.01)])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert steps.max() <= 0.5 + 1e-9, "50 mm/s for 10 ms"
    assert np.median(steps) == pytest.approx(0.5, rel=0.01)
    assert places.min() >= 16 - 1e-9
    assert places.max() <= 144 + 1e-9
    assert pointer.at(pointer.duration) == pytest.approx(pointer.at(0))


def test_the_wristband_follows_a_pointer(skin):
    """True heights against those asked, at the end of each thirtieth of a second."""
    terrain = Terrain.named("volcano", skin.layout)
    begin, off, moved = skin.simulated.time, [], []
    for moment in follow(skin, terrain, Pointer([[30, 80], [80, 80]]), seconds=2):
        off.append(skin.simulated.height_mm - moment.heights_mm)
        moved.append(moment.heights_mm)
    assert len(off) == 61
    assert skin.simulated.time - begin < 2 + 1.5, "and the first shape"
    assert np.ptp(moved, axis=0).min() > 1
    assert np.sqrt(np.mean(np.square(off))) < 0.1


@pytest.mark.medium
def test_the_wristband_follows_where_bubbles_touch():
    """Neighbours lift each other, and the true tops are still those that are asked: 0.3 mm RMS is what is promised."""
    with bs.connect("sim://wristband7") as skin:
        terrain = Terrain.named("volcano", skin.layout)
        off, lifted = [], 0.0
        for moment in follow(skin, terrain, Pointer([[45, 80], [80, 80]]), seconds=1.75):
            off.append(skin.simulated.height_mm - moment.heights_mm)
            lifted = max(lifted, float(np.max(skin.simulated.height_mm - skin.simulated.alone_mm)))
    assert np.sqrt(np.mean(np.square(off))) < 0.3
    assert lifted > 0.3, "or nothing has been shown"


@pytest.mark.medium
def test_the_command_feels_a_terrain(command, tmp_path):
    status, out, err = command("demo", "terrain", "islands", "--seconds", "0.5", "--device", "sim://wristband7")
    assert (status, err) == (0, "")
    assert out.startswith("Felt islands in 16 shapes, 30 a second, true heights within 0.0")
    status, out, _ = command("demo", "--device", "sim://wristband19", "terrain", "--seconds", "0.1", "--json")
    moments = [json.loads(line) for line in out.splitlines()]
    assert status == 0
    assert [len(moment["heights_mm"]) for moment in moments] == [19] * 4
    assert command("demo", "terrain", "moon")[0] == 2
    assert "Cannot read the terrain" in command("demo", "terrain", str(tmp_path / "moon.png"))[2]
