"""``fantoccini validate-reduction``: its output; tests/lab checks the claims."""

from __future__ import annotations

import pytest
from tests.cli.command import fantoccini, mistake

from lab.toys import HELD

pytestmark = pytest.mark.medium


def test_prints_every_claim_with_evidence_and_an_answer():
    done = fantoccini("validate-reduction", "arm2d")
    assert done.exit_code == 0, done.stderr
    lines = [" ".join(line.split()) for line in done.stdout.splitlines() if line.strip()]
    assert lines[0] == "Section VI for arm2d" and len(lines) == 8
    assert lines[2].startswith("the kinetic energy is block diagonal in [q_D, q_K] holds largest")
    assert lines[5].startswith("with taut strings the drives can still give any acc_K holds")
    assert lines[6].endswith("fails outside in 12 of 12 configurations; largest part outside 0.92")
    assert lines[7].startswith("yes: the mixed model is exact")
    assert "examining" in done.stderr


def test_opposing_winches_are_named(tmp_path):
    (tmp_path / "held.yaml").write_text(HELD, encoding="utf-8")
    done = fantoccini("validate-reduction", tmp_path / "held.yaml", "--quiet")
    assert done.exit_code == 0 and done.stderr == ""
    assert "no: the drives can pull above and below against one another" in done.stdout


WRONG = {
    "a name like a bundled one": (["marionete"], "did you mean 'marionette'?"),
    "no file": ([], "Missing argument"),
    "an unknown option": (["arm2d", "--bogus"], "No such option"),
}


@pytest.mark.parametrize(("arguments", "message"), WRONG.values(), ids=WRONG)
def test_wrong_arguments_are_mistakes(arguments, message):
    assert message in " ".join(mistake("validate-reduction", *arguments).split())


def test_a_puppet_without_driven_coordinates_is_a_mistake():
    message = mistake("validate-reduction", "string_pendulum", "--quiet")
    assert "string_pendulum.yaml" in message and "no coordinate is driven" in message
