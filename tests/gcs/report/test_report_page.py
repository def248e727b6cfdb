"""The page as a browser shows it: on a desk and on a phone, by day and by night; and the command that writes it."""

import re
import shutil
from dataclasses import replace

import pytest
from flights import recorded
from pages import AUTO, AVERAGE, dragged, flown, unreached
from playwright.sync_api import sync_playwright

from gcs.report.page import page

SCRIPT = "<script>alert(1)</script> & $5 </title>"
SAID = (("<script>alert(2)</script>", 5, 2, 3.0), ("op1", 5, 1, 9.0), ("op2", None, 4, 12.0))
VIEWS = [(width, scheme) for width in (1280, 390) for scheme in ("light", "dark")]
NO_BROWSER = "no chromium: install the system's package of that name (apt-get install chromium)"

SEEN = """() => {
  const rgb = said => said.match(/[\\d.]+/g).map(Number);
  const light = said => rgb(said).slice(0, 3).map(v => v / 255)
    .map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = node => {
    for (; node; node = node.parentElement) {
      const colour = getComputedStyle(node).backgroundColor;
      if ((rgb(colour)[3] ?? 1) > 0) return colour;
    }
    return "rgb(255, 255, 255)";
  };
  const contrast = (one, other) => {
    const [low, high] = [light(one), light(other)].sort((a, b) => a - b);
    return (high + 0.05) / (low + 0.05);
  };
  const texts = [...document.querySelectorAll("figure svg text")].map(node => {
    const style = getComputedStyle(node), box = node.getBoundingClientRect();
    return {
      said: node.textContent, class_: node.getAttribute("class") || "",
      section: node.closest("section").id,
      pixels: parseFloat(style.fontSize) * node.getScreenCTM().a, contrast: contrast(style.fill, ground(node)),
      box: [box.left, box.top + 2, box.right, box.bottom - 2],
    };
  });
  const marks = [...document.querySelectorAll("#map .place, #map .target")].map(node => {
    const box = node.getBoundingClientRect();
    return {chart: node.closest("svg").getAttribute("aria-label"), class_: node.getAttribute("class"),
            box: [box.left, box.top, box.right, box.bottom]};
  });
  document.querySelectorAll("details").forEach(node => node.open = true);
  const words = [...document.querySelectorAll("body *")]
    .filter(node => !node.closest("svg") && [...node.childNodes].some(one => one.nodeType === 3 && one.data.trim()))
    .map(node => [node.textContent.trim().slice(0, 40), contrast(getComputedStyle(node).color, ground(node))]);
  return {
    texts, words, marks, wide: document.documentElement.scrollWidth, window: innerWidth,
    charts: [...document.querySelectorAll("figure svg")].map(node => node.getAttribute("aria-label")),
  };
}"""


@pytest.fixture(scope="module")
def browser():
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    assert found, NO_BROWSER
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def html():
    """Averaged control, Trust-R, one with ratings and a script for a title, and one of a crowd that is lost."""
    titled = f"title='{SCRIPT}'"
    histories = [flown(AVERAGE), flown(AUTO), dragged(2, 3, titled, said=SAID), dragged(6, 10), unreached()]
    return page(histories)


@pytest.fixture(scope="module")
def tab(browser, html, tmp_path_factory):
    """The page, what the console said and what was asked of the network."""
    file = tmp_path_factory.mktemp("report") / "report.html"
    file.write_text(html, encoding="utf-8")
    tab = browser.new_page()
    complaints, requests = [], []
    tab.on("console", lambda message: complaints.append(message.text))
    tab.on("pageerror", lambda error: complaints.append(str(error)))
    tab.on("request", lambda asked: requests.append(asked.url))
    tab.goto(file.as_uri())
    return tab, complaints, requests


@pytest.fixture(scope="module", params=VIEWS, ids=lambda view: f"{view[0]}-{view[1]}")
def shown(request, tab):
    """What is to be seen, what the console said and what was asked of the network."""
    width, scheme = request.param
    page, complaints, requests = tab
    page.set_viewport_size({"width": width, "height": 900})
    page.emulate_media(color_scheme=scheme)
    return page.evaluate(SEEN), complaints, requests


def test_a_browser_has_nothing_to_complain_about_and_asks_nobody_for_anything(shown):
    _, complaints, requests = shown
    assert complaints == []
    assert [request.split("/")[-1] for request in requests] == ["report.html"]


def test_nothing_is_wider_than_the_window_with_everything_unfolded(shown):
    seen, _, _ = shown
    assert seen["wide"] <= seen["window"]


