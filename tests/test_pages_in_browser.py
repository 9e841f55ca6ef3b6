"""Pages in a real browser: what is drawn, played, picked and turned, and that they ask for nothing else."""

import re
from pathlib import Path

import numpy as np
import pytest

from sfetcas import Scene, load, solve

pytest.importorskip("playwright")
PROBLEMS = Path(__file__).parent.parent / "problems"


@pytest.fixture(scope="module")
def bend():
    return solve(load(PROBLEMS / "bend_45_degrees.toml"))


def numbers(text):
    return [float(one) for one in re.findall(r"-?\d[\d.]*(?:e[+-]?\d+)?", text)]


def test_members_are_drawn_by_webgl(opened, bend):
    page = opened(bend)
    assert page.run("sfetcas.webgl")
    drawn = page.inked()
    # About as many as the member is long, four pixels to one of the window.
    begin, end = page.place(node="root"), page.place(node="tip")
    assert drawn > 4 * 3 * np.hypot(end[0] - begin[0], end[1] - begin[1])
    assert page.window.locator("#title").inner_text() == bend.scene.title
    assert page.window.locator("#panel-report, #panel-scene").count() == 2
    # Nothing is said of what is between load steps.
    assert page.window.locator(".chart svg circle title").count() == len(bend.steps)
    assert page.window.locator(".chart svg line[stroke-width='1.6']").count() == 0


def test_picking_reads_the_numbers_of_the_answer(opened, bend):
    page = opened(bend)
    told = bend.to_dict()["steps"]
    for number, step in enumerate(told):
        page.window.locator("#state").fill(str(number))
        page.click(node="tip")
        assert numbers(page.told("position")) == step["nodes"]["tip"]["position"]
        assert numbers(page.told("quaternion")) == step["nodes"]["tip"]["quaternion"]
    page.click(node="root")
    assert numbers(page.told("force", 1)) == told[-1]["reactions"]["root"]["force"]
    entry = bend.last.along("bend", told[-1]["members"]["bend"]["s"])
    sample = page.run("() => JSON.parse(document.getElementById('content').textContent).members[0].x.length >> 1")
    page.click(member=0, sample=sample)
    at = float(page.told("fraction of its length"))
    entry = bend.last.along("bend", at)
    assert numbers(page.told("position")) == pytest.approx(entry["position"][0].tolist(), rel=1e-12, abs=1e-12)
    (moment,) = numbers(page.told("bending moment, N m", 1))
    tangent = np.gradient(bend.last.along("bend", [at - 1e-5, at, at + 1e-5])["position"], axis=0)[1]
    tangent /= np.linalg.norm(tangent)
    across = entry["moment"][0] - (entry["moment"][0] @ tangent) * tangent
    # The tangent above is one of differences.
    assert moment == pytest.approx(np.linalg.norm(across), rel=1e-6)


def test_what_is_dragged_turns_and_comes_back(opened, bend):
    page = opened(bend)
    page.window.mouse.move(700, 300)
    begin, before = page.place(node="tip"), page.picture()
    page.drag((500, 300), 120, 40)
    assert np.hypot(*np.subtract(page.place(node="tip"), begin)) > 20.0
    assert page.picture() != before
    page.window.mouse.wheel(0, -300)
    page.settled()
    root, tip = page.place(node="root"), page.place(node="tip")
    page.window.mouse.wheel(0, -300)
    page.settled()
    larger = np.hypot(*np.subtract(page.place(node="tip"), page.place(node="root")))
    assert larger == pytest.approx(np.exp(0.45) * np.hypot(*np.subtract(tip, root)), rel=1e-6)
    page.window.locator("#fit").click()
    page.window.mouse.move(700, 300)
    page.settled()
    assert page.place(node="tip") == pytest.approx(begin, abs=1e-6)
    assert page.picture() == before


def test_chart_and_structure_move_each_other(opened):
    path = solve(load(PROBLEMS / "lee_frame.toml"))
    page = opened(path)
    kinds = [point.kind for point in path.points]
    # What was asked for besides is no part of the course.
    assert page.window.locator(".chart svg line[stroke-width='1.6']").count() == len(kinds) - 1
    first = kinds.index("limit point")
    at = page.window.locator(".chart svg circle title", has_text="limit point").first
    box = at.locator("..").bounding_box()
    before = page.place(node="load")
    page.window.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    page.settled()
    assert page.run("sfetcas.state()") == first
    assert "limit point" in page.window.locator("#where").inner_text()
    assert page.place(node="load") != pytest.approx(before, abs=10.0)
    page.click(node="load")
    assert numbers(page.told("position")) == path.limit_points[0].position("load").tolist()
    page.window.locator("#tab-chart").click()
    cursor = page.window.locator(".chart .cursor")
    there = cursor.bounding_box()
    page.window.locator("#state").fill("0")
    page.settled()
    assert cursor.bounding_box() != there
    page.window.locator("#tab-answer").click()
    page.window.locator("#state").fill(str(first))
    assert "neutral" in page.window.locator("#panel-answer").inner_text()


