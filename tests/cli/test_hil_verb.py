"""`bubbleskin hil`: the suite of every target, run as a user runs it."""

import os
import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest

TARGET = "sim://wristband7?contact=0"
ONLY = "first_bubble or untried or requests_of_another_session"


def run(*arguments, cwd):
    command = [sys.executable, "-m", "bubbleskin", "hil", *map(str, arguments)]
    environment = {
        name: value for name, value in os.environ.items() if name not in ("BUBBLESKIN_DEVICE", "PYTEST_ADDOPTS")
    }
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False, timeout=120)


@pytest.mark.slow
def test_what_holds_is_said_with_status_0_and_reports_are_written(tmp_path):
    done = run("--device", TARGET, "--only", ONLY, "--html", "r.html", "--junit", "r.xml", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 passed" in done.stdout
    assert "test_first_moves" in (tmp_path / "r.html").read_text(encoding="utf-8")
    assert len(ET.parse(tmp_path / "r.xml").findall(".//testcase")) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r.html", "r.xml"], "and nothing else is left"


@pytest.mark.slow
def test_a_wristband_that_is_not_there_is_said(tmp_path):
    done = run("--device", tmp_path / "no_port", "--only", "first_bubble", cwd=tmp_path)
    assert done.returncode == 1
    assert "no_port" in done.stdout


@pytest.mark.slow
def test_a_failure_stands_beside_what_the_wristband_says(tmp_path):
    # A plant whose bubble 1 is half a table's stiffness off cannot be known to be where it is asked.
    device = f"{TARGET}&spread=0.4&seed=3"
    done = run("--device", device, "--only", "all_rise_high or extremes", "--html", "r.html", cwd=tmp_path)
    assert done.returncode == 1
    assert "What the wristband says" in done.stdout
    assert "<Health" in done.stdout
    assert "data:image/png;base64," in (tmp_path / "r.html").read_text(encoding="utf-8"), "the shape that stood there"


@pytest.mark.medium
def test_what_would_be_tried_is_listed(tmp_path):
    done = run("--list", "--only", "safety", cwd=tmp_path)
    assert done.returncode == 0
    assert "test_a_shape_is_vented_when_the_host_stays_silent" in done.stdout


@pytest.mark.medium
def test_a_hardware_map_names_more_devices(tmp_path):
    (tmp_path / "lab.toml").write_text(
        '[devices]\nleft = "sim://wristband7"\nright = "sim://wristband19"\n', encoding="utf-8"
    )
    done = run("--list", "--only", "first_bubble", "--map", "lab.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "[sim://wristband7]" in done.stdout
    assert "[sim://wristband19]" in done.stdout


@pytest.mark.medium
@pytest.mark.parametrize("text", ["", "[devices]\n", "devices = 3\n", "[devices]\nleft = 3\n"])
def test_a_hardware_map_without_devices_is_refused_in_a_sentence(tmp_path, text):
    (tmp_path / "lab.toml").write_text(text, encoding="utf-8")
    done = run("--map", "lab.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "[devices]" in done.stderr
