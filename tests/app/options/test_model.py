"""The estimator's settings as options: read from text, and mistakes told by the option's name."""

import pytest

from app.options.model import Model, parsed_priors, priors_text
from app.terminal.errors import UsageError


def test_priors_are_read_as_they_are_written() -> None:
    priors = {"rest": 0.02, "inextensibility": 3.0}
    assert parsed_priors("rest=0.02, inextensibility=3") == priors
    assert parsed_priors(str(priors_text(priors))) == priors
    assert priors_text({}) is None


@pytest.mark.parametrize("text", ["", "rest", "rest=much", "rest=1=2"])
def test_priors_of_another_form_are_refused(text: str) -> None:
    with pytest.raises(UsageError, match=r"--priors .*is no list of NAME=WEIGHT"):
        parsed_priors(text)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"modes": 0}, "--modes 0"),
        ({"window": 0}, "--window 0"),
        ({"focal": -3.0}, "--focal -3.0 is no focal length"),
        ({"priors": {"gravity": 1.0}}, "--priors gravity=1: "),
    ],
)
def test_a_mistake_is_told_by_its_option(options: dict[str, object], what: str) -> None:
    with pytest.raises(UsageError, match=f"^{what}"):
        Model(**options)  # type: ignore[arg-type]
