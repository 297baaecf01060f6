"""`bubbleskin studio` as a process of its own: what it prints, who comes in, and how it ends."""

import json
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request

import pytest

LEFT_S = 8.0
"""Seconds without any page after which it ends."""


@pytest.fixture
def studio(request, start):
    """A studio in a process: the process, and what it printed."""
    more = getattr(request, "param", [])
    process = start("studio", "--port", 0, "--json", "--device", "sim://wristband7", *more)
    yield process, json.loads(process.stdout.readline())
    process.kill()
    process.wait()
    process.stdout.close()
    process.stderr.close()


def post(url, **headers):
    request = urllib.request.Request(url, method="POST", headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as refused:
        with refused:
            return refused.code, refused.read().decode()


@pytest.mark.slow
def test_a_notification_pulses_and_ctrl_c_ends_it(studio):
    process, told = studio
    address = told["url"].partition("/?")[0]
    assert address.startswith("http://127.0.0.1:")
    assert post(f"{address}/notify")[0] == 403
    assert post(f"{address}/notify?token={told['token']}", Origin="http://evil.example")[0] == 403
    assert post(f"{address}/notify?token={told['token']}") == (200, {"problem": ""})
    assert post(f"{address}/vent", Authorization=f"Bearer {told['token']}") == (200, {"problem": ""})
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=20)
    assert (process.returncode, out, err.lstrip()) == (130, "", "Stopped.\n")


def opened(chromium, url):
    """A page that shows bubbles."""
    page = chromium.new_page()
    page.goto(url)
    page.locator("[data-bubble='0'][aria-label]").wait_for()
    return page


@pytest.mark.slow
def test_closing_the_last_page_ends_it(studio, chromium):
    process, told = studio
    page = opened(chromium, told["url"])
    page.reload()
    page.locator("[data-bubble='0'][aria-label]").wait_for()
    assert process.poll() is None
    page.close()
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (0, "", "")


@pytest.mark.slow
@pytest.mark.parametrize("studio", [["--stay"]], indirect=True)
def test_told_to_stay_it_does(studio, chromium):
    process, told = studio
    opened(chromium, told["url"]).close()
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(LEFT_S + 4.0)
    assert post(f"{told['url'].partition('/?')[0]}/notify?token={told['token']}") == (200, {"problem": ""})


@pytest.mark.slow
def test_a_port_in_use_is_said(command):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        status, _, err = command("studio", "--port", port, "--no-open")
    assert (status, err) == (2, f"Port {port} is in use; give another with --port, or 0 for a free one.\n")


def test_without_its_extra_it_says_what_to_install(command, monkeypatch):
    monkeypatch.setitem(sys.modules, "nicegui", None)
    status, _, err = command("studio")
    assert status == 1
    assert "pip install 'bubbleskin[studio]'" in err


@pytest.mark.medium
def test_the_core_knows_nothing_of_it():
    code = (
        "import sys, bubbleskin, bubbleskin.cli.command; bubbleskin.live;"
        "print([name for name in ('nicegui', 'fastapi', 'starlette', 'anywidget', 'traitlets') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
