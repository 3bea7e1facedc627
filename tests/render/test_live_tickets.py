"""A browser is let in with a ticket, which is good once and soon."""

import time

import pytest

from render.live.access import Ticket
from tests.render.live_site import served


def ticket(site):
    return site.server.address_for_once().removeprefix(f"http://{site.host}")


def test_a_ticket_lets_a_browser_in_once_and_holds_no_token():
    with served() as (_, site):
        path = ticket(site)
        assert path.startswith("/?ticket=")
        assert site.token not in path
        status, headers, _ = site.get(path)
        assert (status, headers["Location"]) == (303, "/")
        assert site.get(Cookie=headers["Set-Cookie"].partition(";")[0])[0] == 200
        assert site.get(path)[0] == 401
        assert site.get(path.replace("ticket", "token"))[0] == 401


def test_a_ticket_is_good_for_a_minute_only_and_only_the_last_one():
    with served() as (_, site):
        first, second = ticket(site), ticket(site)
        assert site.get(first)[0] == 401
        assert site.get(second + "x")[0] == 401
        assert site.get(second, Host="evil.test")[0] == 403
        assert site.get(second)[0] == 303
        for spent in ("/?ticket=", "/?ticket=%C3%A9"):
            assert site.get(spent)[0] == 401
    now_s = time.monotonic()
    with pytest.MonkeyPatch.context() as patch:
        late = Ticket()
        patch.setattr("render.live.access.time.monotonic", lambda: now_s + 61.0)
        assert not late.spend(late.text)
