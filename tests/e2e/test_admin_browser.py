"""A researcher in a real browser, on a real server: watches a bot play, intervenes, and replays the game."""

import asyncio
import base64
import contextlib
import io
import json
import re
import threading
import zipfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from PIL import Image
from playwright.sync_api import Browser, Page, Route, WebSocketRoute, expect

from server.bots.participant import Bot
from server.monitoring.report_making import PAGE
from server.settings import ROOT
from server.store import interventions, study_reports
from tests.support import command_line
from tests.support.browser.game_page import draw_less_often, violations
from tests.support.live_server import LiveServer
from tests.support.real_server import SHORT_STUDY

STUDY = SHORT_STUDY.replace("horizon: 60", "horizon: 600").replace(", {name: matrix, title: {en: Matrix}}", "")
PATIENCE_MS = 60_000
MARK_GREEN = (103, 213, 147)  # of the nearest mark: the partner's green at 95 % on white
# How many pixels of the board have the nearest mark's colour: now, and each time it is drawn in the next 1.5 s.
MARK_PIXELS = """() => new Promise((done) => {
  const canvas = document.querySelector('#kitchen'), counts = [], from = performance.now();
  const look = (now) => {
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    for (let i = 0; i < data.length; i += 4) count += data[i] === 103 && data[i + 1] === 213 && data[i + 2] === 147;
    counts.push(count);
    if (now - from > 1500) done(counts); else setTimeout(() => requestAnimationFrame(look), 100);
  };
  requestAnimationFrame(() => requestAnimationFrame(look));
})"""


def play_along(url: str) -> None:
    """A bot plays for as long as there is a server."""
    with contextlib.suppress(ConnectionError, OSError, httpx.HTTPError):
        asyncio.run(Bot(url, "short", 1).take_part())


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    with LiveServer(tmp_path_factory.mktemp("admin"), speed=2.0, study=STUDY) as running:
        threading.Thread(target=play_along, args=(running.url,), daemon=True).start()
        yield running


@pytest.fixture(scope="module")
def password(server: LiveServer) -> str:
    """The account is made while the server runs."""
    made = command_line.run("admin", "--database", server.database, "create", "mara", "--role", "own")
    assert made.returncode == 0, made.stderr
    found = re.search(r"password: (\S+)", made.stdout)
    assert found, made.stdout
    return found.group(1)


@pytest.fixture
def page(chromium: Browser, server: LiveServer, password: str) -> Iterator[Page]:
    """Signed in, at the dashboard; errors on the console fail the test."""
    context = draw_less_often(chromium.new_context(viewport={"width": 1366, "height": 768}))
    opened = context.new_page()
    opened.set_default_timeout(PATIENCE_MS)
    expect.set_options(timeout=PATIENCE_MS)
    errors: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    opened.goto(f"{server.url}/admin/s/short")
    opened.fill("[name=name]", "mara")
    opened.fill("[name=password]", password)
    opened.click("form button")
    opened.wait_for_url("**/admin/s/short")
    yield opened
    context.close()
    assert errors == []


def is_accessible(page: Page) -> None:
    assert violations(page) == []


def played(page: Page, film: bytes, kind: str) -> tuple[float, int, int]:
    """The film's length in seconds, width and height. The browser decodes it to its last picture, which has many
    colours."""
    assert page.context.browser is not None
    watching = page.context.browser.new_page()
    length, width, height, colours = watching.evaluate(
        """async ([kind, data]) => {
          const video = document.createElement('video');
          Object.assign(video, { muted: true, src: `data:video/${kind};base64,${data}` });
          video.onerror = () => { throw new Error(video.error.message); };
          await new Promise((good) => { video.oncanplaythrough = good; });
          video.playbackRate = 4;
          await Promise.all([video.play(), new Promise((good) => { video.onended = good; })]);
          const canvas = document.createElement('canvas');
          Object.assign(canvas, { width: video.videoWidth, height: video.videoHeight });
          const pen = canvas.getContext('2d');
          pen.drawImage(video, 0, 0);
          const dots = new Uint32Array(pen.getImageData(0, 0, canvas.width, canvas.height).data.buffer);
          return [video.duration, canvas.width, canvas.height, new Set(dots).size];
        }""",
        [kind, base64.b64encode(film).decode()],
    )
    watching.close()
    assert colours > 20
    return float(length), width, height


def saved_video(page: Page) -> tuple[str, bytes]:
    """Press the button; return the file's ending and the file."""
    with page.expect_download() as video:
        page.click("#video")
    return video.value.suggested_filename.rpartition(".")[2], Path(video.value.path()).read_bytes()