def test_frequencies_over_the_factor_are_a_chart(opened):
    """Of Beck's column, which does not move up to the point where it flutters."""
    path = solve(load(PROBLEMS / "beck_column_flutter.toml"))
    page = opened(path)
    choices = page.window.locator("#quantity option").all_inner_texts()
    assert choices == [f"frequency {k + 1}, rad/s" for k in range(len(path.points[0].omega))]
    mark = page.window.locator(".chart path").bounding_box()
    page.window.mouse.click(mark["x"] + 0.5 * mark["width"], mark["y"] + 0.5 * mark["height"])
    page.settled()
    cursor = page.window.locator(".cursor").bounding_box()
    assert cursor["y"] + 0.5 * cursor["height"] == pytest.approx(mark["y"] + 0.5 * mark["height"], abs=4.0)
    factor = path.flutter_points[0].factor
    assert page.window.locator("#where").inner_text().startswith(f"factor {factor:.4g}")


def test_of_all_equilibria_the_usual_one_is_seen_first(opened):
    page = opened(solve(load(PROBLEMS / "cantilever_inclined_force_all_equilibria.toml")))
    where = page.window.locator("#where")
    assert page.run("sfetcas.state()") == 0 or "equilibrium 1 of" in where.inner_text()
    assert "unstable" not in where.inner_text()
    page.window.locator("#state").fill(page.window.locator("#state").get_attribute("max"))
    assert "unstable" in where.inner_text()


def test_what_is_zero_everywhere_has_no_colours(opened):
    page = opened(solve(load(PROBLEMS / "rigid_pendulum_static.toml")))
    chosen = page.window.locator("#colour").input_value()
    page.window.locator("#colour").select_option("moment")
    assert chosen != "moment"
    assert page.window.locator("#named").inner_text() == "bending moment about z: 0 everywhere"
    assert page.window.locator("#low").inner_text() == page.window.locator("#high").inner_text() == ""


def test_gravity_is_an_arrow_that_grows_with_the_factor(opened):
    """Downwards, and upwards where the factor is below zero."""
    scene = load(PROBLEMS / "heavy_cantilever_gravity.toml").replace({"analysis.steps": [-0.5, 1.0]})
    page = opened(solve(scene))
    inked = """(dy) => {
        const over = document.getElementById("symbols"), ratio = over.width / over.clientWidth;
        const [x, y] = [108 * ratio, (over.clientHeight - 70 + dy) * ratio], one = document.createElement("canvas");
        one.getContext("2d").drawImage(over, -x, -y);
        const [r, g, b, a] = one.getContext("2d").getImageData(0, 0, 1, 1).data;
        return a > 128 && r > 180 && g < 140 && b < 60;
    }"""
    assert (page.run(inked, 12), page.run(inked, -12)) == (True, False)
    page.window.locator("#state").fill("0")
    page.settled()
    assert (page.run(inked, 12), page.run(inked, -12)) == (False, True)


def test_what_moves_slowly_is_drawn_fine_where_it_stands_still(opened, bend):
    """Of machines that draw less than 30 times a second; here every frame is held up."""
    page = opened(bend)
    page.still()
    size = page.run("document.getElementById('members').width")
    page.run(
        """() => new Promise((done) => {
            let left = 12;
            const turn = () => {
                const begin = performance.now();
                while (performance.now() - begin < 45);
                document.getElementById("show-rest").click();
                if (left--) requestAnimationFrame(turn);
                else done();
            };
            turn();
        })"""
    )
    assert page.run("document.getElementById('members').width") == size / 2
    page.until("sfetcas.fine()")
    assert page.run("document.getElementById('members').width") == size


def test_a_large_window_shows_members_where_they_are(chromium, opened, bend):
    """Browsers draw no canvas of any size."""
    context = chromium.new_context(viewport={"width": 2500, "height": 1400}, device_scale_factor=2)
    page = opened(bend, window=context.new_page())
    x, y = page.place(member=0, sample=20)
    origin = page.window.locator("#members").bounding_box()
    inked = page.run(
        """([x, y]) => {
          const drawn = document.getElementById("members"), copy = document.createElement("canvas");
          const frame = drawn.getBoundingClientRect(), scale = drawn.width / frame.width;
          [copy.width, copy.height] = [40, 40];
          copy.getContext("2d").drawImage(drawn, x * scale - 20, y * scale - 20, 40, 40, 0, 0, 40, 40);
          return copy.getContext("2d").getImageData(18, 18, 4, 4).data[3];
        }""",
        [x - origin["x"], y - origin["y"]],
    )
    assert inked == 255


