"""A browser for tests of pages: Chromium as the system has it, driven by Playwright."""

import os
import shutil
import time

import pytest

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = [
    "--no-sandbox",
    # Drawn by the processor, on any machine alike.
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
]


@pytest.fixture(scope="module")
def chromium():
    """A browser; without one what needs it is skipped, but not in continuous integration, which has to have one."""
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None and not os.environ.get("CI"):
        pytest.skip("found no Chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as run:
        found = run.chromium.launch(executable_path=program, args=FLAGS)
        yield found
        found.close()


class Opened:
    """A page of an answer in a window, and all that it asked for or complained of."""

    def __init__(self, window, file):
        self.window, self.said, self.asked = window, [], []
        window.on("console", lambda message: self.said.append(message.text))
        window.on("pageerror", lambda error: self.said.append(str(error)))
        window.on("request", lambda request: self.asked.append(request.url))
        window.goto(file.as_uri())
        self.until("window.sfetcas !== undefined")
        self.settled()

    def settled(self):
        """Wait until what has changed is drawn."""
        self.window.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def still(self):
        """Wait until what moved is drawn as fine as what stands still."""
        self.until("sfetcas.fine()")

    def until(self, code, seconds=20.0):
        """Wait until something holds; the page itself refuses what would watch it there."""
        begin = time.monotonic()
        while not self.window.evaluate(code):
            assert time.monotonic() - begin < seconds, code
            self.window.wait_for_timeout(20)

    def run(self, code, argument=None):
        return self.window.evaluate(code, argument)

    def place(self, **what):
        """Where a node or a place on a member is seen, in pixels of the window."""
        return self.run("(what) => sfetcas.seen(what)", what)

    def click(self, **what):
        self.window.mouse.click(*self.place(**what))
        self.settled()

    def drag(self, begin, dx, dy):
        mouse = self.window.mouse
        mouse.move(*begin)
        mouse.down()
        mouse.move(begin[0] + dx, begin[1] + dy, steps=4)
        mouse.up()
        self.settled()
        self.still()

    def inked(self):
        """Number of pixels of members that are drawn, where nothing moves."""
        self.still()
        return self._pixels("count")

    def inks(self):
        """Number of colours that members are drawn in."""
        return self._pixels("inks.size")

    def _pixels(self, what):
        return self.run(
            f"""() => {{
              const drawn = document.getElementById("members"), copy = document.createElement("canvas");
              [copy.width, copy.height] = [drawn.width, drawn.height];
              const pen = copy.getContext("2d"), inks = new Set();
              pen.drawImage(drawn, 0, 0);
              let count = 0;
              for (const pixel of new Uint32Array(pen.getImageData(0, 0, copy.width, copy.height).data.buffer)) {{
                count += pixel >>> 24 > 0;
                if (pixel >>> 24 === 255) inks.add(pixel);
              }}
              return {what};
            }}"""
        )

    def picture(self, moving=False):
        """What the stage looks like, at once where something moves."""
        if not moving:
            self.still()
        return self.window.locator("#stage").screenshot()

    def told(self, key, table=0):
        """The text of a value among the values that are told."""
        return self.window.locator(f"#panel-values table:nth-of-type({table + 1}) td[data-key='{key}']").inner_text()


@pytest.fixture
def opened(chromium, tmp_path):
    """Opens the page of an answer, or one that is there, in a new window or a given one.

    At the end pages have said nothing, and asked for nothing but themselves.
    """
    pages = []

    def open_page(answer, file=None, window=None, **how):
        window = window or chromium.new_page(viewport={"width": 1100, "height": 700})
        pages.append(Opened(window, file or answer.page(tmp_path / "page.html", **how)))
        return pages[-1]

    yield open_page
    for page in pages:
        assert page.said == []
        assert all(url.startswith(("file:", "data:", "about:")) for url in page.asked), page.asked
        page.window.close()
