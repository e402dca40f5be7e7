"""The report says how far a model may be off, what control points leave over, and why pixels became no point."""

from falsework.report.scene_tables import kept_rows, pixel_rows, placing_rows, window_rows


def test_limits_and_residuals_stand_in_the_report() -> None:
    """Every limit that is known, every control point, every bar: one row each; with truth, none."""
    rows = placing_rows(
        {
            "expected_error": {
                "share": 0.95,
                "scale_percent": 1.234,
                "tilt_deg": 0.5,
                "heading_deg": None,
                "place_m": 2.0,
            },
            "control_points": [
                {"name": "A", "distance": 0.0214, "agrees": True},
                {"name": "B", "distance": 2.5, "agrees": False},
            ],
            "scale_bars": [{"ends": ["A", "B"], "error": -0.0012}],
        }
    )
    assert rows == [
        ("error of scale, 95 % below", "1.2 %"),
        ("error of tilt, 95 % below", "0.5°"),
        ("error of place, 95 % below", "2 m"),
        ("control point A off by", "0.021 m"),
        ("control point B off by", "2.500 m, left out"),
        ("scale bar A to B off by", "-0.0012 m"),
    ]
    assert placing_rows({"target": "truth"}) == []
    open_frame = {"unit": "unknown", "unfixed": "scale ±128 %", "expected_error": {"scale_percent": 127.7}}
    assert placing_rows(open_frame) == [
        ("unit of length", "unknown"),
        ("GPS does not determine the frame", "scale ±128 %"),
        ("error of scale, 95 % below", "128 %"),
    ]


def test_pixels_of_each_class_stand_in_the_report() -> None:
    """A row a class: how many pixels show it, the share in points and of each reason; without depth maps, none."""
    rows = pixel_rows(
        {
            "pixels": {
                "bearing": {"angle": 1, "in_points": 1000, "no_depth": 800, "seen_through": 9, "views": 190},
                "deck": {"angle": 0, "in_points": 1, "no_depth": 0, "seen_through": 0, "views": 0},
            }
        }
    )
    assert rows == [
        ["bearing", "2,000", "50.0%", "40.0%", "9.5%", "0.4%", "0.1%"],
        ["deck", "1", "100.0%", "0.0%", "0.0%", "0.0%", "0.0%"],
    ]
    assert pixel_rows({"points": 3}) == []


def test_the_points_of_each_window_stand_in_the_report() -> None:
    """A column for each window that the flight saw, by its place along the bridge; none of photographs."""
    dropped = {"views": 1, "reprojection": 2, "deviation": 3000, "duplicate": 4}
    deck = {"kept": 1250, "dropped": dropped, "in_windows": [0, 1200, 0, 50], "windows": 2, "few_in": 0}
    seen = {"classes": {"deck": deck}, "windows": {"seen": [False, True, True, True], "length": 10.0}}
    assert kept_rows(seen) == [["deck", "1,250", "1", "2", "3,000", "4", "0 of 2"]]
    assert window_rows(seen) == [["class", "10 m", "20 m", "30 m"], ["deck", "1,200", "0", "50"]]
    bare = {"classes": {"unlabelled": {"kept": 7, "dropped": dropped}}, "windows": None}
    assert kept_rows(bare) == [["unlabelled", "7", "1", "2", "3,000", "4", ""]]
    assert window_rows(bare) == []
