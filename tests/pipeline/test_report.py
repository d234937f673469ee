from closedrooms.pipeline.report import tour_rows


def test_an_error_that_cannot_be_computed_is_not_available():
    tour = {
        "truth": {"length_m": 0.0},
        "errors_percent": {"closed": None, "baseline": None, "predicted": 12.34},
    }
    assert tour_rows(tour) == [
        ("tour on the true map", "0.0 m"),
        ("tour error, closed", "n/a"),
        ("tour error, baseline", "n/a"),
        ("tour error, predicted", "12.3 %"),
    ]
