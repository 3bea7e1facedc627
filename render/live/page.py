"""The parts of a session's page, and what every answer forbids a browser to do with it.

Input  : a request.    Output : one of a fixed list of files, whatever the request names.
"""

from importlib.resources import files

from aiohttp import web

_PARTS = {
    "index.html": "text/html",
    "style.css": "text/css",
    "app.js": "text/javascript",
    "connection.js": "text/javascript",
    "controls.js": "text/javascript",
    "map.js": "text/javascript",
    "panels.js": "text/javascript",
    "sources.js": "text/javascript",
    "strip.js": "text/javascript",
    "orbit.js": "text/javascript",
    "icon.svg": "image/svg+xml",
}

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


async def serve_page(request: web.Request) -> web.StreamResponse:
    """Return the part of the page that is asked for; the page itself for none."""
    name = request.match_info["name"] or "index.html"
    if name not in _PARTS:
        raise web.HTTPNotFound
    body = (files("render.viewer") / name).read_bytes()
    return web.Response(body=body, content_type=_PARTS[name], charset="utf-8")


def refusal(status: int, text: str) -> web.Response:
    """Return an answer that says no in a line."""
    return web.Response(status=status, text=text + "\n", headers=HEADERS)