def test_a_motion_plays_and_stops(opened):
    motion = solve(load(PROBLEMS / "double_pendulum_rigid.toml"))
    page = opened(motion)
    count = int(page.window.locator("#state").get_attribute("max")) + 1
    assert count > 100
    page.window.locator("#play").click()
    page.until("sfetcas.state() > 5")
    page.window.locator("#play").click()
    page.settled()
    stopped = page.run("sfetcas.state()")
    page.window.wait_for_timeout(200)
    assert page.run("sfetcas.state()") == stopped
    # Between answers a page tells less, and at answers all.
    told = motion.to_dict()
    times = page.run("() => JSON.parse(document.getElementById('content').textContent).states.map((one) => one.at)")
    for number in (0, len(told["times"]) - 1):
        page.window.locator("#state").fill(str(times.index(told["times"][number])))
        name = next(node for node in told["nodes"] if motion.scene.nodes[node].support == "free")
        page.click(node=name)
        assert numbers(page.told("velocity")) == told["nodes"][name]["velocity"][number]


def test_modes_move_and_are_chosen(opened):
    page = opened(solve(load(PROBLEMS / "vibration_helix.toml")))
    moving = page.picture(moving=True)
    page.window.wait_for_timeout(150)
    assert page.picture(moving=True) != moving
    page.window.locator("#play").click()
    page.settled()
    still = page.picture()
    page.window.wait_for_timeout(150)
    assert page.picture() == still
    page.window.locator("#mode").select_option(index=3)
    page.settled()
    other = page.picture()
    assert other != still
    page.window.locator("#size").fill("0")
    page.settled()
    assert page.picture() != other


def test_names_are_text_whatever_they_are(opened):
    name, title = "</script><b>'\"∂&", "<!-- <img src=x onerror=alert(1)> 'quoted' \"twice\" ½ \u2028 @content@"
    scene = Scene.from_dict(
        {
            "title": title,
            "sections": {"s": {"EI3": 1.0}},
            "nodes": {"A": {"position": [0, 0], "support": "clamped"}, name: {"position": [1, 0]}},
            "members": {name: {"nodes": ["A", name], "section": "s"}},
            "loads": {name: {"type": "force", "node": name, "value": [0, 1]}},
        }
    )
    answer = solve(scene)
    page = opened(answer)
    assert page.window.locator("#title").inner_text() == title
    assert page.window.title() == title
    assert page.window.locator("b, img").count() == 0
    page.click(node=name)
    caption = page.window.locator("#panel-values caption").first
    assert caption.text_content() == f"node {name}"
    assert numbers(page.told("position")) == answer.last.position(name).tolist()


def test_a_notebook_shows_the_same_in_a_frame(chromium, bend, tmp_path):
    file = tmp_path / "notebook.html"
    file.write_text(f"<!DOCTYPE html><body>{bend.view()._repr_html_()}</body>", encoding="utf-8")
    window = chromium.new_page()
    said = []
    window.on("console", lambda message: said.append(message.text))
    window.on("pageerror", lambda error: said.append(str(error)))
    window.goto(file.as_uri())
    frame = window.frame_locator("iframe")
    assert frame.locator("#title").inner_text() == bend.scene.title
    assert frame.locator("#where").inner_text() == "factor 600"
    assert said == []
    window.close()


WITHOUT = """
const before = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.startsWith("webgl") ? null : before.call(this, kind, ...more);
};
"""
"""What a browser does that has WebGL switched off."""


def test_without_webgl_members_are_flat_lines(chromium, opened, bend):
    """In their colours all the same."""
    window = chromium.new_page(viewport={"width": 1100, "height": 700})
    window.add_init_script(WITHOUT)
    page = opened(bend, window=window)
    assert not page.run("sfetcas.webgl")
    drawn = page.inked()
    begin, end = page.place(node="root"), page.place(node="tip")
    assert drawn > 3 * np.hypot(end[0] - begin[0], end[1] - begin[1])
    assert page.inks() > 20
    page.window.locator("#colour").select_option("")
    page.settled()
    assert page.inks() == 1
    assert page.inked() == pytest.approx(drawn, rel=0.05)
    page.click(node="tip")
    assert numbers(page.told("position")) == bend.last.position("tip").tolist()
