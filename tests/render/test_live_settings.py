"""Settings that come from outside: taken whole, or refused with the field's name."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.errors import InputError
from lighting.stream.light_stream import LightPlan
from render.live.models import load_models
from render.live.settings import Settings, changed, light_plan


def test_a_change_changes_what_it_names_and_nothing_else():
    after = changed(Settings(), {"count": 12, "yaw_rad": 0.5, "exposures_s": [0.001, 0.02]})
    assert (after.count, after.yaw_rad, after.exposures_s) == (12, 0.5, (0.001, 0.02))
    assert changed(after, {"count": 64, "yaw_rad": 0.0, "exposures_s": None}) == Settings()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": 0}, "count"),
        ({"count": 100_000}, "count"),
        ({"count": "64"}, "count"),
        ({"count": 3.5}, "count"),
        ({"yaw_rad": 4.0}, "yaw_rad"),
        ({"distance": float("nan")}, "distance"),
        ({"exposures_s": [0.0]}, "exposures_s"),
        ({"exposures_s": []}, "exposures_s"),
        ({"exposures_s": [0.1] * 9}, "exposures_s"),
        ({"method": "../../etc/passwd"}, "no method"),
        ({"path": "/etc/passwd"}, "path"),
        ({"is_frozen": 1}, "is_frozen"),
    ],
)
def test_what_is_out_of_range_is_refused(changes, message):
    with pytest.raises(InputError, match=message):
        changed(Settings(), {"is_steady": False, **changes})


@settings(max_examples=60, deadline=None)
@given(
    st.dictionaries(
        st.sampled_from([*Settings.__struct_fields__, "other"]),
        st.none() | st.booleans() | st.floats() | st.text() | st.lists(st.floats(), max_size=3),
        max_size=4,
    )
)
def test_whatever_comes_is_refused_or_makes_a_plan(changes):
    try:
        after = changed(Settings(), changes)
    except InputError:
        return
    assert isinstance(light_plan(after), LightPlan)


def test_only_the_adaptive_method_is_asked_for_an_error():
    wanted = changed(Settings(), {"is_auto": True, "method": "median-cut", "count": 9})
    plan = light_plan(wanted)
    assert (plan.method, plan.count, plan.error) == ("median-cut", 9, None)


@pytest.mark.parametrize("field", ["model", "material"])
def test_a_model_or_material_is_chosen_by_name_only(field):
    models = load_models(())
    models.check(Settings())
    with pytest.raises(InputError, match=f"no {field} is called"):
        models.check(changed(Settings(), {field: "/etc/passwd"}))


def test_a_material_replaces_that_of_every_mesh():
    models = load_models(())
    scene, _ = models.view(changed(Settings(), {"material": "gold"}), (64, 48))
    assert {mesh.material.metalness for mesh in scene.meshes} == {1.0}
    own, _ = models.view(Settings(), (64, 48))
    assert {mesh.material.metalness for mesh in own.meshes} == {0.0, 1.0}


def test_the_viewpoint_goes_where_it_is_asked_to():
    models = load_models(())
    asked = changed(Settings(), {"azimuth_rad": 0.3, "elevation_rad": 0.7, "distance": 1.0})
    _, near = models.view(asked, (64, 48))
    _, far = models.view(changed(asked, {"distance": 2.0}), (64, 48))
    back = near.eye - near.target
    length = (back @ back) ** 0.5
    assert back[1] / length == pytest.approx(0.644218, abs=1e-6)  # sin 0.7
    assert back[0] / back[2] == pytest.approx(0.309336, abs=1e-6)  # tan 0.3
    assert far.eye - far.target == pytest.approx(2 * back)
