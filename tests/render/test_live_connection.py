"""The page's side of a session's socket, in a browser, against a socket that is played here."""

from importlib.resources import files

import pytest

from tests.render.live_browser import chromium

pytestmark = pytest.mark.slow

PLAYED = """
const sockets = [], seen = [];
class WebSocket {
  static OPEN = 1;
  readyState = 1;
  sent = [];
  constructor() { sockets.push(this); }
  send(text) { this.sent.push(JSON.parse(text)); }
}
const location = { host: "" };
// Pictures of more bytes take longer to decode.
const createImageBitmap = (blob) => new Promise((resolve) => {
  setTimeout(() => resolve({ close() {} }), blob.size);
});
function message(number, bytes) {
  const text = new TextEncoder().encode(JSON.stringify({ number, parts: { picture: bytes } }));
  const data = new Uint8Array(4 + text.length + bytes);
  new DataView(data.buffer).setUint32(0, text.length, true);
  data.set(text, 4);
  return { data: data.buffer };
}
"""

PLAY = """
new Connection((header) => seen.push(header.number), () => {});
sockets[0].onmessage(message(1, 80));
sockets[0].onmessage(message(2, 1));
setTimeout(() => {
  document.title = JSON.stringify({ seen, told: sockets[0].sent.map(({ shown }) => shown) });
}, 200);
"""


@pytest.fixture(scope="module")
def browser():
    with chromium() as launched:
        yield launched


def test_moments_are_shown_in_the_order_in_which_they_came(browser):
    connection = (files("render.viewer") / "connection.js").read_text(encoding="utf-8")
    page = browser.new_page()
    script = PLAYED + connection.replace("export class", "class") + PLAY
    page.set_content(f"<title></title><script type=module>{script}</script>")
    page.wait_for_function("document.title")
    assert page.title() == '{"seen":[1,2],"told":[1,2]}'
    page.close()
