"""Every page in a headless Chromium, on a phone's screen: whole, without a network, within its width."""

import json
import shutil
import subprocess
import threading
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from queue import Empty, Queue

import pytest
from committed import ROOT

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
PAGES = [path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "reports").rglob("*.html"))]
WIDTH = 420  # CSS pixels
SECONDS = 300  # for all pages together, on a slow machine
NO_NETWORK = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"

LOOK = """<!DOCTYPE html><body style="margin: 0">
<iframe width="WIDTH" height="900" style="border: 0"></iframe><script>
const frame = document.querySelector("iframe");
async function look(page) {
  const faults = [];
  await new Promise((loaded) => { frame.onload = loaded; frame.src = page; });
  const view = frame.contentWindow, shown = frame.contentDocument;
  view.addEventListener("error", (event) => faults.push(`error: ${event.message}`));
  for (const part of shown.querySelectorAll("details")) part.open = true;
  for (const picture of shown.images) {
    picture.loading = "eager";
    await picture.decode().catch(() => faults.push(`no picture: ${picture.getAttribute("src")}`));
  }
  const wide = shown.documentElement.scrollWidth;
  const over = [...shown.body.querySelectorAll("*")].filter(
    (one) => one.getBoundingClientRect().right > WIDTH && !one.parentElement.closest(".wide"));
  if (wide > WIDTH) faults.push(`as wide as ${wide}: ${over.pop()?.outerHTML.slice(0, 300)}`);
  for (const { name } of view.performance.getEntriesByType("resource"))
    if (!name.startsWith(location.origin)) faults.push(`from elsewhere: ${name}`);
  shown.querySelector("table.sortable th")?.click();
  return faults;
}
(async () => {
  const found = {};
  for (const page of PAGES) found[page] = await look("/" + page).catch((error) => [String(error)]);
  await fetch("/found", { method: "POST", body: JSON.stringify(found) });
})();
</script>"""


class Project(SimpleHTTPRequestHandler):
    """The clone's files, a page that looks at all others, and what it finds."""

    def __init__(self, *given, found, look, **named):
        self.found, self.look = found, look
        super().__init__(*given, directory=ROOT, **named)

    def do_GET(self):
        if self.path != "/look.html":
            return super().do_GET()
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(self.look.encode())
        return None

    def do_POST(self):
        self.found.put(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_):
        """Say nothing."""


@contextmanager
def served(look):
    """Address of the project on this machine, and the queue of what was found."""
    found = Queue()
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Project, found=found, look=look)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}", found
        server.shutdown()


def looked_at(pages, folder):
    """Faults by page, and lines that the browser's console showed."""
    look = LOOK.replace("PAGES", json.dumps(pages)).replace("WIDTH", str(WIDTH))
    log = folder / "console.txt"
    with served(look) as (address, found), log.open("w") as console:
        quiet = ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
        command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", *quiet]
        command += [NO_NETWORK, "--enable-logging=stderr", f"--user-data-dir={folder / 'profile'}"]
        browser = subprocess.Popen([*command, f"{address}/look.html"], stderr=console, stdout=console)
        try:
            faults = found.get(timeout=SECONDS)
        except Empty:
            pytest.fail(f"the browser did not answer: {log.read_text()[-500:]}")
        finally:
            browser.terminate()
            browser.wait()
    return faults, [line for line in log.read_text(errors="replace").splitlines() if "CONSOLE" in line]


pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed (apt install chromium)")


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """Of all pages of the reports."""
    return looked_at(PAGES, tmp_path_factory.mktemp("browser"))


@pytest.mark.parametrize("page", PAGES)
def test_a_page_is_whole_without_a_network_and_fits_a_phone(seen, page):
    assert seen[0][page] == []


def test_the_console_is_silent(seen):
    assert seen[1] == []


def test_a_fault_is_found(tmp_path):
    page = ROOT / "reports" / ".faulty.html"
    page.write_text('<img src="gone.svg"><div style="width: 900px">wide</div><script>none()</script>')
    try:
        faults, console = looked_at([page.relative_to(ROOT).as_posix()], tmp_path)
    finally:
        page.unlink()
    (its,) = faults.values()
    assert its[0] == "no picture: gone.svg"
    assert its[1].startswith("as wide as 9")
    assert any("none is not defined" in line for line in console)
