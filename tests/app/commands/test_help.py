"""Helps: an example first, one screen."""

import pytest

from app.commands.cli import COMMANDS
from tests.app.command_line import Command


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(modeshape: Command, command: str) -> None:
    outcome = modeshape(command, "--help")
    assert outcome.code == 0
    lines = outcome.out.splitlines()
    assert lines[1].startswith(f"  modeshape {command}")
    assert len(lines) <= 40
    assert max(map(len, lines[lines.index("") :])) <= 80
    everything = modeshape(command, "--help-all")
    assert everything.code == 0
    assert "--json" in everything.out