def test_a_running_game_is_watched_paused_and_resumed(page: Page) -> None:
    card = page.locator(".mini").filter(has_text="E1")
    expect(card).to_have_count(1)
    expect(page.locator("#people tr")).to_have_count(1)
    expect(page.locator("#people")).to_contain_text("hidden")
    expect(page.locator("#simulated")).to_have_text("1 simulated participant: no evidence about people")
    is_accessible(page)
    card.click()
    page.wait_for_selector("#game[data-ready=yes]", state="attached")
    expect(page.locator("#now")).to_have_text("Playing")
    expect(page.locator("#scrub")).to_have_attribute("max", "600")  # the axis below it has the same length
    page.click("[data-ask=pause]")
    page.fill("dialog[open] [name=note]", "to see whether it stands still")
    page.click("dialog[open] .main")
    expect(page.locator(".outcome")).to_have_text("The game is paused.")
    expect(page.locator("#now")).to_contain_text("Paused")
    is_accessible(page)
    page.click("[data-ask=resume]")
    page.click("dialog[open] .main")
    expect(page.locator("#now")).to_have_text("Playing")
    before = page.locator("#kitchen").get_attribute("data-timestep")
    assert before is not None
    expect(page.locator("#kitchen")).not_to_have_attribute("data-timestep", before)


def with_marks(route: Route) -> None:
    """Add to a record that the participant saw a move of the watched chef in every timestep."""
    record = route.fetch().json()
    game = record["game"]
    for row in record["rows"]:
        (x, y, *_), (other_x, other_y, *_) = (row["state"]["players"][seat] for seat in (game["watched_seat"], 0))
        free = [
            action
            for action, (columns, rows) in enumerate(((0, -1), (0, 1), (1, 0), (-1, 0)))
            if game["grid"][y + rows][x + columns] in " 12" and (x + columns, y + rows) != (other_x, other_y)
        ]
        row["displayed"] = [[free[0], 95], [6, 80], [6, 60]]
    route.fulfill(json=record)


# Make the page, before its scripts run, as it was a moment before the participant came back.
BEFORE_IT_WAS_LIVE = """document.addEventListener('readystatechange', () => {
  const game = document.querySelector('#game');
  if (document.readyState !== 'interactive' || !game) return;
  game.dataset.live = 'no';
  document.querySelector('#live-badge').textContent = 'running';
  for (const button of document.querySelectorAll('[data-while-live]')) button.hidden = true;
})"""


def test_an_open_page_of_a_game_follows_its_participant_and_colleagues(page: Page, server: LiveServer) -> None:
    page.locator(".mini").filter(has_text="E1").click()
    page.wait_for_selector("#game[data-ready=yes]", state="attached")
    page.add_init_script(BEFORE_IT_WAS_LIVE)
    page.reload()
    expect(page.locator("#live-badge")).to_have_text("Live")
    expect(page.locator("[data-ask=message]")).to_be_visible()
    expect(page.locator("#paused-badge")).to_be_hidden()
    database = server.app.state.services.web.database
    episode = page.url.partition("#")[0].rpartition("/")[2]
    server.do(lambda: database.write(interventions.pause_game, episode, "ada"))
    expect(page.locator("#paused-badge")).to_have_text("Paused by ada")
    server.do(lambda: database.write(interventions.pause_game, episode, None))
    expect(page.locator("#paused-badge")).to_be_hidden()


def test_a_game_is_replayed_and_exported_as_a_film(page: Page, server: LiveServer) -> None:
    page.route("**/record.json", with_marks)
    page.goto(f"{server.url}/admin/s/short/games")
    played_out = page.locator("table tr", has_text="done").locator("a", has_text="Tutorial")
    while not played_out.count():
        page.wait_for_timeout(300)
        page.reload()
    played_out.first.click()
    page.wait_for_selector("#game[data-ready=yes]", state="attached")
    expect(page.locator("#checked")).to_contain_text("are equal to the stored hashes")
    page.evaluate("location.hash = '#t=7'")
    expect(page.locator("#at")).to_have_text("t 7")
    page.keyboard.press("ArrowRight")
    expect(page.locator("#at")).to_have_text("t 8")
    assert page.url.endswith("#t=8")
    expect(page.locator("#inputs-t")).to_have_text("8")
    lane = page.locator("#frame tr", has=page.locator("th", has_text="Inputs"))
    lane.locator("td:not(:empty)").first.click()  # to a timestep in which one arrived
    expect(page.locator("#inputs li").first).to_contain_text("#")
    shown = int(page.url.partition("#t=")[2])
    assert min(page.evaluate(MARK_PIXELS)) > 20, "the marks are there at once, in colour, and stay"
    with page.expect_download() as picture:
        page.click("#picture")
    assert re.fullmatch(rf"[\w-]+-tutorial-t{shown}\.png", picture.value.suggested_filename)
    drawn = Image.open(picture.value.path()).convert("RGB")
    assert drawn.width >= 2 * page.evaluate("document.querySelector('#kitchen').clientWidth")
    assert Counter(zip(*[iter(drawn.tobytes())] * 3, strict=True))[MARK_GREEN] > 400, "the picture has the marks"
    page.set_viewport_size({"width": 390, "height": 844})
    page.evaluate("location.hash = '#t=20'")
    expect(page.locator("#at")).to_have_text("t 20")
    frame, now = (page.locator(each).first.bounding_box() for each in ("#frame", "#frame td.now"))
    assert frame is not None
    assert now is not None
    assert frame["x"] <= now["x"] <= frame["x"] + frame["width"] - now["width"], "on a phone it is scrolled to"
    page.evaluate("location.hash = `#t=${document.querySelector('#scrub').max - 14}`")
    checks_videos(page)