def test_every_word_of_every_chart_can_be_read(shown):
    seen, _, _ = shown
    assert len(seen["texts"]) > 300
    assert min((text["pixels"], text["said"]) for text in seen["texts"])[0] >= 10.0
    assert min((text["contrast"], text["said"]) for text in seen["texts"])[0] >= 4.5


def test_every_word_beside_the_charts_stands_out_from_its_ground(shown):
    seen, _, _ = shown
    assert min((contrast, said) for said, contrast in seen["words"])[0] >= 4.5


def test_no_words_of_a_chart_over_time_overlap(shown):
    seen, _, _ = shown
    for section in {text["section"] for text in seen["texts"]}:
        kinds = ("tick x", "tick y") if section == "map" else ("tick", "name", "marked", "quiet")
        there = [t for t in seen["texts"] if t["section"] == section and t["class_"].startswith(kinds)]
        touching = [
            (one["said"], other["said"])
            for index, one in enumerate(there)
            for other in there[index + 1 :]
            if _overlap(one["box"], other["box"])
        ]
        assert touching == [], section


def test_no_word_on_a_map_covers_another_or_a_mark(shown):
    seen, _, _ = shown
    words = [text for text in seen["texts"] if text["section"] == "map" and text["class_"].startswith(("task", "name"))]
    assert len(words) > 20
    for index, one in enumerate(words):
        there = words[index + 1 :] + seen["marks"]
        assert [other for other in there if _overlap(one["box"], other["box"])] == [], one["said"]


def _overlap(one, other):
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def test_every_chart_says_what_it_shows_to_who_cannot_see_it(shown):
    seen, _, _ = shown
    assert all(re.fullmatch(r"[A-Z][a-z ]+\. .+", said, re.DOTALL) for said in seen["charts"])


def test_what_users_type_stays_text(html):
    assert "<script" not in html
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; $5 &lt;/title&gt;" in html
    assert html.count("&lt;script&gt;alert(2)") >= 2  # in the story and at its mark in the chart


def test_the_page_names_its_flights_apart_and_how_each_ended(html):
    rows = re.findall(r'<tr role="row"><th role="rowheader" scope="row">(.*?)</th>', html.split("</table>")[0])
    assert len(set(rows)) == 5
    table = re.sub(r"<[^>]*>|\s", " ", html.split("</table>")[0])
    for said in ("failed", "passed", "not completed", "14.0°", "at most 4°", "robot 5: 1.3", "no false alarm"):
        assert said in table


def test_what_a_verdict_rests_on_is_said_beside_it():
    shaky = page([replace(dragged(2, 3), measured=True, recovered={})])
    assert "by telemetry: no truth was told; from a recovered recording" in shaky
    assert "by telemetry" not in page([dragged(2, 3)])


def test_two_flights_take_less_than_a_megabyte():
    assert len(page([flown(AVERAGE), flown(AUTO)]).encode()) < 250_000


def test_flights_of_one_name_are_numbered_and_twelve_are_shown():
    shown = page([flown(AUTO)] * 12)
    assert shown.count("<figure>") == 12 * 10
    assert "Trust-R, trust from auto, flight 12" in shown


def test_the_command_writes_the_page_beside_the_first_recording_and_says_where(gcs, tmp_path):
    for number, rule in enumerate((AVERAGE, AUTO)):
        shutil.copytree(recorded("emergency", rule).folder, tmp_path / str(number))
    code, out, _ = gcs("report", tmp_path / "0", tmp_path / "1" / "run.mcap")
    assert code == 0
    assert out.split() == ["report", str(tmp_path / "0" / "report.html")]
    assert (tmp_path / "0" / "report.html").read_text(encoding="utf-8").startswith("<!doctype html>")


@pytest.mark.parametrize("words", [(), ("nowhere.mcap",)])
def test_no_recording_is_a_sentence(gcs, words):
    code, out, err = gcs("report", *words)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1


def test_a_page_that_cannot_be_written_is_a_sentence_and_leaves_nothing_torn(gcs, tmp_path):
    (tmp_path / "file").touch()
    code, _, err = gcs("report", recorded("emergency", AUTO).path, "--out", tmp_path / "file" / "page.html")
    assert code == 2
    assert "page.html: cannot be written" in err
    assert [one.name for one in tmp_path.iterdir()] == ["file"]


def test_a_page_never_takes_the_place_of_a_recording(gcs, tmp_path):
    path = shutil.copy(recorded("emergency", AUTO).path, tmp_path)
    before = (tmp_path / "run.mcap").read_bytes()
    code, _, err = gcs("report", path, "--out", path)
    assert code == 2
    assert err.endswith("must end in .html or .htm\n")
    assert (tmp_path / "run.mcap").read_bytes() == before
