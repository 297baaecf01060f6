import pytest

from bubbleskin.membrane import YeohBalloon


def balloons() -> dict[str, YeohBalloon]:
    return {
        "paper": YeohBalloon(),
        "just snaps": YeohBalloon(mu=46.2e3),
        "snaps": YeohBalloon(mu=79.24e3),
        "neo-Hookean": YeohBalloon(c2=0.0, c3=0.0),
        "Ecoflex": YeohBalloon(mu=15.78e3, c2=91.8, c3=0.0),
        "thick, mid": YeohBalloon(wall="thick"),
        "thick, inner": YeohBalloon(wall="thick", surface="inner"),
        "thick, outer": YeohBalloon(wall="thick", surface="outer"),
        "thick, snaps": YeohBalloon(wall="thick", mu=79.24e3),
    }


@pytest.fixture(params=balloons(), name="balloon")
def _balloon(request: pytest.FixtureRequest) -> YeohBalloon:
    """Every kind of curve: monotonic, barely and truly snapping, thin and thick."""
    return balloons()[request.param]