# A browser that cannot encode H.264 although it says so, and one whose encoders all fail.
WITHOUT_H264 = """() => {
  const configure = VideoEncoder.prototype.configure;
  VideoEncoder.prototype.configure = function (config) {
    if (config.codec.startsWith('avc')) throw new DOMException('no H.264', 'NotSupportedError');
    configure.call(this, config);
  };
}"""
WITH_A_FAILING_ENCODER = """() => {
  VideoEncoder.prototype.encode = () => { throw new DOMException('the encoder failed', 'EncodingError'); };
}"""


def checks_videos(page: Page) -> None:
    """15 timesteps of 200 ms as MP4, then as WebM in a browser without H.264, then none."""
    assets: list[str] = []
    page.on("request", lambda request: assets.append(request.url.rpartition("/")[2]))
    note = page.locator("#video-note")
    expect(note).to_be_hidden()
    assert page.evaluate("performance.getEntriesByType('resource').filter((e) => /mediabunny/.test(e.name))") == []
    ending, film = saved_video(page)
    assert "mediabunny.min.mjs" in assets
    seconds, width, height = played(page, film, ending)
    assert seconds == 3.0
    assert (width % 2, height % 2, width > 400, height > 300) == (0, 0, True, True)
    expect(page.locator("#video")).to_have_text("Video")
    if ending == "mp4":  # builds of Chromium without H.264 save WebM
        assert film.index(b"moov") < film.index(b"mdat"), "it plays while it loads"
        expect(note).to_have_text("Saved as MP4 (H.264), which PowerPoint, Keynote and browsers play.")
        page.evaluate(WITHOUT_H264)
        ending, film = saved_video(page)
        assert played(page, film, ending) == (3.0, width, height)
    assert ending == "webm"
    expect(note).to_contain_text("Saved as WebM, because this browser cannot encode H.264 for MP4.")
    is_accessible(page)
    page.evaluate(WITH_A_FAILING_ENCODER)
    page.click("#video")
    reason = "this browser encodes neither H.264 nor VP9 nor VP8"
    expect(note).to_have_text(f"The video was not saved: {reason}. Try again, or use a newer browser.")
    expect(page.locator("#video")).to_have_text("Video")


def test_the_live_page_shows_no_all_clear_while_an_alert_is_open(page: Page, server: LiveServer) -> None:
    text = "Timesteps come late: 61 ms at the 99th percentile."

    def with_alert(socket: WebSocketRoute) -> None:
        upstream = socket.connect_to_server()

        def forward(message: str | bytes) -> None:
            news = json.loads(message)
            if news["type"] == "alerts":
                news["alerts"] = [{"text": text, "path": "", "since_s": 5}]
            socket.send(json.dumps(news))

        upstream.on_message(forward)

    page.route_web_socket(re.compile("/admin/s/short/live$"), with_alert)
    page.goto(f"{server.url}/admin/s/short")
    expect(page.locator("#alerts li.bad").first).to_contain_text(text)
    expect(page.locator("#attention")).to_contain_text("1 alert")
    expect(page.locator("#attention")).not_to_contain_text("calm")


def test_the_live_page_shows_a_pause_by_somebody_else_without_a_reload(page: Page, server: LiveServer) -> None:
    page.goto(f"{server.url}/admin/s/short")
    expect(page.locator("#study-state")).to_have_text("Running")
    database = server.app.state.services.web.database
    server.do(lambda: database.write(interventions.pause_study, "short", "ada"))
    expect(page.locator("#study-state")).to_have_text("Paused")
    page.click("#pause-study")
    expect(page.locator("#ask-resume")).to_be_visible()
    server.do(lambda: database.write(interventions.resume_study, "short", "ada"))
    expect(page.locator("#study-state")).to_have_text("Running")
    expect(page.locator("#pause-study")).to_have_text("Pause study…")


