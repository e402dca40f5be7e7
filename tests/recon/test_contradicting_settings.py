"""Settings that contradict each other are refused where they are read, not silently unused."""

import pytest

from groundwork.errors import InputError
from groundwork.settings import Settings, parse_settings
from recon.sampling.sampler_settings import AirborneSettings, MeshSettings, MobileSettings, TerrestrialSettings
from recon.settings import ReconSettings

TRIPOD, CAR, PLANE = TerrestrialSettings, MobileSettings, AirborneSettings


@pytest.mark.parametrize(
    ("model", "values", "named"),
    [
        (ReconSettings, {"dense": {"min_angle": 25.0}}, r"dense: min_angle \(25 deg\) is larger than max_angle \(20"),
        (ReconSettings, {"sparse": {"use_gps_in_mapping": True, "mapper": "global"}}, "sparse: use_gps_in_mapping"),
        (MeshSettings, {"survey": "global"}, r"survey \('global'\) has no effect without min_views; .* --visible"),
        (TRIPOD, {"min_range": 40.0, "max_range": 30.0}, r"min_range \(40 m\) .* max_range \(30 m\)"),
        (PLANE, {"min_range": 50.0, "max_range": 50.0}, "min_range"),
        (PLANE, {"altitude": 500.0, "max_range": 400.0}, r"altitude \(500 m\) is not below max_range \(400 m\)"),
        (TRIPOD, {"lowest": 10.0, "highest": 5.0}, r"lowest \(10 deg\) is above highest \(5 deg\)"),
        (CAR, {"lowest": 31.0}, r"lowest \(31 deg\) is above highest \(30 deg\)"),
    ],
)
def test_a_contradiction_is_one_line(model: type[Settings], values: dict[str, object], named: str) -> None:
    """Both keys are named, and the file."""
    with pytest.raises(InputError, match=rf"x\.toml: .*{named}") as caught:
        parse_settings(model, values, "x.toml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("model", "values"),
    [
        (ReconSettings, {"dense": {"min_angle": 20.0}, "sparse": {"use_gps_in_mapping": True, "mapper": "auto"}}),
        (MeshSettings, {"survey": "global", "min_views": 1}),
        (CAR, {"lowest": 0.0, "highest": 0.0, "beams": 1}),
        (PLANE, {"altitude": 399.9, "max_range": 400.0, "min_range": 0.0}),
    ],
)
def test_what_goes_together_is_kept(model: type[Settings], values: dict[str, object]) -> None:
    """The limits themselves, and the mapper that `auto` chooses with GPS."""
    assert parse_settings(model, values, "x.toml").model_dump(include=set(values), exclude_unset=True)