def test_the_live_page_fits_a_phone_also_one_that_is_turned(page: Page, server: LiveServer) -> None:
    page.goto(f"{server.url}/admin/s/short")
    expect(page.locator(".chart canvas").first).to_be_visible()
    page.set_viewport_size({"width": 390, "height": 844})
    rights = "[...document.querySelectorAll('main .card')].map((card) => card.getBoundingClientRect().right)"
    page.wait_for_function(f"() => Math.max(...{rights}) <= 390")  # the charts follow the window a moment later
    tops = [page.locator(card).bounding_box() for card in ("[aria-labelledby=h-al]", "[aria-labelledby=h-live]")]
    assert tops[0] is not None
    assert tops[1] is not None
    assert tops[0]["y"] < tops[1]["y"], "alerts come first"
    assert len(page.evaluate(rights)) > 5
    page.set_viewport_size({"width": 1366, "height": 768})


@pytest.mark.slow
def test_every_page_of_a_researcher_is_accessible(page: Page, server: LiveServer) -> None:
    def look(path: str) -> None:
        answer = page.goto(f"{server.url}/admin{path}")
        assert answer is not None
        assert (answer.status, page.url) == (200, f"{server.url}/admin{path}"), "not the page that is to be looked at"
        is_accessible(page)

    for path in ("", "/audit", "/accounts", "/s/short/games"):
        look(path)
    page.goto(f"{server.url}/admin/s/short/games")
    page.click("#games tbody td a")
    is_accessible(page)
    page.emulate_media(color_scheme="dark")
    for path in ("", "/s/short", "/s/short/games"):
        look(path)
    page.click("text=Sign out")
    expect(page.locator("[name=password]")).to_be_visible()
    is_accessible(page)


def kept_report(server: LiveServer) -> None:
    """A report as the process leaves it, with a second script in it that nobody has reviewed."""
    script = (ROOT / "analysis" / "report.js").read_text(encoding="utf-8")
    text = (
        "<!doctype html><title>Report</title><style>p { color: rgb(1, 2, 3) }</style><p>Numbers</p>"
        '<blockquote class="paste"><button type="button" hidden>Copy</button><span>F(1, 10) = 2</span></blockquote>'
        f"<script>{script}</script><script>document.title = 'taken over'</script>"
    )
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as files:
        files.writestr(PAGE, text)
    database = server.app.state.services.web.database
    number = database.write_now(study_reports.begin, "short", "mara", "reading")
    assert database.write_now(study_reports.finish, number, archive.getvalue(), 12, True)


@pytest.mark.slow
def test_the_kept_report_opens_in_a_sandbox_and_can_be_downloaded(page: Page, server: LiveServer) -> None:
    kept_report(server)
    if page.locator("#blind-note").count():
        page.click("text=Blind mode")
    page.click("[data-ask=report]")
    expect(page.locator("#report-kept")).to_contain_text("by mara: 12 simulated participants analysed. No evidence")
    with page.expect_popup() as opened:
        page.click("text=Open in a new tab")
    report = opened.value
    expect(report.locator("p")).to_have_css("color", "rgb(1, 2, 3)")
    assert report.evaluate("origin") == "null"
    assert report.title() == "Report"
    report.click("text=Copy")
    expect(report.locator("button")).to_have_text("Copied")
    report.close()
    with page.expect_download() as saved:
        page.click("#report-kept form button")
    assert saved.value.suggested_filename == "short-report.zip"


@pytest.mark.slow
def test_a_report_dialog_that_opens_before_its_script_is_filled_when_the_script_comes(
    page: Page, server: LiveServer
) -> None:
    kept_report(server)
    if page.locator("#blind-note").count():
        page.click("text=Blind mode")
        expect(page.locator("#blind-note")).to_have_count(0)
    held: list[Route] = []
    page.route("**/report-dialog.js", lambda route: held.append(route))
    page.reload(wait_until="commit")
    expect(page.locator("#k-games")).to_have_text(re.compile(r"\d"))  # the other scripts are there
    page.click("[data-ask=report]")
    expect(page.locator("#ask-report")).to_be_visible()
    expect(page.locator("#report-kept")).to_be_hidden()
    held[-1].continue_()
    expect(page.locator("#report-kept")).to_contain_text("by mara: 12 simulated participants analysed.")
